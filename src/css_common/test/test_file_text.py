# SPDX-License-Identifier: Apache-2.0
"""A file that is no text says in which line, and what would be right."""

import pytest

from css_common.file_text import decoded
from css_common.mission import load_mission
from css_common.mission_file import MissionError

LATIN = "mission:\n  # Größe der Kamera\n  name: sonde\n".encode("latin-1")


def test_what_ros_reads_is_read():
    text = "name: größe\n"
    for data in (text.encode(), b"\xef\xbb\xbf" + text.encode(), text.encode("utf-16")):
        assert decoded(data) == text


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (LATIN, ["line 2", "'# Größe der Kamera'", "byte 0xF6", "UTF-8"]),
        (b"a: 1\r\nb: \xb5m\r\n", ["line 2", "'b: µm'", "byte 0xB5"]),
        (b"\xff\xfea\0b", ["UTF-16", "damaged"]),
        (b"PK\x03\x04\0\xff\n", ["line 1", "binary data"]),
        (b"x" * 900 + b"\xe9", ["line 1", "x..."]),
    ],
)
def test_what_is_none_is_named(data, words):
    with pytest.raises(ValueError, match="expected") as caught:
        decoded(data)
    said = str(caught.value)
    assert all(word in said for word in words), said
    assert "codec" not in said and "decode" not in said and len(said) < 160


def test_a_mission_in_latin_1(tmp_path):
    path = tmp_path / "sonde.yaml"
    path.write_bytes(LATIN)
    with pytest.raises(MissionError, match=rf"^{path}: cannot be read: line 2, .*expected text saved as UTF-8$"):
        load_mission(str(path))
