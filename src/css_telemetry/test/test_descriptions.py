# SPDX-License-Identifier: Apache-2.0
"""What a description says is what is read: units, axes, scales of single cells, kinds of files."""

import math
import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from presence import present
from scipy.spatial.transform import Rotation

from css_common.mission import mission_from_text
from css_recording.errors import BagError
from css_telemetry.description import VectorForm
from css_telemetry.description_file import description_of, read_description
from css_telemetry.proposal import proposed
from css_telemetry.recording import mission_text
from css_telemetry.telemetry import read_telemetry

CELL = "cells: {c: [1, 0, 0]}\n"
BEGIN = 1_700_000_000


def read(tmp_path, header, *lines, text):
    path = tmp_path / "table.csv"
    path.write_text("\n".join([header, *lines]) + "\n")
    return read_telemetry(path, description_of(text))


@pytest.mark.parametrize(
    ("unit", "si"),
    [("rad/s", 1.0), ("deg/s", math.pi / 180), ("dps", math.pi / 180), ("mrad/s", 1e-3), ("rpm", math.pi / 30)],
)
def test_units_of_rates(tmp_path, unit, si):
    text = CELL + f"aiding: {{rate: {{columns: [p, q, r], unit: {unit}}}}}\n"
    telemetry = read(tmp_path, "time,c,p,q,r", f"{BEGIN},1,1,-2,3", text=text)
    np.testing.assert_allclose(present(telemetry.rate), [[si, -2 * si, 3 * si]], rtol=1e-15)


@pytest.mark.parametrize(
    ("unit", "si"), [("T", 1.0), ("mT", 1e-3), ("uT", 1e-6), ("nT", 1e-9), ("G", 1e-4), ("mG", 1e-7), ("gauss", 1e-4)]
)
def test_units_of_fields(tmp_path, unit, si):
    text = CELL + f"aiding: {{field: {{columns: [p, q, r], unit: {unit}}}}}\n"
    telemetry = read(tmp_path, "time,c,p,q,r", f"{BEGIN},1,0.1,-0.2,0.3", text=text)
    np.testing.assert_allclose(present(telemetry.field), [[0.1 * si, -0.2 * si, 0.3 * si]], rtol=1e-15)


def test_axes_name_what_each_column_measures_along(tmp_path):
    text = CELL + "aiding: {rate: {columns: [p, q, r], unit: rad/s, axes: [+y, -x, z]}}\n"
    telemetry = read(tmp_path, "time,c,p,q,r", f"{BEGIN},1,1,2,3", f"{BEGIN + 1},1,1,,3", text=text)
    np.testing.assert_array_equal(present(telemetry.rate), [[-2, 1, 3], [math.nan] * 3])
    # aiding is no truth
    assert telemetry.truth.omega_bn_b is None


def test_scales_of_single_cells(tmp_path):
    text = """\
cells:
  a: {normal: [1, 0, 0], column: raw_a, full_scale: 2000, dark_level: 100}
  b: {normal: [0, 1, 0], full_scale: 1000, temperature: {column: T, coefficient: -0.01, reference: 20}}
  c: {normal: [0, 0, 1], lookup: [[100, 0.0], [1100, 0.8], [1200, 1.0]]}
unit: counts
"""
    lines = (f"{BEGIN},2100,500,600,20", f"{BEGIN + 1},1100,500,1150,70", f"{BEGIN + 2},100,500,99,")
    telemetry = read(tmp_path, "time,raw_a,b,c,T", *lines, text=text)
    nan = math.nan
    expected = [[1.0, 0.5, 0.4], [0.5, 0.5 / 0.5, 0.9], [0.0, nan, nan]]
    np.testing.assert_allclose(telemetry.cells, expected, rtol=1e-14)
    assert telemetry.scaled and telemetry.read_as == ("cell outputs in counts",)
    assert [(kind, c.times, c.first_line) for kind, c in telemetry.account.repaired.items()] == [
        ("outside of the lookup table", 1, 4)
    ]
    assert telemetry.account.missing["cell outputs without a temperature"][:2] == (1, 4)


def test_fields_of_view_of_single_cells_reach_the_mission(tmp_path):
    text = "cells: {a: {normal: [1, 0, 0], field_of_view_deg: 90}, b: [0, 1, 0]}\nfield_of_view_deg: 140\n"
    telemetry = read(tmp_path, "time,a,b", f"{BEGIN},1,0.5", text=text)
    mission = mission_from_text(mission_text(telemetry, {}, "views", 1.0, 1.0), "views")
    assert mission.values.cells.fields_of_view_deg.tolist() == [90.0, 140.0]
    assert telemetry.description.views_known
    assert not description_of("cells: {a: {normal: [1, 0, 0], field_of_view_deg: 90}, b: [0, 1, 0]}\n").views_known


def test_stated_sentinels_are_those_and_no_others(tmp_path):
    text = CELL + "missing: [0.125]\n"
    telemetry = read(tmp_path, "time,c", f"{BEGIN},0.125", f"{BEGIN + 1},-9999", text=text)
    np.testing.assert_array_equal(telemetry.cells, [[math.nan], [-9999.0]])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["xyzw", "wxyz", "matrix"]), st.booleans())
