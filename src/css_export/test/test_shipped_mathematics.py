# SPDX-License-Identifier: Apache-2.0
"""One mathematics for all processors: the same bits on each, close to the true values, and nothing else changed."""

import math
import re
import shutil
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from css_common.command import USAGE
from css_common.mission import mission_from_text
from css_export import mathematics, shipped_mathematics
from css_export.commands import export
from css_export.elf import contents
from css_export.flown import flying_functions
from css_export.library import MUSL, made_library, write_library
from css_export.machine_code import built
from css_export.programs import compiled_program, run_program, why_not
from css_export.recorded_calls import listen
from css_export.shipped_mathematics import EXACT, with_mathematics
from css_export.targets import TARGETS
from css_export.verbs.export import reference_of
from css_export.verification import judged, run_library
from css_recording.bag_reader import BagReader

ROOT = Path(__file__).parents[3]
REFERENCE = ROOT / "bags" / "reference"
STEPS = 200
HOST = TARGETS["x86_64"]
OF_ONE = ("acos", "asin", "atan", "cbrt", "cos", "erf", "exp", "exp2", "expm1", "log", "log1p", "sin", "tan")
OF_TWO = ("atan2", "fmod", "hypot", "pow")


def _is_here() -> bool:
    try:
        return metadata.version("ziglang") == shipped_mathematics.RELEASE
    except metadata.PackageNotFoundError:
        return False


shipped = pytest.mark.skipif(not _is_here(), reason=f"ziglang is not installed: {shipped_mathematics.INSTALL}")
with_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed: apt-get install gcc")
RUN_HERE = [
    pytest.param(target, marks=pytest.mark.skipif(why_not(target) is not None, reason=str(why_not(target))))
    for target in TARGETS.values()
    if target.runs
]


def test_the_release_is_the_one_that_is_locked():
    assert f"ziglang=={shipped_mathematics.RELEASE}" in (ROOT / "requirements-export.in").read_text()
    lock = (ROOT / "requirements-export.lock").read_text()
    assert re.search(rf"^ziglang=={re.escape(shipped_mathematics.RELEASE)} .*\n +--hash=sha256:", lock, re.MULTILINE)


@pytest.mark.parametrize("release", [None, "0.12.0"])
def test_another_release_is_refused_with_the_command_that_installs_it(release, monkeypatch, tmp_path, capsys):
    def version(name):
        if release is None:
            raise metadata.PackageNotFoundError(name)
        return release

    monkeypatch.setattr(shipped_mathematics.metadata, "version", version)
    shipped_mathematics._musl.cache_clear()
    arguments = ["esprit_2006", "--components", "triad", "--mathematics", "musl", "-o", str(tmp_path / "out")]
    assert export.main(arguments) == USAGE
    shipped_mathematics._musl.cache_clear()
    error = capsys.readouterr().err.splitlines()[-1]
    assert "requirements-export.lock" in error
    assert not (tmp_path / "out").exists()


def functions_text():
    """A module with a function that calls each of the C library's."""
    lines = []
    for name in (*OF_ONE, *OF_TWO):
        kinds = "double" if name in OF_ONE else "double, double"
        given = "double %x" if name in OF_ONE else "double %x, double %y"
        lines += [
            f"declare double @{name}({kinds})",
            f"define double @my_{name}({given}) nounwind {{",
            f"  %r = call double @{name}({given})",
            "  ret double %r",
            "}",
        ]
    lines += [
        "declare <2 x double> @llvm.sin.v2f64(<2 x double>)",
        "define double @my_second_sine(double %x, double %y) nounwind {",
        "  %a = insertelement <2 x double> poison, double %x, i32 0",
        "  %b = insertelement <2 x double> %a, double %y, i32 1",
        "  %r = call <2 x double> @llvm.sin.v2f64(<2 x double> %b)",
        "  %second = extractelement <2 x double> %r, i32 1",
        "  ret double %second",
        "}",
    ]
    return "\n".join([*lines, ""])


MINE = [f"my_{name}" for name in (*OF_ONE, *OF_TWO, "second_sine")]


def functions_object(target):
    """The object of these functions with shipped mathematics."""
    also: set[str] = set()
    while True:
        made = built("functions", with_mathematics([functions_text()], also), MINE, target).object
        more = set(contents(made).missing) & EXACT - also
        if not more:
            return made
        also |= more


