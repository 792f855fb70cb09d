# SPDX-License-Identifier: Apache-2.0
"""A missing cell travels as missing: the line stays, estimators go by the other cells, covariances say what is open."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from faces import FACES, LINES, recording
from flights import fly_composed, samples
from presence import present

from css_analysis.estimate_errors import attitude_errors, heading_errors, tangent_nees
from css_bringup.replay_bag import ReplayResult, mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_common.codec import codec_of
from css_common.mission import load_mission
from css_msgs.msg import AttitudeEstimate, CssVoltages, SunEstimate
from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter


def replayed(bag: Path, *requests: str) -> ReplayResult:
    mission = mission_of_bag(bag, {}, [], None)
    return replay(bag, bag.with_name("replay"), mission, map(parse_request, requests), {}, overwrite=True)


def errors_deg(result: ReplayResult, name: str) -> np.ndarray:
    steps, errors = heading_errors(result.log, name)
    assert steps.tolist() == list(range(LINES)), "no line is lost"
    return np.degrees(errors)


def variances(result: ReplayResult, name: str) -> np.ndarray:
    """Sum [rad^2] of the variances that an estimator claims; negative: it claims nothing."""
    covariance = result.log.estimates[name].covariance
    return np.where(covariance[:, 0] < 0.0, -1.0, covariance[:, [0, 4, 8]].sum(axis=1))


def of_a_plane(errors_deg: np.ndarray, cell_sigma: float = 0.1) -> np.ndarray:
    """The same of two faces that show the Sun's projection on their plane without error, but on neither side of it."""
    cosine = np.cos(np.radians(errors_deg))
    across = 1.0 - (cosine - cell_sigma) ** 2 + (cell_sigma / cosine) ** 2
    return across + 0.5 * np.minimum(across**2, across)


def now_and_then(text: str) -> Callable[[int, str, float], str]:
    """The bright cell of the first half of the lines is missing in four lines of ten."""

    def given(k: int, face: str, value: float) -> str:
        return text if face == "px" and k % 10 in (4, 5, 6, 7) and k < 60 else f"{value:.9f}"

    return given


@pytest.mark.parametrize(
    ("text", "kind"),
    # the import takes fill values out; what no cell can read and is none goes on the wire
    [
        ("", "missing"),
        ("nan", "missing"),
        ("-9999", "missing"),
        ("65535", "missing"),
        ("-500", "impossible"),
        ("3", "impossible"),
    ],
)
def test_a_cell_that_is_missing_now_and_then_costs_neither_line_nor_accuracy(tmp_path, text, kind):
    result = replayed(recording(tmp_path, now_and_then(text)), "ekf", "wls:gate=0")
    assert errors_deg(result, "ekf").max() < 0.1
    errors = errors_deg(result, "wls_gate_0")
    spans = result.log.estimates["wls_gate_0"].mode == 3
    assert errors[spans].max() < 0.1
    # where two cells are left, their plane: least squares says how far off it the Sun is
    missing = np.array([k % 10 in (4, 5, 6, 7) and k < 60 for k in range(LINES)])
    assert np.array_equal(~spans, missing | (np.arange(LINES) % 90 == 0))
    claimed = variances(result, "wls_gate_0")
    plane = result.log.estimates["wls_gate_0"].mode == 2
    np.testing.assert_allclose(claimed[plane], of_a_plane(errors[plane]), rtol=1e-6)
    # outputs that fade together are a Sun that sets: the heading is held
    assert np.count_nonzero(plane) == 18 and np.all(claimed[~spans & ~plane] == -1.0)
    assert result.rejected == {}
    assert result.missing == {"/css/voltages": {f"voltages.{kind}": 24}}
    (report,) = result.reports
    assert report.startswith("css/voltages: voltages[0] is ") and "it counts as missing" in report


