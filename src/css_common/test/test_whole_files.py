# SPDX-License-Identifier: Apache-2.0
"""A file is written whole or stays as it was, and the error names it."""

import resource

import pytest

from css_common.command import FAILED, guarded
from css_common.whole_files import write_whole


@pytest.fixture
def no_room():
    """No file of this process may grow beyond ten bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("content", ["Grüße", b"\x00\xff"])
def test_it_is_written_and_nothing_is_left_beside_it(tmp_path, content):
    file = tmp_path / "a.yaml"
    write_whole(file, "before")
    write_whole(file, content)
    assert file.read_bytes() == (content if isinstance(content, bytes) else content.encode("utf-8"))
    assert [found.name for found in tmp_path.iterdir()] == ["a.yaml"]


@pytest.mark.parametrize("before", [None, "what"])
def test_without_room_all_stays_as_it_was(tmp_path, no_room, before):
    file = tmp_path / "a.yaml"
    if before is not None:
        file.write_text(before)
    with pytest.raises(OSError, match="File too large") as error:
        write_whole(file, 100 * "x")
    assert error.value.filename == str(file)
    assert [found.read_text() for found in tmp_path.iterdir()] == ([] if before is None else [before])


def test_a_command_says_which_file_and_why(tmp_path, no_room, capsys):
    def command():
        write_whole(tmp_path / "a.yaml", 100 * "x")
        return 0

    assert guarded("./sunpoint any", command, (), (OSError,)) == FAILED
    # the message is a pipe's, which has no such limit
    assert capsys.readouterr().err == f"any: error: {tmp_path / 'a.yaml'}: File too large\n"
