# SPDX-License-Identifier: Apache-2.0
"""Values as C structs and back; limits of parameters; archives and names."""

import math
import shutil
import subprocess
from pathlib import Path
from struct import unpack_from
from typing import NamedTuple

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common.declared import built, computed, made, part, table_of
from css_common.declared import given as given_by
from css_common.mission import load_mission
from css_common.schema import ParameterError, checked_values, choice, flag, integer, real, shaped_values
from css_export.archive import archive
from css_export.c_main import state_hash
from css_export.comments import comments_of
from css_export.elf import contents
from css_export.errors import ExportError
from css_export.flown import PARAMETERS, flying_functions
from css_export.layout import FLAG, REAL, Struct, layout_of, leaves, pack, struct_of, unpack
from css_export.limits import FLAG as FLAG_LIMIT
from css_export.limits import REAL as REAL_LIMIT
from css_export.limits import SINGLE as SINGLE_LIMIT
from css_export.limits import WHOLE as WHOLE_LIMIT
from css_export.limits import limits_of
from css_export.machine_code import built as machine_code
from css_export.names import comment, identifier, quoted, snake
from css_export.targets import TARGETS, target_of

ROW = np.dtype([("at", np.float64), ("count", np.int64), ("seen", np.bool_)], align=True)


class Inner(NamedTuple):
    """A part."""

    on: bool  # whether it is
    vector: tuple[float, float, float]  # [m] somewhere


class Outer(NamedTuple):
    """A whole."""

    number: int
    inner: Inner
    nothing: None
    matrix: np.ndarray
    rows: np.ndarray
    none: np.ndarray


def outer(count, on, vector, numbers, seen):
    """A value of every kind that a kernel takes."""
    rows = np.zeros(2, ROW)
    rows["at"], rows["count"], rows["seen"] = numbers[:2], count, seen
    return Outer(count, Inner(on, vector), None, np.array(numbers).reshape(2, 3), rows, np.zeros(0))


EXAMPLE = outer(1, True, (1.0, 2.0, 3.0), [1.0] * 6, True)
LAYOUT = layout_of(numba.typeof(EXAMPLE), EXAMPLE, "outer", comments_of)
reals = st.floats(allow_nan=False)


