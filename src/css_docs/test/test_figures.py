# SPDX-License-Identifier: Apache-2.0
"""Figures of the documentation can be drawn, have all their names, and show what their captions say."""

import importlib

import numpy as np
import pytest
from figure_checks import figure_faults

from css_analysis.figure_style import style
from css_docs.figure_files import figure_names


def drawn(name):
    with style():
        figure = importlib.import_module(f"css_docs.figures.{name}").figure()
        figure.canvas.draw()
    return figure


def line(axes, label):
    """Abscissae and ordinates of a line by its name in the legend."""
    (found,) = [line for line in axes.lines if line.get_label() == label]
    return tuple(np.asarray(values, dtype=float) for values in found.get_data())


@pytest.mark.parametrize("name", figure_names())
def test_what_a_figure_says(name):
    figure = drawn(name)
    assert figure_faults(figure) == []
    for axes in figure.axes:
        assert axes.lines and all(np.any(np.isfinite(line.get_ydata())) for line in axes.lines)
        named = [line for line in axes.lines if not line.get_label().startswith("_")]
        assert len(named) < 2 or axes.get_legend() is not None
    FACTS.get(name, lambda figure: None)(figure)


def the_vector_is_too_bright_toward_the_terminator(figure):
    (axes,) = figure.axes
    _, patches = line(axes, "patches")
    _, vector = line(axes, "vector")
    assert 0.2 < patches.max() < 0.5 and patches.max() == pytest.approx(vector.max(), rel=0.1)
    some = (patches > 0.0) & (patches < 0.1 * patches.max())
    assert np.any(some) and np.all(vector[some] > patches[some])


def bars_of_three_sigma_hold_the_true_scales(figure):
    (axes,) = figure.axes
    (bars,) = axes.containers
    estimated, (_, *_), (segments,) = bars.lines[0].get_ydata(), bars.lines[1], bars.lines[2]
    low, high = np.array([segment[:, 1] for segment in segments.get_segments()]).T
    _, true = line(axes, "true")
    assert np.all((low <= true) & (true <= high))
    np.testing.assert_allclose(0.5 * (low + high), estimated)
    # bars that hold anything would say nothing
    assert np.max(high - low) < 0.5 * np.ptp(true)


def a_stuck_cell_turns_only_the_flight_that_is_not_watched(figure):
    (axes,) = figure.axes
    for label, at_least, at_most in (("health on", 0.0, 5.0), ("health off", 5.0, 180.0)):
        time, error = line(axes, label)
        assert at_least < np.nanmedian(error[time > 350.0]) < at_most
        assert np.nanmedian(error[(time > 100.0) & (time < 150.0)]) < 5.0


def the_peak_and_its_mirror_are_where_the_caption_says(figure):
    (axes,) = figure.axes
    half, true = (line(axes, label)[0][0] for label in ("half of the sampling rate", "true coning"))
    for label, peak_hz in (("Fourier transform", 1.63), ("its mirror", 3.82)):
        frequency, amplitude = line(axes, label)
        assert frequency[np.argmax(amplitude)] == pytest.approx(peak_hz, abs=0.01)
    assert half == pytest.approx(0.5 * (1.63 + 3.82), abs=0.01) and true == pytest.approx(3.82, abs=0.01)
    assert axes.get_xlim() == pytest.approx((0.0, 2.0 * half))


def the_cone_is_half_dark_where_the_cylinder_ends(figure):
    field, dusk = figure.axes
    _, strength = line(field, field.lines[0].get_label())
    assert 15.0 < strength.min() < strength.max() < 60.0
    minutes = np.concatenate([path.vertices[:, 0] for path in field.collections[0].get_paths()])
    assert 33.0 < np.ptp(minutes) < 38.0  # at 400 km, the Sun near the plane of the orbit
    (time, cone), (_, cylinder) = line(dusk, "cone"), line(dusk, "cylinder")
    assert (cone[0], cone[-1], cylinder[0], cylinder[-1]) == (1.0, 0.0, 1.0, 0.0)
    assert np.all(np.diff(cone) <= 1e-12) and set(cylinder) == {0.0, 1.0}
    assert abs(time[np.argmax(cone < 0.5)] - time[np.argmax(cylinder < 0.5)]) < 1.0


def least_squares_is_exact_in_much_of_the_sky_and_dark_cells_help(figure):
    (axes,) = figure.axes
    errors = {curve.get_label().partition(",")[0]: np.asarray(curve.get_xdata()) for curve in axes.lines}
    exact = {label: float(np.mean(of < 1e-6)) for label, of in errors.items()}
    assert exact["weighted average"] == 0.0 and 0.1 < exact["least squares"] <= exact["with dark cells"]
    assert errors["with dark cells"].mean() < errors["least squares"].mean()
    for curve in axes.lines:
        assert f", mean {curve.get_xdata().mean():.1f} deg" in curve.get_label()
        np.testing.assert_allclose(curve.get_ydata(), (np.arange(2000) + 0.5) / 2000)


