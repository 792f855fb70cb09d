# SPDX-License-Identifier: Apache-2.0
"""A table of telemetry becomes the recording that it describes, or is refused by line and column."""

import json
import math
import textwrap

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from presence import present
from rosbags.highlevel import AnyReader

from css_common.mission_file import flattened, read_sections
from css_common.schema import checked_values
from css_common.shared_sections import shared_parameters
from css_recording.bag_reader import BagReader
from css_recording.errors import BagError
from css_telemetry.commands.import_csv import main
from css_telemetry.description import CellForm, Description
from css_telemetry.importing import examined, record
from css_telemetry.table_text import listed
from css_telemetry.telemetry import read_telemetry, refuse_unscaled

LAYOUT = Description((CellForm("c1", "c1", (1.0, 0.0, 0.0)), CellForm("c2", "c2", (0.0, 0.6, 0.8))))
EPOCH_NS = 1_370_044_800_000_000_000
TABLE = """\
    # flight 7, morning pass
    time; c1; c2; temperature; omega_x_deg_s; omega_y_deg_s; omega_z_deg_s; sun_x; sun_y; sun_z
    2013-06-01T00:00:00Z; 0.5; 0.25; 20; 1; 2; -3; 0; 0; 2

    2013-06-01T00:00:00.1Z; ; 0.5; 20; 1; ; -3; 0; 3; 4
    2013-06-01T00:00:00.2Z; nan; NA; 21; 1; 2; 3; -; 3; 4
    2013-06-01T00:00:01Z; 1; -0.01; 21; 0; 0; 0; 1; 0; 0
"""


def table(tmp_path, text):
    path = tmp_path / "table.csv"
    path.write_text(textwrap.dedent(text))
    return path


def imported(path, folder, layout=LAYOUT, **options):
    report = examined(read_telemetry(path, layout, **options), folder)
    record(report, path)
    return report


def decoded(folder):
    """Topic, log time and message, decoded by `rosbags` with the definitions in the file."""
    with AnyReader([folder]) as reader:
        return [
            (connection.topic, stamp, reader.deserialize(data, connection.msgtype))
            for connection, stamp, data in reader.messages()
        ]


def test_values_units_and_gaps_as_other_readers_see_them(tmp_path, doctor):
    report = imported(table(tmp_path, TABLE), tmp_path / "bag")
    doctor(tmp_path / "bag" / "bag_0.mcap")
    seen = decoded(tmp_path / "bag")
    for _, stamp, message in seen:
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp

    cells = [(stamp - EPOCH_NS, list(m.voltages)) for topic, stamp, m in seen if topic == "/css/voltages"]
    assert [time for time, _ in cells] == [0, 100_000_000, 1_000_000_000]
    np.testing.assert_array_equal([v for _, v in cells], [[0.5, 0.25], [math.nan, 0.5], [1.0, -0.01]])

    imu = [message for topic, _, message in seen if topic == "/gyro/imu"]
    degree = math.pi / 180
    rates = [(m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z) for m in imu]
    np.testing.assert_allclose(rates, np.array([(1, 2, -3), (0, 0, 0), (1, 2, 3), (0, 0, 0)]) * degree, rtol=1e-15)
    assert [m.angular_velocity_covariance[0] for m in imu] == [0.0, -1.0, 0.0, 0.0]
    assert all(m.orientation_covariance[0] == m.linear_acceleration_covariance[0] == -1.0 for m in imu)

    truth = [message for topic, _, message in seen if topic == "/truth"]
    np.testing.assert_allclose([m.sun_n for m in truth], [(0, 0, 1), (0, 0.6, 0.8), (1, 0, 0)], rtol=1e-15)
    assert all(not np.any(m.sigma_bn) and m.illumination == m.solar_flux == 1.0 for m in truth)
    assert {m.header.frame_id for m in truth} == {"eci"}
    assert {m.header.frame_id for m in imu} == {"bus"}

    assert report.messages == {"/truth": 3, "/css/voltages": 3, "/gyro/imu": 4}
    missing = {what: (found.times, found.first_line) for what, found in report.telemetry.account.missing.items()}
    assert missing == {
        "missing cell outputs in the other lines": (1, 5),
        "lines used without any cell output": (1, 6),
        "lines used without a rate": (1, 5),
        "lines used without a Sun vector": (1, 6),
    }
    assert (report.gaps, report.longest_gap_s, report.period_s) == (1, 0.8, 0.1)
    assert report.telemetry.largest_output == 1.0
    assert report.states.known == ("sun",)  # a line with the Sun has no rate
    assert report.telemetry.ignored_columns == ("temperature",)
    assert report.telemetry.read_as == ("separator semicolon",)
    assert not any(np.any(m.r_n) or np.any(m.v_n) or np.any(m.field_n) for m in truth)  # not known


