// SPDX-License-Identifier: Apache-2.0
// When the page draws: what is new, as often as it can be followed, and for no more than a share of the time. A machine
// that draws slowly, or has other things to do, draws less often.

const SHARE = 0.1; // of the time that drawing may take
const LONGEST = 2000; // [ms] between drawings, however long they take

export class Painter {
  constructor() {
    this.parts = [];
    this.next = 0;
    this.asked = this.paints = false;
  }

  // A part of the page that is drawn no more often than every so many ms; gives the function that says that there is
  // something new in it. What somebody does to the page is drawn at once.
  part(paint, least) {
    const part = { paint, least, due: 0, stale: false };
    this.parts.push(part);
    return (atOnce = false) => {
      part.stale = true;
      if (atOnce) {
        part.due = this.next = 0;
        this.asked = false;
      }
      this.ask();
    };
  }

  ask() {
    const due = Math.min(...this.parts.map((part) => (part.stale ? part.due : Infinity)));
    if (this.asked || this.paints || due === Infinity) return;
    this.asked = true;
    clearTimeout(this.timer);
    const frame = () => requestAnimationFrame(() => this.paint()); // which there is none of in a page that nobody sees
    const wait = Math.max(this.next, due) - performance.now();
    if (wait > 0) this.timer = setTimeout(frame, wait);
    else frame();
  }

  paint() {
    if (this.paints) return;
    this.asked = false;
    this.paints = true;
    const begun = performance.now();
    for (const part of this.parts) {
      if (!part.stale || part.due > begun) continue;
      part.stale = false;
      part.due = begun + part.least;
      part.paint();
    }
    // the browser lays out and draws what has changed before it comes to this
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = () => {
      this.paints = false;
      this.next = begun + Math.min((performance.now() - begun) / SHARE, LONGEST);
      this.ask();
    };
    port2.postMessage(null);
  }
}
