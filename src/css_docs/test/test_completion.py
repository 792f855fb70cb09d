# SPDX-License-Identifier: Apache-2.0
"""Scripts of `./sunpoint completion` complete in the shells themselves."""

import contextlib
import os
import pty
import re
import shutil
import subprocess
from collections.abc import Iterable
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


_ZSHRC = """
fpath=("$ZDOTDIR" $fpath)
autoload -Uz compinit
compinit -u -d "$ZDOTDIR/dump"
PS1= RPS1=
tell() { print -r -- "<$BUFFER>"; BUFFER= }
zle -N tell
bindkey '^I' expand-or-complete
bindkey '^T' tell
"""


@pytest.mark.skipif(shutil.which("zsh") is None, reason="no zsh on this machine")
def test_zsh_completes(scripts, tmp_path):
    shutil.copy(scripts / "zsh", tmp_path / "_sunpoint")
    (tmp_path / ".zshrc").write_text(_ZSHRC)
    (tmp_path / "flown.mcap").touch()
    typed = {
        "./sunpoint mon": "./sunpoint monte-carlo ",
        "sunpoint fly okeefe_20": "sunpoint fly okeefe_2013 ",
        "sunpoint fly --real": "sunpoint fly --realtime ",
        "sunpoint monte-carlo okeefe_2013 --gyro of": "sunpoint monte-carlo okeefe_2013 --gyro off ",
        "sunpoint completion z": "sunpoint completion zsh ",
        "sunpoint replay flo": "sunpoint replay flown.mcap ",
    }
    assert typed_into_zsh(tmp_path, typed) == list(typed.values())


def typed_into_zsh(home: Path, lines: Iterable[str]) -> list[str]:
    """What becomes of each line in a zsh at a terminal when tab is pressed at its end."""
    env = {**os.environ, "ZDOTDIR": str(home), "HOME": str(home), "TERM": "dumb"}
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(home)
        os.execvpe("zsh", ["zsh", "-i"], env)
    keys = "".join(f"{line}\t\x14" for line in lines) + "exit\n"
    os.write(terminal, keys.encode())
    told = b""
    with contextlib.suppress(OSError):  # the terminal of one that has ended
        while chunk := os.read(terminal, 4096):
            told += chunk
    os.close(terminal)
    os.waitpid(child, 0)
    return [found.decode() for found in re.findall(rb"<([^<>]*)>", told)]
