# SPDX-License-Identifier: Apache-2.0
"""Every kind of fault does what its name says, from its line on; draws are what chance and spans say."""

import math
import re
from collections.abc import Callable

import numpy as np
import pytest
from faults import values_of
from okeefe_spacecraft import okeefe_values
from scipy import stats

from css_common import link_kinds
from css_common.case_faults import NEVER
from css_common.codec import Sample, codec_of
from css_common.fault_lines import parse_line
from css_common.random_streams import random_key
from css_msgs.msg import Faults, SpacecraftState
from css_sim import fault_effects as effects
from css_sim.actuator_faults import new_felt, spoil_actuators
from css_sim.fault_kinds import AXES, KINDS, SORTS, kinds_of
from css_sim.faults import of_case, rows
from css_sim.nodes.css_array import CssArray
from css_sim.rigid_body import rigid_body

KEY = random_key(5, 2)
PERIOD = 0.1
SIGNIFICANCE = 1e-4
UNITS = {sort: AXES if sort in ("gyro", "magnetometer") else [str(i) for i in range(8)] for sort in SORTS}
SI = {
    "cell": 1.0, "gyro": math.pi / 180.0, "magnetometer": 1e-9, "wheel": 1.0, "rod": 1.0,
    "tachometer": math.pi / 30.0,
}  # fmt: skip

# What a kind makes of x, `steps` cycles after its begin, with its values in SI: known without a draw.
EXPECTED: dict[str, Callable[..., float]] = {
    "dead": lambda x, steps: 0.0,
    "stuck": lambda x, steps, level: level,
    "drifting": lambda x, steps, rate: x + rate * PERIOD * steps,
    "bias": lambda x, steps, offset: x + offset,
    "sign": lambda x, steps: -x,
    "saturated": lambda x, steps, limit: max(-limit, min(limit, x)),
    "stuck_low": lambda x, steps: -1e30,
    "stuck_high": lambda x, steps: 1e30,
    "wrap": lambda x, steps: 1e30 if x < 0.0 else x,
}
FACTOR: dict[str, Callable[..., float]] = {"scaled": lambda x, steps, factor: factor * x}  # whose values have no unit
DRAWN = {"noisy", "spikes", "intermittent", "stuck_random"}
OF_THEIR_OWN = {"frozen", "silent", "swapped", "shadowed", "friction"}
NOT_OF_COMMANDS = {("wheel", "dead"), ("wheel", "saturated"), ("head", "dead")}


def lines_of(*lines, kinds=KINDS, key=KEY):
    return rows(of_case(kinds, UNITS, key, PERIOD).of(list(lines)))


def line(kind, unit=1, times="from 1"):
    target = f"{kind.sort}.{'all' if kind.whole else UNITS[kind.sort][unit]}"
    return " ".join([target, kind.name, *(f"{value:g}" for value in values_of(kind)), times])


def spoiled(table, sort, step, values):
    """Values of all units of a sort after the faults."""
    values = np.array(values, dtype=float)
    if sort in ("gyro", "magnetometer"):
        return np.array(effects.spoil_axes(table, SORTS[sort], KEY, step, tuple(values)))
    effects.spoil(table, SORTS[sort], KEY, step, values)
    return values


def test_all_kinds_are_tested_here_and_numbered_once():
    assert {kind.name for kind in KINDS if kind.sort != "head"} == {*EXPECTED, *FACTOR, *DRAWN, *OF_THEIR_OWN}
    assert (
        len({(kind.sort, kind.name) for kind in KINDS}) == len({(kind.sort, kind.code) for kind in KINDS}) == len(KINDS)
    )


def test_messages_have_the_same_numbers():
    for name, code in (SORTS | link_kinds.SORTS).items():
        assert getattr(Faults, f"SORT_{name.upper()}") == code
    told = {code for name in dir(Faults) if name.startswith("KIND_") for code in [getattr(Faults, name)]}
    assert told == {kind.code for kind in (*KINDS, *link_kinds.KINDS)} - {effects.STUCK_RANDOM}
    codes = vars(link_kinds) | vars(effects)
    assert all(getattr(Faults, name) == codes[name[5:]] for name in dir(Faults) if name.startswith("KIND_"))


