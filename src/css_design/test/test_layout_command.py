# SPDX-License-Identifier: Apache-2.0
"""The layout verb: what it says when it is interrupted, and of missions whose cells it cannot place."""

import json
import os
import signal

import pytest

from css_common.command import INTERRUPTED, USAGE
from css_common.mission import load_mission
from css_design.commands import layout
from css_design.layout.search import LayoutSearch

SMALL = ["okeefe_2013", "--set", "mission.duration=600", "--set", "orbit.true_anomaly_deg=60", "--faces", "+z", "-z"]


def interrupt_at(monkeypatch, step):
    """Ctrl-C at some call of a step of the search."""
    calls, original = [], getattr(LayoutSearch, step)

    def interrupted(search, *arguments):
        calls.append(step)
        if len(calls) == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return original(search, *arguments)

    monkeypatch.setattr(LayoutSearch, step, interrupted)


def test_ctrl_c_ends_the_search_with_the_best_so_far(tmp_path, capsys, monkeypatch):
    interrupt_at(monkeypatch, "_exchanged")
    assert layout.main([*SMALL, "--cells", "1-4", "--out", str(tmp_path), "--json"]) == INTERRUPTED
    printed = capsys.readouterr()
    assert "layout: interrupted; these are the best so far" in printed.err and "Traceback" not in printed.err
    result = json.loads(printed.out.splitlines()[-1])
    assert result["interrupted"] and [point["cells"] for point in result["front"]] == [1]
    assert len(load_mission(result["front"][0]["mission"]).values.cells.normals) == 1


def test_ctrl_c_before_there_is_a_layout(tmp_path, capsys, monkeypatch):
    interrupt_at(monkeypatch, "_cost")
    assert layout.main([*SMALL, "--cells", "3", "--out", str(tmp_path)]) == INTERRUPTED
    assert capsys.readouterr().err.endswith("layout: interrupted before the first layout\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (
            ["cells.clip_normal=0,0,0", "css_array.collar.axis=0,0,1", "css_array.collar.cells=0"],
            "css_array.collar.axis: a collar shades the cells that stand in it, none of those that are placed anew; "
            "expected a mission without, by --set css_array.collar.axis=0,0,0 --set css_array.collar.cells=, and the "
            "collar as a part of --structure",
        ),
        (
            [
                "css_array.warp=false",
                "css_array.response.angles_deg=0,90",
                f"css_array.response.outputs={','.join(['1,0'] * 8)}",
            ],
            "css_array.response.outputs: 8 curves given, one for each cell that is there; expected one for all, as a "
            "cell that is placed anew has none, such as their mean by --set css_array.response.outputs=",
        ),
    ],
)
def test_cells_that_cannot_be_placed_anew_are_refused_with_what_would_be_right(overrides, words, tmp_path, capsys):
    changes = [word for override in overrides for word in ("--set", override)]
    assert layout.main([*SMALL, *changes, "--out", str(tmp_path)]) == USAGE
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
