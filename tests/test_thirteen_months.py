# SPDX-License-Identifier: Apache-2.0
"""Thirteen months of telemetry are one recording, which every reader of ours opens."""

import json

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from css_analysis.flight_log import read_flight
from css_bringup.commands import replay as replay_command
from css_common.mission import mission_from_text
from css_recording.bag_reader import BagReader
from css_recording.commands import recover
from css_telemetry import import_table

DAYS = 396
STEP_S = 3600
BEGIN = 1_672_531_200  # 2023-01-01
LINES = DAYS * 24


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp("long")
    rng = np.random.default_rng(13)
    sun = rng.normal(size=(LINES, 3))
    sun /= np.linalg.norm(sun, axis=1, keepdims=True)
    lines = ["time,px,mx,py,my,pz,mz,sun_x,sun_y,sun_z"]
    for k, (x, y, z) in enumerate(sun):
        cells = ",".join(f"{max(0.0, value):.6f}" for value in (x, -x, y, -y, z, -z))
        lines.append(f"{BEGIN + k * STEP_S},{cells},{x:.8f},{y:.8f},{z:.8f}")
    (folder / "long.csv").write_text("\n".join(lines) + "\n")
    faces = {"px": [1, 0, 0], "mx": [-1, 0, 0], "py": [0, 1, 0], "my": [0, -1, 0], "pz": [0, 0, 1], "mz": [0, 0, -1]}
    (folder / "long.yaml").write_text(
        "cells:\n" + "".join(f"  {name}: {normal}\n" for name, normal in faces.items()) + "field_of_view_deg: 180\n"
    )
    report = import_table(folder / "long.csv", folder / "long.yaml", folder / "bag")
    assert report.telemetry.account.refused == {} and len(report.telemetry.stamps_ns) == LINES
    return report.recording


def test_nothing_of_it_is_lost(bag):
    with BagReader(bag) as reader:
        mission = mission_from_text(str(reader.mission_text), "recording")
        assert mission.values.mission.duration == (LINES - 1) * STEP_S > 395 * 86_400
        assert {topic.topic.name: topic.count for topic in reader.topics} == {"/css/voltages": LINES, "/truth": LINES}
    with AnyReader([bag]) as foreign:
        assert foreign.message_count == 2 * LINES
    log = read_flight(bag)
    assert log.truth is not None and len(log.truth) == LINES and log.notes == []


def test_it_is_replayed_and_indexed_anew(bag, capsys):
    out = str(bag.with_name("out"))
    assert replay_command.main([str(bag), "--out", out, "--json", "--estimators", "wls:gate=0"]) == 0
    (run,) = json.loads(capsys.readouterr().out.splitlines()[-1])["runs"]
    assert run["steps_without_estimate"] == 0 and run["heading_error_p95_deg"] < 0.001
    (bag / "metadata.yaml").unlink()
    assert recover.main([str(bag)]) == 0
    with BagReader(bag) as reader:
        assert sum(topic.count for topic in reader.topics) == 2 * LINES