def test_mission_inside_holds_the_layout_and_passes_the_checks_of_missions(tmp_path):
    layout = LAYOUT._replace(field_of_view_deg=100.0, clip_normal_b=(0.0, 0.0, 1.0))
    imported(table(tmp_path, TABLE), tmp_path / "bag", layout)
    with BagReader(tmp_path / "bag") as reader:
        text = reader.mission_text
        assert reader.description["python"]
    shared = flattened(read_sections(present(text), "recording")["/**"])
    values = checked_values(shared_parameters().values(), shared)
    assert values["cells.normals"] == [1.0, 0.0, 0.0, 0.0, 0.6, 0.8]
    assert values["cells.field_of_view_deg"] == 100.0
    assert values["cells.clip_normal"] == [0.0, 0.0, 1.0]
    assert values["mission.period"] == 0.1
    assert values["mission.epoch"] == "2013-06-01T00:00:00Z"
    assert values["mission.name"] == "table"
    assert values["mission.duration"] == 1.0
    assert values["io.largest_gap"] == 60.0


@pytest.mark.parametrize(
    ("times", "period", "gap"),
    [((0.0, 25.0, 50.0), 25.0, 60.0), ((0.0, 1.0, 2.0, 102.0), 1.0, 200.0), ((0.0, 100.0), 60.0, 200.0)],
)
def test_what_a_replay_bears_follows_from_the_steps(tmp_path, times, period, gap):
    """Twice the largest step, at least a minute; no cycle is longer than a minute."""
    rows = "".join(f"{1370000000.0 + time},1,2\n" for time in times)
    imported(table(tmp_path, f"time,c1,c2\n{rows}"), tmp_path / "bag")
    with BagReader(tmp_path / "bag") as reader:
        values = flattened(read_sections(present(reader.mission_text), "recording")["/**"])
    assert (values["mission.period"], values["io.largest_gap"]) == (period, gap)
    assert values["mission.duration"] == times[-1]


def test_columns_that_are_not_there_make_no_topics(tmp_path):
    report = imported(table(tmp_path, "time,c1,c2\n1370000000,1,2\n1370000000.5,3,4\n"), tmp_path / "bag")
    assert report.messages == {"/css/voltages": 2}


def test_seconds_count_exactly_from_the_epoch(tmp_path):
    text = "time,c1,c2\n0.1,1,2\n0.30000000000000004,1,2\n123456.123456789,3,4\n"
    stamps = read_telemetry(table(tmp_path, text), LAYOUT, epoch_ns=EPOCH_NS).stamps_ns
    assert (stamps - EPOCH_NS).tolist() == [100_000_000, 300_000_000, 123_456_123_456_789]


def test_outputs_are_divided_by_full_scale(tmp_path):
    path = table(tmp_path, "time,c1,c2\n1370000000,1.5,3\n")
    assert read_telemetry(path, LAYOUT, full_scale=3.0).cells.tolist() == [[0.5, 1.0]]


@pytest.mark.parametrize("unit", ["rad_s", "rad/s", "[rad/s]", "rad_per_s", "(rad/s)"])
@pytest.mark.parametrize("name", ["omega", "gyro", "Rate", "omega_b"])
def test_names_of_rate_columns(tmp_path, name, unit):
    stem, *frame = name.split("_")
    columns = ",".join("_".join([stem, axis, *frame, unit]) for axis in "XYz")
    telemetry = read_telemetry(table(tmp_path, f"time,c1,c2,{columns}\n1370000000,1,1,1,2,3\n"), LAYOUT)
    assert present(telemetry.rate).tolist() == [[1.0, 2.0, 3.0]]


HEADER = "time,c1,c2,omega_x_rad_s,omega_y_rad_s,omega_z_rad_s,sun_x,sun_y,sun_z\n"
GOOD = "1370000000,1,1,0,0,0,1,0,0\n"


