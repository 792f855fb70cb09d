# SPDX-License-Identifier: Apache-2.0
"""What is counted of faults and isolations: against flights made up by hand, and by the loop as by the log."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_analysis import fault_sums
from css_analysis.fault_sums import CELLS, RODS, SENSORS, WHEELS
from css_analysis.flight_metrics import windows_of
from css_common.case_faults import NEVER
from css_common.kernel import typed_call
from css_common.mission import load_mission
from css_estimation.sun.sun_heading import LEFT_FIELD, LEFT_GYRO
from css_monte_carlo.case_table import case_table
from css_monte_carlo.case_tallies import Tallies
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.failing_units import NOTHING_FAILS, evident_cells, failing_units, uncertainty_of
from css_monte_carlo.health_tallies import HealthTallies, Held, new_health, tally_health
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.named_faults import class_of_kind, note_cell_kinds
from css_monte_carlo.stepped_flight import SteppedFlight
from css_sim.fault_effects import (
    BIAS,
    CELL,
    DEAD,
    DRIFTING,
    FAULT,
    FROZEN,
    GYRO,
    INTERMITTENT,
    MAGNETOMETER,
    NOISY,
    ROD,
    SATURATED,
    SCALED,
    SHADOWED,
    SIGN,
    SPIKES,
    STUCK,
    STUCK_HIGH,
    STUCK_LOW,
    SWAPPED,
    TACHOMETER,
    WHEEL,
    WRAP,
)

PERIOD_S = 0.5
NOTHING_HELD = Held(0, 0, 0, 0)
_tally = typed_call(tally_health)


def counted(steps):
    """Sums of one case whose steps are (failing, held)."""
    sums = new_health(1)
    for step, (failing, held) in enumerate(steps):
        _tally(sums, 0, step, failing, held)
    return sums


def of_one(values):
    (value,) = values.tolist()
    return value


def test_a_fault_that_is_found_is_detected_from_when_it_shows():
    acts, shows = NOTHING_FAILS._replace(cells=4), NOTHING_FAILS._replace(cells=4, cells_evident=4)
    quiet, held = NOTHING_HELD, NOTHING_HELD._replace(cells=4)
    steps = [(NOTHING_FAILS, quiet), *[(acts, quiet)] * 3, *[(shows, quiet)] * 5, (acts, held), (shows, held)]
    sums = counted(steps)
    assert of_one(fault_sums.shown_s(sums, PERIOD_S)) == 4 * PERIOD_S
    assert of_one(fault_sums.detected_s(sums, PERIOD_S)) == 5 * PERIOD_S
    assert of_one(fault_sums.undetected_units(sums)) == 0
    assert of_one(fault_sums.isolated_units(sums, CELLS)) == 1
    assert of_one(fault_sums.false_isolations(sums, CELLS, WHEELS, RODS, SENSORS)) == 0


def test_the_slowest_of_several_counts_and_one_that_is_never_found_leaves_no_time():
    both = NOTHING_FAILS._replace(cells=3, cells_evident=3)
    one, two = NOTHING_HELD._replace(cells=1), NOTHING_HELD._replace(cells=3)
    late = counted([(both, NOTHING_HELD), *[(both, one)] * 4, (both, two)])
    assert of_one(fault_sums.detected_s(late, PERIOD_S)) == 5 * PERIOD_S
    never = counted([(both, NOTHING_HELD), *[(both, one)] * 5])
    assert np.isnan(fault_sums.detected_s(never, PERIOD_S)[0])
    assert of_one(fault_sums.undetected_units(never)) == 1


def test_what_has_not_shown_is_neither_detected_nor_missed():
    hidden = counted([(NOTHING_FAILS._replace(cells=1), NOTHING_HELD)] * 9)
    assert np.isnan(fault_sums.shown_s(hidden, PERIOD_S)[0]) and np.isnan(fault_sums.detected_s(hidden, PERIOD_S)[0])
    assert of_one(fault_sums.undetected_units(hidden)) == 0


def test_onsets_without_a_fault_are_false_each_time_they_begin():
    """Of a healthy cell twice, of the wrong cell once, of a cell whose fault is over once."""
    wrong = NOTHING_HELD._replace(cells=2)
    fails = NOTHING_FAILS._replace(cells=1, cells_evident=1)
    steps = [(NOTHING_FAILS, wrong), (NOTHING_FAILS, wrong), (NOTHING_FAILS, NOTHING_HELD), (NOTHING_FAILS, wrong)]
    steps += [(NOTHING_FAILS, NOTHING_HELD), (fails, wrong), (fails, NOTHING_HELD)]
    steps += [(NOTHING_FAILS, NOTHING_HELD._replace(cells=1))]
    sums = counted(steps)
    assert of_one(fault_sums.false_isolations(sums, CELLS)) == 4
    assert of_one(fault_sums.isolated_units(sums, CELLS)) == 2
    assert of_one(fault_sums.undetected_units(sums)) == 1


def test_actuators_and_sensors_have_sums_of_their_own():
    fails = NOTHING_FAILS._replace(wheels=8, sensors=LEFT_GYRO)
    held = Held(0, 8, 1, LEFT_GYRO | LEFT_FIELD)
    sums = counted([(fails, NOTHING_HELD), (fails, held)])
    assert [of_one(fault_sums.isolated_units(sums, s)) for s in (CELLS, WHEELS, RODS, SENSORS)] == [0, 1, 1, 2]
    assert [of_one(fault_sums.false_isolations(sums, s)) for s in (CELLS, WHEELS, RODS, SENSORS)] == [0, 0, 1, 1]
    assert of_one(fault_sums.detected_s(sums, PERIOD_S)) == PERIOD_S


masks = st.integers(0, 2**32 - 1).map(lambda bits: bits & 0x8000_0105)


@given(st.lists(st.tuples(masks, masks, masks), max_size=30))
def test_any_flight_is_counted_as_whole_columns_say(steps):
    """Bits of (failed, evident of them, held) over time, each unit by itself."""
    failed, evident, held = (np.array([step[i] for step in steps], np.int64) for i in range(3))
    evident &= failed
    sums = counted(
        (NOTHING_FAILS._replace(cells=int(f), cells_evident=int(e)), NOTHING_HELD._replace(cells=int(h)))
        for f, e, h in zip(failed, evident, held, strict=True)
    )
    false = ever = 0
    for unit in range(32):
        fails, shows, is_held = ((column >> unit & 1).astype(bool) for column in (failed, evident, held))
        begins = is_held & ~np.concatenate(([False], is_held[:-1]))[: len(steps)]
        false += int(np.count_nonzero(begins & ~fails))
        ever += int(is_held.any())
        for found, when in ((sums.shown_step, shows), (sums.found_step, fails & is_held)):
            assert found[0, CELLS, unit] == (int(np.argmax(when)) if when.any() else -1)
    assert of_one(fault_sums.false_isolations(sums, CELLS)) == false
    assert of_one(fault_sums.isolated_units(sums, CELLS)) == ever


def test_units_fail_while_their_faults_act():
    table = np.zeros(6, FAULT)
    table["sort"] = [CELL, CELL, WHEEL, TACHOMETER, ROD, GYRO]
    table["unit"] = [3, 1, 2, 0, 1, 2]
    table["kind"] = [DEAD, SWAPPED, DEAD, DEAD, DEAD, DEAD]
    table["value"][1] = 7.0
    table["first_step"], table["end_step"] = 5, [10, NEVER, NEVER, NEVER, NEVER, NEVER]
    failing = typed_call(failing_units)
    assert failing(table, 4) == NOTHING_FAILS
    assert failing(table, 5) == (1 << 3 | 1 << 1 | 1 << 7, 0, 0b101, 0b10, LEFT_GYRO)
    assert failing(table, 10).cells == 1 << 1 | 1 << 7
    table["sort"][5] = MAGNETOMETER
    assert failing(table, 5).sensors == LEFT_FIELD


@pytest.mark.parametrize(
    ("settings", "albedo", "threshold"),
    [
        (("css_array.noise=0.01", "css_array.degradation=0"), 0.0, 0.05),
        (("css_array.noise=0", "css_array.degradation=0.06"), 0.0, 5 * 0.06 / np.sqrt(12.0) * 0.5),
        (
            ("css_array.degradation=0", "css_array.scale_cell_error=0.03", "css_array.scale_common_error=0.04"),
            0.0,
            0.125,
        ),
        (
            ("css_array.degradation=0", "css_array.misalignment_deg=1", "css_array.bias=0.01"),
            0.0,
            5 * np.hypot(0.01, np.pi / 180),
        ),
        (("css_array.noise=0.03", "css_array.degradation=0"), 0.1, 5 * np.hypot(0.03, 0.04)),
        (("css_array.noise=0.01", "css_array.degradation=0", "css_array.bits=8"), 0.0, 0.05 + 2.0 / 256),
    ],
)
def test_a_fault_shows_beyond_what_a_healthy_reading_is_uncertain_by(settings, albedo, threshold):
    mission = load_mission("okeefe_2013", settings)
    u = uncertainty_of(mission.node("css_array").values)
    evident, healthy = typed_call(evident_cells), np.full(3, 0.5)
    light = np.full(3, albedo)
    for off, expected in ((0.99 * threshold, 0), (1.01 * threshold, 0b101), (-1.01 * threshold, 0b101)):
        assert evident(u, 0b101, healthy, healthy + off, light) == expected


FAULTS = (
    "css_array.faults=0 dead from 20,1 swapped 4 from 30 to 90,5 stuck 1.6 from 40,6 noisy 0.3 from 100,"
    "any frozen within 50",
    "dynamics.faults=wheel.1 dead from 50,rod.0 stuck 0.1 from 60,tachometer.2 bias 100 from 70",
    "gyro.faults=gyro.x bias 1 from 80",
    "magnetometer.faults=magnetometer.all dead from 90",
)
FITTED = (
    "graph.nodes=css_sim/dynamics,css_sim/css_array,css_sim/gyro,css_sim/magnetometer,css_estimation/ekf,"
    "sunpoint_control/mrp_control",
    "rods.fitted=true",
    "mrp_control.dumping.enabled=true",
    "css_array.noise=0.01",
    "css_array.albedo.draw=per_cell",
    "mission.period=1.0",
    "mission.duration=200",
    "mrp_control.gains.p=0.5",
)


def looped(mission, cases) -> Tallies:
    tallies = fly_cases(MissionFlight(mission), cases, 10).tallies
    assert isinstance(tallies, Tallies)
    return tallies


def test_the_log_of_a_flight_says_of_faults_what_the_loop_counts():
    mission, cases = load_mission("okeefe_2013", FITTED).with_overrides(FAULTS), np.array([0, 3])
    compiled = looped(mission, cases)
    stepped, _ = SteppedFlight(mission).fly(cases, 10)
    assert isinstance(stepped, Tallies)
    # what a cell is taken for is known of those who tell it
    told = "health/ekf" in mission.topics
    for name, ours, theirs in zip(HealthTallies._fields, compiled.health, stepped.health, strict=True):
        if told or not name.endswith("_kind"):
            np.testing.assert_array_equal(ours, theirs, err_msg=name)
    shown = compiled.health.shown_step
    assert np.all(shown[:, WHEELS, [1, 2]] == [50, 70]) and np.all(shown[:, RODS, 0] == 60)
    assert np.all(shown[:, SENSORS, :2] == [80, 90])
    assert np.all(shown[:, CELLS, 5] == 40)
    row = case_table(cases, compiled, 1.0, windows_of(mission)).to_pylist()[0]
    assert row["fault_shown_s"] > 0.0 and row["undetected_units"] >= 5 and row["detected_s"] is None


def test_a_flight_without_faults_has_none_that_show():
    text = "css_array.faults=0 stuck 1.5 from 10 to 20"
    mission = load_mission("okeefe_2013", FITTED).with_overrides([text])
    sums = looped(mission, np.array([0])).health
    assert sums.shown_step[0, CELLS, 0] == 10
    none = looped(load_mission("okeefe_2013", FITTED), np.array([0])).health
    assert not none.sums["shown"].any() and (none.shown_step == -1).all()


def test_kinds_that_no_reading_tells_apart_are_one():
    of = typed_call(class_of_kind)
    assert {of(kind, 0.0) for kind in (DEAD, STUCK, FROZEN, STUCK_LOW, SIGN)} == {DEAD}
    assert {of(kind, 0.7) for kind in (STUCK, FROZEN, STUCK_HIGH)} == {STUCK}
    assert of(SIGN, -0.7) == SIGN and of(DEAD, 0.7) == DEAD
    assert {of(kind, 0.3) for kind in (SCALED, SHADOWED, SATURATED)} == {SCALED}
    assert {of(kind, 0.3) for kind in (NOISY, SPIKES)} == {NOISY}
    rest = (DRIFTING, BIAS, WRAP, INTERMITTENT, SWAPPED)
    assert len({of(kind, 0.3) for kind in (*rest, DEAD, STUCK, SCALED, NOISY, SIGN)}) == len(rest) + 5


def test_the_last_verdict_on_a_cell_that_fails_is_held_against_what_it_is():
    note, sums = typed_call(note_cell_kinds), new_health(1)
    faults = np.zeros(2, FAULT)
    faults["sort"], faults["unit"], faults["kind"] = CELL, [1, 2], [SCALED, SWAPPED]
    faults["value"], faults["end_step"] = [0.5, 0.0], NEVER
    cells, voltages = np.zeros(4, [("kind", np.int64)]), np.full(4, 0.4)
    cells["kind"] = [SWAPPED, STUCK, BIAS, NOISY]
    note(sums, 0, 0b0111, cells, faults, 3, voltages)
    # cells 0 and 2 are exchanged; 3 is not of the mask
    assert sums.fault_kind[0, CELLS, :4].tolist() == [SWAPPED, SCALED, SWAPPED, -1]
    assert sums.verdict_kind[0, CELLS, :4].tolist() == [SWAPPED, STUCK, BIAS, -1]
    sums.found_step[0, CELLS, :3] = 1
    assert of_one(fault_sums.misnamed_units(sums)) == 2
    cells["kind"][1] = SHADOWED
    note(sums, 0, 0b0010, cells, faults, 4, voltages)
    assert of_one(fault_sums.misnamed_units(sums)) == 1
