# SPDX-License-Identifier: Apache-2.0
"""Tables as spreadsheets and loggers write them: read to the right value, or refused with what helps."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from css_recording.errors import BagError
from css_telemetry.clock import LONGEST_NS, consistent_lines, newest_first
from css_telemetry.description import CellForm, Description
from css_telemetry.header import likenesses
from css_telemetry.sentinels import fill_values
from css_telemetry.telemetry import read_telemetry

LAYOUT = Description((CellForm("c1", "c1", (1.0, 0.0, 0.0)), CellForm("c2", "c2", (0.0, 0.6, 0.8))))
BEGIN_NS = 1_700_000_000 * 10**9


def read(tmp_path, content, layout=LAYOUT, **options):
    path = tmp_path / "table.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_telemetry(path, layout, **options)


@pytest.mark.parametrize(
    ("content", "read_as"),
    [
        ("time,c1,c2\n1700000000.5,0.5,0.25\n", ()),
        ("time;c1;c2\n1700000000,5;0,5;0,25\n", ("separator semicolon", "decimal comma")),
        ("time\tc1\tc2\n1700000000,5\t,5\t2,5e-1\n", ("separator tabulator", "decimal comma")),
        ("time;c1;c2\n1700000000.5;0.5;0.25\n", ("separator semicolon",)),
        ("time | c1 | c2\n1700000000.5 | .5 | 25e-2\n", ("separator bar",)),
        ("time   c1  c2\n1700000000.5  0.5 0.25\n", ("separator space",)),
        ("\ufefftime,c1,c2\r\n1700000000.5,0.5,0.25\r\n", ()),
        ("time,c1,c2\r1700000000.5,0.5,0.25\r", ()),
        ("time,c1,c2\n1700000000.5,0.5,0.25", ()),
        ('"time","c1","c2"\n"1700000000.5","0.5","0.25"\n', ()),
        ("time,c1,c2,Temp °C\n1700000000.5,0.5,0.25,20\n".encode("latin-1"), ("encoding Latin-1",)),
        ("time,c1,c2\n1700000000.5,0.5,0.25\n".encode("utf-16"), ("encoding utf-16",)),
        ("timestamp,c1,c2\n1700000000.5,0.5,0.25\n", ("time from the column timestamp",)),
        ("time [s],c1 [V],c2 [V]\n1700000000.5,0.5,0.25\n", ("cell outputs in V",)),
        ("Time (ms),c1,c2\n1700000000500,0.5,0.25\n", ()),
        ("time,c1,c2\n2023-11-14T22:13:20.5Z,0.5,0.25\n", ()),
        ("time,c1,c2\n2023-11-15 00:13:20.5+02:00,0.5,0.25\n", ()),
        ("time,c1,c2\n2023-318T22:13:20.5Z,0.5,0.25\n", ()),
    ],
)
def test_the_same_line_in_many_forms(tmp_path, content, read_as):
    telemetry = read(tmp_path, content)
    assert telemetry.stamps_ns.tolist() == [BEGIN_NS + 500_000_000]
    assert telemetry.cells.tolist() == [[0.5, 0.25]]
    assert telemetry.read_as == read_as
    account = telemetry.account
    assert (account.lines, account.refused, account.repaired, account.fills) == (1, {}, {}, {})


def test_instants_are_exact_to_the_nanosecond(tmp_path):
    text = "time,c1,c2\n2023-11-14T22:13:20.000000001Z,1,1\n2023-11-14T22:13:20.123456789Z,1,1\n"
    assert (read(tmp_path, text).stamps_ns - BEGIN_NS).tolist() == [1, 123_456_789]


@pytest.mark.parametrize(
    ("unit", "count"), [("s", "1700000000"), ("ms", "1700000000000"), ("ns", "1700000000000000000")]
)
def test_unit_of_times(tmp_path, unit, count):
    assert read(tmp_path, f"time,c1,c2\n{count},1,1\n", time_unit=unit).stamps_ns.tolist() == [BEGIN_NS]


def test_commas_among_points_are_no_decimal_commas(tmp_path):
    account = read(tmp_path, "time;c1;c2\n1700000000;0.5;0.25\n1700000001;0,7;0.25\n").account
    ((kind, found),) = account.repaired.items()
    assert (kind, found) == ("no number", (1, 3, "column c1: '0,7' found, expected a number"))


def test_rates_in_dps(tmp_path):
    content = "time,c1,c2,gyro_x_dps,gyro_y_dps,gyro_z [dps]\n1700000000,1,1,1,-2,180\n"
    np.testing.assert_allclose(read(tmp_path, content).rate[0], np.radians([1, -2, 180]), rtol=1e-15)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        (
            "time,c1,c2,omega_x_rad_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s",
            "omega_x_rad_s and gyro_x_rad_s both are omega_x",
        ),
        ("time,c1,c2,sun_x,Sun_X,sun_y,sun_z", "the columns sun_x and Sun_X both are sun_x"),
        ("time,Time [s],c1,c2", "the columns time and Time [s] both are a time"),
        ("time,c1 [V],c1 [mV],c2 [V]", "the columns c1 [V] and c1 [mV] both are c1"),
        ("time,c1 [V],c2 [mV]", "c1 [V] and c2 [mV] have different units, expected one, or a full scale for each"),
        ("time [fortnights],c1,c2", "expected its unit as one of s, ms, us, ns"),
        ("1700000000,1,1", "the first line must name the columns"),
        ('"time,c1,c2', "a quotation mark is left open"),
    ],
)
def test_a_header_that_could_mean_two_things_is_refused(tmp_path, header, words):
    with pytest.raises(BagError) as refusal:
        read(tmp_path, header + "\n")
    assert words in str(refusal.value)


def test_a_line_for_each_cell_is_named(tmp_path):
    with pytest.raises(BagError, match="a line for each cell and time, expected a column for each cell"):
        read(tmp_path, "time,cell,value\n1700000000,c1,0.5\n1700000000,c2,0.25\n")


def test_columns_not_used_are_told_by_what_they_look_like(tmp_path):
    names = ["wx", "gyr_y", "omega3", "q_w", "quat0", "mag_x", "Bz", "sun_eci_x", "temperature", "watts"]
    content = f"time,c1,c2,{','.join(names)}\n1700000000,1,1{',0' * len(names)}\n"
    telemetry = read(tmp_path, content)
    assert telemetry.ignored_columns == tuple(names)
    rates, sun, attitude, field = likenesses(telemetry.ignored_columns)
    assert rates.startswith("wx, gyr_y, omega3 look like body rates") and "omega_x_deg_s" in rates
    assert sun.startswith("sun_eci_x looks like a Sun vector")
    assert attitude.startswith("q_w, quat0 look") and field.startswith("mag_x, Bz look")


def test_dark_level_and_full_scale_of_each_cell(tmp_path):
    first, second = LAYOUT.cells
    cells = (first._replace(dark_level=100.0, full_scale=3000.0), second._replace(dark_level=90.0, full_scale=2000.0))
    layout = LAYOUT._replace(cells=cells)
    telemetry = read(tmp_path, "time,c1,c2\n1700000000,2698,90\n", layout)
    assert telemetry.cells.tolist() == [[2598 / 3000, 0.0]] and telemetry.scaled
    telemetry = read(tmp_path, "time,c1,c2\n1700000000,1100,1090\n", layout, full_scale=1000.0)
    assert telemetry.cells.tolist() == [[1.0, 1.0]]


def test_fill_values_are_missing_and_counted(tmp_path):
    header = "time,c1,c2,omega_x_deg_s,omega_y_deg_s,omega_z_deg_s,sun_x,sun_y,sun_z\n"
    lines = [
        "1700000000,-9999,0.5,1,1,1,1,0,0",
        "1700000001,0.5,65535,1,-9999,1,1,0,0",
        "1700000002,0.5,0,1,1,1,0,0,-9999",
    ]
    telemetry = read(tmp_path, header + "\n".join(lines))
    nan = math.nan
    np.testing.assert_array_equal(telemetry.cells, [[nan, 0.5], [0.5, nan], [0.5, 0.0]])
    assert np.isfinite(telemetry.rate).all(axis=1).tolist() == [True, False, True]
    assert np.isfinite(telemetry.truth.sun_b).all(axis=1).tolist() == [True, True, False]
    assert {value: (c.times, c.first_line) for value, c in telemetry.account.fills.items()} == {
        -9999.0: (3, 2),
        65535.0: (1, 3),
    }


@pytest.mark.parametrize(
    ("readings", "fills"),
    [
        ([4095.0, 4094.0, 100.0], ()),  # saturated, not missing
        ([65535.0, 60000.0, 0.0], ()),
        ([65535.0, 4095.0, 0.0], (65535.0,)),
        ([-9999.0, 4095.0, 0.0], (-9999.0,)),
        ([-9999.0, -8000.0, 9000.0], ()),
        ([999.0, 0.2, -999.0, 999.0], (999.0, -999.0)),
        ([-1.0, 0.5], ()),
        ([math.nan], ()),
        ([-9999.0], (-9999.0,)),
    ],
)
def test_only_values_far_outside_are_fill_values(readings, fills):
    assert set(fill_values(np.array(readings))) == set(fills)


def seconds(*counts):
    return [count * 10**9 for count in counts]


@pytest.mark.parametrize(
    ("stamps", "kept"),
    [
        ([], []),
        (seconds(5), [0]),
        (seconds(1, 2, 2, 3), [0, 1, 3]),
        (seconds(5, 4, 6), [0, 2]),
        (seconds(*range(3600, 3620), *range(20, 120)), list(range(20, 120))),
        (seconds(*range(9), 2_000_000_000, *range(10, 20)), [*range(9), *range(10, 20)]),
        (seconds(*range(9), 2_000_000_000), list(range(9))),
        (seconds(0, *range(400_000_000, 400_000_009)), list(range(1, 10))),
        (seconds(0, 1, 31_000_000), [0, 1, 2]),
        # a step ahead is judged by what follows: a clock that was set goes on, a damaged time stands alone
        (seconds(*range(9), *range(900_000, 900_009)), list(range(18))),
        (seconds(*range(9), 900_000, 900_001, *range(10, 19)), [*range(9), *range(11, 20)]),
        (seconds(*range(9), 900_000), list(range(9))),
        (seconds(*range(9), 90_000), list(range(9))),
        (seconds(*range(9), 80_000), list(range(10))),  # a pause within the day
        (seconds(0, *range(900_000, 900_009)), list(range(1, 10))),
        (seconds(*range(0, 9_000_000, 1_000_000)), list(range(9))),  # the usual step
        # thirteen months, a line a day
        (seconds(*range(0, 34_200_000, 86_400)), list(range(396))),
    ],
)
def test_the_largest_set_of_times_that_fit_together(stamps, kept):
    assert consistent_lines(stamps).tolist() == kept


@pytest.mark.parametrize(
    ("stamps", "backward"),
    [
        (seconds(*range(120)), False),
        (seconds(*range(119, -1, -1)), True),
        (seconds(*range(300, 200, -1), *range(900, 800, -1)), True),  # a clock that was set
        (seconds(*range(3600, 3620), *range(20, 120)), False),
        (seconds(2, 1), False),  # one damaged time as well
        (seconds(5, 5, 5, 5, 5), False),
        (np.random.default_rng(2).permutation(120) * 10**9, False),
    ],
)
def test_a_table_that_goes_backward_is_told_from_one_in_no_order(stamps, backward):
    assert newest_first(stamps) == backward


@settings(max_examples=300, deadline=None)
@given(st.lists(st.integers(0, 30), max_size=12))
def test_no_larger_set_of_times_grows(stamps):
    kept = consistent_lines(stamps).tolist()
    values = [stamps[index] for index in kept]
    assert kept == sorted(kept) and values == sorted(set(values))
    longest = [1] * len(stamps)  # the textbook way, in quadratic time
    for end in range(len(stamps)):
        longest[end] += max((longest[k] for k in range(end) if stamps[k] < stamps[end]), default=0)
    assert len(kept) == max(longest, default=0)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(0, 4 * LONGEST_NS), max_size=12))
def test_no_set_of_times_covers_more_than_a_mission_may(stamps):
    values = [stamps[index] for index in consistent_lines(stamps)]
    assert not stamps or values
    assert max(values, default=0) - min(values, default=0) <= LONGEST_NS


LINES = ["{t},1,1", "{t},,1", "{t},x,1", "{t},1", "soon,1,1", "{t},-9999,1", '{t},"1,1', "0,1,1"]


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(LINES), st.integers(-3, 40)), max_size=25))
def test_every_line_is_used_or_refused(tmp_path_factory, lines):
    texts = [form.format(t=1_700_000_000 + second) for form, second in lines]
    try:
        telemetry = read(tmp_path_factory.mktemp("sum"), "\n\n".join(["time,c1,c2", *texts]))
    except BagError as error:
        assert "line" in str(error)
        return
    account = telemetry.account
    assert len(telemetry.stamps_ns) + account.refused_lines == account.lines == len(lines)
    for refused in (*account.refused.values(), *account.repaired.values()):
        assert 3 <= refused.first_line <= 2 * len(lines) + 1


def test_a_header_of_rubbish_makes_a_line_that_can_be_read(tmp_path):
    with pytest.raises(BagError) as told:
        read(tmp_path, b"\x44" * 5000 + b"\n1,2\n")
    assert "no column time; the header is DDD" in str(told.value) and len(str(told.value)) < 600