REFUSED = [
    ("1370000001,1,1,0,0,0,1,0", "expected 9 fields, found 8", "wrong number of fields"),
    ("1370000001,1,1,0,0,0,1,0,0,7", "expected 9 fields, found 10", "wrong number of fields"),
    ("yesterday,1,1,0,0,0,1,0,0", "column time: 'yesterday' found, expected seconds or an instant", "no time"),
    (",1,1,0,0,0,1,0,0", "column time: '' found", "no time"),
    ("nan,1,1,0,0,0,1,0,0", "column time: 'nan' found", "no time"),
    ("1e400,1,1,0,0,0,1,0,0", "column time: '1e400' found", "no time"),
    ("9999999999,1,1,0,0,0,1,0,0", "outside of 1970 to 2038", "no time"),
    ("1e999999999,1,1,0,0,0,1,0,0", "column time: '1e999999999' found", "no time"),
    ("17_00000000,1,1,0,0,0,1,0,0", "column time: '17_00000000' found", "no time"),
    ("2024-366T00:00:61,1,1,0,0,0,1,0,0", "column time: '2024-366T00:00:61' found", "no time"),
    ("2023-366T00:00:00,1,1,0,0,0,1,0,0", "column time: '2023-366T00:00:00' found", "no time"),
    ('1370000001,"1,1,0,0,0,1,0,0', "a quotation mark is left open", "not readable"),
    (
        "12.5,1,1,0,0,0,1,0,0",
        "12.5 s is not a time since 1970; --epoch, or time: epoch, names its beginning",
        "no epoch",
    ),
    ("1370000000,1,1,0,0,0,1,0,0", "column time: it does not go forward", "does not go forward"),
]
LEFT_OUT = [
    ("1370000001,0x10,1,0,0,0,1,0,0", "column c1: '0x10' found", "no number"),
    ("1370000001,1_0,1,0,0,0,1,0,0", "column c1: '1_0' found", "no number"),
    ("1370000001,1,high,0,0,0,1,0,0", "column c2: 'high' found, expected a number", "no number"),
    ('1370000001,1,"0,5",0,0,0,1,0,0', "column c2: '0,5' found, expected a number", "no number"),
    ("1370000001,1,inf,0,0,0,1,0,0", "column c2: 'inf' found", "no number"),
    ("1370000001,1,1,0,0,x,1,0,0", "column omega_z_rad_s: 'x' found", "no number"),
    ("1370000001,1,1,0,0,0,0,0,0", "columns sun_x, sun_y, sun_z: expected a direction", "no direction"),
]


@pytest.mark.parametrize(("line", "words", "kind"), [*REFUSED, *LEFT_OUT])
def test_a_value_that_cannot_be_read_costs_itself_a_time_its_line(tmp_path, line, words, kind):
    path = table(tmp_path, HEADER + GOOD + "\n" + line + "\n1370000002,1,1,0,0,0,1,0,0\n")
    telemetry = read_telemetry(path, LAYOUT)
    account = telemetry.account
    refused = (line, words, kind) in REFUSED
    assert account.lines == 3 and len(telemetry.stamps_ns) == 3 - refused == 3 - account.refused_lines
    counts, others = (account.refused, account.repaired) if refused else (account.repaired, account.refused)
    ((found, counted),) = counts.items()
    assert kind in found and words in counted.detail and (counted.times, counted.first_line) == (1, 4)
    assert others == {}


@pytest.mark.parametrize(("line", "words", "kind"), REFUSED)
def test_a_table_of_which_no_line_can_be_used_is_refused_by_the_first(tmp_path, line, words, kind):
    if kind == "does not go forward":
        return
    path = table(tmp_path, HEADER + line + "\n")
    with pytest.raises(BagError) as refusal:
        read_telemetry(path, LAYOUT)
    assert str(refusal.value).startswith(f"{path}: line 2: ") and words in str(refusal.value)


def test_what_a_bad_value_costs(tmp_path):
    text = HEADER + GOOD + "1370000001,x,1,0,y,0,0,0,0\n1370000002,1,1,0,0,0,1,0,0\n"
    telemetry = read_telemetry(table(tmp_path, text), LAYOUT)
    np.testing.assert_array_equal(telemetry.cells, [[1, 1], [math.nan, 1], [1, 1]])
    assert np.isfinite(present(telemetry.rate)).all(axis=1).tolist() == [True, False, True]
    assert np.isfinite(present(telemetry.truth.sun_b)).all(axis=1).tolist() == [True, False, True]
    assert {kind: (c.times, c.first_line) for kind, c in telemetry.account.repaired.items()} == {
        "no number": (2, 3),
        "no direction": (1, 3),
    }


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("t,c1,c2", "no column time; the header is t, c1, c2"),
        ("time,c1", "no column c2, which the description names"),
        ("time,c1,c2,c1", "two columns are called c1, the 2. and the 4., expected a name for each"),
        ("time,c1,c2,omega_x,omega_y,omega_z", "column omega_x: expected its unit"),
        ("time,c1,c2,omega_x_rad_s", "no column omega_y"),
        ("time,c1,c2,omega_x_rad_s,omega_y_deg_s,omega_z_rad_s", "different units"),
        ("time,c1,c2,sun_x,sun_y", "no column sun_z"),
        ("", "nothing is there, expected the names of columns"),
    ],
)
def test_a_header_without_what_is_needed_is_refused(tmp_path, header, words):
    with pytest.raises(BagError, match="line 1") as refusal:
        read_telemetry(table(tmp_path, header + "\n"), LAYOUT)
    assert words in str(refusal.value)


