# SPDX-License-Identifier: Apache-2.0
"""Scripts of `./sunpoint completion` complete in the shells themselves."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from css_docs.commands.completion import SHELLS
from css_docs.reference.verbs import table_of_verbs

ROOT = Path(__file__).parents[3]

_TRY = """
source "$1"
shift
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
COMPREPLY=()
_shtab_sunpoint
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    """The script of each shell; the start installs what makes them."""
    folder = tmp_path_factory.mktemp("completion")
    env = {name: value for name, value in os.environ.items() if name != "SUNPOINT_VERB"}
    for shell in SHELLS:
        command = [str(ROOT / "sunpoint"), "completion", shell]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=env, timeout=300)
        (folder / shell).write_text(done.stdout)
    return folder


@pytest.mark.parametrize("shell", SHELLS)
def test_every_verb_is_in_it_and_the_shell_reads_it(scripts, shell):
    text = (scripts / shell).read_text()
    for name in table_of_verbs(ROOT).VERBS:
        assert name in text
    assert text.startswith("#compdef sunpoint\n") == (shell == "zsh")
    if shutil.which(shell):
        subprocess.run([shell, "-n", scripts / shell], check=True, timeout=60)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("mon",), {"monte-carlo"}),
        (("fly", "okeefe_20"), {"okeefe_2013"}),
        (("fly", "--real"), {"--realtime"}),
        (("monte-carlo", "okeefe_2013", "--gyro", "o"), {"on", "off"}),
        (("play", "--fl"), {"--flight"}),
        (("completion", "z"), {"zsh"}),
    ],
)
def test_bash_completes(scripts, words, expected, tmp_path):
    done = subprocess.run(
        ["bash", "-c", _TRY, "try", scripts / "bash", "./sunpoint", *words],
        capture_output=True, text=True, check=True, cwd=tmp_path, timeout=60,
    )  # fmt: skip
    assert set(done.stdout.split()) == expected