def every_case_ends_in_the_deadband(figure):
    (axes,) = figure.axes
    for case in range(5):
        time, error = line(axes, f"case {case}")
        assert error[0] > 15.0 and np.all(error[time > 230.0] < 16.0)
    assert {line.get_ydata()[0] for line in axes.lines if np.ptp(line.get_ydata()) == 0.0} == {15.0, 30.0}


def the_rate_follows_what_the_sun_can_show(figure):
    (axes,) = figure.axes
    true, told = line(axes, "truth, across the Sun"), line(axes, "estimate")
    late = told[0][(told[0] > 30.0) & np.isfinite(told[1])]
    off = np.interp(late, *told) - np.interp(late, *true)
    assert abs(np.mean(off)) < 0.3 and np.sqrt(np.mean(off**2)) < 0.5 < true[1].max() < 10.0


def the_simulated_gyro_is_that_of_the_closed_form(figure):
    (axes,) = figure.axes
    (tau, simulated), (_, stated) = line(axes, "simulated"), line(axes, "closed form")
    groups = 200_000 * 0.1 / tau  # of which the deviation is taken
    np.testing.assert_array_less(np.abs(simulated / stated - 1.0), 4.0 / np.sqrt(groups))
    assert tau[0] == pytest.approx(0.1) and stated[0] == pytest.approx(0.01, rel=1e-3)


def momentum_and_energy_stay(figure):
    (axes,) = figure.axes
    for label in ("momentum in n", "energy of the body"):
        time, change = line(axes, label)
        assert time[-1] == pytest.approx(599.9) and np.all(change < 1e-6)


def counts_are_finest_where_the_slits_end(figure):
    (axes,) = figure.axes
    steps = []
    for label in ("10 kHz", "100 kHz", "1000 kHz"):
        angle, step = line(axes, label)
        assert np.all(np.diff(step) < 0.0) and 59.0 < angle[-1] < 60.0
        steps.append(step[0])
    np.testing.assert_allclose(np.divide(steps[:-1], steps[1:]), 10.0, rtol=1e-3)
    # at the middle d(angle) = d(arc) / tan(30 deg), half a turn in 1e4 / 6 counts
    assert steps[0] == pytest.approx(180.0 / (1e4 / 6.0) * np.sqrt(3.0), rel=1e-2)


def pulses_miss_the_true_motion_by_half_a_degree_and_more(figure):
    (axes,) = figure.axes
    told, true = line(axes, "by the slits"), line(axes, "true motion")
    missed = np.abs(told[1] - np.interp(told[0], *true))
    assert 0.5 < missed.max() < 5.0 and len(missed) >= 10
    assert (true[0][0], true[0][-1]) == pytest.approx((78.0, 80.0), abs=0.11)


def losses_take_up_to_five_per_cent(figure):
    (axes,) = figure.axes
    (angle, cosine), (_, response) = line(axes, "cosine"), line(axes, "response")
    np.testing.assert_allclose(cosine, np.cos(np.radians(angle)))
    assert response[0] == pytest.approx(1.0) and angle[-1] == 60.0
    (band,) = axes.collections
    edges = band.get_paths()[0].vertices
    upright = edges[np.isclose(edges[:, 0], 0.0), 1]
    assert (upright.min(), upright.max()) == pytest.approx((0.95, 1.0))


def draws_are_those_of_the_covariance(figure):
    (axes,) = figure.axes
    (_, found), (angle, stated) = line(axes, "drawn"), line(axes, "covariance")
    # a root mean square of 400 draws; nearly all of it about one axis
    np.testing.assert_allclose(found, stated, rtol=4.0 / np.sqrt(2.0 * 400.0))
    assert angle[-1] == 88.0 and np.all(np.diff(stated) < 0.0)


def the_bias_is_that_of_perfect_cells(figure):
    (axes,) = figure.axes
    (angle, mean), (_, largest), (near, bias) = (line(axes, label) for label in ("mean", "largest", "bias"))
    assert np.all(mean <= largest + 1e-12) and axes.get_xlim() == (0.0, 180.0)
    np.testing.assert_allclose(bias, near - np.degrees(np.arctan(0.5 * np.tan(np.radians(near)))))
    # as long as all four cells see the Sun at any azimuth
    assert near[-1] == pytest.approx(19.4, abs=0.3)
    np.testing.assert_allclose(mean[: len(near)][near < 14.0], bias[near < 14.0], atol=1e-3)
    assert angle[np.argmax(np.diff(largest[angle < 40.0]))] == pytest.approx(19.5, abs=1.0)


def only_the_watched_wheels_point(figure):
    (axes,) = figure.axes
    ends = {label: line(axes, label)[1][-1] for label in ("all wheels", "one dead, health on", "one dead, health off")}
    assert ends["all wheels"] < 16.0 and ends["one dead, health on"] < 16.0


