# SPDX-License-Identifier: Apache-2.0
"""Layouts of cells: names are what stands there, and what is no layout is refused by cell and value."""

import textwrap

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from css_recording.errors import BagError
from css_telemetry.description import CellForm, Description
from css_telemetry.description_file import read_description


def layout(tmp_path, text, name="layout.yaml"):
    path = tmp_path / name
    path.write_text(textwrap.dedent(text))
    return path


def names_of(found):
    return tuple(cell.name for cell in found.cells)


def normals_of(found):
    return [cell.normal_b for cell in found.cells]


def test_layouts_in_both_forms(tmp_path):
    text = """\
        cells: {CSS 1: [0.71, 0, 0.71], 2: [0, 0, -1]}
        field_of_view_deg: 100
        clip_normal: [0, 0, 1]
    """
    found = read_description(layout(tmp_path, text))
    assert names_of(found) == ("CSS 1", "2")
    np.testing.assert_allclose(normals_of(found), [(0.5**0.5, 0, 0.5**0.5), (0, 0, -1)], rtol=1e-15)
    assert found.field_of_view_deg == 100.0
    assert found.clip_normal_b == (0.0, 0.0, 1.0)
    found = read_description(layout(tmp_path, "cell,x,y,z\nA, 1, 0, 0\nB,0,0,-1\n", "layout.csv"))
    assert found == Description((CellForm("A", "A", (1.0, 0.0, 0.0)), CellForm("B", "B", (0.0, 0.0, -1.0))))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected the key cells"),
        ("[1, 2]", "expected the key cells"),
        ("cells: 3", "expected the key cells"),
        ("cells: {}", "0 cells given"),
        ("cells: {a: [1, 0]}", "cell a: .* expected a unit vector"),
        ("cells: {a: [1, 1, 0]}", "cell a: a vector of length 1.414"),
        ("cells: {a: [1, 0, x]}", "cell a: 'x' given, expected a number"),
        ("cells: {a: [1, 0, true]}", "cell a: 'true' given"),
        ("cells: {a: [.nan, 0, 1]}", "cell a: '.nan' given"),
        ("cells: {a: [1_0, 0, 1]}", "cell a: '1_0' given"),
        ("cells: {a: [" + 400 * "1" + ", 0, 0]}", "cell a: '1{39}... given, expected a number"),
        ("cells: {a: !!bool foo}", "cell a: 'foo' given, expected a unit vector"),
        ("cells:\n  a: [1, 0, 0]\n  a: [0, 1, 0]", "line 3: a stands twice"),
        ("cells: {a: [1, 0, 0]}\ncells: {b: [1, 0, 0]}", "line 2: cells stands twice"),
        ("cells: {'': [1, 0, 0]}", "a cell has no name"),
        ("cells: {? [a] : [1, 0, 0]}", "line 1: expected a word as key"),
        ("cells: " + 3000 * "[", "not valid YAML"),
        ("cells: {a: [1, 0, 0]}\nfull_scale: 0", "full_scale: '0' given, expected a number above 0"),
        ("cells: {a: [1, 0, 0]}\nfull_scale: {b: 1}", "full_scale: a is not in both"),
        ("cells: {a: [1, 0, 0]}\ndark_level: high", "dark_level: 'high' given"),
        ("cells: {a: north}", "cell a: 'north' given"),
        ("cells: {a: [1, 0, 0]}\nfov: 3", "unknown key fov"),
        ("cells: {a: [1, 0, 0]}\nfield_of_view_deg: 200", "expected 1 to 180"),
        ("cells: {a: [1, 0, 0]}\nclip_normal: 3", "clip_normal: '3' given"),
        ("cells: [", "not valid YAML"),
        ("cells: {" + ", ".join(f"c{i}: [1, 0, 0]" for i in range(33)) + "}", "33 cells given, expected 1 to 32"),
    ],
)
def test_broken_layouts_are_refused(tmp_path, text, words):
    with pytest.raises(BagError, match=words):
        read_description(layout(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected the header"),
        ("name,x,y,z\n", "expected the header cell,x,y,z"),
        ("cell,x,y,z\na,1,0\n", "cell a: expected a name and three numbers"),
        ("cell,x,y,z\na,1,0,0\na,1,0,0\n", "cell a stands twice"),
        ("cell,x,y,z\n,1,0,0\n", "a cell has no name"),
        ("cell,x,y,z\na,1,0," + 200000 * "0", "field larger than"),
    ],
)
def test_broken_layout_tables_are_refused(tmp_path, text, words):
    with pytest.raises(BagError, match=words):
        read_description(layout(tmp_path, text, "layout.csv"))


def test_names_are_what_stands_there(tmp_path):
    text = """\
        cells:
          +X: [1, 0, 0]
          -X: [-1, 0, 0]
          on: [0, 1, 0]
          1: [0, 0, 1]
          01: [0, 0, -1]
          0x1: [0, -1, 0]
    """
    found = read_description(layout(tmp_path, text))
    assert names_of(found) == ("+X", "-X", "on", "1", "01", "0x1")
    assert normals_of(found)[2] == (0.0, 1.0, 0.0)


def test_scale_and_dark_level_of_all_or_of_each_cell(tmp_path):
    text = """\
        cells: {a: [1, 0, 0], b: [0, 1, 0]}
        full_scale: 3000
        dark_level: {b: 90, a: 100.5}
    """
    found = read_description(layout(tmp_path, text))
    assert [cell.full_scale for cell in found.cells] == [3000.0, 3000.0] and found.scaled
    assert [cell.dark_level for cell in found.cells] == [100.5, 90.0]


def test_folders_and_rubbish_are_refused(tmp_path):
    (tmp_path / "rubbish.yaml").write_bytes(bytes(range(256)))
    for path in (tmp_path, tmp_path / "nowhere.yaml", tmp_path / "rubbish.yaml"):
        with pytest.raises(BagError, match="cannot be read"):
            read_description(path)


@settings(max_examples=200, deadline=None)
@given(
    st.text(max_size=100) | st.text("cels:abxyz{}[],.!&*?-10 \n\"'", max_size=100), st.sampled_from([".yaml", ".csv"])
)
def test_no_text_makes_the_reader_crash(tmp_path_factory, text, suffix):
    path = tmp_path_factory.mktemp("garbage") / f"layout{suffix}"
    path.write_text("cells: {a: [1, 0, 0]}\n" * (suffix == ".yaml") + text, encoding="utf-8", errors="replace")
    try:
        found = read_description(path)
    except BagError as error:
        assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
    else:
        np.testing.assert_allclose(np.linalg.norm(normals_of(found), axis=1), 1.0, rtol=1e-12)
