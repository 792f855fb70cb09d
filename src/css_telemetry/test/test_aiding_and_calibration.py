# SPDX-License-Identifier: Apache-2.0
"""What a recording of telemetry holds for estimators beside readings: the flag of a shadow, a calibration."""

import pytest
from presence import present
from sensor_msgs.msg import Illuminance

from css_common.codec import codec_of
from css_common.mission import mission_from_text
from css_msgs.msg import CssVoltages
from css_recording.bag_reader import BagReader
from css_telemetry import import_table
from css_telemetry.commands.import_csv import main
from css_telemetry.summary import summary_lines

FLAGGED = """\
cells: {c1: [1, 0, 0], c2: [0, 1, 0]}
field_of_view_deg: 180
time: {column: time}
aiding: {eclipse: {column: dark}}
"""


def test_a_flag_of_the_shadow_that_is_aiding_is_told_to_estimators_and_is_no_truth(tmp_path, capsys):
    (tmp_path / "t.csv").write_text(
        "time,c1,c2,dark\n1700000000,0.9,0.1,0\n1700000001,0.0,0.0,1\n1700000002,0.0,0.0,\n"
    )
    (tmp_path / "d.yaml").write_text(FLAGGED)
    report = import_table(tmp_path / "t.csv", tmp_path / "d.yaml", tmp_path / "bag")
    assert report.states is None and report.messages["/sunlight/illuminance"] == 2
    with BagReader(tmp_path / "bag") as reader:
        told = [codec_of(Illuminance).decode(m.data).illuminance for m in reader.messages(["/sunlight/illuminance"])]
    assert told == [133_100.0, 0.0]
    assert any("eclipse.source flag" in line for line in summary_lines(report))


CALIBRATION = "/**:\n  ros__parameters:\n    cells: {measured: {scales: [0.9, 1.1], darks: [0.01, 0.0]}}\n"


def test_a_calibration_goes_into_the_mission_of_the_recording(tmp_path, capsys):
    (tmp_path / "t.csv").write_text("time,c1,c2\n1700000000,0.9,0.1\n1700000001,0.8,0.2\n")
    (tmp_path / "d.yaml").write_text("cells: {c1: [1, 0, 0], c2: [0, 1, 0]}\n")
    (tmp_path / "c.yaml").write_text(CALIBRATION)
    options = [str(tmp_path / "t.csv"), str(tmp_path / "d.yaml"), "-o", str(tmp_path / "bag")]
    assert main([*options, "--calibration", str(tmp_path / "c.yaml")]) == 0
    assert f"calibration: {tmp_path / 'c.yaml'}, taken off by whoever replays" in capsys.readouterr().out
    with BagReader(tmp_path / "bag") as reader:
        mission = mission_from_text(present(reader.mission_text), "bag")
        outputs = [codec_of(CssVoltages).decode(m.data).voltages for m in reader.messages(["/css/voltages"])]
    assert mission.values.cells.measured.scales.tolist() == [0.9, 1.1]
    assert outputs[0].tolist() == [0.9, 0.1]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            CALIBRATION.replace("[0.9, 1.1]", "[0.9]"),
            "c.yaml: /**: cells.measured.scales: 1 given, expected one for each of the 2",
        ),
        (CALIBRATION.replace("measured", "measurd"), "c.yaml: tells nothing of a sensor"),
        ("", "c.yaml: tells nothing of a sensor, expected cells.measured"),
        (None, "c.yaml"),
    ],
)
def test_what_is_no_calibration_of_these_cells_is_refused_before_anything_is_written(tmp_path, capsys, text, told):
    (tmp_path / "t.csv").write_text("time,c1,c2\n1700000000,0.9,0.1\n1700000001,0.8,0.2\n")
    (tmp_path / "d.yaml").write_text("cells: {c1: [1, 0, 0], c2: [0, 1, 0]}\n")
    if text is not None:
        (tmp_path / "c.yaml").write_text(text)
    options = [str(tmp_path / "t.csv"), str(tmp_path / "d.yaml"), "-o", str(tmp_path / "bag")]
    assert main([*options, "--calibration", str(tmp_path / "c.yaml")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line
    assert not (tmp_path / "bag").exists()
