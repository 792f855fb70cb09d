# SPDX-License-Identifier: Apache-2.0
"""Replay of recordings that are not as a flight of ours is: by reception time, cut, changed, with broken inputs."""

import json
import random
from pathlib import Path

import numpy as np
import pytest
from flights import messages_by_topic
from rewritten_bag import REFERENCE, edited, on, rewritten
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import Imu

from css_bringup.commands import replay as command
from css_common.codec import Sample
from css_msgs.msg import CssVoltages, SunEstimate
from css_recording.bag_reader import BagReader
from css_recording.provenance import software_versions
from css_recording.schemas import schema_of

SECOND = 1_000_000_000
ESTIMATES = 1500


def untouched(stamp_ns: int, data: bytes) -> bytes:
    return data


def replay(bag: Path, capsys, *arguments: str) -> tuple[int, dict, str]:
    """Exit code, JSON object and standard error of the command."""
    out = bag.parent / "replayed"
    code = command.main([str(bag), "--out", str(out), "--overwrite", "--json", *arguments])
    captured = capsys.readouterr()
    return code, json.loads(captured.out.splitlines()[-1]), " ".join(captured.err.split())


def test_recording_by_reception_time_gives_the_bytes_that_flew(tmp_path, capsys):
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in ("CssVoltages", "SunEstimate"):
        name = f"css_msgs/msg/{name}"
        store.register(get_types_from_msg(schema_of(name).text.split("=" * 80)[0], name))
    # 4 s of the wall clock for each of the flight, as a recorder hears it, later by up to half a period
    chance = random.Random(4)
    began = 1_800_000_000 * SECOND
    with BagReader(REFERENCE) as reader:
        topics = [t.topic for t in reader.topics if t.topic.name in ("/css/voltages", "/gyro/imu", "/ekf/sun_estimate")]
        heard = [
            (began + 4 * (m.stamp_ns - reader.start_ns) + chance.randrange(4 * SECOND // 20), m)
            for m in reader.messages([t.name for t in topics])
        ]
    heard.sort(key=lambda entry: entry[0])
    with Writer(tmp_path / "heard", version=9, storage_plugin=StoragePlugin.MCAP) as out:
        connections = {t.name: out.add_connection(t.name, t.type, typestore=store) for t in topics}
        for log_time, message in heard:
            out.write(connections[message.topic], log_time, message.data)
    code, result, _ = replay(tmp_path / "heard", capsys, "--mission", "okeefe_2013", "--estimators", "ekf")
    assert code == 0
    assert result["replayed"][0]["comparison"] | {"largest_difference": 0.0} == {
        "compared": ESTIMATES,
        "different": 0,
        "unmatched": 0,
        "identical": True,
        "first_different_ns": None,
        "first_unmatched_ns": None,
        "largest_difference": 0.0,
    }
    assert result["parameters"].endswith("config/okeefe_2013.yaml")
    assert result["simulated_s"] == pytest.approx(149.9)
    flown = messages_by_topic(REFERENCE)["/ekf/sun_estimate"]
    assert messages_by_topic(tmp_path / "replayed")["/ekf/sun_estimate"] == flown


def test_nothing_compared_is_no_success(tmp_path, capsys):
    year = 365 * 86400 * SECOND
    bag = rewritten(
        tmp_path / "bag",
        on("/ekf/sun_estimate", edited(SunEstimate, lambda s: setattr(s, "stamp_ns", s.stamp_ns - year))),
    )
    code, result, errors = replay(bag, capsys, "--estimators", "ekf")
    assert code == 1
    comparison = result["replayed"][0]["comparison"]
    assert (comparison["compared"], comparison["identical"]) == (0, False)
    assert comparison["unmatched"] == 2 * ESTIMATES
    assert "nothing could be compared with the flight" in errors


def test_estimates_on_one_side_only_are_counted_and_the_first_is_named(tmp_path, capsys):
    with BagReader(REFERENCE) as reader:
        start = reader.start_ns
    lost = {start + k * SECOND // 10 for k in (700, 701)}
    bag = rewritten(tmp_path / "bag", on("/ekf/sun_estimate", lambda stamp, data: None if stamp in lost else data))
    code, result, errors = replay(bag, capsys, "--estimators", "ekf")
    assert code == 1
    comparison = result["replayed"][0]["comparison"]
    assert (comparison["compared"], comparison["different"], comparison["unmatched"]) == (ESTIMATES - 2, 0, 2)
    assert comparison["first_unmatched_ns"] == min(lost)
    assert f"2 stand on one side only, the first at {min(lost)} ns in the replay" in errors


@pytest.mark.parametrize(("cpu", "error", "expected"), [("", 1e-9, 1), ("another", 1e-9, 0), ("another", 1e-3, 1)])
def test_other_bytes_are_excused_where_rounding_and_another_processor_explain_them(
    tmp_path, capsys, cpu, error, expected
):
    def bend(sample: Sample) -> None:
        sample.sun_b = sample.sun_b + np.array([error, 0.0, 0.0])

    here = software_versions()
    bag = rewritten(
        tmp_path / "bag", on("/ekf/sun_estimate", edited(SunEstimate, bend)), **(here | ({"cpu": cpu} if cpu else {}))
    )
    code, result, _ = replay(bag, capsys, "--estimators", "ekf")
    assert code == expected
    comparison = result["replayed"][0]["comparison"]
    assert comparison["different"] == ESTIMATES and not comparison["identical"]
    assert comparison["largest_difference"] == pytest.approx(error, rel=1e-6)
    assert bool(result["software_differs"]) == bool(cpu)


def test_a_parameter_of_the_command_line_is_not_taken_for_what_flew(tmp_path, capsys):
    arguments = ("--estimators", "ekf", "--set", "ekf.cell_sigma=0.2")
    code = command.main([str(REFERENCE), "--out", str(tmp_path / "out"), "--json", *arguments])
    result = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert code == 0
    assert result["replayed"][0]["comparison"] is None


def late(sample: Sample) -> None:
    sample.stamp_ns += 20_000_000


def test_inputs_that_never_meet_are_named_with_the_remedy_which_helps(tmp_path, capsys):
    bag = rewritten(tmp_path / "bag", on("/gyro/imu", edited(Imu, late)))
    with BagReader(bag) as reader:
        first = reader.start_ns
    code, result, errors = replay(bag, capsys, "--estimators", "ekf")
    assert code == 1
    assert "no estimate from ekf: gyro/imu: missing in 1500 cycles, which did not run, the first at stamp" in errors
    assert f"{first} ns (io.input_matching=latest pairs" in errors
    code, result, _ = replay(bag, capsys, "--estimators", "ekf", "--set", "io.input_matching=latest")
    assert code == 0
    assert result["replayed"][0]["estimates"] > ESTIMATES - 10


@pytest.mark.parametrize("kind", ["offset", "damaged", "foreign type"])
def test_a_gyro_that_is_not_used_may_be_broken_in_any_way(tmp_path, capsys, kind):
    changes = {"offset": edited(Imu, late), "damaged": lambda stamp, data: data[:60], "foreign type": untouched}
    types = {"/gyro/imu": "sensor_msgs/msg/MagneticField"} if kind == "foreign type" else None
    bag = rewritten(tmp_path / "bag", on("/gyro/imu", changes[kind]), types)
    code, result, _ = replay(bag, capsys, "--estimators", "ekf:gyro=off", "wavg:gyro=off")
    assert code == 0
    assert [run["estimates"] for run in result["replayed"]] == [ESTIMATES, ESTIMATES]
    assert result["rejected"] == {}
    command.main([str(REFERENCE), "--out", str(tmp_path / "whole"), "--estimators", "ekf:gyro=off", "wavg:gyro=off"])
    for topic in ("/ekf_gyro_off/sun_estimate", "/wavg_gyro_off/sun_estimate"):
        assert messages_by_topic(tmp_path / "replayed")[topic] == messages_by_topic(tmp_path / "whole")[topic]


def test_a_topic_of_another_type_is_refused_by_name_where_it_is_used(tmp_path, capsys):
    bag = rewritten(tmp_path / "bag", on("/gyro/imu", untouched), {"/gyro/imu": "sensor_msgs/msg/MagneticField"})
    assert command.main([str(bag), "--out", str(tmp_path / "out"), "--estimators", "ekf"]) == 2
    errors = " ".join(capsys.readouterr().err.split())
    assert "topic /gyro/imu is sensor_msgs/msg/MagneticField, ekf expected sensor_msgs/msg/Imu" in errors
    assert "ekf:gyro=off" in errors


def test_every_cell_lost_is_every_estimate_lost_and_exit_code_1(tmp_path, capsys):
    def blind(sample: Sample) -> None:
        sample.voltages = np.full(8, np.nan)

    bag = rewritten(tmp_path / "bag", on("/css/voltages", edited(CssVoltages, blind)))
    code, result, errors = replay(bag, capsys, "--estimators", "wavg")
    assert code == 1
    assert result["rejected"]["/css/voltages"] == {"not_finite": ESTIMATES}
    assert "no estimate from wavg" in errors


@pytest.mark.parametrize(("epoch", "age"), [("13132.00000000", "20.0 days"), ("13151.00000000", "")])
def test_an_element_set_of_another_time_is_said_of_each_estimator(tmp_path, capsys, epoch, age):
    lines = (
        f"1 25544U 98067A   {epoch}  .00002182  00000-0  46000-4 0  999",
        "2 25544  51.6400 100.0000 0001000  90.0000 270.0000 15.5000000000000",
    )
    sums = [sum(int(c) if c.isdigit() else c == "-" for c in line) % 10 for line in lines]
    given = [f"orbit.tle_line{i + 1}={line}{check}" for i, (line, check) in enumerate(zip(lines, sums, strict=True))]
    code = command.main(
        [str(REFERENCE), "--out", str(tmp_path / "replayed"), "--estimators", "wavg:eclipse.source=model", "ekf"]
        + [argument for value in ("orbit.source=tle", *given) for argument in ("--set", value)]
    )
    said = " ".join("".join(capsys.readouterr()).split())
    assert code == 0
    for name in ("wavg_eclipse_source_model", "ekf"):
        noted = f"{name}: orbit.tle_line1: the set of 2013-05-12T00:00 is used up to {age} after its epoch"
        assert (noted in said) is bool(age)
    assert age or "tle_line1" not in said
