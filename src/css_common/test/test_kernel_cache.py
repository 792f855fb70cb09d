# SPDX-License-Identifier: Apache-2.0
"""An edited kernel is compiled anew everywhere, also in callers that live in other files and were cached.

Each test works on a copy of the decorator beside two small packages of kernels, in processes of their own.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from presence import present

import css_common.compile_news
import css_common.kernel
import css_common.linked_code
import css_common.places
import css_common.progress_lines
from css_common import boxed_tuples, kernel_sources
from css_common.kernel_sources import kernel_modules, sources_of

INNER = "from css_common.kernel import kernel\n@kernel\ndef inner(x):\n    return x + {}\n"
OUTER = (
    "from css_common.kernel import kernel\nfrom css_environment.inner import inner\n"
    "@kernel\ndef outer(x):\n    return 10.0 * inner(x)\n"
)
PROGRAM = """
import json, os, sys
{before}
from css_sim.outer import outer
result = outer(1.0)
hits = sum(outer.stats.cache_hits.values())
print(json.dumps(dict(result=result, hits=hits, folder=outer.stats.cache_path)))
"""


class Project:
    """A tree with the decorator and two kernels, one calling the other from another package."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.home = root / "home"
        for package in ("css_common", "css_environment", "css_sim", "css_sim/nodes"):
            (root / package).mkdir()
            (root / package / "__init__.py").touch()
        for module in (
            boxed_tuples,
            css_common.compile_news,
            css_common.kernel,
            kernel_sources,
            css_common.linked_code,
            css_common.places,
            css_common.progress_lines,
        ):
            shutil.copy(present(module.__file__), root / "css_common")
        self.write_inner("1.0")
        (root / "css_sim" / "outer.py").write_text(OUTER)

    def write_inner(self, term: str) -> None:
        """Edits the kernel that is called."""
        (self.root / "css_environment" / "inner.py").write_text(INNER.format(term))

    def run(self, before: str = "", **environment: str) -> dict:
        """Calls the outer kernel in a fresh process: result, cache hits and cache folder."""
        ours = ("NUMBA_", "SUNPOINT_", "PYTHON", "XDG_")
        env = {key: value for key, value in os.environ.items() if not key.startswith(ours)}
        # Python's own bytecode cache would miss an edit that keeps the file's size and second; that of numba is read
        env |= {"PYTHONPATH": str(self.root), "PYTHONDONTWRITEBYTECODE": "1", "SUNPOINT_HOME": str(self.home)}
        env |= {key: os.environ[key] for key in ("PYTHONPYCACHEPREFIX",) if key in os.environ}
        env |= environment
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM.format(before=before)], env=env, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)


@pytest.fixture
def project(tmp_path):
    """A fresh project without any cache."""
    return Project(tmp_path)


def test_second_start_compiles_nothing(project):
    first, second = project.run(), project.run()
    assert first["result"] == second["result"] == 20.0
    assert (first["hits"], second["hits"]) == (0, 1)
    assert first["folder"] == second["folder"]


def test_edit_in_another_file_reaches_a_cached_caller(project):
    before = project.run()
    project.write_inner("2.0")
    after = project.run()
    assert (before["result"], after["result"]) == (20.0, 30.0)
    assert before["folder"] != after["folder"]
    project.write_inner("1.0")
    assert project.run() == before | {"hits": 1}, "the old cache serves the old sources again"


def test_the_trap_is_real(project):
    # One folder for all sources, as numba has it by default: the caller keeps what it once compiled. When this
    # fails, numba checks the files of callees too and the folder needs no hash any more.
    fixed = {"NUMBA_CACHE_DIR": str(project.root / "fixed")}
    assert project.run(**fixed)["result"] == 20.0
    project.write_inner("2.0")
    assert project.run(**fixed)["result"] == 20.0


def test_folder_chosen_by_the_user_is_used(project):
    chosen = project.root / "chosen"
    assert Path(project.run(NUMBA_CACHE_DIR=str(chosen))["folder"]).is_relative_to(chosen)


def test_change_of_a_numba_variable_does_not_move_the_cache(project):
    # numba reads its whole environment again at the next compilation
    meddle = (
        "import css_common.kernel, numba, os\n"
        "os.environ['NUMBA_DISABLE_PERFORMANCE_WARNINGS'] = '1'\n"
        "numba.njit(lambda x: x)(1.0)"
    )
    assert Path(project.run(before=meddle)["folder"]).is_relative_to(project.home)


def test_only_what_a_kernel_is_made_from_names_its_folder(project):
    before = project.run()
    for path in ("css_sim/nodes/array.py", "css_sim/data/table.py", "css_sim/other.py", "css_environment/other.py"):
        file = project.root / path
        file.parent.mkdir(exist_ok=True)
        file.write_text("from css_common.kernel import kernel\nx = 1\n")
    assert project.run() == before | {"hits": 1}


def test_a_cache_that_names_a_type_which_is_gone_is_made_anew(project):
    """Tests hand kernels types of their own; whoever flies afterwards cannot import those."""
    (project.root / "visitor.py").write_text("from typing import NamedTuple\nclass Pair(NamedTuple):\n    x: float\n")
    (project.root / "css_sim" / "outer.py").write_text(
        "from numba.extending import overload\nfrom css_common.kernel import kernel\n"
        "from css_environment.inner import inner\n"
        "def value(x):\n    return x\n"
        "@overload(value)\ndef _value(x):\n"
        "    return (lambda x: x.x) if hasattr(x, 'instance_class') else (lambda x: x)\n"
        "@kernel\ndef outer(x):\n    return 10.0 * inner(value(x))\n"
    )
    before = project.run("from visitor import Pair\nfrom css_sim.outer import outer\nouter(Pair(2.0))")
    assert before["result"] == 20.0
    (project.root / "visitor.py").unlink()
    assert project.run() == before | {"hits": 0}
    assert project.run() == before | {"hits": 1}


def test_edit_two_imports_away_counts(project):
    (project.root / "css_sim" / "constants.py").write_text("TERM = 1.0\n")
    inner = project.root / "css_environment" / "inner.py"
    inner.write_text("from css_sim.constants import (  # by name\n    TERM,\n)\n" + INNER.format("TERM"))
    assert project.run()["result"] == 20.0
    (project.root / "css_sim" / "constants.py").write_text("TERM = 3.0\n")
    assert project.run()["result"] == 40.0


def test_a_loop_is_made_from_every_kernel_that_it_may_be_handed(project):
    # nothing that is imported by the loop: called by the type of an argument, as an estimator is
    (project.root / "css_sim" / "outer.py").write_text(
        "from css_common.kernel import study_kernel\n@study_kernel\ndef outer(x):\n    return 20.0 * x\n"
    )
    before = project.run()
    assert project.run() == before | {"hits": 1}
    project.write_inner("2.0")
    assert project.run()["folder"] != before["folder"]


def test_imports_are_followed_as_python_writes_them():
    sources = {source.stem for source in sources_of("css_estimation.sun.sunline_ekf")}
    assert {"sunline_ekf", "vectors", "attitude", "low_pass", "kernel"} <= sources
    assert not {"wls", "numpy", "typing", "mission"} & sources
    assert {source.stem for source in kernel_modules()} >= {
        "sunline_ekf",
        "sun_cells",
        "rigid_body",
        "wheel_allocation",
    }


def test_without_a_project_the_users_cache_is_taken(project):
    folder = project.run(SUNPOINT_HOME="", XDG_CACHE_HOME=str(project.root / "xdg"))["folder"]
    assert Path(folder).is_relative_to(project.root / "xdg" / "sunpoint" / "kernels")