def asked(target, folder):
    """What each function gives on a processor for the arguments that `mathematics` draws, and these as program text."""
    (folder / "shipped.o").write_bytes(functions_object(target))
    text = mathematics.program_text([*OF_ONE, *OF_TWO])
    for name in (*OF_ONE, *OF_TWO):
        text = text.replace(f" = {name}(", f" = my_{name}(")
    names = "".join(f"double my_{n}(double x{', double y' if n in OF_TWO else ''});\n" for n in (*OF_ONE, *OF_TWO))
    source = folder / "functions.c"
    source.write_text(text.replace("static uint64_t drawn;", f"{names}static uint64_t drawn;"))
    program = compiled_program(target, [source], [folder / "shipped.o"], folder / "functions")
    written = run_program(target, program, b"")
    return np.frombuffer(written, ">u8" if target.big_endian else "<u8").astype("<u8").tobytes()


def drawn():
    """The first argument of each call of a function, as the program draws it."""
    value, values = 1, []
    for _ in range(2 * mathematics.ARGUMENTS):
        value = (value * 6364136223846793005 + 1442695040888963407) % 2**64
        values.append(8.0 * ((value >> 11) / 2.0**53) - 4.0)
    return np.array(values[::2])


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """What the functions give on this machine."""
    return asked(HOST, tmp_path_factory.mktemp("here"))


@shipped
@with_compiler
@pytest.mark.parametrize("target", RUN_HERE, ids=lambda target: target.name)
def test_every_function_gives_the_same_bits_on_all_processors(target, here, tmp_path):
    assert len(here) == 8 * mathematics.ARGUMENTS * len((*OF_ONE, *OF_TWO))
    assert asked(target, tmp_path) == here


@shipped
@with_compiler
def test_they_are_within_an_ulp_of_the_c_library_here(here, tmp_path):
    source = tmp_path / "libc.c"
    source.write_text(mathematics.program_text([*OF_ONE, *OF_TWO]))
    theirs = run_program(HOST, compiled_program(HOST, [source], [], tmp_path / "libc"), b"")
    a, b = (np.frombuffer(data, np.float64).reshape(-1, mathematics.ARGUMENTS) for data in (here, theirs))
    assert np.array_equal(np.isnan(a), np.isnan(b))
    off = np.abs(a - b) / np.spacing(np.where(np.isnan(b), 1.0, np.abs(b)))
    # that of this C library is off by some ulps itself
    a_cbrt, x = a[OF_ONE.index("cbrt")], drawn()
    off[OF_ONE.index("cbrt")] = np.abs(a_cbrt - np.cbrt(x.astype(np.longdouble))) / np.spacing(np.abs(a_cbrt))
    worst = dict(zip((*OF_ONE, *OF_TWO), np.nanmax(off, axis=1).tolist(), strict=True))
    assert max(worst.values()) <= 1.0, worst
    assert worst["fmod"] == 0.0
    assert np.count_nonzero(off) > 0  # another implementation it is


@shipped
def test_nothing_of_mathematics_is_left_to_be_linked():
    for name in ("x86_64", "armv7", "cortex-m4", "leon3"):
        missing = contents(functions_object(TARGETS[name])).missing
        assert not [m for m in missing if hasattr(math, m) or m.rstrip("f") in EXACT], name
        assert not [m for m in missing if "unwind" in m], name


@shipped
def test_a_name_that_nobody_defines_is_said(monkeypatch):
    monkeypatch.setattr(shipped_mathematics, "available", lambda: frozenset(["nothing_at_all"]))
    text = "declare double @nothing_at_all(double)\n"
    with pytest.raises(shipped_mathematics.ExportError, match="nothing there defines nothing_at_all"):
        with_mathematics([text])


@pytest.fixture(scope="module")
def control(tmp_path_factory):
    """The control of the reference recording with shipped mathematics, and its calls with the library itself."""
    folder = tmp_path_factory.mktemp("control")
    with BagReader(REFERENCE) as reader:
        mission = mission_from_text(reader.mission_text or "", "reference")
        (function,) = flying_functions(mission, ["mrp_control"])
        library = made_library(mission, function, MUSL)
        calls = listen(reader, mission, library, STEPS, reference_of(library, folder / "reference"), big_endian=True)
    return library, folder, calls


@shipped
@with_compiler
@pytest.mark.parametrize("target", RUN_HERE, ids=lambda target: target.name)
def test_every_step_gives_the_same_bits_on_all_processors(target, control):
    library, folder, calls = control
    code = library.for_target(target)
    write_library(library, [code], folder)
    written, instructions = run_library(library, target, folder, calls)
    verdict = judged(library, calls, written, big_endian=target.big_endian)
    assert (verdict.steps, verdict.equal, verdict.largest) == (STEPS, STEPS, {})
    assert code.contents.variables == 0
    assert "musl" in library.version
    assert "MIT" in (folder / "COPYRIGHT.musl").read_text()
    if target.machine:
        assert instructions is not None and 500 < instructions < 1_000_000
    else:
        assert instructions is None
