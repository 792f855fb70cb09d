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


def passages_of(frequency_hz, full_angle_deg, spin_hz=5.45):
    """Sun angles that swing by a full angle, one a turn for a minute."""
    time = 10.0 + np.arange(0.0, 60.0, 1.0 / spin_hz)
    angle = 0.4 + np.radians(0.5 * full_angle_deg) * np.sin(2.0 * np.pi * frequency_hz * time)
    zero = np.zeros_like(time)
    return Passages(time, angle, zero, zero, zero, zero)


def test_the_coning_angle_and_what_windows_make_of_it_are_where_they_are(tmp_path, figures):
    windows: Any = {
        "before": SimpleNamespace(start=20.0, end=40.0, full_angle=np.radians(12.0), max_min_angle=np.radians(10.0)),
        "after": SimpleNamespace(start=50.0, end=60.0, full_angle=np.radians(8.0), max_min_angle=np.radians(7.0)),
    }
    spin_figures.write_coning_figure(passages_of(0.1, 10.0), windows, tmp_path / "coning.png", start=20.0)
    (axes,) = figures[0].axes
    (differences,) = axes.lines
    assert differences.get_xdata().min() > 20.0 and axes.get_ylim()[0] == 0.0
    np.testing.assert_allclose(differences.get_ydata(), 10.0, rtol=0.02)
    drawn = {lines.get_label(): lines.get_segments()[0].tolist() for lines in axes.collections}
    for name, window in windows.items():
        for angle, what in ((window.full_angle, "motion fitted"), (window.max_min_angle, "mean of max - min")):
            expected = [[window.start, np.degrees(angle)], [window.end, np.degrees(angle)]]
            np.testing.assert_allclose(drawn.pop(f"{name}: {what}"), expected)
    assert drawn == {} and axes.get_legend() is not None


def test_the_spectrum_has_its_peak_and_its_mirror_and_names_the_candidates(tmp_path, figures):
    chosen, mirror = SimpleNamespace(frequency=1.63), SimpleNamespace(frequency=5.45 - 1.63)
    beyond = SimpleNamespace(frequency=5.45 + 1.63)
    windows: Any = {"all": SimpleNamespace(start=10.0, end=70.0, candidates=[mirror, chosen, beyond], chosen=1)}
    spin_figures.write_spectrum_figure(passages_of(1.63, 10.0), windows, tmp_path / "spectrum.png")
    (axes,) = figures[0].axes
    curve, half = axes.lines
    frequency, amplitude = (np.asarray(v) for v in curve.get_data())
    assert half.get_xdata()[0] == pytest.approx(0.5 * 5.45, rel=1e-3)
    for low, peak in ((0.0, 1.63), (half.get_xdata()[0], 5.45 - 1.63)):
        part = (frequency >= low) & (frequency <= low + half.get_xdata()[0])
        assert frequency[part][np.argmax(amplitude[part])] == pytest.approx(peak, abs=0.01)
        assert amplitude[part].max() == pytest.approx(5.0, rel=0.02)
    named = {text.get_text(): text.xy[0] for text in axes.texts}
    assert named == {f"{1.0 / 3.82:.4f} s": 5.45 - 1.63, f"{1.0 / 1.63:.4f} s, chosen": 1.63}
    assert axes.get_ylim() == pytest.approx((0.0, 1.25 * amplitude.max()))


def test_rates_and_angles_are_drawn_in_hertz_and_degrees(axes):
    above, below = axes
    assert np.asarray(above.lines[0].get_ydata())[0] == pytest.approx(6.0, abs=0.31)
    assert np.ptp(np.asarray(below.lines[0].get_ydata())) == pytest.approx(np.degrees(0.2), rel=0.02)