def the_gyro_is_left_out_where_it_is_watched(figure):
    (axes,) = figure.axes
    for label, error in (("health on", 0.0), ("health off", 1.0)):
        time, off = line(axes, label)
        assert np.nanmedian(off[(time > 60.0) & (time < 120.0)]) < 0.2
        assert np.nanmedian(off[time > 130.0]) == pytest.approx(error, abs=0.2)


def voltages_do_with_four_cells_in_a_plane(figure):
    (axes,) = figure.axes
    late = {label: np.nanmedian(line(axes, label)[1][-500:]) for label in ("Sun vector", "voltages")}
    assert late["voltages"] < 0.5 * late["Sun vector"]
    bounds_hold(axes, "Sun vector", "voltages")


def bounds_hold(axes, *labels):
    """Bounds of three sigma hold most errors and are no larger than they need to be."""
    for label in labels:
        (time, error), (at, bound) = line(axes, label), line(axes, f"{label}, 3 sigma")
        ratio = (error / np.interp(time, at, bound))[time > 0.5 * time[-1]]
        ratio = ratio[np.isfinite(ratio)]
        assert np.mean(ratio < 1.0) > 0.9 and np.quantile(ratio, 0.95) > 0.1, label


def the_attitude_is_told_once_one_turn_is_left(figure):
    (axes,) = figure.axes
    time, error = line(axes, "error")
    assert time[0] > 30.0 and np.nanmedian(error[time > 1500.0]) < 10.0
    bound = line(axes, "3 sigma")[1]
    assert np.nanmean(error < bound) > 0.8


def the_tip_off_is_taken_away_and_the_shadow_is_grey(figure):
    rate, pointing = figure.axes
    (time, size), angle = (np.asarray(v) for v in rate.lines[0].get_data()), pointing.lines[0].get_ydata()
    assert size[0] > 5.0 and np.all(size[time > 5560.0] < 4.0) and np.median(angle[time > 10000.0]) < 45.0
    for axes in figure.axes:
        grey = sum(patch.get_width() for patch in axes.patches)
        assert 2 * 1500.0 < grey < 2 * 2300.0


def the_pyramid_is_better_once_the_panels_face_the_sun(figure):
    (axes,) = figure.axes
    late = {
        label: np.nanmedian(line(axes, label)[1][-300:]) for label in ("flat cells and pyramid", "flat cells alone")
    }
    assert late["flat cells and pyramid"] < 0.5 * late["flat cells alone"]


def both_bounds_hold_at_the_end(figure):
    bounds_hold(figure.axes[0], "gyro", "no gyro")


def the_filter_errs_by_less_than_the_average(figure):
    (axes,) = figure.axes
    assert np.nanmean(line(axes, "Kalman filter")[1]) < np.nanmean(line(axes, "weighted average")[1])
    bounds_hold(axes, "Kalman filter")


def the_filters_find_the_sun(figure):
    for name in ("ekf", "sunline_ukf", "sunline_suekf"):
        time, error = line(figure.axes[0], name)
        assert np.nanmedian(error[time > 200.0]) < 10.0


FACTS = {
    "aiding_health": the_gyro_is_left_out_where_it_is_watched,
    "attitude_filter": voltages_do_with_four_cells_in_a_plane,
    "earthlight": the_attitude_is_told_once_one_turn_is_left,
    "magnetic_control": the_tip_off_is_taken_away_and_the_shadow_is_grey,
    "safe_hold": the_pyramid_is_better_once_the_panels_face_the_sun,
    "sun_filter": both_bounds_hold_at_the_end,
    "sunline_ekf": the_filter_errs_by_less_than_the_average,
    "unscented_filters": the_filters_find_the_sun,
    "albedo": the_vector_is_too_bright_toward_the_terminator,
    "calibration": bars_of_three_sigma_hold_the_true_scales,
    "cell_health": a_stuck_cell_turns_only_the_flight_that_is_not_watched,
    "coning": the_peak_and_its_mirror_are_where_the_caption_says,
    "environment": the_cone_is_half_dark_where_the_cylinder_ends,
    "least_squares": least_squares_is_exact_in_much_of_the_sky_and_dark_cells_help,
    "mrp_control": every_case_ends_in_the_deadband,
    "rate_and_eclipse": the_rate_follows_what_the_sun_can_show,
    "rate_and_field_sensors": the_simulated_gyro_is_that_of_the_closed_form,
    "rigid_body": momentum_and_energy_stay,
    "slit_angles": counts_are_finest_where_the_slits_end,
    "slit_sensor": pulses_miss_the_true_motion_by_half_a_degree_and_more,
    "sun_cells": losses_take_up_to_five_per_cent,
    "triad": draws_are_those_of_the_covariance,
    "weighted_average": the_bias_is_that_of_perfect_cells,
    "wheel_health": only_the_watched_wheels_point,
}
