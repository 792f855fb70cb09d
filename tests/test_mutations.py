# SPDX-License-Identifier: Apache-2.0
"""What `benchmarks/mutants.py` changes, and by which tests it looks for the change."""

import ast
import json
import os
import subprocess
import sys
from collections import Counter

import pytest
from listing import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))
from mutants import EQUIVALENT, draw, recall
from mutations import mutations
from relevant_tests import Sources

SOURCE = b'''"""Documentation: -1 < 2."""

LIMIT: float = 2.0


def f(x: int = 3) -> int:
    """More, 4."""
    if x < -LIMIT and not x[1]:
        x.y = 5
        return None
    x += x * f"{x + 1}"
    return x if x == 0.0 else "6"
'''


@pytest.fixture(scope="module")
def sources():
    return Sources(ROOT)


def test_every_kind_of_change_and_no_other():
    changed = Counter((m.kind, m.applied(SOURCE).decode().splitlines()[m.line - 1].strip()) for m in mutations(SOURCE))
    assert changed == Counter(
        [
            ("constant changed", "LIMIT: float = 4.0"),
            ("constant changed", "def f(x: int = 4) -> int:"),
            ("condition negated", "if (not (x < -LIMIT and not x[1])):"),
            ("operator swapped", "if x < -LIMIT or not x[1]:"),
            ("comparison moved", "if x <= -LIMIT and not x[1]:"),
            ("sign changed", "if x < (LIMIT) and not x[1]:"),
            ("condition negated", "if x < -LIMIT and (x[1]):"),
            ("index shifted", "if x < -LIMIT and not x[0]:"),
            ("statement dropped", "pass"),
            ("constant changed", "x.y = 6"),
            ("statement dropped", "pass"),
            ("operator swapped", 'x -= x * f"{x + 1}"'),
            ("operator swapped", 'x += x / f"{x + 1}"'),
            ("condition negated", 'return x if (not (x == 0.0)) else "6"'),
            ("comparison moved", 'return x if x != 0.0 else "6"'),
            ("constant changed", 'return x if x == 1.0 else "6"'),
        ]
    )


def test_changes_of_all_packages_are_valid_and_change_something(sources):
    for file in sources.modules.values():
        source = file.read_bytes()
        before = ast.dump(ast.parse(source))
        for mutation in mutations(source)[::29]:
            assert ast.dump(ast.parse(mutation.applied(source))) != before, (file, mutation)


def test_the_draw_is_even_over_packages_and_the_beginning_of_a_longer_one():
    names = [mutant.name for mutant in draw(ROOT, 1, 60)]
    assert names[:20] == [mutant.name for mutant in draw(ROOT, 1, 20)]
    assert names != [mutant.name for mutant in draw(ROOT, 2, 60)]
    assert len(set(names)) == 60
    counts = Counter(name.split("/")[1] for name in names)
    assert set(counts) == {path.parent.name for path in ROOT.glob("src/*/setup.py")}
    assert max(counts.values()) - min(counts.values()) <= 1


def test_mutants_are_found_again_by_their_names():
    names = [mutant.name for mutant in draw(ROOT, 1, 30)]
    gone = ["src/css_sim/css_sim/gyro.py: no such line -> pass", "src/css_sim/css_sim/no_such_file.py: a -> pass"]
    assert sorted(mutant.name for mutant in recall(ROOT, [*names, *gone])) == sorted(names)


def test_mutants_listed_as_equivalent_are_of_the_sources_as_they_are_and_say_why():
    listed = {entry["mutant"]: entry["reason"] for entry in json.loads(EQUIVALENT.read_text(encoding="utf-8"))}
    assert {mutant.name for mutant in recall(ROOT, listed)} == set(listed)
    assert all(reason.strip() for reason in listed.values())


def test_the_nearest_tests_come_first_and_those_of_the_package_before_others(sources):
    own, others = sources.seen_by(ROOT / "src/css_sim/css_sim/gyro.py", 3)
    names = [test.name for test in own]
    assert {"test_gyro_and_magnetometer_statistics.py", "test_draws_are_independent.py"} <= set(names[:3])
    assert "test_simulation_components.py" in names[:4] and "test_rigid_body_against_closed_forms.py" not in names
    assert len(others) == 1 + 3 and not any("css_sim" in test.parts for test in others)
    assert others[0].name == "test_option_ranges.py"
    # a node file is imported by what loads missions
    _, others = sources.seen_by(ROOT / "src/css_estimation/css_estimation/nodes/coning.py", 50)
    assert ROOT / "tests/test_components.py" in others
    # a command by what starts its verb
    _, others = sources.seen_by(ROOT / "src/css_bringup/css_bringup/commands/demo.py", 3)
    assert ROOT / "tests/test_verbs.py" in others
    # the work of a command is imported by name when it is asked for, and so is a paper
    own, _ = sources.seen_by(ROOT / "src/css_bringup/css_bringup/verbs/replay.py", 0)
    assert ROOT / "src/css_bringup/test/test_bringup_requests.py" in own
    own, _ = sources.seen_by(ROOT / "src/css_papers/css_papers/digregorio/figures.py", 0)
    assert ROOT / "src/css_papers/test/test_digregorio_page.py" in own
    # a figure of the documentation by what draws them all
    own, _ = sources.seen_by(ROOT / "src/css_docs/css_docs/figures/triad.py", 0)
    assert own[0] == ROOT / "src/css_docs/test/test_figures.py"


FAILING = """
import pytest

@pytest.mark.parametrize("text", ["good", "1 25544U  - [x]::y  9.5"])
def test_of_text(text):
    assert text == "good"
"""


@pytest.mark.parametrize(
    ("source", "failed"),
    [(FAILING, "test_some.py::test_of_text[1 25544U  - [x]::y  9.5]"), ("import nowhere_at_all", "test_some.py")],
)
def test_the_test_that_failed_is_known_whatever_its_name(tmp_path, source, failed):
    (tmp_path / "test_some.py").write_text(source)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(ROOT / "benchmarks"), os.environ.get("PYTHONPATH", "")]),
        "MUTANT_PROGRESS": str(tmp_path / "progress.json"),
    }
    command = [sys.executable, "-m", "pytest", "-qx", "-p", "no:cacheprovider", "-p", "one_test"]

    def noted(what):
        subprocess.run([*command, what], cwd=tmp_path, env=environment, capture_output=True, check=False)
        return json.loads((tmp_path / "progress.json").read_text())["failed"]

    assert noted("test_some.py") == failed
    assert noted(failed) == failed