@pytest.mark.parametrize(
    "kind",
    [k for k in KINDS if k.name in EXPECTED | FACTOR and (k.sort, k.name) not in NOT_OF_COMMANDS],
    ids=lambda k: f"{k.sort} {k.name}",
)
def test_what_a_kind_makes_of_readings_and_commands(kind):
    unit, table = 1, lines_of(line(kind, times="from 1 to 2"))
    scale = 1.0 if kind.name in FACTOR else SI[kind.sort]
    values = [value * scale for value in values_of(kind)]
    size = 3.0 * SI[kind.sort] * max([1.0, *values_of(kind)])
    for x in (size, -0.4 * size, 0.01 * size):
        given = [x] * len(UNITS[kind.sort])
        for step in (0, 9, 20, 10**9):
            assert np.array_equal(spoiled(table, kind.sort, step, given), given)
        for step in (10, 13, 19):
            result = spoiled(table, kind.sort, step, given)
            expected = (EXPECTED | FACTOR)[kind.name](x, step - 10, *values)
            assert result[unit] == pytest.approx(expected, rel=1e-12, abs=0.0)
            assert np.all(np.delete(result, unit) == x)


@pytest.mark.parametrize("kind", [k for k in KINDS if k.name == "frozen"], ids=lambda k: k.sort)
def test_what_is_frozen_stays_at_what_it_was_when_the_fault_began(kind):
    table = lines_of(line(kind, times="from 1 to 2"))
    readings = [spoiled(table, kind.sort, step, [0.1 * step] * 3)[1] for step in range(25)]
    expected = [0.1 * (10 if 10 <= step < 20 else step) for step in range(25)]
    assert readings == expected


@pytest.mark.parametrize("kind", [k for k in KINDS if k.name == "noisy"], ids=lambda k: k.sort)
def test_noise_is_normal(kind):
    table = lines_of(line(kind, times=""))
    noise = [spoiled(table, kind.sort, step, [2.0] * 3)[1] - 2.0 for step in range(2000)]
    assert stats.kstest(noise, "norm", (0.0, values_of(kind)[0] * SI[kind.sort])).pvalue > SIGNIFICANCE


@pytest.mark.parametrize("kind", [k for k in KINDS if k.name == "spikes"], ids=lambda k: k.sort)
def test_spikes_come_in_their_share_of_cycles_either_way(kind):
    size, share = values_of(kind)
    table = lines_of(line(kind, times=""))
    off = np.array([spoiled(table, kind.sort, step, [0.0] * 3)[1] for step in range(4000)]) / SI[kind.sort]
    up, down = np.count_nonzero(np.isclose(off, size)), np.count_nonzero(np.isclose(off, -size))
    assert up + down == np.count_nonzero(off)
    assert stats.binomtest(up + down, len(off), share).pvalue > SIGNIFICANCE
    assert stats.binomtest(up, up + down, 0.5).pvalue > SIGNIFICANCE


@pytest.mark.parametrize("kind", [k for k in KINDS if k.name == "intermittent"], ids=lambda k: k.sort)
def test_intermittent_ones_give_nothing_in_a_share_of_spells(kind):
    share, spell = values_of(kind)
    length = round(spell / PERIOD)
    table = lines_of(line(kind, times="from 0.3"))
    there = np.array([spoiled(table, kind.sort, step, [1.0] * 3)[1] for step in range(3, 3 + 2000 * length)])
    spells = there.reshape(-1, length)
    assert np.all(spells == spells[:, :1]) and set(np.unique(there)) == {0.0, 1.0}
    assert stats.binomtest(int(np.sum(spells[:, 0] == 0.0)), 2000, share).pvalue > SIGNIFICANCE