def test_attitudes_in_every_form_are_one(tmp_path_factory, seed, order, inverted):
    """SciPy's rotation of q turns vectors by A(q)^T."""
    dcm = Rotation.random(random_state=seed).as_matrix()
    given = dcm.T if inverted else dcm
    x, y, z, w = Rotation.from_matrix(given.T).as_quat()
    values = {"xyzw": (x, y, z, w), "wxyz": (w, x, y, z), "matrix": tuple(given.ravel())}[order]
    names = [f"a{i}" for i in range(len(values))]
    direction = "body_to_inertial" if inverted else "inertial_to_body"
    text = CELL + f"truth: {{attitude: {{columns: [{', '.join(names)}], order: {order}, direction: {direction}}}}}\n"
    line = ",".join([str(BEGIN), "1", *(f"{value:.15g}" for value in values)])
    telemetry = read(tmp_path_factory.mktemp("q"), f"time,c,{','.join(names)}", line, text=text)
    (sigma,) = present(telemetry.truth.sigma_bn)
    back = Rotation.from_mrp(sigma).as_matrix().T
    np.testing.assert_allclose(back, dcm, atol=1e-9)


def test_what_is_no_rotation_is_left_out(tmp_path):
    text = CELL + "truth: {attitude: {columns: [x, y, z, w], order: xyzw, direction: inertial_to_body}}\n"
    lines = (f"{BEGIN},1,0,0,0,1", f"{BEGIN + 1},1,0,0,0,0", f"{BEGIN + 2},1,0,0,0,")
    telemetry = read(tmp_path, "time,c,x,y,z,w", *lines, text=text)
    assert np.isfinite(present(telemetry.truth.sigma_bn)).all(axis=1).tolist() == [True, False, False]
    assert telemetry.account.repaired["no rotation"][:2] == (1, 3)


def test_a_row_of_units(tmp_path):
    header = "time,c,gyro_x,gyro_y,gyro_z"
    telemetry = read(tmp_path, header, "s,V,deg/s,deg/s,deg/s", f"{BEGIN},1,1,2,3", text=CELL)
    np.testing.assert_allclose(present(telemetry.rate), np.radians([[1, 2, 3]]))
    assert telemetry.read_as == ("units in line 2", "cell outputs in V")
    assert telemetry.account.lines == 1


@pytest.mark.parametrize("kind", ["parquet", "xlsx", "csv"])
def test_kinds_of_files(tmp_path, kind):
    frame = pd.DataFrame(
        {
            "stamp": pd.to_datetime([BEGIN * 10**9 + k * 250_000_000 for k in range(4)]),
            "c": [0.5, math.nan, 0.25, 1.0],
            "note": ["a", None, "b", "c"],
        }
    )
    path = tmp_path / f"table.{kind}"
    if kind == "parquet":
        frame.to_parquet(path)
    elif kind == "xlsx":
        with pd.ExcelWriter(path) as book:
            pd.DataFrame({"x": [1]}).to_excel(book, sheet_name="cover", index=False)
            frame.to_excel(book, sheet_name="data", index=False)
    else:
        frame.to_csv(path, index=False)
    sheet = "table: {sheet: data}\n" if kind == "xlsx" else ""
    telemetry = read_telemetry(path, description_of(CELL + sheet + "time: {column: stamp}\n"))
    assert (telemetry.stamps_ns - BEGIN * 10**9).tolist() == [0, 250_000_000, 500_000_000, 750_000_000]
    np.testing.assert_array_equal(telemetry.cells[:, 0], [0.5, math.nan, 0.25, 1.0])
    assert telemetry.ignored_columns == ("note",)
    if kind == "xlsx":
        assert telemetry.read_as == ("Excel, sheet data",)
        found = read_telemetry(path, description_of(CELL + "time: {column: stamp}\n"))
        assert found.read_as == ("Excel, sheet data of cover, data",), "the one with the columns, said"
        with pytest.raises(BagError, match="no sheet moon, expected one of cover, data"):
            read_telemetry(path, description_of(CELL + "table: {sheet: moon}\n"))