def test_a_cell_that_is_always_missing_leaves_open_what_it_alone_sees(tmp_path):
    bag = recording(tmp_path, lambda k, face, value: "" if face == "px" else f"{value:.9f}")
    result = replayed(bag, "ekf", "wls:gate=0", "wls:gate=0,use_dark_cells=true")
    errors = errors_deg(result, "ekf")
    _, nees = tangent_nees(result.log, "ekf")
    sigma_deg = np.degrees(np.sqrt(variances(result, "ekf")))
    # the Sun is on +x first: that face alone would tell, and the filter says so
    assert errors[0] > 50.0 and np.all(sigma_deg[:4] > 60.0)
    assert nees.max() < 2.0
    # the gyro turns what the others see into what is missing, a cell that the Sun only grazes among them
    assert errors[10:].max() < 0.1
    for name in ("wls_gate_0", "wls_gate_0_use_dark_cells_true"):
        known = result.log.estimates[name].mode == 3
        assert errors_deg(result, name)[known].max() < 0.1
        assert np.count_nonzero(known) == 29, "those behind the missing face, where three other cells are lit"
        assert np.all(np.sin(np.radians(errors_deg(result, name))) ** 2 <= variances(result, name))


def test_every_estimator_takes_a_missing_cell_and_gives_finite_numbers(tmp_path):
    bag = recording(tmp_path, lambda k, face, value: "" if FACES[k % 6] == face else f"{value:.9f}")
    names = (
        "wavg",
        "wls",
        "ekf",
        "flat:eclipse.source=sensors",
        "wavg:gate_kind=absolute,gate=0.1",
        "wls:use_dark_cells=true",
    )
    result = replayed(bag, *names)
    assert [(run.messages, run.failures) for run in result.replayed] == [(LINES, 0)] * len(names)
    for name, estimates in result.log.estimates.items():
        lit = estimates.lit_mask
        missing = 1 << (np.arange(LINES) % 6)
        assert not np.any(lit & missing), f"{name} uses a cell that is missing"


def test_the_attitude_filter_goes_on_with_the_other_cells(tmp_path):
    flown = tmp_path / "flown"
    fly_composed(load_mission("cubesat_vmm", ["mission.duration=400.0"]), flown)
    codec = codec_of(CssVoltages)
    with BagReader(flown) as reader, BagWriter(tmp_path / "bag", metadata=reader.description) as writer:
        for entry in reader.topics:
            writer.add_topic(Topic(entry.topic.name, entry.topic.type))
        for message in reader.messages():
            data = message.data
            if message.topic == "/css/voltages":
                sample = codec.decode(data)
                sample.voltages[0] = np.nan
                data = codec.encode(sample)
            writer.write(message.topic, message.stamp_ns, data)
    topics = {output.topic for output in load_mission("cubesat_vmm", []).outputs.values()}
    names = sorted(topic.removesuffix("/attitude") for topic in topics if topic.endswith("/attitude"))
    result = replay(
        tmp_path / "bag",
        tmp_path / "replay",
        mission_of_bag(tmp_path / "bag", {}, [], None),
        map(parse_request, names),
        {},
    )
    steps = len(samples(flown, f"/{names[0]}/attitude", AttitudeEstimate))
    for run in result.replayed:
        assert (run.messages, run.failures) == (steps, 0)
        assert present(run.comparison).different, "one cell less is another estimate"
        found, errors, _ = attitude_errors(result.log, run.label)
        assert np.degrees(np.median(errors[found > 0.75 * steps])) < 2.0


def test_a_mission_may_say_what_a_reading_is(tmp_path):
    bag = recording(tmp_path, now_and_then("-1"))
    mission = mission_of_bag(bag, {}, ["cells.smallest_reading=-0.5"], None)
    result = replay(bag, tmp_path / "replay", mission, [parse_request("ekf")], {})
    assert errors_deg(result, "ekf").max() < 0.1
    assert result.missing == {"/css/voltages": {"voltages.impossible": 24}}
    assert len(samples(tmp_path / "replay", "/ekf/sun_estimate", SunEstimate)) == LINES
