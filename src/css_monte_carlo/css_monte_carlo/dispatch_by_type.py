# SPDX-License-Identifier: Apache-2.0
"""One compiled loop for every estimator, with control or without: types of parameters say what is called.

As for Sun estimators alone (`css_estimation.sun.heading_dispatch`). None in the place of parameters is a part that a
flight does not have: nothing is compiled for it. Running sums name their module in the same way.
"""

from numba.extending import overload

from css_estimation.sun.heading_dispatch import home_of
from css_monte_carlo.health_tallies import NO_ACTUATORS_LEFT, ActuatorsLeft
from css_monte_carlo.surroundings import references_at


def estimate_attitude(p, state, memory, dt, voltages, aiding, around, k):
    """State and `AttitudeSolution` after one cycle of an attitude filter.

    Args:
        p, state, memory, dt, voltages: as of `css_estimation.attitude.attitude_ekf.step`.
        aiding: `Aiding`, with the field if it was measured in this cycle; an algorithm with `AIDED_BY_SKY` has no more.
        around: `Surroundings`, with what the filter's own models say.
        k: row of the cycle in them.
    """
    return _attitude_step(home_of(p))(p, state, memory, dt, voltages, aiding, around, k)


def command(p, state, memory, dt, heading, speeds, field, torque_out, dipole_out):
    """State after one cycle of a control law, and `ActuatorsLeft`; without control, commands stay as they are.

    Args:
        heading: `SunHeading`.
        p, memory, speeds, field, torque_out, dipole_out: as in `sunpoint_control.control_algorithm`.
    """
    return _control_step(home_of(p))(p, state, memory, dt, heading, speeds, field, torque_out, dipole_out)


def tally(tallies, c, step, marks, truth, heading, attitude, memory, left):
    """Counts one step of case `c`; arguments as of `tally_step` in the module of the sums."""
    _tally_step(home_of(tallies))(tallies, c, step, marks, truth, heading, attitude, memory, left)


def note_estimate(tallies, heading, attitude, out):
    """Writes what a trace keeps of the measured estimate, as `ESTIMATE_COLUMNS` of the module of the sums says."""
    _note(home_of(tallies))(tallies, heading, attitude, out)


@overload(estimate_attitude, jit_options={"forceinline": True})
def _overload_attitude(p, state, memory, dt, voltages, aiding, around, k):
    return _attitude_step(home_of(p))


def _attitude_step(home):
    if home is None:
        return lambda p, state, memory, dt, voltages, aiding, around, k: (None, None)
    step = home.step
    if getattr(home, "AIDED_BY_SKY", False):
        return lambda p, state, memory, dt, voltages, aiding, around, k: step(p, state, memory, dt, voltages, aiding)

    def call(p, state, memory, dt, voltages, aiding, around, k):
        light = around.predicted_light[min(k, around.predicted_light.shape[0] - 1)]
        return step(
            p,
            state,
            memory,
            dt,
            voltages,
            aiding.gyro_b,
            aiding.gyro_valid,
            aiding.field_b,
            aiding.field_valid,
            references_at(around.references, k),
            light,
        )

    return call


@overload(command, jit_options={"forceinline": True})
def _overload_command(p, state, memory, dt, heading, speeds, field, torque_out, dipole_out):
    return _control_step(home_of(p))


def _control_step(home):
    if home is None:
        return lambda p, state, memory, dt, heading, speeds, field, torque_out, dipole_out: (None, NO_ACTUATORS_LEFT)
    step = home.step

    def call(p, state, memory, dt, heading, speeds, field, torque_out, dipole_out):
        after, output = step(
            p,
            state,
            memory,
            dt,
            heading.sun_b,
            heading.validity,
            heading.eclipse,
            heading.omega_bn_b,
            heading.rate_source,
            speeds,
            field,
            torque_out,
            dipole_out,
        )
        return after, ActuatorsLeft(output.wheels_isolated, output.rods_isolated)

    return call


@overload(tally, jit_options={"forceinline": True})
def _overload_tally(tallies, c, step, marks, truth, heading, attitude, memory, left):
    return _tally_step(home_of(tallies))


def _tally_step(home):
    tally_step = home.tally_step

    def call(tallies, c, step, marks, truth, heading, attitude, memory, left):
        tally_step(tallies, c, step, marks, truth, heading, attitude, memory, left)

    return call


@overload(note_estimate, jit_options={"forceinline": True})
def _overload_note(tallies, heading, attitude, out):
    return _note(home_of(tallies))


def _note(home):
    note = home.note_estimate

    def call(tallies, heading, attitude, out):
        note(heading, attitude, out)

    return call
