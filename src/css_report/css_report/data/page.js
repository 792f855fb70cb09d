// SPDX-License-Identifier: Apache-2.0
// Draws the plots of a page when they come into view, links their abscissas, follows the theme, and prints them all.
(() => {
  "use strict";
  const root = document.documentElement;
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  const touch = matchMedia("(pointer: coarse)");
  const plots = [...document.querySelectorAll("figure.plot")].map((figure) => ({
    figure, chart: figure.querySelector(".chart"), linked: figure.dataset.linked, hidden: new Set(), drawn: false,
  }));
  const ranges = {};  // stretch of the abscissa that linked plots show, by their word; none: all of it
  let chosen = "", following = false;

  const setTheme = () => { root.dataset.theme = chosen || (scheme.matches ? "dark" : "light"); };
  const variable = (name) => getComputedStyle(root).getPropertyValue(name).trim();

  // colours of the palette stand in variables, so that a theme may change them; what follows them is opacity
  const themed = (value) => {
    if (typeof value === "string") {
      return /^#[0-9a-fA-F]{6}([0-9a-fA-F]{2})?$/.test(value)
        ? (variable("--k-" + value.slice(1, 7).toLowerCase()) || value.slice(0, 7)) + value.slice(7) : value;
    }
    if (Array.isArray(value)) return value.map(themed);
    if (value && typeof value === "object" && !("bdata" in value)) {
      return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, themed(inner)]));
    }
    return value;
  };

  const specOf = (plot) => plot.spec ??= JSON.parse(plot.figure.querySelector("script").textContent);

  const tracesOf = (plot) => themed(specOf(plot).traces).map((trace) => ({
    ...trace, visible: !plot.hidden.has(trace.name),
  }));

  const layoutOf = (plot) => {
    const spec = specOf(plot);
    const soft = variable("--soft"), grid = variable("--grid");
    const axis = {
      automargin: true, gridcolor: grid, linecolor: soft, tickcolor: soft, zeroline: false, showline: true,
      tickfont: { size: 12, color: soft }, nticks: plot.chart.clientWidth < 500 ? 6 : 12,
    };
    const range = plot.linked && ranges[plot.linked];
    const x = { ...axis, ...themed(spec.x), ...(range ? { range: [...range], autorange: false } : {}) };
    return {
      height: spec.height, margin: { l: 44, r: 16, t: 8, b: 26 }, showlegend: false,
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: variable("--text") },
      hovermode: plot.linked ? "x unified" : "closest", hoverdistance: 30,
      hoverlabel: { bgcolor: variable("--card"), bordercolor: soft, font: { size: 12, color: variable("--text") } },
      dragmode: touch.matches ? false : "zoom",
      xaxis: x, yaxis: { ...axis, nticks: 7, ...themed(spec.y) }, shapes: themed(spec.shapes),
    };
  };

  const draw = (plot) => {
    const first = !plot.drawn;
    plot.drawn = true;
    const config = { displayModeBar: false, responsive: true, doubleClick: "reset", scrollZoom: false };
    const done = Plotly.react(plot.chart, tracesOf(plot), layoutOf(plot), config);
    if (first) {
      plot.chart.on("plotly_relayout", (change) => follow(plot, change));
      if (plot.linked) {
        plot.chart.on("plotly_hover", (event) => point(plot, event.points[0].x));
        plot.chart.on("plotly_unhover", () => point(plot, null));
      }
    }
    return done;
  };

  const others = (plot) => plots.filter((other) => other !== plot && other.drawn && other.linked === plot.linked);

  const follow = (plot, change) => {
    if (!plot.linked || following) return;
    const low = change["xaxis.range[0]"] ?? change["xaxis.range"]?.[0];
    const high = change["xaxis.range[1]"] ?? change["xaxis.range"]?.[1];
    if (low !== undefined && high !== undefined) show(plot.linked, [low, high], plot);
    else if (change["xaxis.autorange"]) show(plot.linked, null, plot);
  };

  const show = (linked, range, from) => {
    if (range) ranges[linked] = range; else delete ranges[linked];
    following = true;
    const waiting = plots.filter((plot) => plot !== from && plot.drawn && plot.linked === linked).map((plot) => {
      const whole = specOf(plot).x.range;
      const asked = range ?? whole;
      return Plotly.relayout(plot.chart, asked ? { "xaxis.range": [...asked] } : { "xaxis.autorange": true });
    });
    Promise.all(waiting).finally(() => { following = false; });
  };

  const point = (plot, x) => {
    for (const other of others(plot)) {
      let cursor = other.chart.querySelector(".cursor");
      if (!cursor) {
        cursor = document.createElement("div");
        cursor.className = "cursor";
        other.chart.append(cursor);
      }
      const axis = other.chart._fullLayout?.xaxis;
      const at = x === null || !axis ? -1 : axis.d2p(x);
      const inside = axis && at >= 0 && at <= axis._length;
      cursor.hidden = !inside;
      if (inside) cursor.style.left = `${axis._offset + at}px`;
    }
  };

  const redraw = () => Promise.all(plots.filter((plot) => plot.drawn).map(draw));

  for (const plot of plots) {
    plot.figure.querySelector("[data-do=whole]")?.addEventListener("click", () => {
      if (plot.linked) show(plot.linked, null, null);
      else if (plot.drawn) draw(plot);
    });
    plot.figure.querySelector("[data-do=png]")?.addEventListener("click", () => {
      Promise.resolve(draw(plot)).then(() => Plotly.downloadImage(plot.chart, {
        format: "png", scale: 2, width: plot.chart.clientWidth, height: plot.chart.clientHeight,
        filename: plot.figure.id,
      }));
    });
    for (const entry of plot.figure.querySelectorAll(".legend button")) {
      entry.addEventListener("click", () => {
        const name = entry.dataset.name, on = plot.hidden.has(name);
        if (on) plot.hidden.delete(name); else plot.hidden.add(name);
        entry.setAttribute("aria-pressed", String(on));
        draw(plot);
      });
    }
  }

  document.querySelector("[data-do=theme]")?.addEventListener("click", () => {
    chosen = root.dataset.theme === "dark" ? "light" : "dark";
    setTheme();
    redraw();
  });
  scheme.addEventListener("change", () => { setTheme(); redraw(); });
  for (const button of document.querySelectorAll("[data-do=copy]")) {
    button.addEventListener("click", () => {
      const text = button.closest(".command").querySelector("pre").textContent;
      navigator.clipboard?.writeText(text).then(() => { button.textContent = "copied"; });
    });
  }

  // paper is light, and shows what nobody has scrolled to
  let before = "";
  addEventListener("beforeprint", () => {
    before = chosen;
    chosen = "light";
    setTheme();
    for (const plot of plots) { draw(plot); Plotly.relayout(plot.chart, { width: 680 }); }
  });
  addEventListener("afterprint", () => {
    chosen = before;
    setTheme();
    for (const plot of plots) Plotly.relayout(plot.chart, { width: null, autosize: true });
    redraw();
  });

  setTheme();
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries.filter((found) => found.isIntersecting)) {
      seen.unobserve(entry.target);
      draw(plots.find((plot) => plot.figure === entry.target));
    }
    root.dataset.drawn ??= performance.now().toFixed(0);
  }, { rootMargin: "300px 0px" });
  for (const plot of plots) seen.observe(plot.figure);
})();
