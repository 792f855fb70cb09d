# SPDX-License-Identifier: Apache-2.0
"""What every command says of itself and of what is wrong."""

import ctypes
import signal
import threading

import pytest

from css_common.command import FAILED, INTERRUPTED, USAGE, command_parser, guarded, number, positive, short_name


@pytest.fixture
def parser(monkeypatch):
    monkeypatch.setenv("SUNPOINT_VERB", "record:recorder")
    return command_parser("css_recording", "recorder", "Records.", ("", "--all"), {1: "the disk is full"})


def test_the_name_is_what_was_typed(parser, monkeypatch):
    assert parser.prog == "./sunpoint record"
    # a command that another verb starts inherits its word
    other = command_parser("css_recording", "player", "Plays.", ("bag",))
    assert other.prog == "ros2 run css_recording player"
    monkeypatch.delenv("SUNPOINT_VERB")
    assert command_parser("css_recording", "recorder", "", ()).prog == "ros2 run css_recording recorder"


@pytest.mark.parametrize(
    ("prog", "name"),
    [
        ("./sunpoint record", "record"),
        ("./sunpoint bench graph", "bench graph"),
        ("ros2 run css_recording recorder", "recorder"),
        ("ros2 run css_bringup bench graph", "bench graph"),
        ("tool", "tool"),
    ],
)
def test_errors_begin_with_the_short_name(prog, name):
    assert short_name(prog) == name


def test_help_has_examples_and_exit_codes(parser):
    told = parser.format_help()
    assert "examples:\n  ./sunpoint record\n  ./sunpoint record --all\n" in told
    assert "exit codes:\n    0  done\n    1  the disk is full\n    2  something asked for is wrong\n  130  int" in told


def test_a_wrong_option_is_one_line_that_names_the_help(parser, capsys):
    with pytest.raises(SystemExit) as caught:
        parser.parse_args(["--nonsense"])
    assert caught.value.code == USAGE
    assert capsys.readouterr().err == (
        "record: error: unrecognized arguments: --nonsense; see ./sunpoint record --help\n"
    )


def test_faces_and_numbers_below_zero_are_values(parser, capsys):
    parser.add_argument("--faces", nargs="+")
    parser.add_argument("--inertia")
    read = parser.parse_args(["--faces", "+x", "-x", "-z", "--inertia", "-0.05,0.04,0.02"])
    assert (read.faces, read.inertia) == (["+x", "-x", "-z"], "-0.05,0.04,0.02")
    assert parser.parse_args(["--faces", "-x,+y", "-.5"]).faces == ["-x,+y", "-.5"]
    for word in ("-xy", "-q"):
        with pytest.raises(SystemExit):
            parser.parse_args(["--faces", "+x", word])
    assert "unrecognized arguments: -xy" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["okeefe", "--disperse", "a.b=normal:0.1", "c=uniform:0:1", "--cases", "3"],
        ["okeefe", "--disperse", "a.b=normal:0.1", "--cases", "3", "--disperse", "c=uniform:0:1"],
        ["--disperse", "a.b=normal:0.1", "c=uniform:0:1", "okeefe", "--cases=3"],
        ["--cases", "3", "--disperse=a.b=normal:0.1", "c=uniform:0:1", "okeefe"],
        ["--cases", "3", "--disp", "a.b=normal:0.1", "c=uniform:0:1", "--", "okeefe"],
    ],
)
def test_pairs_stand_behind_one_option_or_each_behind_its_own(parser, words):
    parser.add_argument("mission")
    parser.add_argument("--disperse", action="append", default=[], metavar="KEY=DISTRIBUTION")
    parser.add_argument("--cases", type=int)
    read = parser.parse_args(words)
    assert read.disperse == ["a.b=normal:0.1", "c=uniform:0:1"]
    assert (read.mission, read.cases) == ("okeefe", 3)


def test_a_pair_that_no_option_takes_is_named(parser, capsys):
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--cases", type=int)
    with pytest.raises(SystemExit):
        parser.parse_args(["--set", "a=1", "--cases", "3", "b=2"])
    assert "unrecognized arguments: b=2" in capsys.readouterr().err


def test_a_repeated_option_forgets_nothing(parser):
    parser.add_argument("--estimators", nargs="+", default=["ekf"])
    parser.add_argument("--faces", nargs="+")
    read = parser.parse_args(["--estimators", "wavg", "--faces", "+x", "-x", "--estimators", "wls", "flat"])
    assert (read.estimators, read.faces) == (["wavg", "wls", "flat"], ["+x", "-x"])
    assert parser.parse_args([]).estimators == ["ekf"] and parser.parse_args([]).faces is None


def raising(error):
    def run():
        raise error

    return run


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyError("a"), USAGE, "record: error: 'a'\n"),
        (ValueError("b"), FAILED, "record: error: b\n"),
        (KeyboardInterrupt(), INTERRUPTED, "record: stopped here\n"),
    ],
)
def test_expected_errors_are_one_line_and_a_code(parser, capsys, error, code, said):
    assert guarded(parser.prog, raising(error), (KeyError,), (ValueError,), "stopped here") == code
    assert capsys.readouterr().err == said


def test_other_errors_are_not_hidden(parser):
    with pytest.raises(TypeError):
        guarded(parser.prog, raising(TypeError()), (KeyError,))


def test_numbers(capsys):
    parser = command_parser("p", "e", "", ())
    parser.add_argument("--size", type=positive)
    parser.add_argument("--any", type=number("anything but 3", lambda value: value != 3.0))
    assert parser.parse_args(["--size", "1e-3", "--any", "inf"]).size == 1e-3
    for wrong in ("--size=0", "--size=nan", "--size=inf", "--size=x", "--any=3", "--any=nan"):
        with pytest.raises(SystemExit):
            parser.parse_args([wrong])
        option, text = wrong.split("=")
        assert f"argument {option}: {text} given, expected " in capsys.readouterr().err


def test_an_interrupt_that_comes_while_the_compiler_calls_back_is_not_lost(capsys):
    """Where C calls Python no exception can be raised: it is thrown away, and what was to end goes on."""
    lost = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))

    def compiling():
        lost()
        threading.Event().wait(60.0)
        return 0

    assert guarded("./sunpoint export", compiling, ()) == INTERRUPTED
    assert capsys.readouterr().err == "export: interrupted\n"
