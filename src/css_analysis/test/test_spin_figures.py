# SPDX-License-Identifier: Apache-2.0
"""Names in the figures of a spinning payload can be read."""

from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Annotation
from noting import noted

from css_analysis import spin_figures
from css_estimation.spin.coning import Passages

EVENTS = [(62.19, "motor separation"), (66.17, "nosecone"), (69.18, "booms"), (357.0, "flat spin")]


@pytest.fixture
def figures(monkeypatch):
    """What was saved."""
    saved: list[Any] = []
    save = spin_figures.save
    monkeypatch.setattr(spin_figures, "save", lambda figure, path: noted(saved, figure, lambda: save(figure, path)))
    return saved


@pytest.fixture
def axes(tmp_path, figures):
    """Both parts of the figure of a flight of 374 s, drawn."""
    time = np.arange(0.2, 374.0, 1 / 5.5)
    rate = 2.0 * np.pi * (np.where(time < 69.18, 6.0, 5.45) + 0.3 * np.sin(24.0 * time))
    zero = np.zeros_like(time)
    passages = Passages(time, 0.4 + 0.1 * np.sin(24.0 * time), rate, zero, zero, zero)
    spin_figures.write_rate_figure(passages, tmp_path / "figure_4.png", EVENTS)
    figures[0].canvas.draw()  # in its own resolution
    return figures[0].axes


def test_names_of_events_neither_overlap_nor_cover_the_data(axes):
    above, _ = axes
    boxes = {text.get_text(): text.get_window_extent() for text in above.texts if isinstance(text, Annotation)}
    assert list(boxes) == [name for _, name in EVENTS]
    for (one, box), (other, box_of_other) in combinations(boxes.items(), 2):
        assert not box.overlaps(box_of_other), (one, other)
    frame = above.get_window_extent()
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 and box.y1 <= frame.y1 for box in boxes.values())
    highest = above.transData.transform((0.0, above.lines[0].get_ydata().max()))[1]
    assert all(box.y0 >= highest for box in boxes.values())


def test_the_line_of_a_microsecond_is_where_it_says(tmp_path, figures):
    candidates = [SimpleNamespace(frequency=1.6), SimpleNamespace(frequency=3.8)]
    studies: Any = {"one head": SimpleNamespace(candidates=candidates, residuals=(2e-4, 3e-7))}
    spin_figures.write_alias_figure(studies, 5.45, tmp_path / "aliases.png")
    (axes,) = figures[0].axes
    points, line = axes.lines
    np.testing.assert_allclose(points.get_ydata(), [200.0, 0.3])
    assert set(line.get_ydata()) == {1.0} and "1 us" in [text.get_text() for text in axes.texts]
