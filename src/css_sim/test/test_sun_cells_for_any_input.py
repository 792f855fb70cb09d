# SPDX-License-Identifier: Apache-2.0
"""Properties of the cells' outputs that hold for any attitude, light, fault and setting."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from okeefe_spacecraft import okeefe_values

from css_common.mission_section import MISSION
from css_common.random_streams import random_key
from css_sensors.cells import CELLS
from css_sim import cell_errors, cell_faults, cell_screen, sun_cells
from css_sim.fault_effects import NO_FAULTS
from css_sim.faults import rows

fraction = st.floats(0.0, 1.0)
anything = st.floats(allow_nan=True, allow_infinity=True)
lights = st.lists(st.one_of(st.floats(0.0, 2.0), anything), min_size=8, max_size=8)


@st.composite
def set_ups(draw):
    """Parameters, cells and faults with every effect possibly on."""
    low = draw(st.floats(-1.0, 0.5))
    own = sun_cells.PARAMETERS + cell_faults.PARAMETERS + cell_screen.PARAMETERS + cell_errors.PARAMETERS
    values = okeefe_values(
        MISSION + CELLS + own,
        warp=draw(st.booleans()),
        degradation=draw(fraction),
        degradation_mode=draw(st.sampled_from(["common", "per_cell"])),
        noise=draw(fraction),
        dropout=draw(fraction),
        output_low=low,
        output_high=low + draw(st.floats(0.1, 3.0)),
        bits=draw(st.integers(0, 16)),
        faults=draw(st.lists(st.sampled_from(["1 dead", "2 stuck 0.7", "3 noisy 0.5", "2 stuck -9.0"]), max_size=3)),
        random_faults__count=draw(st.integers(0, 8)),
        random_faults__kind=draw(st.sampled_from(["dead", "stuck", "mixed"])),
        random_faults__value=draw(st.sampled_from([-1.0, 0.0, 10.0])),
        scale_cell_error=draw(fraction),
        bias=draw(fraction),
        misalignment_deg=draw(st.floats(0.0, 45.0)),
    )
    nominal = cell_errors.nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    cells = nominal.copy()
    key = random_key(draw(st.integers(0, 99)), 0)
    cell_errors.draw_cells(cell_errors.error_model(values), key, nominal, cells)
    return sun_cells.parameters(values), cells, rows(cell_faults.case_faults(values, key))


@settings(max_examples=300, deadline=None)
@given(set_ups(), st.tuples(anything, anything, anything), anything, lights, st.integers(0, 2**31))
def test_outputs_are_numbers_inside_the_limits_and_flagged_at_the_top(set_up, sun_b, intensity, albedo, step):
    p, cells, faults = set_up
    voltages = np.full(8, math.nan)
    mask = sun_cells.sample(p, cells, faults, random_key(1, 0), step, sun_b, intensity, np.array(albedo), voltages)
    assert np.all(voltages >= p.output_low) and np.all(voltages <= p.output_high)
    top = p.output_high - ((p.output_high - p.output_low) / p.levels if p.levels else 0.0)
    for i, v in enumerate(voltages):
        assert bool(mask >> i & 1) == (v == top)
    if p.levels:
        codes = (voltages - p.output_low) / (p.output_high - p.output_low) * p.levels
        np.testing.assert_allclose(codes, np.round(codes), atol=1e-6)


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, math.pi), st.floats(-math.pi, math.pi), st.floats(0.0, 1.4), st.floats(0.01, 0.99))
def test_more_light_never_reads_less(polar, azimuth, intensity, part):
    # the warp of Eq. 16 rises with the output it bends, so the whole chain does
    values = okeefe_values(CELLS + sun_cells.PARAMETERS + cell_screen.PARAMETERS)
    p = sun_cells.parameters(values)
    cells = cell_errors.nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    sun_b = (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar))
    bright, dim = np.zeros(8), np.zeros(8)
    none, key = NO_FAULTS, random_key(1, 0)
    sun_cells.sample(p, cells, none, key, 3, sun_b, intensity, np.full(8, 0.1), bright)
    sun_cells.sample(p, cells, none, key, 3, sun_b, part * intensity, np.full(8, 0.1), dim)
    assert np.all(bright >= dim)
