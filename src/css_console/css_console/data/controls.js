// SPDX-License-Identifier: Apache-2.0
// What can be done: every control is an order, and shows by which command of ROS the same is done.

const $ = (id) => document.getElementById(id);
const SPEEDS = [[1, "1 ×"], [10, "10 ×"], [60, "60 ×"], [0, "as fast as it goes"]];

// A text in its place; the same text once more would be laid out again.
export function put(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

// Choices, and which of them is the present one; what somebody has chosen stays until that changes.
export function fill(select, names, chosen) {
  const wanted = JSON.stringify([names, chosen]);
  if (select.dataset.told === wanted) return;
  const before = chosen ?? select.value;
  select.dataset.told = wanted;
  select.replaceChildren(...names.map((name) => new Option(name, name)));
  if (names.includes(before)) select.value = before;
}

export class Controls {
  constructor(line) {
    this.line = line;
    this.scene = null;
    this.pace = {};
    this.nodes = [];
    this.dragged = false;
    this.offer($("toggle"), () => ({ do: this.pace.paused ? "resume" : "pause" }));
    this.offer($("step"), () => ({ do: "step" }));
    this.offer($("set-speed"), () => ({ do: "rate", rate: Number($("speed").value) || 0 }));
    for (const [rate, text] of SPEEDS) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: text });
      $("speeds").append(button);
      this.offer(button, () => ({ do: "rate", rate }));
    }
    this.offer($("gyro"), () => ({ do: "lifecycle", node: this.gyro, transition: this.gyroActive ? "deactivate" : "activate" }));
    this.offer($("fault-clear"), () => ({ do: "clear", node: $("fault-node").value, fault: "" }));
    this.submit($("fault-form"), () => ({
      do: "inject", node: $("fault-node").value, target: $("fault-target").value.trim(), kind: $("fault-kind").value,
      values: $("fault-values").value.split(/[\s,;]+/).filter(Boolean).map(Number), duration: Number($("fault-duration").value) || 0,
    }));
    this.submit($("estimator-form"), () => ({ do: "reset", estimator: $("estimator").value, keep: true }));
    this.submit($("reset-form"), () => ({
      do: "reset", mission: $("reset-mission").value, case: Number($("reset-case").value),
      overrides: $("reset-overrides").value.split(/\s+/).filter(Boolean), paused: $("reset-paused").checked,
    }));
    $("filter").addEventListener("input", () => this.sift());
    const slider = $("slider");
    slider.addEventListener("input", () => { this.dragged = true; $("slider-time").textContent = `${Number(slider.value).toFixed(1)} s`; });
    slider.addEventListener("change", async () => {
      await this.order({ do: "seek", time: Number(slider.value) });
      this.dragged = false;
    });
    document.addEventListener("keydown", (e) => {
      if (e.target.closest("input, select, textarea, button, summary, a") || e.ctrlKey || e.metaKey || e.altKey) return;
      if (e.key === " ") $("toggle").click();
      else if (e.key === ".") $("step").click();
      else return;
      e.preventDefault();
    });
  }

  // Does an order, and says what came of it.
  async order(fields) {
    const answer = await this.line.order(fields);
    const said = answer.good ? "done" : "refused";
    $("command").textContent = `${answer.commands.join(" && ") || fields.do}: ${said}${answer.message ? `, ${answer.message}` : ""}`;
    $("command").classList.toggle("bad", !answer.good);
    return answer;
  }

  // A button whose order is known only when it is pressed; before, it shows its command.
  offer(button, fields) {
    button.addEventListener("click", () => this.order(fields()));
    for (const event of ["focus", "pointerenter"]) button.addEventListener(event, () => this.tell(fields()));
  }

  submit(form, fields) {
    form.addEventListener("submit", (e) => { e.preventDefault(); this.order(fields()); });
    form.addEventListener("focusin", () => this.tell(fields()));
    form.addEventListener("change", () => this.tell(fields()));
  }

  async tell(fields) {
    const answer = await this.line.order({ ...fields, dry: true });
    $("command").textContent = answer.good ? answer.commands.join(" && ") : answer.message;
    $("command").classList.remove("bad");
  }

  show(scene) {
    this.scene = scene;
    const { subject, craft } = scene;
    for (const id of ["toggle", "step", "set-speed", "speed"]) $(id).disabled = !scene.pace;
    for (const button of $("speeds").children) button.disabled = !scene.pace;
    $("slider-row").hidden = !scene.player || !subject.length_s;
    $("slider").max = subject.length_s;
    $("fault-form").hidden = !scene.faulty.length;
    fill($("fault-node"), scene.faulty, scene.faulty.find((n) => n.endsWith("/css_array")));
    fill($("fault-kind"), scene.kinds);
    const units = [];
    for (let i = 0; i < (craft.normals ?? []).length / 3; i++) units.push(`cell.${i}`);
    for (let i = 0; i < (craft.wheel_axes ?? []).length / 3; i++) units.push(`wheel.${i}`, `tachometer.${i}`);
    if (craft.rods_fitted) for (let i = 0; i < (craft.rod_axes ?? []).length / 3; i++) units.push(`rod.${i}`);
    for (const axis of "xyz") units.push(`gyro.${axis}`, `magnetometer.${axis}`);
    $("targets").replaceChildren(...units.map((unit) => new Option(unit, unit)));
    $("reset-box").hidden = !scene.director;
    $("estimator-form").hidden = !scene.director || !subject.estimators.length;
    fill($("estimator"), subject.estimators, craft.estimator ?? undefined);
    fill($("reset-mission"), subject.missions.length ? subject.missions : [craft.mission ?? ""], craft.mission ?? undefined);
    this.gyro = scene.lifecycle.find((name) => name.endsWith("/gyro"));
    $("gyro-box").hidden = !this.gyro;
    this.parameters(scene.parameters);
  }

  showPace(pace) {
    this.pace = pace;
    put($("toggle"), pace.paused ? "Go on" : "Pause");
    if (document.activeElement !== $("speed") && $("speed").value !== String(pace.rate)) $("speed").value = pace.rate;
  }

  showTime(time) {
    if (this.dragged || $("slider-row").hidden) return;
    $("slider").value = time;
    $("slider-time").textContent = `${time.toFixed(1)} s`;
  }

  showNodes({ nodes, director }) {
    this.nodes = nodes;
    const gyro = nodes.find((row) => row.node === this.gyro);
    this.gyroActive = gyro?.state === "active";
    put($("gyro"), this.gyroActive ? "Gyro off" : "Gyro on");
    put($("gyro-state"), gyro ? `gyro is ${gyro.state}` : "");
    put($("director"), director.message ? `${director.node}: ${director.message}` : "");
    const table = $("nodes").tBodies[0];
    const known = new Map([...table.rows].map((row) => [row.dataset.node, row]));
    for (const told of nodes) {
      const row = known.get(told.node) ?? this.nodeRow(table, told.node);
      known.delete(told.node);
      const counters = Object.entries(told.counters).filter(([, value]) => value !== "0").map(([key, value]) => `${key} ${value}`);
      put(row.cells[1], told.state || "–");
      put(row.cells[2], told.message || "–");
      if (row.cells[2].className !== told.level) row.cells[2].className = told.level;
      put(row.cells[3], counters.join(", ") || "–");
      const button = row.cells[4].firstChild;
      button.hidden = !["active", "inactive"].includes(told.state);
      put(button, told.state === "active" ? "Deactivate" : "Activate");
      row.dataset.state = told.state;
    }
    for (const gone of known.values()) gone.remove();
  }

  nodeRow(table, node) {
    const row = table.insertRow();
    row.dataset.node = node;
    for (let i = 0; i < 5; i++) row.insertCell();
    row.cells[0].textContent = node;
    const button = Object.assign(document.createElement("button"), { type: "button" });
    row.cells[4].append(button);
    this.offer(button, () => ({ do: "lifecycle", node, transition: row.dataset.state === "active" ? "deactivate" : "activate" }));
    return row;
  }

  parameters(table) {
    const place = $("parameters");
    const known = new Map([...place.querySelectorAll(".parameter")].map((row) => [row.dataset.key, row]));
    for (const told of table) {
      const key = `${told.node} ${told.name}`;
      const before = known.get(key);
      known.delete(key);
      // one whose value was not known yet had a place for any text
      const row = before?.dataset.kind === kindOf(told.value) ? before : this.parameterRow(place, told, key);
      if (before && before !== row) before.replaceWith(row);
      const input = row.querySelector("input");
      if (input === document.activeElement) continue;
      if (input.type === "checkbox") input.checked = told.value;
      else input.value = Array.isArray(told.value) ? JSON.stringify(told.value) : (told.value ?? "");
    }
    for (const gone of known.values()) gone.remove();
    for (const group of place.querySelectorAll("details")) if (!group.querySelector(".parameter")) group.remove();
    this.sift();
  }

  parameterRow(place, told, key) {
    let group = place.querySelector(`details[data-node="${CSS.escape(told.node)}"]`);
    if (!group) {
      group = document.createElement("details");
      group.dataset.node = told.node;
      group.append(Object.assign(document.createElement("summary"), { textContent: told.node }));
      place.append(group);
    }
    const row = document.createElement("div");
    row.className = "parameter";
    row.dataset.key = key;
    row.dataset.kind = kindOf(told.value);
    const input = document.createElement("input");
    input.setAttribute("aria-label", `${told.node} ${told.name}`);
    const kind = typeof told.value;
    if (kind === "boolean") input.type = "checkbox";
    else if (kind === "number") Object.assign(input, { type: "number", step: "any" });
    if (told.range) { input.min = told.range[0] ?? ""; input.max = told.range[1] ?? ""; }
    const fields = () => ({ do: "set", node: told.node, name: told.name, value: valueOf(input, told.value) });
    input.addEventListener("focus", () => this.tell(fields()));
    input.addEventListener("change", () => this.order(fields()));
    const span = (name, text) => Object.assign(document.createElement("span"), { className: name, textContent: text });
    row.append(span("name", told.name), span("what", `${told.what}; ${told.expected}`), input);
    group.append(row);
    return row;
  }

  sift() {
    const wanted = $("filter").value.trim().toLowerCase();
    for (const row of $("parameters").querySelectorAll(".parameter")) row.hidden = !row.textContent.toLowerCase().includes(wanted) && !row.dataset.key.includes(wanted);
    for (const group of $("parameters").querySelectorAll("details")) {
      group.hidden = ![...group.querySelectorAll(".parameter")].some((row) => !row.hidden);
      if (wanted) group.open = true;
    }
  }
}

function kindOf(value) {
  return Array.isArray(value) ? "list" : typeof value;
}

function valueOf(input, before) {
  if (input.type === "checkbox") return input.checked;
  if (input.type === "number") return Number(input.value);
  if (!Array.isArray(before)) return input.value;
  try {
    return JSON.parse(input.value);
  } catch {
    return input.value.split(/[\s,]+/).filter(Boolean);
  }
}
