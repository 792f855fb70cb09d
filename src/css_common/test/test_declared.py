# SPDX-License-Identifier: Apache-2.0
"""NamedTuples that say which parameters they are built of, and what READMEs show of these."""

import math
from typing import NamedTuple

import pytest

from css_common.conversions import cosine_of_degrees, sine_of_degrees, square, square_of_degrees
from css_common.declared import builder, built, computed, given, made, merged, part, table_of
from css_common.readme_parameters import HEADER, documented, rewritten, row
from css_common.schema import choice, default_values, flag, integer, real, reals, text, texts

SIGMA = real("sigma", 0.5, "-", "error, 1 sigma", low=0.0, open_low=True, high=2.0, tunable=True)
SIZE = integer("size", 3, "-", "how many", low=1)


class Inner(NamedTuple):
    wide: bool = made(lambda word: word == "wide", choice("inner.kind", "wide", ("wide", "narrow"), "which"))
    sigma: float = given(SIGMA)


class Outer(NamedTuple):
    variance: float = made(square, SIGMA)
    inner: Inner = part(Inner)
    area: float = made(lambda sigma, size: sigma * size, SIGMA, SIZE)
    total: float = computed(lambda values: values[SIZE] + values.inner.offset, SIZE)
    limit: float = made(math.radians, real("limit_deg", 90.0, "deg", "bound"))


def test_the_table_has_every_parameter_once_in_the_order_of_the_fields():
    assert [p.name for p in table_of(Outer)] == ["sigma", "inner.kind", "size", "limit_deg"]
    assert table_of(Outer)[0] is SIGMA


def test_another_default_changes_the_table_alone():
    narrow = table_of(Outer, inner__kind="narrow")
    assert [p.default for p in narrow] == [0.5, "narrow", 3, 90.0]
    assert table_of(Outer)[1].default == "wide"


def test_fields_are_built_of_values():
    table = merged(table_of(Outer), (integer("inner.offset", 4, "-", "more"), SIGMA))
    assert [p.name for p in table].count("sigma") == 1
    values = default_values(table, sigma=1.5, inner__kind="narrow", limit_deg=180.0)
    outer = built(Outer, values)
    assert outer == (2.25, (False, 1.5), 4.5, 7, math.pi)
    assert type(outer) is Outer and type(outer.inner) is Inner
    assert builder(Inner)(values) == outer.inner


def test_conversions():
    assert square(3.0) == 9.0
    assert square_of_degrees(180.0) == pytest.approx(math.pi**2)
    assert sine_of_degrees(30.0) == pytest.approx(0.5) and cosine_of_degrees(60.0) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("parameter", "line"),
    [
        (SIGMA, "| `sigma` * | 0.5 | - | > 0 .. 2 | error, 1 sigma |"),
        (SIZE, "| `size` | 3 | - | >= 1 | how many |"),
        (real("most", 1e6, "m", "a|b", high=2e6), r"| `most` | 1e+06 | m | <= 2e+06 | a\|b |"),
        (flag("on", False, "whether"), "| `on` | false | - |  | whether |"),
        (choice("k", "a", ("a", "b"), "which"), "| `k` | a | - | a, b | which |"),
        (reals("r", (0.0, 1.5), "T", "field"), "| `r` | [0, 1.5] | T |  | field |"),
        (text("t", "", "name"), "| `t` | (empty) | - |  | name |"),
        (texts("ts", (), "names"), "| `ts` | [] | - |  | names |"),
    ],
)
def test_rows_of_a_readme(parameter, line):
    assert row(parameter) == line


def test_tables_are_written_below_the_headings_of_nodes_and_nowhere_else():
    other = "### other\n\n| a | b |\n|---|---|\n| 1 | 2 |\n"
    head = "\n".join(HEADER) + "\n"
    before = f"# A package\n\n### wavg\n\nA sentence.\n\n{head}| `old` | 1 | - | | gone |\n\nAfter.\n\n{other}"
    after = rewritten(before, "css_estimation")
    assert documented(before) == ["wavg"]
    assert after.startswith(f"# A package\n\n### wavg\n\nA sentence.\n\n{head}| `cell_sigma` * | 0.1 |")
    last = "the longest darkness that is an eclipse |\n\nAfter.\n\n"
    assert after.endswith(f"{last}{other}") and "gone" not in after
    assert rewritten(after, "css_estimation") == after
