# SPDX-License-Identifier: Apache-2.0
"""Plots that come from figures of matplotlib hold the numbers of the figures, and what they say in letters."""

import numpy as np
import pytest
from figure_checks import checked_figures
from matplotlib.colors import BoundaryNorm, ListedColormap

from css_analysis import figure_style
from css_analysis.figure_style import BLUE, VERMILION, keep_figures, kept_figure, new_figure, save, style
from css_report.blocks import Page, Section
from css_report.drawn_figures import plots_of
from css_report.html_page import html_of

__all__ = ["checked_figures"]

TIME = np.linspace(0.0, 90.0, 500)


def figure(tmp_path):
    """Two pairs of axes on one abscissa: lines, a band, levels, eclipse, names of events; a map."""
    with style(), keep_figures():
        drawn = new_figure(8.0, 6.0)
        above, below = drawn.subplots(2, 1, sharex=True)
        figure_style.shade_dark(above, TIME, (TIME > 30.0) & (TIME < 60.0))
        above.plot(TIME, np.exp(-TIME), color=BLUE, label="mean")
        above.plot(TIME, 2.0 * np.exp(-TIME), color=BLUE, linestyle=(0, (1, 1.2)))
        figure_style.level_line(above, 0.5, "half")
        figure_style.logarithmic(above)
        above.set_ylim(1e-3, 10.0)
        above.set_ylabel("angle [deg]")
        above.set_title("Errors")
        figure_style.subtitle(above, "dotted: 95 %")
        figure_style.legend(above, title="solid: mean")
        below.plot(TIME, TIME, color=BLUE)
        below.step(TIME, TIME**2, where="post", color=VERMILION, marker="o", label="steps")
        below.fill_between(TIME, 0.0, TIME, color=VERMILION, alpha=0.5, label="area")
        below.hlines(3.0, 10.0, 20.0, color=BLUE, linestyle=(0, (4, 3)), label="leg")
        below.axvline(12.0, color=VERMILION)
        below.annotate("boom", (12.0, 1.0), xycoords=("data", "axes fraction"))
        below.annotate("peak", (40.0, 5.0), xytext=(0, 3), textcoords="offset points")
        below.set_xlabel("time [min]")
        below.set_ylabel("angle [deg]")
        figure_style.legend(below)
        path = save(drawn, tmp_path / "figure.png")
        assert kept_figure(path) is drawn
    assert kept_figure(path) is None
    return drawn


def test_numbers_scales_and_words_are_those_of_the_figure(tmp_path):
    plots = plots_of(figure(tmp_path), "figure-6")
    assert plots is not None
    above, below = plots
    assert (above.title, above.y_label, above.x_label) == ("Errors", "angle [deg]", "time [min]")
    assert above.linked == below.linked == "figure-6"
    assert above.y["type"] == "log" and above.y["range"] == pytest.approx([-3.0, 1.0])
    assert above.caption == "solid: mean. dotted: 95 %"
    mean, upper, half = above.traces
    assert mean["name"] == "mean" and np.array_equal(mean["x"], TIME)
    assert np.array_equal(mean["y"], np.exp(-TIME).astype(np.float32))
    assert upper["line"]["dash"] == "dot" and upper["name"] == ""
    assert half["name"] == "half" and half["y"].tolist() == [0.5, 0.5] and half["line"]["dash"] == "dash"
    (dark,) = above.shapes
    assert (dark["x0"], dark["x1"]) == (TIME[TIME > 30.0][0], TIME[TIME < 60.0][-1])
    names = [trace["name"] for trace in below.traces]
    assert {"mean", "steps", "area", "leg", "named places"} <= set(names)
    steps = next(trace for trace in below.traces if trace["name"] == "steps")
    assert steps["line"]["shape"] == "hv" and steps["marker"]["symbol"] == "circle"
    assert below.legend[0][0] == "boom (12)"
    assert below.caption == "Named places: peak at 40"


def test_every_plot_is_one_that_plotly_takes(tmp_path):
    from plotly.graph_objects import Figure as Checked  # a second to load

    for plot in plots_of(figure(tmp_path), "f") or ():
        assert len(Checked(list(plot.traces), {"xaxis": dict(plot.x), "yaxis": dict(plot.y)}).data) == len(plot.traces)
        assert "<figure" in html_of(Page("p", "l", [Section("s", [plot])]))


def test_a_large_map_keeps_its_largest_value(tmp_path):
    values = np.zeros((720, 1440))
    values[333, 777] = 5.0
    with style():
        drawn = new_figure(6.0, 4.0)
        axes = drawn.subplots()
        image = axes.imshow(values, extent=(0.0, 360.0, -90.0, 90.0), origin="lower", aspect="auto")
        drawn.colorbar(image, ax=axes).set_label("error [deg]")
        axes.set_xlabel("azimuth [deg]")
        axes.set_ylabel("angle [deg]")
        axes.set_title("Errors")
        save(drawn, tmp_path / "map.png")
    plots = plots_of(drawn, "map")
    assert plots is not None
    (plot,) = plots
    (trace,) = plot.traces
    row, column = np.unravel_index(np.argmax(trace["z"]), trace["z"].shape)
    assert trace["z"].max() == 5.0 and trace["z"].shape == (360, 720)
    assert abs(trace["x"][column] - (777.5 / 4.0)) < 0.5 and abs(trace["y"][row] - (333.5 / 4.0 - 90.0)) < 0.5
    assert "Shades: error [deg]" in plot.caption and "largest of 2 by 2" in plot.caption


def test_classes_of_a_map_keep_their_colours(tmp_path):
    with style():
        drawn = new_figure(6.0, 4.0)
        axes = drawn.subplots()
        colours = ListedColormap(["#ff0000", "#00ff00", "#0000ff"])
        axes.imshow(np.array([[1, 2], [2, 1]]), cmap=colours, norm=BoundaryNorm(np.arange(4) - 0.5, 3), aspect="auto")
        axes.set_xlabel("x")
        axes.set_ylabel("y")
        axes.set_title("Classes")
        save(drawn, tmp_path / "classes.png")
    plots = plots_of(drawn, "classes")
    assert plots is not None
    (trace,) = plots[0].traces
    assert (trace["zmin"], trace["zmax"]) == (-0.5, 2.5)  # none is 0, whose colour is not given to 1
    assert [colour for _, colour in trace["colorscale"][::2]] == ["#ff0000", "#00ff00", "#0000ff"]
    assert trace["colorscale"][2][0] == pytest.approx(1.0 / 3.0)


def test_what_has_no_counterpart_leaves_the_picture(tmp_path):
    with style():
        drawn = new_figure(4.0, 3.0)
        axes = drawn.subplots()
        axes.scatter([0.0, 1.0], [1.0, 2.0])
        axes.set_xlabel("x")
        axes.set_ylabel("y")
        axes.set_title("Dots")
        save(drawn, tmp_path / "dots.png")
    assert plots_of(drawn, "dots") is None