@pytest.mark.parametrize("name", ["table.parquet", "table.xlsx"])
def test_rubbish_is_refused_in_one_line(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(bytes(range(256)))
    with pytest.raises(BagError, match="cannot be read as") as refusal:
        read_telemetry(path, description_of(CELL))
    assert "\n" not in str(refusal.value)


def test_long_form_with_repetitions(tmp_path):
    text = "cells: {a: [1, 0, 0], b: [0, 1, 0]}\ntable: {long: {name: what, value: v}}\n"
    lines = [f"{BEGIN},a,0.5", f"{BEGIN},b,0.25", f"{BEGIN},b,0.75", f"{BEGIN + 1},b,1", f"{BEGIN + 1},odd,7"]
    telemetry = read(tmp_path, "time,what,v", *lines, text=text)
    np.testing.assert_array_equal(telemetry.cells, [[0.5, 0.25], [math.nan, 1.0]])
    assert telemetry.account.refused["stands twice"][:2] == (1, 4)
    assert telemetry.ignored_columns == ("odd",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "aiding: {rate: {columns: [a, b], unit: rad/s}}",
            "aiding.rate.columns: ['a', 'b'] given, expected a list of 3",
        ),
        ("aiding: {rate: {columns: [a, b, c]}}", "aiding.rate.unit: missing, expected one of rad/s"),
        ("aiding: {rate: {columns: [a, b, c], unit: T}}", "aiding.rate.unit: 'T' given, expected one of rad/s"),
        ("aiding: {rate: {columns: [a, b, c], unit: rpm, axes: [x, x, z]}}", "expected x, y and z in some order"),
        (
            "aiding: {sun: 3}",
            "aiding: unknown key sun, expected eclipse, field, illumination, position, rate, temperatures, wheels",
        ),
        ("truth: {field: 3}", "truth: unknown key field"),
        ("truth: {attitude: {columns: [a, b, c, d], order: abcd}}", "truth.attitude.order: 'abcd' given"),
        (
            "truth: {attitude: {columns: [a, b, c, d], order: xyzw}}",
            "truth.attitude.direction: missing, expected one of",
        ),
        ("truth: {attitude: {columns: [a, b, c], order: matrix}}", "expected a list of 9"),
        ("truth: {sun_inertial: [1, 0, 0]}", "given without attitude"),
        ("truth: {eclipse: {column: a}, illumination: {column: b}}", "expected one of them"),
        ("aiding: {position: {frame: lunar, columns: [a, b, c], unit: km}}", "aiding.position.frame: 'lunar' given"),
        ("aiding: {position: {tle: [a, b]}}", "aiding.position.tle: line 1: 1 characters given, expected 69"),
        ("aiding: {wheels: {columns: [a], unit: rpm}}", "aiding.wheels.axes: missing, expected a list"),
        ("cells: {c: {normal: [1, 0, 0], lookup: [[1, 0], [1, 1]]}}", "whose readings grow"),
        ("cells: {c: {normal: [1, 0, 0], colour: red}}", "cell c: unknown key colour"),
        ("cells: {c: {normal: [1, 0, 0], field_of_view_deg: 200}}", "field_of_view_deg: 200 given, expected 1 to 180"),
        ("cells: {c: {full_scale: 3}}", "cell c.normal: missing, expected a unit vector"),
        ("table: {separator: x}", "table.separator: 'x' given"),
        ("table: {encoding: klingon}", "table.encoding: 'klingon' given, expected an encoding"),
        ("table: {units_row: perhaps}", "table.units_row: 'perhaps' given, expected true or false"),
        ("inertia: [1, 2]", "inertia: ['1', '2'] given, expected a list of 9"),
        ("unit: furlong", "unit: 'furlong' given, expected one of V, mV"),
        ("missing: 3", "missing: '3' given, expected a list"),
    ],
)
def test_wrong_descriptions_are_told_by_key_and_value(text, words):
    whole = text if text.startswith("cells") else CELL + text
    with pytest.raises(ValueError, match=re.escape(words)):
        description_of(whole + "\n")


def test_columns_that_are_not_there_are_named(tmp_path):
    text = CELL + "aiding: {rate: {columns: [p, q, r], unit: rad/s}}\n"
    with pytest.raises(BagError, match="line 1: no column q, which the description names; the header is time, c, p"):
        read(tmp_path, "time,c,p", f"{BEGIN},1,2", text=text)


def test_vectors_need_all_components():
    assert VectorForm(("a", "b", "c")).axes == ("+x", "+y", "+z")


@settings(max_examples=150, deadline=None)
@given(st.text(max_size=300) | st.text("celsaidngtruhm:{}[],. -?\n123", max_size=300))
def test_no_text_makes_the_reader_crash(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("garbage") / "description.yaml"
    path.write_text(CELL + text, encoding="utf-8", errors="replace")
    try:
        read_description(path)
    except BagError as error:
        assert str(error).startswith(f"{path}: ") and "\n" not in str(error)


@settings(max_examples=150, deadline=None)
@given(
    st.lists(
        st.sampled_from(["time", "css_px", "gps_time", "q0", "lat", "mag_x", "t", "date", "wx", "pd3", "+X"]),
        max_size=6,
    ),
    st.lists(
        st.lists(st.sampled_from(["1", "", "-9999", "1700000000", "2024-01-01", "x", "1e99"]), max_size=6), max_size=5
    ),
)
def test_no_table_makes_a_proposal_crash(tmp_path_factory, header, lines):
    path = tmp_path_factory.mktemp("garbage") / "table.csv"
    path.write_text("\n".join([",".join(header), *map(",".join, lines)]) + "\n")
    try:
        text = proposed(path)
    except BagError as error:
        assert str(error).startswith(f"{path}: ")
        return
    assert text.startswith("# Proposed for table.csv")
    if "[?" not in text:
        description_of(text)