def test_lines_from_the_newest_on_are_read_from_the_oldest_on_and_said(tmp_path):
    lines = [f"{1_370_000_000 + k},{0.01 * k},1.0" for k in range(50)]
    forward = read_telemetry(table(tmp_path, "\n".join(["time,c1,c2", *lines])), LAYOUT)
    backward = read_telemetry(
        table(tmp_path, "\n".join(["time,c1,c2", *lines[:20:-1], "x,1,1", *lines[20::-1]])), LAYOUT
    )
    np.testing.assert_array_equal(backward.stamps_ns, forward.stamps_ns)
    np.testing.assert_array_equal(backward.cells, forward.cells)
    assert backward.read_as == ("newest line first",)
    assert forward.read_as == ()
    assert {kind: (c.times, c.first_line) for kind, c in backward.account.refused.items()} == {"no time": (1, 31)}


def test_a_hundred_thousand_columns_are_read(tmp_path):
    """Each name was looked for among all others, which took hours."""
    others = [f"x{number}" for number in range(100_000)]
    lines = [",".join(["time", "c1", "c2", *others])]
    lines += [",".join([str(1_370_000_000 + k), "0.5", "1.0", *["1"] * len(others)]) for k in range(3)]
    telemetry = read_telemetry(table(tmp_path, "\n".join(lines)), LAYOUT)
    np.testing.assert_array_equal(telemetry.cells, [[0.5, 1.0]] * 3)
    assert len(telemetry.ignored_columns) == len(others)
    assert len(listed(telemetry.ignored_columns)) < 400 and listed(others).endswith(" ... (100000 in all)")


def test_tables_without_telemetry_are_refused(tmp_path):
    with pytest.raises(BagError, match="no line of telemetry"):
        read_telemetry(table(tmp_path, HEADER), LAYOUT)
    path = table(tmp_path, "time,c1,c2\n1370000000,,\n")
    with pytest.raises(BagError, match="every cell output is missing"):
        refuse_unscaled(read_telemetry(path, LAYOUT), path)
    with pytest.raises(BagError, match="cannot be read"):
        read_telemetry(tmp_path / "nowhere.csv", LAYOUT)
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))
    for path in (tmp_path / "binary.csv", tmp_path):
        with pytest.raises(BagError, match="cannot be read"):
            read_telemetry(path, LAYOUT)


# round large numbers may be fill values, which have tests of their own
numbers = st.floats(-1e6, 1e6).filter(lambda value: abs(value) < 900 or value % 1 != 0) | st.just(math.nan)
vectors = st.none() | st.tuples(*[st.floats(-10, 10)] * 3)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(st.integers(1, 10**10), numbers, numbers, vectors), min_size=1, max_size=8),
    st.sampled_from(",;\t"),
)
def test_any_table_comes_out_as_it_went_in(tmp_path_factory, lines, delimiter):
    tmp_path = tmp_path_factory.mktemp("any")
    path = tmp_path / "table.csv"
    stamp_ns, expected, text = EPOCH_NS, [], [delimiter.join(HEADER.strip().split(",")[:6])]
    for step_ns, c1, c2, rate in lines:
        stamp_ns += step_ns
        expected.append((stamp_ns, (c1, c2), rate))
        time = f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"
        fields = [time, *("" if math.isnan(c) else repr(c) for c in (c1, c2)), *map(repr, rate or ("", "", ""))]
        text.append(delimiter.join(field if field != "''" else "" for field in fields))
    path.write_text("\n".join(text) + "\n")
    imported(path, tmp_path / "bag")
    seen = decoded(tmp_path / "bag")
    cells = {stamp: tuple(message.voltages) for topic, stamp, message in seen if topic == "/css/voltages"}
    wanted = {stamp: pair for stamp, pair, _ in expected if not all(map(math.isnan, pair))}
    assert cells.keys() == wanted.keys()
    for stamp, pair in wanted.items():
        np.testing.assert_array_equal(cells[stamp], pair)
    rates = [
        (m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z)
        if m.angular_velocity_covariance[0] != -1.0
        else None
        for topic, _, m in seen
        if topic == "/gyro/imu"
    ]
    assert rates == [rate for _, _, rate in expected]


