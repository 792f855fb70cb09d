# SPDX-License-Identifier: Apache-2.0
"""Parameter specifications: what passes, what is refused, and what is said about it."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
    assert real("a.b.c", 0.0, "-", "") in values and real("e", 0.0, "-", "") in values
    assert all(real(name, 0.0, "-", "") not in values for name in ("a.b.e", "b", "a.b.c.d"))


def test_specifications_cannot_change():
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(GAIN, "low", -1.0)  # noqa: B010


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