def test_levels_that_are_drawn_are_uniform_and_differ_between_cells():
    drawn = np.stack([lines_of("cell.0-2 stuck_random 0.2 0.6", key=random_key(1, c))["value"] for c in range(2000)])
    assert stats.kstest(drawn[:, 0], "uniform", (0.2, 0.4)).pvalue > SIGNIFICANCE
    assert stats.pearsonr(drawn[:, 0], drawn[:, 1]).pvalue > SIGNIFICANCE
    assert np.all(lines_of("cell.0 stuck_random 0.2 0.6")["kind"] == effects.STUCK)


def test_swapped_cells_read_what_the_other_one_should():
    table = lines_of("cell.1 swapped 3 from 1")
    assert spoiled(table, "cell", 10, [0.0, 1.0, 2.0, 3.0]).tolist() == [0.0, 3.0, 2.0, 1.0]
    assert spoiled(table, "cell", 9, [0.0, 1.0, 2.0, 3.0]).tolist() == [0.0, 1.0, 2.0, 3.0]


def outputs(*faults, **changes):
    """Outputs of the cells in full light, without degradation."""
    values = okeefe_values(
        CssArray.table(), faults=list(faults), degradation=0.0, albedo__enabled=False, warp=False, **changes
    )
    array = CssArray("css_array", values)
    truth = codec_of(SpacecraftState).sample(
        array.epoch_ns, "eci", sun_n=np.array([0.6, 0.0, 0.8]), solar_flux=1.0, illumination=1.0
    )
    voltages = array.cycle(array.epoch_ns, {"truth": truth})["voltages"]
    assert isinstance(voltages, Sample)
    return voltages.voltages


def test_a_shadow_takes_light_and_leaves_the_offset():
    healthy, dim = outputs(bias=0.05), outputs("all shadowed 0.75", bias=0.05)
    offsets = outputs("all shadowed 1", bias=0.05, output_low=-1.0)
    bright = healthy > 0.3
    assert np.count_nonzero(bright) >= 2
    np.testing.assert_allclose(dim[bright] - offsets[bright], 0.25 * (healthy - offsets)[bright], rtol=1e-12)


def test_cells_at_the_limits_of_their_converter():
    bits = {"bits": 8, "output_low": -0.5, "output_high": 1.5}
    low, high = outputs("all stuck_low", **bits), outputs("all stuck_high", **bits)
    assert np.all(low == -0.5)
    assert np.all(high == 1.5 - 2.0 / 256)
    wrapped = outputs("all bias -0.1", "all wrap", **bits)
    healthy = outputs(**bits)
    assert np.all((wrapped == high) == (healthy < 0.1))


def spoiled_actuators(*lines, step=10, command=0.01):
    """Wheels and commands of a spacecraft with faults."""
    body = rigid_body(np.eye(3).ravel(), np.vstack([np.eye(3), [[0.6, 0.8, 0.0]]]), wheel_friction=(0.001, 0.0001))
    felt = new_felt(body.wheels, 3)
    spoil_actuators(lines_of(*lines), KEY, step, body.wheels, np.full(4, command), np.full(3, 0.5), felt)
    return body.wheels, felt


def test_wheels_that_are_not_as_they_were_built():
    lines = ("wheel.0 dead from 1", "wheel.1 friction 0.002 0.0003 from 1", "wheel.2 saturated 3000 from 1")
    wheels, room = spoiled_actuators(*lines)
    expected = wheels.copy()
    expected["max_torque"][0] = 0.0
    expected["coulomb"][1] += 0.002
    expected["viscous"][1] += 0.0003
    expected["max_speed"][2] = 3000.0 * math.pi / 30.0
    assert np.array_equal(room.wheels, expected)
    wheels, room = spoiled_actuators(*lines, step=9)
    assert np.array_equal(room.wheels, wheels)


def test_commands_that_wheels_and_rods_do_not_follow():
    _, room = spoiled_actuators("wheel.3 sign", "wheel.1 scaled 0.5", "rod.0 dead", "rod.2 stuck -1.5")
    assert room.torque.tolist() == [0.01, 0.005, 0.01, -0.01]
    assert room.dipole.tolist() == [0.0, 0.5, -1.5]


