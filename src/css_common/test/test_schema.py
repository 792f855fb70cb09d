# SPDX-License-Identifier: Apache-2.0
"""Parameter specifications: what passes, what is refused, and what is said about it."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common import sections
from css_common.schema import (
    ParameterError,
    Values,
    checked_values,
    choice,
    default_values,
    flag,
    integer,
    integers,
    missing,
    nested,
    real,
    reals,
    shaped_values,
    text,
    texts,
    unknown_name,
)

GAIN = real("law.gain", 1.0, "1/s", "a gain", low=0.0, high=10.0)
WIDTH = real("width_deg", 30.0, "deg", "a width", low=0.0, open_low=True)
COUNT = integer("count", 4, "-", "a count", low=1, high=100)
FREE = integer("free", 0, "-", "any whole number")
ON = flag("on", True, "a switch")
KIND = choice("kind", "a", ("a", "b"), "a kind")
NOTE = text("note", "", "a note")
AXIS = reals("axis", (0.0, 0.0, 1.0), "-", "an axis", length=3, low=-1.0, high=1.0)
ROWS = reals("rows", (1.0, 2.0, 3.0), "-", "some rows", columns=3)
STEPS = integers("steps", (1, 2), "-", "some steps", low=0)
NAMES = texts("names", (), "some names")
TABLE = (GAIN, WIDTH, COUNT, FREE, ON, KIND, NOTE, AXIS, ROWS, STEPS, NAMES)


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        (GAIN, 0.0), (GAIN, 10.0), (GAIN, np.float64(3.0)), (WIDTH, 5e-324), (COUNT, 1), (COUNT, np.int64(100)),
        (FREE, 2**63 - 1), (FREE, -(2**63)), (ON, False), (KIND, "b"), (NOTE, ""), (NOTE, "1.0"),
        (AXIS, [0.0, 1.0, 0.0]), (AXIS, np.zeros(3)), (AXIS, (0.0, 0.0, -1.0)), (ROWS, []), (ROWS, [0.0] * 6),
        (STEPS, []), (STEPS, [3]), (NAMES, []), (NAMES, ["a", "b"]),
    ],
)  # fmt: skip
def test_right_values_pass(parameter, value):
    assert np.array_equal(parameter.check(value), value)


WRONG = [
    (GAIN, 1, "a number written with a point [1/s], at least 0 and at most 10"),
    (GAIN, True, "a number written with a point"),
    (GAIN, "1.0", "a number written with a point"),
    (GAIN, None, "a number written with a point"),
    (GAIN, -1e-9, "expected at least 0 and at most 10 [1/s]"),
    (GAIN, math.nextafter(10.0, 11.0), "at most 10"),
    (GAIN, math.nan, "a finite number"),
    (GAIN, math.inf, "a finite number"),
    (GAIN, [1.0], "a number"),
    (WIDTH, 0.0, "above 0"),
    (COUNT, 0, "expected at least 1 and at most 100"),
    (COUNT, 1.0, "a whole number"),
    (COUNT, True, "a whole number"),
    (FREE, 2**63, "a whole number"),
    (FREE, 10**400, "a whole number"),
    (ON, 1, "true or false"),
    (ON, "true", "true or false"),
    (KIND, "c", "one of a, b"),
    (KIND, True, "one of a, b"),
    (NOTE, 3, "a text"),
    (NOTE, "a\nb", "one line without control characters"),
    (NOTE, "\udcff", "one line without control characters"),
    (AXIS, [0.0, 0.0], "3 values"),
    (AXIS, [0.0, 0.0, 1], "a list of numbers written with points"),
    (AXIS, [0.0, 0.0, 1.5], "at most 1"),
    (AXIS, "0.0, 0.0, 1.0", "a list of numbers"),
    (AXIS, 1.0, "a list of numbers"),
    (AXIS, {"x": 1.0}, "a list of numbers"),
    (AXIS, [0.0, 0.0, math.nan], "a finite number"),
    (AXIS, [[0.0], [0.0], [1.0]], "a list of numbers"),
    (ROWS, [1.0, 2.0], "rows of 3 values"),
    (STEPS, [1.0], "a list of whole numbers"),
    (STEPS, [-1], "expected each at least 0"),
    (NAMES, "a", "a list of texts"),
    (NAMES, [1], "a list of texts"),
]


@pytest.mark.parametrize(("parameter", "value", "expected"), WRONG)
def test_wrong_values_are_named_shown_and_put_right(parameter, value, expected):
    with pytest.raises(ParameterError) as caught:
        parameter.check(value)
    message = str(caught.value)
    assert message.startswith(f"{parameter.name}: ")
    assert expected in message
    assert " given, expected " in message
    assert "\n" not in message


def test_long_values_are_shown_shortened():
    with pytest.raises(ParameterError) as caught:
        AXIS.check([0.123456789] * 1000)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    ("parameter", "given_text", "value"),
    [
        (GAIN, "1", 1.0), (GAIN, " 2.5e-1 ", 0.25), (COUNT, "7", 7), (ON, "false", False), (ON, "On", True),
        (KIND, "b", "b"), (NOTE, "hello, you", "hello, you"), (AXIS, "0,0,1", [0.0, 0.0, 1.0]),
        (AXIS, "[0.0, 1e-3, 1]", [0.0, 0.001, 1.0]), (ROWS, "[]", []), (ROWS, "", []), (STEPS, "[1,2]", [1, 2]),
        (NAMES, "a, b", ["a", "b"]), (NAMES, "['a', \"b\"]", ["a", "b"]),
    ],
)  # fmt: skip
def test_command_line_texts(parameter, given_text, value):
    assert parameter.parse(given_text) == value


@pytest.mark.parametrize(
    ("parameter", "given_text"),
    [
        (GAIN, ""), (GAIN, "much"), (GAIN, "nan"), (GAIN, "1e400"), (GAIN, "11"), (COUNT, "1.5"), (COUNT, "1e1"),
        (FREE, "9" * 30), (ON, "1"), (ON, "ja"), (KIND, "c"), (AXIS, "0,0"), (AXIS, "0,0,x"), (ROWS, "1,2"),
        (STEPS, "1,,2"),
    ],
)  # fmt: skip
def test_command_line_texts_that_mean_nothing(parameter, given_text):
    with pytest.raises(ParameterError, match=rf"^{parameter.name}: .* given, expected "):
        parameter.parse(given_text)


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.binary(max_size=5) | st.dates(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.parametrize("parameter", TABLE, ids=lambda p: p.name)
@given(value=anything, words=st.text(max_size=20))
def test_whatever_is_given_is_checked_or_refused_and_never_anything_else(parameter, value, words):
    for attempt in (lambda: parameter.check(value), lambda: parameter.parse(words)):
        try:
            checked = attempt()
        except ParameterError as error:
            assert "\n" not in str(error)
        else:
            assert np.array_equal(parameter.check(checked), checked)
            parameter.shaped(checked)


def test_unknown_names_are_refused_with_the_nearest_one():
    with pytest.raises(ParameterError, match=r"^law\.gian: unknown; did you mean law\.gain\?$"):
        checked_values(TABLE, {"law.gian": 1.0})
    assert unknown_name("xyzzy", ["gain"]) == "xyzzy: unknown"
    assert "\n" not in unknown_name("a\nb", ["gain"])


def test_algorithms_see_arrays():
    values = default_values(TABLE, rows=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], law__gain=2.0)
    assert values.law.gain == 2.0
    assert values.rows.shape == (2, 3)
    assert values.rows.dtype == values.axis.dtype == np.float64
    assert values.steps.dtype == np.int64
    assert default_values(TABLE, rows=[]).rows.shape == (0, 3)
    assert dict(values.items()).keys() == {p.name for p in TABLE}


def test_defaults_are_not_shared_between_values():
    first, second = default_values(TABLE), default_values(TABLE)
    first.axis[0] = 9.0
    first.names.append("x")
    assert second.axis[0] == default_values(TABLE).axis[0] == 0.0
    assert second.names == default_values(TABLE).names == []


def test_nested_values_are_plain_attributes():
    values = nested({"a.b.c": 1, "a.b.d": 2, "e": 3})
    assert (values.a.b.c, values.a.b.d, values.e) == (1, 2, 3)
    assert isinstance(values.a, Values)


@pytest.mark.parametrize("name", sections.SECTIONS)
def test_every_shared_default_passes_its_own_check(name):
    table = sections.SECTIONS[name]
    canonical = checked_values(table, {})
    for parameter in table:
        assert parameter.check(parameter.default) == canonical[parameter.name]
        assert parameter.description
        assert parameter.unit
        if parameter.kind == "real" and parameter.name.endswith("_deg"):
            assert parameter.unit == "deg"
    assert list(sections.conflicts(shaped_values(table, canonical))) == []


def test_shared_names_are_unique_and_stand_in_their_section():
    names = [p.name for table in sections.SECTIONS.values() for p in table]
    assert len(set(names)) == len(names)
    for section, table in sections.SECTIONS.items():
        assert all(p.name.startswith(f"{section}.") or p.name == "autostart" for p in table)


ORBIT = {"orbit__source": "elements", "orbit__altitude": 400e3}
CONFLICTS = [
    ("orbit", {"orbit__source": "elements"}, "orbit.altitude: missing, expected a number [m], at least 100000"),
    ("orbit", {**ORBIT, "orbit__altitude": 5e4}, "orbit.altitude: 50000 given, expected a number [m], at least 100000"),
    ("mission", {"mission__epoch": "tomorrow"}, "mission.epoch: 'tomorrow' is not a UTC instant"),
    ("mission", {"mission__epoch": "1969-12-31T00:00:00Z"}, "mission.epoch: "),
    ("mission", {"mission__epoch": "2038-01-19T03:00:00Z"}, "mission.epoch: "),
    ("orbit", {"orbit__source": "tle"}, "orbit.tle_line1: expected the 69 characters"),
    (
        "orbit",
        {**ORBIT, "orbit__eccentricity": 0.5},
        "0.5 given, which with orbit.altitude 400000 m puts",
    ),
    ("orbit", {**ORBIT, "orbit__eccentricity": 0.05}, "at 61 km; expected at most 0.0442, a perigee of 100 km"),
    ("spacecraft", {"spacecraft__inertia": [1.0, 0.1, 0, 0, 1, 0, 0, 0, 1]}, "spacecraft.inertia: not symmetric"),
    ("spacecraft", {"spacecraft__inertia": [1.0, 0, 0, 0, -1, 0, 0, 0, 1]}, "spacecraft.inertia: eigenvalue -1 given"),
    ("spacecraft", {"spacecraft__inertia": [1.0, 0, 0, 0, 1, 0, 0, 0, 3]}, "break the triangle inequality"),
    ("spacecraft", {"spacecraft__array_normal": [0, 0, 0.5]}, "spacecraft.array_normal: length 0.5 given"),
    ("cells", {"cells__normals": [1, 0, 0] * 33}, "cells.normals: 33 rows given, expected 1 to 32"),
    ("cells", {"cells__normals": [1, 0, 0, 0, 2, 0]}, "cells.normals: row 1 has length 2"),
    ("cells", {"cells__clip_normal": [0, 0, 0.1]}, "cells.clip_normal: length 0.1 given"),
    ("wheels", {"wheels__axes": [1, 0, 0, 0, 1, 0]}, "wheels.axes: 2 rows given, expected 3 to 32"),
    ("wheels", {"wheels__axes": [1, 0, 0, 0, 1, 0, 0, -1, 0]}, "wheels.axes: they span 2 of 3 directions"),
    ("rods", {"rods__axes": [1, 1, 0]}, "rods.axes: row 0 has length 1.41421"),
    ("io", {"io__body_frame": "b" * 256}, "io.body_frame: "),
    ("io", {"io__inertial_frame": "ä" * 128}, "io.inertial_frame: "),
]


@pytest.mark.parametrize(("section", "changes", "expected"), CONFLICTS)
def test_values_that_conflict_are_named(section, changes, expected):
    changes = {k: [float(x) for x in v] if isinstance(v, list) else v for k, v in changes.items()}
    found = list(sections.conflicts(default_values(sections.SECTIONS[section], **changes)))
    assert any(expected in line for line in found), found
    assert all("\n" not in line for line in found)


def test_inertia_of_a_flat_plate_passes():
    plate = [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0]
    assert not list(sections.conflicts(default_values(sections.SPACECRAFT, spacecraft__inertia=plate)))


def test_specifications_cannot_change():
    with pytest.raises(dataclasses.FrozenInstanceError):
        GAIN.low = -1.0


def test_a_spacecraft_without_wheels_has_no_axes():
    axes = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    fitted, bare = (default_values(sections.WHEELS, wheels__fitted=word, wheels__axes=axes) for word in (True, False))
    assert sections.wheel_axes(fitted).shape == (3, 3)
    assert sections.wheel_axes(bare).shape == (0, 3)


def test_what_has_no_default_is_missing_until_it_is_given():
    table = (reals("rows", (), "-", "rows", columns=2, length=4, example="rows: [1.0, 0.0, 0.0, 1.0]"), GAIN)
    assert default_values(table).rows.shape == (0, 2)
    (line,) = missing(table, default_values(table), ["rows"])
    assert line.startswith(
        "rows: missing, expected a list of numbers written with points, 4 values, for instance rows: ["
    )
    assert list(missing(table, default_values(table, rows=[1.0, 2.0, 3.0, 4.0]), ["rows"])) == []
    with pytest.raises(ParameterError, match="4 values, not 2"):
        default_values(table, rows=[1.0, 2.0])
