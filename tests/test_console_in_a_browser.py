# SPDX-License-Identifier: Apache-2.0
"""The console in a real browser, on a real flight and a real recording, driven as people drive it."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from console_process import WITHOUT, console
from listing import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))

from browser import NAMES, Browser, browser_path
from page_checks import LAYOUT_FAULTS, WIDTHS

BROWSER = browser_path() or ""
pytestmark = [
    pytest.mark.skipif(not BROWSER, reason=f"no browser on this machine, looked for {', '.join(NAMES)}"),
    pytest.mark.skipif(bool(WITHOUT), reason=WITHOUT),
    pytest.mark.timeout(600),  # its flight compiles what no test before it has
]
PICTURE = "SUNPOINT_PICTURE"
"""Environment variable: file that gets the picture of the README."""
OF_THE_MACHINE = ("swiftshader", "GL Driver Message")  # it has no graphics processor
TIME = "parseFloat(document.getElementById('time').textContent)"
ERROR = "parseFloat(document.getElementById('error').textContent)"


# A parameter whose value comes after its name; gives what is ordered when a number is put into its place.
_VALUE_KNOWN_LATER = """(async () => {
  const { Controls } = await import("./controls.js");
  const ordered = [];
  const controls = Object.create(Controls.prototype);
  Object.assign(controls, { order: (fields) => ordered.push(fields.value), tell() {} });
  for (const value of [null, 0.5])
    controls.parameters([{ node: "/made_up", name: "gate", value, what: "", expected: "" }]);
  const input = document.querySelector('[data-key="/made_up gate"] input');
  input.value = "0.25";
  input.dispatchEvent(new Event("change"));
  return ordered;
})()"""


class Page:
    """The console's page as somebody sees and uses it."""

    def __init__(self, browser: Browser) -> None:
        self.browser = browser

    def until(self, condition: str) -> None:
        self.browser.until(condition, condition)

    def text(self, name: str) -> str:
        return self.browser.evaluate(f"document.getElementById('{name}').textContent")

    def number(self, expression: str) -> float:
        return float(self.browser.evaluate(expression))

    def press(self, selector: str) -> None:
        self.browser.evaluate(f"document.querySelector({selector!r}).click()")

    def put(self, name: str, value: str) -> None:
        place = f"document.getElementById('{name}')"
        self.browser.evaluate(
            f"{place}.value = {value!r}; {place}.dispatchEvent(new Event('change', {{bubbles: true}}))"
        )

    def has(self, name: str, text: str) -> None:
        self.until(f"document.getElementById('{name}').textContent.includes({text!r})")

    def complaints(self) -> list[str]:
        return [line for line in self.browser.complaints if not any(word in line for word in OF_THE_MACHINE)]


def held(page: Page) -> float:
    """Time [s] at which the flight stands, once it does."""
    page.has("toggle", "Go on")
    before = page.number(TIME)
    number = page.number("document.documentElement.dataset.frame")
    # two looks at the graph and its nodes later it is still the same
    page.has("factor", "held")
    assert page.number("document.documentElement.dataset.frame") >= number
    page.until(f"{TIME} >= {before}")
    return page.number(TIME)


def test_a_flight_is_seen_held_and_stepped():
    with console("okeefe_2013") as running, Browser(BROWSER, 800) as browser:
        page = Page(browser)
        browser.open(running.address)
        page.until(f"{TIME} > 1")
        page.has("title", "okeefe_2013, case 0")
        page.has("toggle", "Pause")
        page.press("#toggle")
        at = held(page)
        page.press("#step")
        page.until(f"{TIME} > {at}")
        assert page.number(TIME) == pytest.approx(at + 0.1, abs=0.06)
        page.has("command", "ros2 service call /dynamics/play_next_stamp std_srvs/srv/Trigger: done")
        assert browser.evaluate(LAYOUT_FAULTS) == []
        assert page.complaints() == []
        own = running.address.rstrip("/")
        assert browser.evaluate(_VALUE_KNOWN_LATER) == [0.25]
        assert [url for url in browser.requests if not url.replace("ws:", "http:").startswith(own)] == []


