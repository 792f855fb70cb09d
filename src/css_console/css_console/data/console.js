// SPDX-License-Identifier: Apache-2.0
// The page: what the console tells goes to its places.

import { Body } from "./body.js";
import { Charts } from "./charts.js";
import { Controls, put } from "./controls.js";
import { Painter } from "./painter.js";
import { Line } from "./socket.js";

const NUMBERS_MS = 100;
const $ = (id) => document.getElementById(id);
const degrees = (value) => (value === null || value === undefined ? "–" : `${value.toFixed(value < 10 ? 2 : 1)} deg`);

const line = new Line((there) => {
  $("link").textContent = there ? "connected" : "the console is gone; this page waits for it";
  $("link").classList.toggle("bad", !there);
});
const controls = new Controls(line);
const painter = new Painter();
const charts = new Charts($("charts"), () => line.tell({ do: "history" }), painter);
const body = new Body($("scene"), $("no-scene"), painter);
$("view").addEventListener("change", () => body.seeFrom($("view").value));

let series = [];
line.on("scene", (scene) => {
  const { mission, case: number } = scene.craft;
  const title = scene.subject.kind === "recording" || !mission ? scene.subject.title : `${mission}, case ${number}`;
  document.title = `${title} · Sunpoint console`;
  $("title").textContent = title;
  controls.show(scene);
  body.become(scene.craft);
  const changed = JSON.stringify(series) !== JSON.stringify(scene.series);
  series = scene.series;
  if (changed) line.tell({ do: "history" });
  $("warning").hidden = !scene.rivals.length;
  $("warning").textContent = scene.rivals.join("; ");
});
line.on("history", (told) => charts.begin(told.series, told.columns));
line.on("nodes", (told) => {
  controls.showNodes(told);
  const starts = told.nodes.filter((row) => ["configuring", "unconfigured", "activating"].includes(row.state));
  $("doing").textContent = starts.length ? `getting ready: ${starts.map((row) => row.node).join(", ")} (the first start compiles)` : told.director.message;
  const bad = told.nodes.filter((row) => row.level !== "ok");
  $("health").textContent = told.nodes.length ? (bad.length ? `${bad.length} of ${told.nodes.length} not ok` : "ok") : "–";
  $("health").classList.toggle("bad", bad.length > 0);
});
line.on("log", ({ log }) => {
  $("log").replaceChildren(...log.toReversed().map((entry) => {
    const item = document.createElement("li");
    for (const command of entry.commands) item.append(Object.assign(document.createElement("code"), { textContent: command }), " ");
    const said = `${entry.good ? "done" : "refused"}${entry.message ? `: ${entry.message}` : ""}`;
    item.append(Object.assign(document.createElement("span"), { textContent: said, className: entry.good ? "" : "refused" }));
    return item;
  }));
});

let latest = null;
const numbersAreStale = painter.part(() => numbers(latest), NUMBERS_MS);
line.on("frame", (frame) => {
  latest = frame;
  document.documentElement.dataset.frame = frame.number;
  if (frame.now) {
    charts.add(frame.now.time, frame.row);
    body.show(frame.now);
  }
  numbersAreStale();
});

function numbers(frame) {
  controls.showPace(frame.pace);
  put($("factor"), frame.factor === null ? (frame.pace.paused ? "held" : "stands still") : `${frame.factor.toPrecision(3)} ×`);
  list($("faults"), frame.faults);
  const now = frame.now;
  if (!now) return;
  controls.showTime(now.time);
  const flies = now.estimates.find((e) => e.flies) ?? now.estimates[0];
  put($("time"), `${now.time.toFixed(1)} s`);
  $("time").title = now.utc;
  put($("mode"), now.control ? `${now.control.mode} (${now.control.reason})` : "–");
  put($("error"), degrees(flies?.error_deg));
  put($("bound"), degrees(flies?.bound_deg));
  put($("pointing"), degrees(now.pointing_deg));
  const rate = now.rate_deg_s ? Math.hypot(...now.rate_deg_s) : null;
  put($("rate"), rate === null ? "–" : `${rate.toFixed(3)} deg/s`);
  put($("sunlit"), now.sunlit === undefined ? "–" : `${Math.round(100 * now.sunlit)} %`);
  estimates(now.estimates);
  bars($("cells"), now.cells ?? [], (v) => v, (i) => flies?.lit.includes(i), (i) => flies?.isolated.includes(i), "");
  show($("wheels-box"), $("wheels"), now.wheels_rpm, now.control?.wheels_isolated, "rpm");
  show($("rods-box"), $("rods"), now.rods, now.control?.rods_isolated, "");
  list($("verdicts"), now.health.map((v) => `${v.node}: ${v.unit} ${v.kind}, ${v.evidence}, since ${v.since_s.toFixed(1)} s`));
}

function show(box, place, values, out, unit) {
  box.hidden = !values?.length;
  const most = Math.max(1e-9, ...(values ?? []).map(Math.abs));
  bars(place, values ?? [], (v) => Math.abs(v) / most, () => false, (i) => out?.includes(i), unit);
}

// One bar for each value: its length, its number, and whether it is used or left out, in words too.
function bars(place, values, length, used, out, unit) {
  while (place.children.length > values.length) place.lastChild.remove();
  while (place.children.length < values.length) {
    const item = document.createElement("li");
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("viewBox", "0 0 100 10");
    svg.setAttribute("preserveAspectRatio", "none");
    svg.append(document.createElementNS("http://www.w3.org/2000/svg", "rect"));
    svg.firstChild.setAttribute("height", "10");
    const span = (name) => Object.assign(document.createElement("span"), { className: name });
    item.append(span("name"), svg, span("value"));
    item.firstChild.textContent = place.children.length;
    place.append(item);
  }
  values.forEach((value, i) => {
    const item = place.children[i];
    const width = String(Math.round(Math.min(100, Math.max(0, 100 * length(value ?? 0)))));
    const bar = item.querySelector("rect");
    if (bar.getAttribute("width") !== width) bar.setAttribute("width", width);
    put(item.lastChild, value === null ? "none" : value.toFixed(unit === "rpm" ? 0 : 3));
    item.classList.toggle("fault", Boolean(out(i)) || value === null);
    item.classList.toggle("used", Boolean(used(i)));
    const said = out(i) ? "held for failed, left out" : used(i) ? "used by the estimate" : "";
    if (item.title !== said) item.title = said;
  });
}

function list(place, lines) {
  const told = lines.length ? lines : ["none"];
  if (place.dataset.told === told.join("\n")) return;
  place.dataset.told = told.join("\n");
  place.replaceChildren(...told.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
}

function estimates(given) {
  const head = ["", "error", "3 sigma", "state", "rate from", "left out"];
  const rows = given.map((e) => [
    e.flies ? `${e.name} (flies)` : e.name, degrees(e.error_deg), degrees(e.bound_deg),
    e.validity + (e.eclipse ? ", eclipse" : ""), e.rate_source, e.isolated.map((i) => `cell ${i}`).join(", ") || "none",
  ]);
  const table = $("estimates");
  while (table.rows.length > rows.length + 1) table.deleteRow(-1);
  [head, ...rows].forEach((texts, r) => {
    const row = table.rows[r] ?? table.insertRow();
    texts.forEach((text, c) => { put(row.cells[c] ?? row.appendChild(document.createElement(r ? "td" : "th")), text); });
  });
}