def test_silence_is_of_the_whole_sensor():
    for sort in ("gyro", "magnetometer"):
        table = lines_of(f"{sort}.all silent from 1 to 2")
        assert [effects.is_silent(table, SORTS[sort], step) for step in (9, 10, 19, 20)] == [False, True, True, False]
        with pytest.raises(ValueError, match=rf"expected {sort}\.all"):
            parse_line(f"{sort}.x silent", KINDS, UNITS)


def test_a_board_is_a_range():
    assert lines_of("cell.4-7 dead")["unit"].tolist() == [4, 5, 6, 7]
    assert lines_of("cell.all dead")["unit"].tolist() == list(range(8))


def test_cells_need_no_sort_where_there_are_cells_alone():
    short = parse_line("2 dead", kinds_of("cell"), {"cell": UNITS["cell"]})
    assert short == parse_line("cell.2 dead", kinds_of("cell"), {"cell": UNITS["cell"]})


def drawn(*lines, cases=3000):
    return np.stack([lines_of(*lines, key=random_key(11, case)) for case in range(cases)])


def test_a_chance_is_the_share_of_cases():
    happened = drawn("cell.1 dead from 2 chance 0.3")["first_step"][:, 0] == 20
    assert stats.binomtest(int(happened.sum()), len(happened), 0.3).pvalue > SIGNIFICANCE
    assert np.all(drawn("cell.1 dead chance 0", cases=50)["first_step"] == NEVER)


def test_targets_and_times_are_uniform_and_independent():
    faults = drawn("cell.any stuck 0.5 from 10 to 30 within 100")[:, 0]
    assert stats.chisquare(np.bincount(faults["unit"], minlength=8)).pvalue > SIGNIFICANCE
    late = faults["first_step"] - 100
    assert stats.kstest((late - 0.5) / 1000, "uniform").pvalue > SIGNIFICANCE
    assert np.all(np.abs(faults["end_step"] - faults["first_step"] - 200) <= 1)
    assert stats.pearsonr(faults["unit"], late).pvalue > SIGNIFICANCE


def test_a_fault_that_is_added_changes_the_draws_of_no_other():
    one = "cell.any stuck_random 0 1 within 100"
    alone, among = lines_of(one), lines_of("cell.3 dead", one, one)
    assert np.array_equal(alone[["unit", "value", "first_step"]], among[["unit", "value", "first_step"]][1:2])
    assert not np.array_equal(among["value"][1:2], among["value"][2:])


WRONG = {
    "": "expected TARGET KIND",
    "cell.1": "expected TARGET KIND",
    "cell.8 dead": "expected cell.0 to cell.7, cell.all or cell.any",
    "cell.3-2 dead": "expected cell.0 to cell.7",
    "cell.-1 dead": "expected cell.0 to cell.7",
    "gyro.w stuck 1": "expected gyro.x, gyro.y, gyro.z",
    "gryo.x dead": "did you mean gyro?",
    "cell.1 broken": "expected dead, stuck",
    "cell.1 stuk 1": "did you mean stuck?",
    "cell.1 stuck": "expected stuck with level",
    "cell.1 stuck high": "expected stuck with level",
    "cell.1 dead 0.5": "expected dead in",
    "cell.1 dead from": "is no fault",
    "cell.1 dead from 9 to 3": "expected later than 9",
    "cell.1 dead from 1 from 2": "is no fault",
    "cell.1 noisy -0.1": "sigma: -0.1 given, expected at least 0",
    "cell.1 stuck nan": "expected a finite number",
    "cell.1 dead chance 1.5": "probability: 1.5 given",
    "gyro.x spikes 1": "expected spikes with size, share",
    "wheel.1 silent": "no fault of a wheel",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_lines_are_refused_with_what_would_be_right(text):
    with pytest.raises(ValueError, match=re.escape(WRONG[text])):
        parse_line(text, KINDS, UNITS)