def test_a_flight_driven_from_its_page(tmp_path):
    with console("okeefe_2013") as running, Browser(BROWSER, 1400, 1350) as browser:
        page = Page(browser)
        browser.open(running.address)
        page.until(f"{ERROR} > 5")  # as it begins
        page.until(f"{ERROR} < 3 && document.getElementById('mode').textContent.includes('point')")

        # a fault of a cell that is used: its mask, its verdict, its command
        page.put("fault-target", "cell.0")
        page.put("fault-kind", "dead")
        page.press("#fault-form button:not([type])")
        page.has("command", "/css_array/inject_fault css_msgs/srv/InjectFault")
        page.has("faults", "css_array: cell.0 dead")
        page.until("document.querySelector('#cells li:first-child').classList.contains('fault')")
        page.has("verdicts", "ekf: cell.0 dead")
        page.has("estimates", "cell 0")
        page.until(f"{ERROR} < 5 && document.getElementById('mode').textContent.includes('point')")
        picture(browser, Path(os.environ.get(PICTURE) or tmp_path / "console.png"))
        page.press("#fault-clear")
        page.until("document.getElementById('faults').textContent === 'none'")

        # without the gyro the rate comes from the Sun
        page.press("#gyro")
        page.has("gyro-state", "inactive")
        page.until(
            "/ sun/.test(' ' + document.querySelector('#estimates tr:nth-child(2) td:nth-child(5)').textContent)"
        )

        # a value that is refused, and one that is taken
        assert ": refused" in set_parameter(page, "/ekf", "gate", "7")
        assert ": done" in set_parameter(page, "/ekf", "gate", "0.25")
        page.has("log", "ros2 param set /ekf gate 0.25")

        # what the page says that it did, a shell can do
        gate = browser.evaluate("[...document.querySelectorAll('#log code')].map((c) => c.textContent)"
                                ".find((c) => c.includes('param set /ekf gate 0.25'))")  # fmt: skip
        assert shell(gate.replace("0.25", "0.125")) == "Set parameter successful"
        page.until("document.querySelector('[data-key=\"/ekf gate\"] input').value === '0.125'")

        # another case, held at the beginning
        page.press("#toggle")
        held(page)
        page.put("reset-case", "3")
        browser.evaluate("document.getElementById('reset-paused').checked = true")
        page.press("#reset-form button")
        page.has("title", "case 3")
        page.until(f"{TIME} === 0")
        page.has("director", "flying okeefe_2013, case 3")
        page.has("toggle", "Go on")
        page.press("#toggle")
        page.until(f"{TIME} > 1")

        # another estimator
        page.put("estimator", "wavg")
        page.press("#estimator-form button")
        page.has("estimates", "wavg (flies)")
        page.until(f"{ERROR} > 0")
        assert page.complaints() == []


def shell(command: str) -> str:
    """Last line that a command of ROS prints."""
    done = subprocess.run(shlex.split(command), capture_output=True, text=True, check=True)
    return done.stdout.strip().splitlines()[-1]


def set_parameter(page: Page, node: str, name: str, value: str) -> str:
    """Puts a value into its place on the page; what the page says that came of it."""
    place = f"document.querySelector('[data-key=\"{node} {name}\"] input')"
    page.until(place)
    page.browser.evaluate("document.getElementById('command').textContent = ''")
    page.browser.evaluate(f"{place}.value = '{value}'; {place}.dispatchEvent(new Event('change'))")
    page.until("/: (done|refused)/.test(document.getElementById('command').textContent)")
    return page.text("command")


def picture(browser: Browser, file: Path) -> None:
    browser.evaluate("scrollTo(0, 0)")
    browser.screenshot(file)
    assert file.stat().st_size > 50_000