@settings(max_examples=150, deadline=None)
@given(st.text(max_size=200) | st.text("time,c1c2;\n\t0123456789.-\"'#", max_size=200))
def test_no_text_makes_the_reader_crash(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("garbage") / "table.csv"
    path.write_text("time,c1,c2\n1370000000,1,1\n" + text, encoding="utf-8", errors="replace", newline="")
    try:
        telemetry = read_telemetry(path, LAYOUT)
    except BagError as error:
        assert str(path) in str(error)
    else:
        stamps = telemetry.stamps_ns.tolist()
        assert stamps == sorted(set(stamps))
        assert len(stamps) + telemetry.account.refused_lines == telemetry.account.lines


def layout(tmp_path, text):
    path = tmp_path / "layout.yaml"
    path.write_text(text)
    return path


def test_command(tmp_path, capsys):
    cells = str(layout(tmp_path, "cells: {c1: [1, 0, 0], c2: [0, 0.6, 0.8]}"))
    flight = str(table(tmp_path, "time,c1,c2,mode\n0,2,1,a\n1,oops,1,b\n2,1,,c\n"))
    bag = str(tmp_path / "bag")
    assert main([flight, cells, "-o", bag, "--epoch", "2013-06-01"]) == 1
    complaint = capsys.readouterr().err
    assert "1 values left out of 3 lines; --skip-bad takes that as it is" in complaint
    assert main([flight, cells, "-o", bag, "--epoch", "2013-06-01", "--skip-bad", "--overwrite", "--json"]) == 0
    *printed, last = capsys.readouterr().out.splitlines()
    for words in (
        "3 messages, every 1 s",
        "time (UTC): 2013-06-01T00:00:00Z to 2013-06-01T00:00:02Z, 2 s",
        "lines of telemetry: 3 read, 3 used, 0 refused, 1 values left out",
        "values left out (no number): 1, the first is line 3: column c1: 'oops' found, expected a number",
        "missing cell outputs in the other lines: 2, the first in line 3",
        "columns not used: mode",
        "--full-scale",
    ):
        assert words in "\n".join(printed)
    told = json.loads(last)
    assert told["lines"] == {"read": 3, "used": 3, "refused": 0} and told["span_s"] == 2.0
    assert told["repaired"] == [{"kind": "no number", "count": 1, "first_line": 3}]
    assert main([flight, cells, "-o", bag, "--epoch", "2013-06-01", "--skip-bad"]) == 1
    assert "not empty" in capsys.readouterr().err
    for wrong in (["--epoch", "soon"], ["--full-scale", "0"], ["--time-unit", "days"], ["--nonsense"]):
        with pytest.raises(SystemExit) as exit_info:
            main([flight, cells, *wrong])
        assert exit_info.value.code == 2


@pytest.mark.parametrize(
    "epoch", ["2013-06-01", "2013-06-01T00:00Z", "2013-06-01T02:00:00+02:00", "2013-06-01 00:00:00"]
)
def test_forms_of_the_epoch(tmp_path, epoch):
    cells = str(layout(tmp_path, "cells: {c1: [1, 0, 0], c2: [0, 0.6, 0.8]}"))
    flight = str(table(tmp_path, "time,c1,c2\n1.5,1,1\n"))
    assert main([flight, cells, "-o", str(tmp_path / "bag"), "--epoch", epoch]) == 0
    ((_, stamp, _),) = decoded(tmp_path / "bag")
    assert stamp == EPOCH_NS + 1_500_000_000


@pytest.mark.parametrize("outputs", ["0.0021,0.001", "2698,100"])
def test_another_unit_than_full_sun_must_be_said(tmp_path, capsys, outputs):
    cells = str(layout(tmp_path, "cells: {c1: [1, 0, 0], c2: [0, 0.6, 0.8]}"))
    flight = str(table(tmp_path, f"time,c1,c2\n1370000000,{outputs}\n"))
    bag = str(tmp_path / "bag")
    assert main([flight, cells, "-o", bag]) == 2
    assert "--full-scale" in capsys.readouterr().err and not (tmp_path / "bag").exists()
    assert main([flight, cells, "-o", bag, "--full-scale", "1"]) == 0
    assert "the largest cell output is" in capsys.readouterr().out
