# SPDX-License-Identifier: Apache-2.0
"""Exported libraries give the bits of the kernels that flew; what must not fly is refused."""

import re
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import pytest

from css_common.kernel import kernel
from css_common.mission import load_mission, mission_from_text
from css_export import mathematics
from css_export.c_main import STEP, word
from css_export.counted_operations import counted
from css_export.elf import Contents, contents
from css_export.errors import ExportError
from css_export.flown import INPUT, PARAMETERS, STATE, Function, flying_functions
from css_export.layout import leaves, other_order, pack
from css_export.library import MachineCode, made_library, write_library
from css_export.machine_code import built
from css_export.operations import OPERATIONS, Bound
from css_export.programs import compiled_object, compiled_program, run_program, shared_library, why_not
from css_export.recorded_calls import Calls, listen
from css_export.report import Row
from css_export.speed import time_ratio
from css_export.targets import TARGETS, target_of
from css_export.verification import Verdict, judged, relative_difference, run_library
from css_recording.bag_reader import BagReader

REFERENCE = Path(__file__).parents[3] / "bags" / "reference"
STEPS = 300
HOST = TARGETS["x86_64"]
with_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
with_cplusplus = pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
OTHERS = [
    pytest.param(target, marks=pytest.mark.skipif(why_not(target) is not None, reason=str(why_not(target))))
    for target in TARGETS.values()
    if target.emulator and not target.machine and not target.big_endian
]


@pytest.fixture(scope="module")
def mission():
    """That of the reference recording, its estimator without the health of its sensors, which takes long to compile."""
    with BagReader(REFERENCE) as reader:
        return mission_from_text(reader.mission_text or "", "reference", ["ekf.health.enabled=false"])


@pytest.fixture(scope="module", params=["ekf", "mrp_control"])
def exported(request, mission, tmp_path_factory):
    """A library, its folder and the calls of the flight."""
    folder = tmp_path_factory.mktemp(request.param)
    (function,) = flying_functions(mission, [request.param])
    library = made_library(mission, function)
    write_library(library, [library.for_target(HOST)], folder)
    with BagReader(REFERENCE) as reader:
        return library, folder, listen(reader, mission, library, STEPS)


@with_compiler
def test_every_step_of_a_flight_gives_the_same_bits(exported):
    library, folder, calls = exported
    assert calls.steps == STEPS
    assert calls.messages >= STEPS
    verdict = judged(library, calls, run_library(library, HOST, folder, calls)[0])
    assert (verdict.steps, verdict.equal, verdict.largest) == (STEPS, STEPS, {})


def test_the_calls_are_those_of_the_flight(exported):
    _, _, calls = exported
    assert calls.as_recorded == calls.messages


@with_compiler
def test_other_parameters_give_other_bits(exported):
    library, folder, calls = exported
    p = library.function.sample[library.function.places(PARAMETERS)[0]]
    struct_ = library.interface.structs[PARAMETERS]
    part, name = ("sunline", "cell_variance") if hasattr(p, "sunline") else ("pointing", "k")
    numbers = getattr(p, part)
    changed = p._replace(**{part: numbers._replace(**{name: getattr(numbers, name) * (1.0 + 1e-12)})})
    stream = word(3) + bytes(pack(struct_, changed)) + bytes(calls.stream)
    program = compiled_program(
        HOST,
        [folder / f"{library.prefix}_main.c"],
        [folder / HOST.name / f"lib{library.prefix}.a"],
        folder / "changed",
    )
    verdict = judged(library, calls, run_program(HOST, program, stream))
    assert verdict.steps == STEPS
    assert verdict.equal < STEPS
    assert verdict.largest_relative_difference > 0.0


def test_no_code_is_made_for_as_many_numbers_at_once_as_this_machine_takes(exported):
    library, _, _ = exported
    assert not re.search(r"<\d+ x (double|i64|i1)>|@llvm\.masked", library.texts[0])


def test_no_step_of_a_flight_makes_more_operations_than_it_can(exported, capfd):
    library, _, calls = exported
    code = library.for_target(HOST)
    assert code.bound.operations is not None, code.bound.reason
    made = list(counted(library, code.text, calls))
    assert len(made) == STEPS
    for cost in made:
        assert 0 < cost.pop(OPERATIONS) <= code.bound.operations
        assert all(count <= code.bound.calls[name] for name, count in cost.items())
    assert capfd.readouterr().err == "", "LLVM says how much stack its code takes to whoever compiles it so"


