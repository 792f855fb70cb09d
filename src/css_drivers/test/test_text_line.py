# SPDX-License-Identifier: Apache-2.0
"""Lines of text: what is written is read, what is damaged is refused, and nothing else ever happens."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_drivers.text_line import (
    LONGEST,
    CellLine,
    LineBuffer,
    LineError,
    LineFormat,
    checksum,
    parse_line,
    usual_fields,
    write_line,
)

USUAL = LineFormat("$CSS", ",", "xor", usual_fields(3), 3)
PLAIN = LineFormat("", ";", "none", ("cell.1", "-", "cell.0"), 2)
volts = st.floats(-1e3, 1e3).map(lambda x: float(f"{x:.6g}")) | st.just(math.nan)


def same(a, b):
    return len(a) == len(b) and all(x == y or (x != x and y != y) for x, y in zip(a, b, strict=True))


@given(st.integers(0, 10**12), st.lists(volts, min_size=3, max_size=3))
def test_what_is_written_is_read(sequence, values):
    read = parse_line(USUAL, write_line(USUAL, sequence, values).rstrip())
    assert read.sequence == sequence
    assert same(read.values, values)


def test_checksum_is_that_of_nmea_0183():
    # the sentence that NMEA's own texts use
    form = LineFormat("$GPGLL", ",", "xor", ("cell.0", "-", "-", "-", "-", "-"), 1)
    read = parse_line(form, b"$GPGLL,5300.97914,N,00259.98174,E,125926,A*28")
    assert read.values == (5300.97914,)


def test_fields_may_stand_in_any_order():
    assert parse_line(PLAIN, b" 2.5 ;whatever; -.5e-1") == CellLine(None, (-0.05, 2.5))


def summed(body):
    """A line with its right checksum."""
    return f"${body}*{checksum(body.encode()):02x}".encode()


@pytest.mark.parametrize(
    ("form", "line", "kind"),
    [
        (USUAL, b"", "checksum"),
        (USUAL, b"$CSS,1,0.1,0.2,0.3", "checksum"),
        (USUAL, b"$CSS,1,0.1,0.2,0.3*ZZ", "checksum"),
        (USUAL, b"$CSS,1,0.1,0.2,0.3*00", "checksum"),
        (USUAL, summed("GPS,1,0.1,0.2,0.3"), "prefix"),
        (USUAL, b"\xff\xfe", "prefix"),
        (USUAL, summed("CSS,1,0.1,0.2"), "fields"),
        (USUAL, summed("CSS,1,0.1,0.2,0.3,0.4"), "fields"),
        (USUAL, summed("CSS,-1,0.1,0.2,0.3"), "number"),
        (USUAL, summed("CSS,1,0.1,0.2,volts"), "number"),
        (PLAIN, b"1;2", "fields"),
        (PLAIN, b"0x1;2;3", "number"),
        (PLAIN, b"1_0;2;3", "number"),
        (PLAIN, b"1e999;2;3", "number"),
    ],
)
def test_lines_that_are_none(form, line, kind):
    with pytest.raises(LineError) as caught:
        parse_line(form, line)
    assert caught.value.kind == kind


def test_word_for_nothing_costs_its_cell_alone():
    read = parse_line(PLAIN, b"n/a;0;0.25")
    assert same(read.values, (0.25, math.nan))


@given(st.binary(max_size=200), st.sampled_from([USUAL, PLAIN]))
def test_no_bytes_do_harm(line, form):
    try:
        read = parse_line(form, line)
    except LineError:
        return
    assert len(read.values) == form.cells
    assert not any(math.isinf(value) for value in read.values)


@given(st.lists(st.floats(-10, 10).map(lambda x: float(f"{x:.6g}")), min_size=3, max_size=3), st.data())
def test_no_flipped_bit_changes_a_value(values, data):
    line = bytearray(write_line(USUAL, 7, values).rstrip())
    at = data.draw(st.integers(0, 8 * len(line) - 1))
    line[at // 8] ^= 1 << at % 8
    try:
        read = parse_line(USUAL, bytes(line))
    except LineError:
        return
    assert read == parse_line(USUAL, write_line(USUAL, 7, values).rstrip())


@given(st.binary(max_size=300), st.lists(st.integers(1, 40)))
def test_lines_do_not_hang_on_how_bytes_come(data, cuts):
    whole, parts = LineBuffer(), LineBuffer()
    expected = whole.feed(data)[0]
    found, at = [], 0
    for cut in [*cuts, len(data)]:
        found += parts.feed(data[at : at + cut])[0]
        at += cut
    assert found == expected


def test_line_without_an_end_is_thrown_away_and_the_next_one_is_read():
    buffer = LineBuffer()
    for _ in range(5):
        lines, _ = buffer.feed(b"x" * LONGEST)
        assert lines == []
    assert buffer.feed(b"yy\ngood\n")[0] == [b"good"]


@pytest.mark.parametrize(
    ("form", "word"),
    [
        (USUAL._replace(fields=("sequence", "cell.0", "cell.1")), "each of the 3 cells once"),
        (USUAL._replace(fields=("cell.0", "cell.1", "cell.3")), "each of the 3 cells once"),
        (USUAL._replace(fields=("cell.0", "cell.1", "cell.2", "volts")), "expected sequence"),
        (USUAL._replace(separator="."), "line.separator"),
        (USUAL._replace(separator=""), "line.separator"),
        (USUAL._replace(fields=("sequence", "sequence", "cell.0", "cell.1", "cell.2")), "twice"),
    ],
)
def test_descriptions_that_are_none(form, word):
    assert word in "; ".join(form.wrong())
    assert list(USUAL.wrong()) == []
