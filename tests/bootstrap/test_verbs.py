# SPDX-License-Identifier: Apache-2.0
"""The verbs: help, unknown names, and that each names an executable of a package."""

import pytest

from bootstrap.cli import main
from bootstrap.verbs import OWN_USAGE, VERBS, help_text, unknown_verb


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"], ["help"]])
def test_help_names_every_verb(arguments, capsys):
    assert main(arguments) == 0
    shown = capsys.readouterr().out
    assert shown == help_text() + "\n"
    for name, verb in VERBS.items():
        assert any(line.split()[:1] == [name] and verb.summary in line for line in shown.splitlines())
    assert max(map(len, shown.splitlines())) <= 100


@pytest.mark.parametrize(("typed", "meant"), [("replai", "replay"), ("import_csv", "import-csv"), ("fyl", "fly")])
def test_unknown_verb_suggests_the_nearest(typed, meant, capsys):
    assert main([typed, "--help"]) == 2
    assert f"did you mean '{meant}'" in capsys.readouterr().err


def test_unknown_verb_without_a_near_one_points_to_the_help():
    assert "--help" in unknown_verb("zzzzzz")


def test_verbs_without_executable_explain_themselves(capsys):
    assert {name for name, verb in VERBS.items() if not verb.package} == set(OWN_USAGE)
    for name in OWN_USAGE:
        assert main([name, "--help"]) == 0
        assert capsys.readouterr().out.startswith(f"Usage: ./sunpoint {name}")


def test_executables_are_names_of_modules():
    for verb in VERBS.values():
        assert bool(verb.package) == bool(verb.executable)
        assert verb.executable.isidentifier() or not verb.executable