def test_several_browsers_see_the_same_and_one_that_comes_late_sees_what_was():
    with console("okeefe_2013") as running, Browser(BROWSER, 1400) as first:
        page = Page(first)
        first.open(running.address)
        page.until(f"{TIME} > 20")
        page.press("#toggle")
        at = held(page)
        with Browser(BROWSER, 390) as second:
            late = Page(second)
            second.open(running.address)
            late.until(f"{TIME} === {at}")
            late.has("toggle", "Go on")
            # the strip charts reach back to what this browser never saw
            late.until("document.querySelectorAll('figure.strip').length === 5")
            late.press("#toggle")
            page.has("toggle", "Pause")
            page.until(f"{TIME} > {at}")
            for width in WIDTHS:
                for scheme in ("light", "dark"):
                    features = [{"name": "prefers-color-scheme", "value": scheme}]
                    second.call("Emulation.setEmulatedMedia", features=features)
                    second.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1,
                                mobile=width < 500)  # fmt: skip
                    late.until(f"innerWidth === {width}")
                    assert second.evaluate(LAYOUT_FAULTS) == []
            assert late.complaints() == []


def test_the_keyboard_alone_suffices():
    with console("okeefe_2013", "--paused") as running, Browser(BROWSER, 800) as browser:
        page = Page(browser)
        browser.open(running.address)
        page.until(f"{TIME} === 0")
        key(browser, ".", "Period", 190)
        page.until(f"{TIME} > 0")
        key(browser, " ", "Space", 32)
        page.until(f"{TIME} > 1")
        key(browser, " ", "Space", 32)
        held(page)
        wanted = int(browser.evaluate(
            "[...document.querySelectorAll('button, input, select, #scene, summary')].filter((e) => e.checkVisibility()"
            " && !e.disabled).map((e) => { e.dataset.wanted = e.id || e.textContent; return e; }).length"
        ))  # fmt: skip
        assert wanted > 40
        for _ in range(wanted + 20):
            key(browser, "Tab", "Tab", 9)
            browser.evaluate("delete document.activeElement.dataset.wanted")
        left = "[...document.querySelectorAll('[data-wanted]')].filter((e) => e.checkVisibility())"
        assert browser.evaluate(f"{left}.map((e) => e.dataset.wanted)") == []


def key(browser: Browser, name: str, code: str, number: int) -> None:
    text = {"text": name} if len(name) == 1 else {}
    fields = {"key": name, "code": code, "windowsVirtualKeyCode": number}
    browser.call("Input.dispatchKeyEvent", type="keyDown", **fields, **text)
    browser.call("Input.dispatchKeyEvent", type="keyUp", **fields)


def test_a_recording_is_played_and_gone_through():
    with console(str(ROOT / "bags" / "reference")) as running, Browser(BROWSER, 800) as browser:
        page = Page(browser)
        browser.open(running.address)
        page.until(f"{TIME} > 1")
        page.has("title", "bags/reference")
        page.until("document.getElementById('slider').max > 140")
        seek(page, 100.0)
        page.until(f"{TIME} >= 100")
        page.has("command", "/player/seek css_msgs/srv/Seek")
        page.press("#toggle")
        held(page)
        seek(page, 20.0)
        page.until(f"Math.abs({TIME} - 20) < 0.3")
        page.press("#toggle")
        page.until(f"{TIME} > 25")
        seek(page, 149.0)
        page.until(f"{TIME} > 149.5")
        seek(page, 5.0)  # from its end
        page.until(f"{TIME} < 20")
        assert browser.evaluate(LAYOUT_FAULTS) == []
        assert page.complaints() == []


def seek(page: Page, time_s: float) -> None:
    place = "document.getElementById('slider')"
    page.browser.evaluate(f"{place}.value = {time_s}; for (const n of ['input', 'change']) "
                          f"{place}.dispatchEvent(new Event(n, {{bubbles: true}}))")  # fmt: skip
