// SPDX-License-Identifier: Apache-2.0
// Strip charts: everything so far, thinned by the console where it is long.

import uPlot from "./uplot.js";

const TITLES = {
  heading: "Error of the estimated Sun", pointing: "Arrays to the Sun", rate: "Body rate",
  wheels: "Wheel speed", rods: "Rod dipole", cells: "Cell voltage",
};
const ORDER = ["heading", "pointing", "rate", "wheels", "rods", "cells"];
const LOGARITHMIC = new Set(["heading"]);
const COLOURS = {
  light: ["#0072b2", "#c25400", "#008560", "#b85a90", "#b07a00", "#2f8fc7"],
  dark: ["#55aef0", "#ff8a3d", "#2cc79c", "#e69ac6", "#f5bb3d", "#8fd3ff"],
};
const DASHES = [[], [7, 4], [2, 3], [7, 3, 2, 3], [11, 4]];
const LEAST = 1e-3; // [deg] for the logarithmic axis
const MOST = 8000; // rows, after which the console is asked for thinner ones
const DRAW_MS = 250;
const dark = matchMedia("(prefers-color-scheme: dark)");

export class Charts {
  constructor(place, thin, painter) {
    this.place = place;
    this.thin = thin;
    this.series = [];
    this.columns = [[]];
    this.charts = [];
    this.stale = painter.part(() => this.draw(), DRAW_MS);
    this.sight = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        const chart = this.charts.find(({ place: own }) => own === target);
        if (chart) chart.inView = isIntersecting;
      }
      this.stale();
    });
    dark.addEventListener("change", () => this.build());
    new ResizeObserver(() => this.fit()).observe(place);
  }

  begin(series, columns) {
    const same = JSON.stringify(series) === JSON.stringify(this.series) && this.charts.length > 0;
    this.series = series;
    this.columns = columns.length === series.length + 1 ? columns : [[], ...series.map(() => [])];
    if (same) this.stale(true);
    else this.build();
  }

  add(time, row) {
    if (row.length !== this.series.length) return;
    const times = this.columns[0];
    const last = times[times.length - 1];
    if (time < last) return;
    if (time === last) for (const column of this.columns) column.pop(); // more is known of it now
    times.push(time);
    row.forEach((value, i) => this.columns[i + 1].push(value));
    if (times.length === MOST) this.thin();
    this.stale();
  }

  build() {
    for (const { plot } of this.charts) plot.destroy();
    this.sight.disconnect();
    this.charts = [];
    this.place.replaceChildren();
    const names = ORDER.filter((name) => this.series.some((s) => s.chart === name));
    for (const name of names) this.charts.push(this.chart(name));
    for (const { place } of this.charts) this.sight.observe(place);
    this.stale(true);
  }

  chart(name) {
    const indices = this.series.map((s, i) => (s.chart === name ? i : -1)).filter((i) => i >= 0);
    const unit = this.series[indices[0]].unit;
    const figure = document.createElement("figure");
    figure.className = "strip";
    figure.id = `strip-${name}`;
    const caption = document.createElement("figcaption");
    caption.textContent = `${TITLES[name]} [${unit}]`;
    const place = document.createElement("div");
    place.className = "plot";
    const legend = document.createElement("div");
    legend.className = "legend";
    figure.append(caption, place, legend);
    this.place.append(figure);
    const style = getComputedStyle(document.documentElement);
    const [text, grid] = ["--soft", "--grid"].map((v) => style.getPropertyValue(v).trim());
    const colours = COLOURS[dark.matches ? "dark" : "light"];
    const look = (k) => ({ stroke: colours[k % 6], dash: DASHES[Math.floor(k / 6 + (k % 6) * 2) % 5] });
    const axis = { stroke: text, grid: { stroke: grid, width: 1 }, ticks: { stroke: grid, width: 1 }, font: "12px sans-serif" };
    const plot = new uPlot({
      width: Math.max(place.clientWidth, 50), height: Math.max(place.clientHeight, 50), legend: { show: false },
      cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
      scales: { x: { time: false }, y: LOGARITHMIC.has(name) ? { distr: 3 } : {} },
      axes: [
        { ...axis, size: 26, values: (_, ticks) => ticks.map((v) => `${v} s`) },
        { ...axis, size: 52, values: (_, ticks) => ticks.map((v) => (v === null ? "" : Number(v.toPrecision(6)).toString())) },
      ],
      series: [{}, ...indices.map((i, k) => ({ label: this.series[i].name, width: 1.5, ...look(k), spanGaps: false, points: { show: false } }))],
    }, [[], ...indices.map(() => [])], place);
    indices.forEach((i, k) => legend.append(this.entry(plot, k + 1, this.series[i].name, look(k))));
    return { name, indices, plot, place, inView: true };
  }

  entry(plot, k, text, look) {
    const button = document.createElement("button");
    button.type = "button";
    button.setAttribute("aria-pressed", "true");
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("width", "26");
    svg.setAttribute("height", "8");
    const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
    line.setAttribute("d", "M0 4h26");
    line.setAttribute("stroke", look.stroke);
    line.setAttribute("stroke-width", "2");
    line.setAttribute("stroke-dasharray", look.dash.join(" "));
    svg.append(line);
    button.append(svg, text);
    button.addEventListener("click", () => {
      const shown = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(shown));
      plot.setSeries(k, { show: shown });
    });
    return button;
  }

  draw() {
    for (const { name, indices, plot, inView } of this.charts) {
      if (!inView) continue;
      const columns = indices.map((i) => this.columns[i + 1]);
      const shown = LOGARITHMIC.has(name)
        ? columns.map((c) => c.map((v) => (v === null ? null : Math.max(v, LEAST)))) : columns;
      plot.setData([this.columns[0], ...shown]);
    }
  }

  fit() {
    for (const { plot, place } of this.charts)
      if (place.clientWidth && place.clientWidth !== plot.width)
        plot.setSize({ width: place.clientWidth, height: place.clientHeight });
  }
}
