// SPDX-License-Identifier: Apache-2.0
// The line to the console: what it says goes to listeners by type, orders come back as promises.

export class Line {
  constructor(changed) {
    this.listeners = new Map();
    this.waiting = new Map();
    this.number = 0;
    this.changed = changed;
    this.open();
  }

  open() {
    const address = new URL("socket", location.href);
    address.protocol = "ws:";
    this.socket = new WebSocket(address);
    this.socket.onopen = () => this.changed(true);
    this.socket.onmessage = ({ data }) => this.take(JSON.parse(data));
    this.socket.onclose = () => {
      this.changed(false);
      for (const done of this.waiting.values()) done({ good: false, message: "the console is gone", commands: [] });
      this.waiting.clear();
      setTimeout(() => this.open(), 1000);
    };
  }

  on(type, listener) {
    this.listeners.set(type, listener);
  }

  take(message) {
    if (message.type === "answer") {
      this.waiting.get(message.id)?.(message);
      this.waiting.delete(message.id);
    } else {
      this.listeners.get(message.type)?.(message);
    }
  }

  // What came of an order: { good, message, commands }.
  order(fields) {
    const id = ++this.number;
    if (this.socket.readyState !== WebSocket.OPEN)
      return Promise.resolve({ good: false, message: "the console is not there", commands: [] });
    return new Promise((done) => {
      this.waiting.set(id, done);
      this.socket.send(JSON.stringify({ id, ...fields }));
    });
  }

  tell(fields) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ id: 0, ...fields }));
  }
}
