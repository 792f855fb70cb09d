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
_NORMALS = {"px": [1, 0, 0], "mx": [-1, 0, 0], "py": [0, 1, 0], "my": [0, -1, 0], "pz": [0, 0, 1], "mz": [0, 0, -1]}
FACES = "cells:\n" + "".join(f"  {name}: {at}\n" for name, at in _NORMALS.items()) + "field_of_view_deg: 180\n"


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
    (folder / "long.yaml").write_text(FACES)
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


def test_lines_of_ten_minutes_with_shadows_and_gaps_lose_no_cell(tmp_path, capsys):
    rng = np.random.default_rng(14)
    times = np.arange(1200) * 600.0
    for gap in (200, 500, 900):
        times[gap:] += rng.uniform(3_000.0, 30_000.0)
    sun = rng.normal(size=(len(times), 3))
    sun /= np.linalg.norm(sun, axis=1, keepdims=True)
    sun[times % 5677.0 > 0.64 * 5677.0] = 0.0
    outputs = np.maximum(0.0, sun @ np.array(list(_NORMALS.values())).T) + rng.normal(0.0, 0.003, (len(times), 6))
    lines = ["time,px,mx,py,my,pz,mz,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s"]
    for time, cells, rate in zip(times, outputs, rng.normal(0.0, 0.01, (len(times), 3)), strict=True):
        lines.append(",".join(f"{value:.5f}" for value in (BEGIN + time, *cells, *rate)))
    (tmp_path / "long.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "long.yaml").write_text(FACES)
    import_table(tmp_path / "long.csv", tmp_path / "long.yaml", tmp_path / "bag")
    assert replay_command.main([str(tmp_path / "bag"), "--json", "--no-report", "--estimators", "wls"]) == 0
    said = capsys.readouterr().out
    (run,) = json.loads(said.splitlines()[-1])["runs"]
    assert run["isolated_cells"] == []
    assert "steps are longer than 10 s" in said and "the gyro is not held against the Sun" in said