@with_compiler
def test_header_and_main_are_without_warnings_in_c(exported, tmp_path):
    library, folder, _ = exported
    compiled_object(HOST, folder / f"{library.prefix}_main.c", tmp_path / "main.o")


@with_cplusplus
def test_header_and_main_are_without_warnings_in_cplusplus(exported, tmp_path):
    library, folder, _ = exported
    compiled_object(HOST, folder / f"{library.prefix}_main.c", tmp_path / "main.o", cplusplus=True)


@pytest.mark.parametrize("target", OTHERS, ids=lambda target: target.name)
def test_other_processors_give_the_same_bits(exported, target):
    """But for the last ones of functions that the C library rounds otherwise there, which are found and named."""
    library, folder, calls = exported
    code = library.for_target(target)
    write_library(library, [code], folder)
    verdict = judged(library, calls, run_library(library, target, folder, calls)[0])
    row = Row(library, code, verdict)
    assert verdict.steps == STEPS
    if verdict.equal < STEPS:
        row.differing = mathematics.differing_functions(code.contents.missing, target, folder)
    assert row.is_right


def test_numbers_in_the_other_order_of_bytes_are_the_same_numbers(exported):
    library, _, calls = exported
    for role in (PARAMETERS, STATE, INPUT):
        struct_ = library.interface.structs[role]
        data = bytes(range(256)) * (struct_.size // 256 + 1)
        data = data[: struct_.size]
        turned = other_order(struct_, data)
        assert other_order(struct_, turned) == data
        for _, scalar, at in leaves(struct_):
            assert turned[at : at + scalar.size] == data[at : at + scalar.size][::-1]
    assert calls.hashes_of_big_endian == []


@pytest.mark.parametrize(
    "cplusplus", [pytest.param(False, marks=with_compiler), pytest.param(True, marks=with_cplusplus)]
)
def test_examples_in_the_documentation_compile_without_warnings(exported, cplusplus, tmp_path):
    library, folder, _ = exported
    page = (Path(__file__).parents[3] / "docs" / "export.md").read_text()
    examples = [text.partition("```")[0] for text in page.split("```c\n")[1:]]
    assert len(examples) == 2
    if library.function.component != "ekf":
        return
    for k, text in enumerate(examples):
        source = tmp_path / f"example{k}.c"
        source.write_text(text)
        header = folder / f"{library.prefix}.h"
        (tmp_path / header.name).write_bytes(header.read_bytes())
        compiled_object(HOST, source, tmp_path / "example.o", cplusplus=cplusplus)


@with_compiler
def test_the_time_of_a_step_is_measured(exported):
    library, folder, calls = exported
    packed = folder / HOST.name / f"lib{library.prefix}.a"
    file = shared_library(HOST, packed, packed.with_suffix(".so"))
    ratio = time_ratio(library, file, calls)
    assert ratio is not None and 0.0 < ratio < 100.0
    assert time_ratio(library, file, Calls()) is None


# Products fused with sums, other units of floating point, calls of an operating system. Arm's vmla is none of these: it
# rounds the product before it adds.
FORBIDDEN = {
    "x86_64": ("objdump", r"vfn?m(add|sub)|\bf(ld|st|add|mul)p?\b|\bsyscall\b|\bint\b|[xyz]mm.*[yz]mm"),
    "aarch64": ("aarch64-linux-gnu-objdump", r"\bfn?m(add|sub)\b|\bfml[as]\b|\bsvc\b"),
    "riscv64": ("riscv64-linux-gnu-objdump", r"\bfn?m(add|sub)\b|\becall\b"),
    "armv7": ("arm-linux-gnueabihf-objdump", r"\bvfn?m[as]\b|\bsvc\b"),
    "cortex-m7": ("arm-none-eabi-objdump", r"\bvfn?m[as]\b|\bsvc\b"),
    "cortex-m4": ("arm-none-eabi-objdump", r"\bv(add|sub|mul|div|ldr|str|mov|fma|mla|sqrt)\b|\bsvc\b"),
    "leon3": ("sparc64-linux-gnu-objdump", r"\bfn?m(add|sub)|\bta\b"),
}


@pytest.mark.parametrize("name", FORBIDDEN)
def test_no_instruction_that_rounds_otherwise_or_asks_an_operating_system(exported, name, tmp_path):
    tool, forbidden = FORBIDDEN[name]
    if shutil.which(tool) is None:
        pytest.skip(f"{tool} is not installed: apt-get install {TARGETS[name].package}")
    library, _, _ = exported
    (tmp_path / "step.o").write_bytes(library.for_target(TARGETS[name]).object)
    shown = subprocess.run([tool, "-d", str(tmp_path / "step.o")], capture_output=True, text=True, check=True).stdout
    # without the names that addresses stand for, which are made of hashes and may read like anything
    instructions = [line.split("\t", 2)[-1].partition("<")[0] for line in shown.splitlines() if line.count("\t") >= 2]
    assert len(instructions) > 1000
    assert not [line for line in instructions if re.search(forbidden, line)]


def test_nothing_but_mathematics_and_memory_is_linked(exported):
    library, folder, _ = exported
    found = contents((folder / HOST.name / f"{library.prefix}.o").read_bytes())
    assert set(found.missing) <= {"atan2", "cos", "exp", "expm1", "memset", "sin", "sincos", "tan"}
    assert set(found.offered) == set(library.exported)
    assert found.variables == 0


@with_compiler
def test_what_the_initial_state_is_in_c(exported):
    library, folder, _ = exported
    struct_ = library.interface.structs[STATE]
    source = folder / "initial.c"
    source.write_text(
        f'#include "{library.prefix}.h"\n#include <stdio.h>\nint main(void)\n{{\n    static {library.prefix}_state s;\n'
        f"    {library.prefix}_init(&s);\n    return fwrite(&s, sizeof s, 1, stdout) == 1 ? 0 : 1;\n}}\n"
    )
    program = compiled_program(HOST, [source], [folder / HOST.name / f"lib{library.prefix}.a"], folder / "initial")
    function = library.function
    values = tuple(v for v, r in zip(function.sample, function.roles, strict=True) if r in (STATE, "memory"))
    assert run_program(HOST, program, b"") == bytes(pack(struct_, values))


# what must not fly


class Limits(NamedTuple):
    """Parameters."""

    most: float
    exponent: int


def function_of(compiled):
    """A kernel of one input as a function of a component."""
    sample = (Limits(1.0, 2), 2.0)
    return Function("refused", "refused", compiled, (PARAMETERS, INPUT), ("p", "x"), sample, False, "_step", "")


@kernel
def _raises(p: Limits, x: float) -> float:
    if x > p.most:
        raise ValueError("too large")
    return x


@kernel
def _power(p: Limits, x: float) -> float:
    return x**p.exponent


@kernel
def _prints(p: Limits, x: float) -> float:
    print(x)
    return p.most


@pytest.mark.parametrize(
    ("compiled", "named"), [(_raises, "ValueError"), (_power, "OverflowError in int_power"), (_prints, "Py")]
)
def test_what_must_not_fly_is_refused_by_name(compiled, named):
    library = made_library(load_mission("okeefe_2013"), function_of(compiled))
    with pytest.raises(ExportError, match=named):
        library.for_target(HOST)


@kernel
def _beyond(p: Limits, x: float) -> float:
    total = 0.0
    for i in range(int(x)):
        total += (p.most, x, 1.0)[i]
    return total


def test_an_exception_that_lost_its_name_is_named_nevertheless():
    library = made_library(load_mission("okeefe_2013"), function_of(_beyond))
    with pytest.raises(ExportError, match="IndexError"):
        library.for_target(HOST)


@pytest.mark.parametrize("name", ["sunline_ukf", "sunline_suekf"])
def test_an_unscented_filter_has_no_way_to_an_exception(name):
    nodes = f"[css_sim/dynamics, css_sim/css_array, css_sim/gyro, css_estimation/{name}, sunpoint_control/mrp_control]"
    changes = [f"graph.nodes={nodes}", f"graph.estimator={name}", f"{name}.health.enabled=false"]
    mission = load_mission("okeefe_2013", changes)
    (function,) = flying_functions(mission, [name])
    assert made_library(mission, function).for_target(HOST).contents.code > 1000


def test_allocation_is_refused_by_name():
    text = "declare ptr @malloc(i64)\ndefine ptr @f(i64 %n) {\n  %p = call ptr @malloc(i64 %n)\n  ret ptr %p\n}\n"
    with pytest.raises(ExportError, match="malloc"):
        built("f", [text], ["f"], HOST)


def test_a_processor_that_nobody_knows_is_refused():
    text = "define void @f() {\n  ret void\n}\n"
    with pytest.raises(ExportError, match="nothing-at-all"):
        built("f", [text], ["f"], HOST._replace(name="nothing-at-all", triple="nothing-at-all"))


def test_a_target_that_nobody_knows_is_refused_with_those_that_there_are():
    with pytest.raises(ExportError, match=r"--target z80: unknown; expected one of x86_64, .*, or TRIPLE or"):
        target_of("z80")


def test_relative_differences():
    assert relative_difference(1.0, 1.0 + 2.0**-52) == pytest.approx(2.0**-52)
    assert relative_difference(float("nan"), float("nan")) == 0.0
    assert relative_difference(float("nan"), 1.0) == float("inf")
    assert relative_difference(1.0, -1.0) == 2.0


@with_compiler
@pytest.mark.parametrize("stream", [word(9), word(STEP) + b"short"])
def test_a_stream_that_is_none_is_refused(exported, stream):
    from css_export.errors import ToolError

    library, folder, _ = exported
    program = compiled_program(
        HOST, [folder / f"{library.prefix}_main.c"], [folder / HOST.name / f"lib{library.prefix}.a"], folder / "main"
    )
    with pytest.raises(ToolError, match="cannot be read"):
        run_program(HOST, program, stream)


def test_a_missing_value_stays_missing(exported):
    library, _, _ = exported
    if library.function.component != "ekf":
        return
    sample = list(library.function.sample)
    sample[4] = np.full_like(sample[4], np.nan)
    packed = pack(library.interface.structs[INPUT], tuple(sample[3:]))
    (first,) = struct.unpack_from("<d", packed, 8)
    assert first != first


@with_compiler
def test_the_c_library_of_this_machine_is_like_itself(tmp_path):
    assert mathematics.differing_functions(["sincos", "atan2", "expm1", "memset"], HOST, tmp_path) == {}


@with_compiler
def test_another_mathematics_is_named(tmp_path, monkeypatch):
    """A C library whose sine ends in another bit for one argument in four."""
    runs: list[Any] = []

    def run(target, program, stream):
        values = np.frombuffer(run_program(target, program, stream), np.uint64).copy()
        if runs:
            values[mathematics.ARGUMENTS :: 4] ^= 1
        runs.append(target)
        return values.tobytes()

    monkeypatch.setattr(mathematics, "run_program", run)
    assert mathematics.differing_functions(["sin", "cos"], HOST, tmp_path) == {"sin": 0.25}


@pytest.mark.skipif(why_not(TARGETS["aarch64"]) is not None, reason=str(why_not(TARGETS["aarch64"])))
def test_erf_of_another_processor_is_named(tmp_path):
    """glibc makes it with fused products there, and without here."""
    assert "erf" in mathematics.differing_functions(["erf", "sincos"], TARGETS["aarch64"], tmp_path)


def test_a_function_that_nobody_compares_is_told_from_memory_and_runtime():
    assert mathematics.not_asked(["erf", "memset", "__aeabi_l2d", "sincos", "lgamma"]) == ["lgamma"]


@pytest.mark.parametrize(
    ("equal", "largest", "differing", "right"),
    [
        (10, {}, None, True),
        (9, {"sun_b[0]": 1e-15}, {"sin": 0.1}, True),
        (9, {"sun_b[0]": 1e-15}, {}, False),
        (9, {"sun_b[0]": 1e-9}, {"sin": 0.1}, False),
    ],
)
def test_a_difference_has_to_be_small_and_of_a_named_function(equal, largest, differing, right):
    code = MachineCode(HOST, b"", b"", Contents(0, 0, 0, ()), 0)
    row = Row(cast(Any, None), code, Verdict(10, equal, equal, largest), None, differing)
    assert row.is_right is right


@pytest.mark.parametrize(
    ("counted_of_steps", "right"),
    [({OPERATIONS: 7, "sin": 2}, True), ({OPERATIONS: 8, "sin": 2}, False), ({OPERATIONS: 7, "sin": 3}, False)],
)
def test_a_step_that_makes_more_than_it_can_is_no_proof(counted_of_steps, right):
    code = MachineCode(HOST, b"", b"", Contents(0, 0, 0, ()), 0, Bound(7, {"sin": 2}))
    row = Row(cast(Any, None), code, Verdict(10, 10, 10), counted=counted_of_steps)
    assert row.is_right is right
