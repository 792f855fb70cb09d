# SPDX-License-Identifier: Apache-2.0
"""The page of a flight: its numbers are the flight's, its texts harmless, its bytes the same each time."""

import json

import numpy as np
import pytest
from page_flight import SIGMA, SPIKE, STEPS, flight
from page_reader import read
from synthetic_flight import estimates, record, tilted

from css_analysis.flight_log import read_flight
from css_common.mission import load_mission
from css_msgs.msg import SunEstimate
from css_report.commands.report import main
from css_report.flight_page import flight_page, read_for_page
from css_report.html_page import html_of

HOSTILE = '</script><script>alert("x")</script><!-- & \u2028'


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return flight(tmp_path_factory.mktemp("bags") / "made_up", load_mission("okeefe_2013").text())


@pytest.fixture(scope="module")
def page(bag):
    return read(html_of(flight_page(read_for_page(bag))))


def test_every_part_is_there(page):
    sections = ["summary", "against-time", "the-sun-over-the-body", "orbit-and-light", "refused-at-the-edges"]
    assert [name for name in page.ids if name in sections] == sections
    drawn = {
        "heading-error",
        "pointing-error",
        "nis",
        "nees",
        "rate",
        "rate-axes",
        "wheel-speed",
        "wheel-torque",
        "rods",
    }
    drawn |= {"mode", "cells", "masks", "units", "body-map", "orbit", "illumination", "earthlight"}
    assert set(page.plots) == drawn
    assert page.scripts == 2 and page.outside == []
    assert any("how many cells see" in text for text in page.texts)


def test_a_spike_of_one_sample_is_on_the_page(page, bag):
    log = read_flight(bag)
    drawn = page.trace("cells", "cell 3")
    assert len(drawn["x"]) < STEPS
    at = int(np.argmax(drawn["y"]))
    assert drawn["y"][at] == np.float32(1.25)
    assert drawn["x"][at] == log.time(log.having("voltages"))[SPIKE] / 60.0


def test_arrays_are_those_of_the_flight(page, bag):
    log = read_flight(bag)
    minutes = log.time(log.having("truth")) / 60.0
    drawn = page.trace("pointing-error", "true")
    rows = np.searchsorted(minutes, drawn["x"])
    assert np.array_equal(minutes[rows], drawn["x"])
    assert np.array_equal(np.degrees(log.pointing_error).astype(np.float32)[rows], drawn["y"])
    error = page.trace("heading-error", "ekf (gyro, flown)")
    known = np.isfinite(error["y"])
    assert known.any() and error["y"][known] == pytest.approx(1.0, abs=1e-4)
    assert np.nanmin(error["x"]) == minutes[100]  # before, there is no estimate


def test_the_bound_is_three_sigma_of_the_filter(page):
    bound = page.trace("heading-error", "ekf: 3 sigma it claims")
    assert bound["y"][np.isfinite(bound["y"])] == pytest.approx(np.degrees(3.0 * SIGMA), rel=1e-5)
    assert page.trace("nis", "ekf: mean")["y"] == pytest.approx(1.0)
    # one degree off across, two axes
    nees = page.trace("nees", "ekf: mean")["y"]
    assert nees == pytest.approx(0.5 * (2.0 * np.sin(np.radians(0.5)) * np.cos(np.radians(0.5)) / SIGMA) ** 2, rel=1e-3)


def test_masks_and_health_are_bars(page):
    used = page.trace("masks", "used by ekf")
    assert set(used["y"][np.isfinite(used["y"])].tolist()) == {0.0, 1.0, 3.0}
    assert page.trace("masks", "left out for failed")["y"][0] == pytest.approx(2.0 - 0.22)
    held = page.trace("units", "held for failed by ekf")
    assert held["x"][0] == pytest.approx(500.0 / 60.0) and held["x"][1] == pytest.approx((STEPS - 1) * 0.1 / 60.0)


