# SPDX-License-Identifier: Apache-2.0
"""When the page draws, by a clock that is made up."""

import json
import sys
from importlib import resources

import numpy as np
import pytest
from listing import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))

from browser import NAMES, Browser, browser_path

BROWSER = browser_path() or ""
pytestmark = pytest.mark.skipif(not BROWSER, reason=f"no browser on this machine, looked for {', '.join(NAMES)}")

# One part that is new every 20 ms for ten seconds; gives the times [ms] at which it was drawn.
_DRAWN = """((text, cost, least, atOnceAt) => {
  let now = 0, number = 0;
  const queue = [], drawn = [];
  const at = (when, what) => { queue.push({ when, number: ++number, what }); return number; };
  class Channel {
    constructor() {
      this.port1 = {};
      this.port2 = { postMessage: () => at(now, () => this.port1.onmessage()) };
    }
  }
  const Painter = new Function("performance", "requestAnimationFrame", "setTimeout", "clearTimeout", "MessageChannel",
    text.replace("export class Painter", "return class Painter"))(
    { now: () => now }, (frame) => at(now, frame), (what, ms) => at(now + ms, what),
    (gone) => { const i = queue.findIndex((one) => one.number === gone); if (i >= 0) queue.splice(i, 1); }, Channel);
  const isNew = new Painter().part(() => { drawn.push(now); now += cost; }, least);
  for (let ms = 0; ms < 10000; ms += 20) at(ms, () => isNew());
  if (atOnceAt !== null) at(atOnceAt, () => isNew(true));
  while (queue.length) {
    queue.sort((a, b) => a.when - b.when || a.number - b.number);
    const { when, what } = queue.shift();
    now = Math.max(now, when);
    what();
  }
  return drawn;
})"""


@pytest.fixture(scope="module")
def drawn():
    """Times [ms] of drawing a part, by what drawing takes and the least time between two [ms]."""
    text = (resources.files("css_console") / "data" / "painter.js").read_text(encoding="utf-8")
    with Browser(BROWSER, 400) as browser:

        def of(cost, least, at_once_at=None):
            return np.array(browser.evaluate(f"{_DRAWN}({json.dumps([text, cost, least, at_once_at])[1:-1]})"))

        yield of


def test_what_is_drawn_fast_is_drawn_ten_times_a_second_and_to_the_last(drawn):
    times = drawn(1, 100)
    assert np.all(np.diff(times) >= 100) and len(times) == pytest.approx(100, abs=2)
    assert times[-1] >= 9980  # what was new last is seen


def test_drawing_takes_no_more_than_a_tenth_of_the_time(drawn):
    times = drawn(50, 100)
    assert np.all(np.diff(times) >= 500) and len(times) == pytest.approx(20, abs=2)


def test_the_slowest_machine_draws_every_other_second(drawn):
    assert np.diff(drawn(1500, 100)) == pytest.approx(2000.0, abs=20.0)


def test_what_somebody_does_is_drawn_at_once(drawn):
    assert 1210 in drawn(80, 100, 1210)
    assert 1210 not in drawn(80, 100)