def same(a, b):
    """Equal, arrays and all."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b)
    if isinstance(a, tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return a == b


@given(
    st.integers(-(2**63), 2**63 - 1),
    st.booleans(),
    st.tuples(reals, reals, reals),
    st.lists(reals, min_size=6, max_size=6),
    st.booleans(),
)
def test_a_value_comes_back_from_its_bytes(count, on, vector, numbers, seen):
    value = outer(count, on, vector, numbers, seen)
    data = pack(LAYOUT, value)
    assert len(data) == LAYOUT.size
    assert same(unpack(LAYOUT, EXAMPLE, data), value)


def test_where_members_are():
    places = {name: at for name, _, at in leaves(LAYOUT)}
    assert places["number"] == 0
    assert places["inner.on"] == 8
    assert places["inner.vector[0]"] == 16
    assert places["matrix[1][2]"] == 40 + 5 * 8
    assert places["rows[1].seen"] == 88 + 24 + 16
    assert LAYOUT.size == 88 + 48
    assert "none" not in places


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_a_compiler_of_c_puts_members_there(tmp_path):
    source = tmp_path / "places.c"
    source.write_text(
        "#include <stddef.h>\n#include <stdint.h>\n"
        "struct inner { uint8_t on; double vector[3]; };\n"
        "struct row { double at; int64_t count; uint8_t seen; };\n"
        "struct outer { int64_t count; struct inner inner; double matrix[2][3]; struct row rows[2]; };\n"
        "int check[(offsetof(struct outer, rows[1].seen) == 128 && offsetof(struct outer, inner.vector) == 16"
        " && sizeof(struct outer) == 136) ? 1 : -1];\n"
    )
    subprocess.run(["gcc", "-c", "-o", str(tmp_path / "places.o"), str(source)], check=True)


def test_comments_are_those_of_the_source():
    assert comments_of(Inner)("vector") == "[m] somewhere"
    assert comments_of(Inner)("on") == "whether it is"
    assert comments_of(Outer)("number") == ""


def test_what_c_cannot_have_is_refused():
    text = "a text"
    with pytest.raises(ExportError, match=r"here: .*unicode"):
        layout_of(numba.typeof(text), text, "here", comments_of)
    backward = np.zeros((2, 3)).T
    with pytest.raises(ExportError, match="follow one another"):
        layout_of(numba.typeof(backward), backward, "here", comments_of)


# limits

GAIN = real("gain", 0.5, "-", "share", low=0.0, high=1.0, open_low=True)
SIGMA = real("sigma_deg", 1.0, "deg", "error", low=0.0, high=10.0)
COUNT = integer("count", 3, "-", "how many", low=1, high=9)
WAY = choice("way", "left", ("left", "right"), "where to")
USE = flag("use", True, "whether")
OTHER = real("other", 1.0, "-", "another", low=0.0, high=1.0)


class Part(NamedTuple):
    """A part."""

    sigma: float = made(math.radians, SIGMA)
    falling: float = made(lambda gain: 1.0 / gain, GAIN)


class Declared(NamedTuple):
    """Fields of every kind."""

    gain: float = given_by(GAIN)
    number: int = given_by(COUNT)
    way: int = made(("left", "right").index, WAY)
    use: bool = given_by(USE)
    of_two: float = computed(lambda values: values[GAIN] * values[OTHER], GAIN, OTHER)
    inner: Part = part(Part)


TABLE = table_of(Declared)
DEFAULT = built(Declared, shaped_values(TABLE, checked_values(TABLE, {})))
STRUCT = layout_of(numba.typeof(DEFAULT), DEFAULT, "declared", comments_of)
assert isinstance(STRUCT, Struct)
LIMITS = {limit.name: limit for limit in limits_of(STRUCT, DEFAULT)}


def keeps(name, value):
    """Whether a member of the struct is within its limits."""
    return LIMITS[name].low <= value <= LIMITS[name].high


@pytest.mark.parametrize(
    ("parameter", "name", "convert"),
    [(GAIN, "gain", float), (SIGMA, "inner.sigma", math.radians), (COUNT, "number", int)],
)
@given(st.data())
def test_limits_are_as_strict_as_the_nodes(parameter, name, convert, data):
    kind = st.integers(-3, 12) if parameter is COUNT else st.floats(-2.0, 12.0)
    value = data.draw(kind)
    try:
        parameter.check(value)
        accepted = True
    except ParameterError:
        accepted = False
    assert keeps(name, convert(value)) == accepted


def test_limits_of_what_is_converted():
    assert (LIMITS["way"].low, LIMITS["way"].high) == (0.0, 1.0)
    assert (LIMITS["use"].low, LIMITS["use"].high) == (0.0, 1.0)
    assert LIMITS["inner.falling"].low == 1.0
    assert LIMITS["inner.sigma"].unit == "rad"
    assert LIMITS["inner.falling"].unit == "made of gain"
    assert not LIMITS["of_two"].declared
    assert not keeps("of_two", math.inf)
    assert not keeps("of_two", math.nan)


RATE = real("rate_deg_s", 1.0, "deg/s", "how fast", low=0.0, high=10.0)


@pytest.mark.parametrize(
    ("source", "told"),
    [
        (given_by(RATE), "[deg/s] how fast"),
        (made(math.radians, RATE), "[rad/s] rate_deg_s [deg/s]: how fast"),
        (made(lambda rate: math.radians(rate) ** 2, RATE), "[(rad/s)^2] square of rate_deg_s [deg/s]: how fast"),
        (made(lambda gain: gain**2, GAIN), "[-] square of gain [-]: share"),
        (made(lambda gain: 1.0 / gain, GAIN), "made of gain [-]: share"),
        (made(math.cos, SIGMA), "made of sigma_deg [deg]: error"),
        (made(("left", "right").index, WAY), "made of way [-]: where to"),
    ],
)
def test_a_member_of_c_has_the_unit_that_it_has_and_not_its_parameters(source, told):
    class One(NamedTuple):
        one: float = source

    assert comments_of(One)("one") == told


class Twice(NamedTuple):
    """The same part made of parameters, and of something else."""

    own: Part = part(Part)
    other: Part = computed(lambda values: Part(-1.0, math.inf))
    table: np.ndarray = computed(lambda values: np.array([1.0, math.inf]))


def test_what_is_made_of_something_else_has_no_limits_of_a_parameter():
    values = shaped_values(table_of(Twice), checked_values(table_of(Twice), {}))
    p = built(Twice, values)
    layout = layout_of(numba.typeof(p), p, "twice", comments_of)
    assert isinstance(layout, Struct)
    found = {limit.name: limit for limit in limits_of(layout, p, values)}
    assert found["own.sigma"].declared
    assert found["own.falling"].declared
    assert (found["other.sigma"].declared, found["other.falling"].declared) == (False, False)
    assert kept(layout, p, found.values()) == []
    assert kept(layout, p._replace(other=Part(math.nan, 1.0)), found.values()) == ["other.sigma"]


def kept(layout, p, limits):
    """Names of the limits that a struct of parameters does not keep."""
    data, codes = pack(layout, p), {REAL_LIMIT: "d", FLAG_LIMIT: "?", WHOLE_LIMIT: "q", SINGLE_LIMIT: "f"}
    return [
        limit.name
        for limit in limits
        if not all(
            limit.low <= number <= limit.high
            for number in unpack_from(f"<{limit.count}{codes[limit.kind]}", data, limit.offset)
        )
    ]


@pytest.mark.parametrize("name", sorted(file.stem for file in (Path(__file__).parents[3] / "config").glob("*.yaml")))
def test_the_parameters_of_a_mission_keep_their_own_limits(name):
    """Else none can be changed in flight: whoever asks `check` is told of the one that nobody touched."""
    for function in flying_functions(load_mission(name)):
        p = function.sample[function.places(PARAMETERS)[0]]
        layout = layout_of(numba.typeof(p), p, "params", comments_of)
        assert isinstance(layout, Struct)
        assert kept(layout, p, limits_of(layout, p, function.values)) == [], function.name


# files

CODE = "define i32 @{0}() {{\n  %r = call i32 @elsewhere()\n  ret i32 %r\n}}\ndeclare i32 @elsewhere()\n"


@pytest.fixture(scope="module")
def objects():
    return {f"{name}.o": machine_code(name, [CODE.format(name)], [name], TARGETS["x86_64"]).object for name in "ab"}


def test_symbols_of_an_object(objects):
    found = contents(objects["a.o"])
    assert (found.offered, found.missing) == (["a"], ["elsewhere"])
    assert found.code > 0
    with pytest.raises(ValueError, match="ELF"):
        contents(b"something else")


@pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS)
def test_bytes_of_an_object_are_those_of_its_code_and_data(target):
    data = (
        "@kept = constant [5 x i32] [i32 1, i32 2, i32 3, i32 4, i32 5]\n@set = global i32 7\n@clear = global i64 0\n"
    )
    names = ["kept", "set", "clear"]
    found = contents(machine_code("data", [data], names, target).object)
    assert (found.code, found.constants, found.variables) == (0, 20, 12)
    assert sorted(found.offered) == sorted(names) and found.missing == []
    both = contents(machine_code("both", [data + CODE.format("a")], [*names, "a"], target).object)
    (function,) = (symbol for symbol in both.symbols if symbol.is_function and symbol.defined)
    assert function.name == "a" and both.code >= function.size > 0
    assert both.variables == found.variables and "elsewhere" in both.missing


@pytest.mark.skipif(shutil.which("nm") is None, reason="binutils are not installed")
def test_an_archive_is_read_by_binutils(objects, tmp_path):
    file = tmp_path / "lib.a"
    file.write_bytes(archive(objects))
    listed = subprocess.run(["ar", "t", str(file)], capture_output=True, text=True, check=True).stdout.split()
    assert listed == ["a.o", "b.o"]
    index = subprocess.run(["nm", "-s", str(file)], capture_output=True, text=True, check=True).stdout
    assert "a in a.o" in index
    assert "b in b.o" in index


def test_the_same_object_on_every_run(objects):
    assert machine_code("a", [CODE.format("a")], ["a"], TARGETS["x86_64"]).object == objects["a.o"]


def test_blocks_with_endless_names_are_not_taken_for_one_another():
    """LLVM cuts names off at 1024 characters when it reads them."""
    one, other = (1100 * "b" + end for end in "xy")
    text = (
        "declare void @left()\ndeclare void @right()\n"
        f"define void @f(i1 %c) {{\n  br i1 %c, label %{one}, label %{other}\n"
        f"{one}:\n  call void @left()\n  ret void\n{other}:\n  call void @right()\n  ret void\n}}\n"
    )
    found = contents(machine_code("f", [text], ["f"], TARGETS["x86_64"]).object)
    assert found.missing == ["left", "right"]


def test_a_string_that_ends_like_the_beginning_of_a_name_stays_what_it_is():
    """Check sums of what numba leaves of an exception hold any byte."""
    comment = 60 * "; and "
    text = (
        f'@kept = constant [2 x i8] c"\\01%"\n{comment}\n@other = constant [1 x i8] c"x"\n'
        "define void @f() {\n  ret void\n}\n"
    )
    object_ = machine_code("f", [text], ["f", "kept", "other"], TARGETS["x86_64"]).object
    assert b"\x01%x" in object_


def test_names():
    assert identifier("default") == "default_"
    assert identifier("2nd-cell") == "n2nd_cell"
    assert snake("HealthState") == "health_state"
    assert quoted('a "b" \\ c') == '"a \\"b\\" \\\\ c"'
    assert "*/" not in comment("ends */ here")


def test_targets_by_name_and_by_triple():
    assert target_of("aarch64") is TARGETS["aarch64"]
    assert target_of("powerpc-unknown-elf:750").processor == "750"
    with pytest.raises(ExportError, match="did you mean cortex-m7"):
        target_of("cortex-m8")


def test_a_processor_that_nobody_knows_is_refused():
    """LLVM makes code for another one, on aarch64 without floating point, and says so where nobody reads it."""
    with pytest.raises(ExportError, match="processor cortex-a35x is unknown"):
        machine_code("a", [CODE.format("a")], ["a"], target_of("aarch64-unknown-elf:cortex-a35x"))
    assert machine_code("a", [CODE.format("a")], ["a"], target_of("aarch64-unknown-elf:cortex-a35")).object


def test_the_hash_hangs_on_every_word():
    state = bytearray(range(64))
    first = state_hash(state)
    for at in range(64):
        state[at] ^= 1
        assert state_hash(state) != first
        state[at] ^= 1
    assert state_hash(b"") == 0
    assert state_hash(bytes(range(16))) != state_hash(bytes(range(8, 16)) + bytes(range(8)))


def test_a_struct_without_members_has_no_size():
    assert struct_of("empty", []) == Struct("empty", (), 0, 1)
    assert struct_of("two", [("a", FLAG), ("b", REAL)]).size == 16