def test_eclipses_are_shaded_in_every_plot_against_time(page):
    for name in ("heading-error", "cells", "mode"):
        (shape,) = page.plots[name]["shapes"]
        assert shape["x0"] == pytest.approx(10.0) and shape["x1"] == pytest.approx((STEPS - 1) * 0.1 / 60.0)


def test_lines_differ_without_colour(page):
    for name, plot in page.plots.items():
        lines = [t for t in plot["traces"] if t["type"] == "scatter" and "lines" in t["mode"] and t["name"]]
        looks: dict[tuple, set[str]] = {}
        for trace in lines:
            look = (trace["line"].get("dash"), trace["line"]["width"], trace.get("marker", {}).get("symbol"))
            looks.setdefault(look, set()).add(trace["name"])
        alike = [names for names in looks.values() if len(names) > 1]
        assert alike == [], (name, alike)


def test_legends_name_what_is_drawn(page):
    for name, plot in page.plots.items():
        named = {t["name"] for t in plot["traces"] if t.get("name") and not t.get("meta", {}).get("part")}
        assert set(page.legend[name]) == named


def test_the_same_recording_gives_the_same_bytes(bag, tmp_path):
    for name in ("a", "b"):
        assert main([str(bag), "-o", str(tmp_path / name)]) == 0
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_json_names_file_size_and_sections(bag, tmp_path, capsys):
    file = tmp_path / "new" / "page.html"
    assert main([str(bag), "-o", str(file), "--json"]) == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert list(told) == ["file", "bytes", "sections"]
    assert told["file"] == str(file) and told["bytes"] == file.stat().st_size < 15_000_000
    assert told["sections"][0] == "summary" and "mission-and-versions" in told["sections"]


def test_hostile_names_stay_texts(tmp_path):
    text = load_mission("okeefe_2013", ["mission.description=" + HOSTILE.replace("\u2028", "")]).text()
    bag = flight(tmp_path / "</script><b>", text)
    page = read(html_of(flight_page(read_for_page(bag))))
    assert page.scripts == 2
    assert any(HOSTILE.replace("\u2028", "").strip() in text for text in page.texts)
    assert "b" not in page.open


def test_hostile_names_of_estimators_stay_data(bag):
    subject = read_for_page(bag)
    subject.log.estimates[HOSTILE] = subject.log.estimates.pop("ekf")
    page = read(html_of(flight_page(subject)))
    assert page.scripts == 2 and f"{HOSTILE}: 3 sigma it claims" in page.legend["heading-error"]
    assert page.trace("heading-error", f"{HOSTILE}: 3 sigma it claims")


def test_two_flights_stand_side_by_side(bag, tmp_path, capsys):
    file = tmp_path / "both.html"
    other = flight(tmp_path / "other")
    assert main([str(bag), "--against", str(other), "-o", str(file)]) == 0
    page = read(file.read_text(encoding="utf-8"))
    assert {"heading-error", "heading-error-2", "cells", "cells-2"} <= set(page.plots)
    assert page.plots["cells"]["x"] == page.plots["cells-2"]["x"]
    assert "both" in page.ids and any("no plot of this kind" in text for text in page.texts)
    assert any(text == "second less first" for text in page.texts)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["missing"], "missing"),
        (["{bag}", "--against", "{study}"], "expected a recording"),
        (["{bag}", "-o", "{study}"], "is a folder"),
        (["{study}"], "holds no complete study"),
    ],
)
def test_what_is_wrong_is_one_line(bag, tmp_path, arguments, told, capsys):
    (tmp_path / "study.json").write_text("{}")
    filled = [text.format(bag=bag, study=tmp_path) for text in arguments]
    assert main(filled) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line


def test_a_bare_estimate_has_a_page(tmp_path):
    bag = record(tmp_path / "bare", {"/x/sun_estimate": (SunEstimate, estimates(tilted(np.full(50, 20.0))))})
    page = read(html_of(flight_page(read_for_page(bag))))
    assert set(page.plots) == {"body-map"}
    assert any("no truth" in text for text in page.texts)
    assert not any("how many cells see" in text for text in page.texts), "of what is not drawn"
