# SPDX-License-Identifier: Apache-2.0
"""The component shown in the README flies as it stands there."""

import re
from pathlib import Path

import numpy as np
import pytest

from css_common.codec import codec_of
from css_common.mission import mission_from_text
from css_msgs.msg import CssVoltages, SunEstimate

README = Path(__file__).parents[1] / "README.md"


@pytest.fixture
def example(tmp_path, monkeypatch):
    """A mission of the README's component alone."""
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    nodes = tmp_path / "my_package" / "nodes"
    nodes.mkdir(parents=True)
    (nodes / "brightest_cell.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    return mission_from_text(
        "/**: {ros__parameters: {extends: okeefe_2013, graph: {nodes: [my_package/brightest_cell]}}}", "readme"
    )


def test_example(bench, example):
    node = example.nodes[0]
    assert example.awaited == ("brightest_cell/sun_estimate",)
    estimates = bench.listen("brightest_cell/sun_estimate", SunEstimate)
    bench.host(node.component, example, node.name)
    codec = codec_of(CssVoltages)
    dark, bright = np.zeros(8), np.array([0.0, 0.0, 0.0, 0.9, 0.2, 0.0, 0.0, 0.0])
    for step, voltages in enumerate((dark, bright, dark)):
        stamp = example.epoch_ns + step * example.period_ns
        bench.publish("css/voltages", CssVoltages, codec.sample(stamp, "bus", voltages=voltages))
    bench.until(lambda: len(estimates) == 3, "three estimates")
    assert [e.validity for e in estimates] == [0, 2, 1]
    assert estimates[0].sun_b.tolist() == [0.0, 0.0, 0.0]
    assert estimates[2].sun_b.tolist() == node.values.cells.normals[3].tolist()


def test_modules_of_the_readme_are_those_of_the_package():
    named = set(re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (`.*?) \|", README.read_text(), re.MULTILINE))))
    modules = {f.stem for f in (README.parent / "css_common").glob("*.py")} - {"__init__"}
    assert named == modules
