# SPDX-License-Identifier: Apache-2.0
"""What a browser shows of a page: is anything cut, does anything overlap, does it complain, how fast is it there."""

import json
import time
from pathlib import Path
from typing import NamedTuple

from browser import Browser, BrowserError

WIDTHS = (1400, 800, 390)
"""[px] a desk, a tablet, a phone."""

_ALL_DRAWN = """(async () => {
  const pause = (ms) => new Promise((done) => setTimeout(done, ms));
  const drawn = ".main-svg .cartesianlayer .subplot";
  for (const figure of document.querySelectorAll("figure.plot")) {
    figure.scrollIntoView();
    for (let i = 0; i < 600 && !figure.querySelector(drawn); i++) await pause(50);
  }
  scrollTo(0, 0);
  await pause(100);
  const missing = [...document.querySelectorAll("figure.plot")].filter((f) => !f.querySelector(drawn));
  return missing.map((f) => f.id);
})()"""

_FIRST_DRAWN = """(async () => {
  while (document.querySelector("figure.plot") && !document.documentElement.dataset.drawn)
    await new Promise((done) => setTimeout(done, 20));
  return Number(document.documentElement.dataset.drawn ?? performance.now());
})()"""

LAYOUT_FAULTS = r"""(() => {
  const faults = [];
  const width = document.documentElement.clientWidth;
  if (document.documentElement.scrollWidth > width + 1)
    faults.push(`the page is ${document.documentElement.scrollWidth} px wide`);
  const shown = (element) => {
    return element.checkVisibility({ opacityProperty: true, visibilityProperty: true })
      && !element.closest("script, style, [hidden], thead, .hoverlayer, title");
  };
  const name = (element) => (element.id ? `#${element.id} ` : "") + element.tagName.toLowerCase();
  const texts = [];
  const add = (rect, node, text) => {
    if (rect.width < 1 || rect.height < 1) return;
    // letters do not fill the height of their line
    const inset = 0.18 * rect.height;
    texts.push({ left: rect.left, right: rect.right, top: rect.top + inset, bottom: rect.bottom - inset, node, text });
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const text = node.textContent.trim();
    if (!text || !shown(node.parentElement)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const rect of range.getClientRects()) {
      add(rect, node, text.slice(0, 40));
      if (rect.left < -1 || rect.right > width + 1) faults.push(`cut at the edge of the page: ${text.slice(0, 60)}`);
      for (let box = node.parentElement; box && box !== document.body; box = box.parentElement) {
        const style = getComputedStyle(box);
        if (style.overflowX === "visible" && box.tagName !== "svg") continue;
        const frame = box.getBoundingClientRect();
        if (rect.left < frame.left - 1 || rect.right > frame.right + 1 || rect.top < frame.top - 2
            || rect.bottom > frame.bottom + 2)
          faults.push(`cut by ${name(box)} of ${box.closest("[id]")?.id}: ${text.slice(0, 60)}`);
      }
    }
  }
  texts.sort((a, b) => a.top - b.top);
  for (let i = 0; i < texts.length; i++) {
    for (let j = i + 1; j < texts.length && texts[j].top < texts[i].bottom - 1; j++) {
      const a = texts[i], b = texts[j];
      if (a.node !== b.node && Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1)
        faults.push(`${a.text} overlaps ${b.text} in ${a.node.parentElement.closest("[id]")?.id}`);
    }
  }
  const boxes = [...document.querySelectorAll("button, .chart, pre, table, h1, h2, h3, img, .note, .axis")]
    .filter(shown).map((element) => ({ element, rect: element.getBoundingClientRect() }))
    .filter(({ rect }) => rect.width > 0 && rect.height > 0).sort((a, b) => a.rect.top - b.rect.top);
  for (let i = 0; i < boxes.length; i++) {
    const a = boxes[i];
    if (a.rect.left < -1 || a.rect.right > width + 1) faults.push(`${name(a.element)} leaves the page`);
    for (let j = i + 1; j < boxes.length && boxes[j].rect.top < a.rect.bottom - 1; j++) {
      const b = boxes[j];
      if (!a.element.contains(b.element) && !b.element.contains(a.element)
          && Math.min(a.rect.right, b.rect.right) - Math.max(a.rect.left, b.rect.left) > 1)
        faults.push(`${name(a.element)} overlaps ${name(b.element)}: ${b.element.textContent.slice(0, 40)}`);
    }
  }
  return [...new Set(faults)];
})()"""


class Seen(NamedTuple):
    """A page at one width."""

    width: int
    loaded_ms: float  # from the start of navigation to the event `load`
    drawn_ms: float  # to the first plots in view, the last before `load` or after it
    cpu_s: float  # processor time of all processes of the browser for it
    plots: int
    faults: list[str]


def look_at(path: str, page: Path, width: int, shots: Path | None = None, *, dark: bool = False) -> Seen:
    """Opens a page in a browser, scrolls through it, and says what is wrong.

    Args:
        path: of the browser.
        page: an HTML file.
        width: of the window [px].
        shots: folder for a picture of the whole page.
        dark: as those who prefer dark pages see it.

    Raises:
        BrowserError: the browser fails.
    """
    with Browser(path, width) as browser:
        if dark:
            features = [{"name": "prefers-color-scheme", "value": "dark"}]
            browser.call("Emulation.setEmulatedMedia", features=features)
        before_s = browser.cpu_s()
        browser.open(page)
        drawn_ms = float(browser.evaluate(_FIRST_DRAWN))
        loaded_ms = float(
            browser.evaluate("(([entry]) => entry.loadEventEnd || performance.now())"
                             "(performance.getEntriesByType('navigation'))")
        )  # fmt: skip
        cpu_s = browser.cpu_s() - before_s
        faults = [f"plot {name} is not drawn" for name in browser.evaluate(_ALL_DRAWN)]
        faults += browser.evaluate(LAYOUT_FAULTS)
        faults += [f"console: {line}" for line in browser.complaints]
        faults += [f"asks the network for {url}" for url in browser.requests]
        plots = int(browser.evaluate("document.querySelectorAll('figure.plot').length"))
        if shots is not None:
            browser.screenshot(shots / f"{page.stem}_{width}{'_dark' if dark else ''}.png", whole=True)
        return Seen(width, loaded_ms, max(drawn_ms, loaded_ms), cpu_s, plots, faults)


def linked_zoom(path: str, page: Path) -> tuple[list[float], list[float]]:
    """Abscissas of two linked plots after the first has been zoomed, the second drawn before.

    Raises:
        BrowserError: the browser fails, or there are no two plots that are linked.
    """
    with Browser(path, 1000) as browser:
        browser.open(page)
        browser.evaluate(_ALL_DRAWN)
        ids = browser.evaluate(
            "[...document.querySelectorAll('figure.plot')].filter((f) => f.dataset.linked).map((f) => f.id)"
        )
        if len(ids) < 2:
            raise BrowserError(f"{page}: no two plots are linked")
        first, second = (f"document.getElementById({json.dumps(name)}).querySelector('.chart')" for name in ids[:2])
        browser.evaluate(f"Plotly.relayout({first}, {{'xaxis.range[0]': 1.0, 'xaxis.range[1]': 2.0}}).then(() => 1)")
        deadline = time.monotonic() + 10.0
        while True:
            ranges = [browser.evaluate(f"{chart}._fullLayout.xaxis.range") for chart in (first, second)]
            if ranges[0] == ranges[1] or time.monotonic() > deadline:
                return ranges[0], ranges[1]
