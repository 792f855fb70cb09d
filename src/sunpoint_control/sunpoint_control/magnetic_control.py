# SPDX-License-Identifier: Apache-2.0
"""One cycle of the control with torque rods alone: motion of the field, mode, torque, dipoles.

    SAFE             commanded, or a Sun estimate that is no number: rods at rest
    DETUMBLE         body rate across the field above the threshold, or `law` is `detumble`: B-dot
    ECLIPSE          in the shadow: the spin is kept, or rods rest
    SUN_ACQUISITION  spin axis on its way to the Sun
    SUN_POINT        spin axis on the Sun

Rods and magnetometer share a cycle of measuring and acting: with `rest_before_measurement` the rods are off in the last
control cycle before a measurement is due, so that their field has died down when it is taken.

Without a field that is measured, and in the time until two measurements make a derivative, the rods rest.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from css_common.declared import builder, computed, made, part, table_of
from css_common.kernel import kernel
from css_common.schema import Values, choice, flag
from css_common.vectors import Vec3, angle_between, cross, norm
from sunpoint_control import field_motion, magnetic_spin, modes
from sunpoint_control.control_output import ControlOutput
from sunpoint_control.field_motion import FieldMotion, FieldMotionParameters, field_now, follow_field, usable
from sunpoint_control.held_field import HeldField
from sunpoint_control.magnetic_spin import SpinParameters, damping_torque, spin_torque
from sunpoint_control.modes import MODE_DETUMBLE, MODE_ECLIPSE, MODE_SAFE, ModeParameters, ModeState, next_mode
from sunpoint_control.plausible import LARGEST_DIRECTION, LARGEST_RATE, within
from sunpoint_control.torque_rods import TorqueRods, limit_dipoles, rod_dipoles, rod_torque
from sunpoint_control.wheel_tracks import ControlMemory, new_memory

# The numbers of css_msgs/SunEstimate.
_VALIDITY_VALID = 2
_RATE_GYRO = 1
_RATE_FIELD = 3

_SHORTEST = 1e-6  # [s] two measurements closer than that make no derivative

_ZERO: Vec3 = (0.0, 0.0, 0.0)

_REST = flag(
    "rest_before_measurement", False, "rods off in the control cycle before each measurement of the field is due"
)
_LAW = choice("law", "spin", ("spin", "detumble"), "spin about the Sun line once detumbled, or detumbling for good")


def _modes(values: Values) -> ModeParameters:
    """Modes without a search: rods cannot turn the body along a script, and the spin sweeps the sky."""
    return ModeParameters(
        enabled=values[modes.ENABLED],
        debounce=values[modes.DEBOUNCE],
        detumble_rate=math.radians(values[modes.DETUMBLE_RATE]),
        detumble_exit_rate=math.radians(values[modes.DETUMBLE_EXIT_RATE]),
        point_angle=math.radians(values[modes.POINT_ANGLE]),
        acquire_angle=math.radians(values[modes.ACQUIRE_ANGLE]),
        search_wait=math.inf,
        search_rate=0.0,
        search_phase_time=math.inf,
        search_lit_time=0.0,
    )


def _cycles_to_measurement(values: Values) -> int:
    """Control cycles after a measurement in which rods may act; at least the whole time without a rest."""
    divider = int(values.magnetometer.divider)
    return divider - 1 if values[_REST] else divider


class MagneticParameters(NamedTuple):
    """All of the control."""

    detumble_only: bool = made(lambda word: word == "detumble", _LAW)
    rate_of_estimator: bool = made(
        lambda word: word == "estimator",
        choice(
            "rate_from",
            "field",
            ("field", "estimator"),
            "body rate of the spin: from the motion of the field, or that of the Sun estimator where it has the whole",
        ),
    )
    coast_in_eclipse: bool = made(
        lambda word: word == "coast",
        choice("eclipse_behaviour", "spin", ("spin", "coast"), "in the shadow: keep the spin, or rods at rest"),
    )
    acting_cycles: int = computed(_cycles_to_measurement, _REST)
    modes: ModeParameters = computed(
        _modes,
        modes.ENABLED,
        modes.DEBOUNCE,
        modes.DETUMBLE_RATE,
        modes.DETUMBLE_EXIT_RATE,
        modes.POINT_ANGLE,
        modes.ACQUIRE_ANGLE,
    )
    motion: FieldMotionParameters = part(FieldMotionParameters)
    spin: SpinParameters = part(SpinParameters)
    rods: TorqueRods = part(TorqueRods)


PARAMETERS = table_of(MagneticParameters)
parameters = builder(MagneticParameters)


class MagneticState(NamedTuple):
    """Carried from cycle to cycle."""

    motion: FieldMotion
    since_measurement: int  # control cycles since the last measurement of the field
    torque_b: Vec3  # [N m] of the rods, in the cycle that begins
    modes: ModeState


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between parameters, one message each."""
    yield from modes.conflicts(values)
    yield from magnetic_spin.conflicts(values)
    if not values.rods.fitted:
        yield "rods.fitted: false, but the control turns the spacecraft with torque rods"
    if values[_REST] and values.magnetometer.divider < 2:
        yield (
            f"rest_before_measurement: true, but magnetometer.divider is {values.magnetometer.divider}: the field is "
            "measured in every control cycle, and the rods could never act; expected at least 2"
        )


def initial_state(p: MagneticParameters) -> MagneticState:
    """Nothing measured yet."""
    return MagneticState(field_motion.initial_state(), 0, _ZERO, modes.initial_state())


def initial_memory(p: MagneticParameters) -> ControlMemory:
    """None that it needs: rods are not judged."""
    return new_memory(0)


@kernel
def step(
    p: MagneticParameters,
    state: MagneticState,
    memory: ControlMemory,
    dt: float,
    sun_b: Vec3,
    validity: int,
    eclipse: int,
    omega_bn_b: Vec3,
    rate_source: int,
    wheel_speeds,
    field: HeldField,
    torque_out,
    dipole_out,
) -> tuple[MagneticState, ControlOutput]:
    """One cycle; arguments in `sunpoint_control.control_algorithm`. Wheels are left alone."""
    dt = dt if _SHORTEST <= dt < math.inf else 0.0
    motion = follow_field(p.motion, state.motion, dt, field, state.torque_b)
    since = 0 if field.fresh else state.since_measurement + 1
    inputs_ok = within(sun_b, LARGEST_DIRECTION) and within(omega_bn_b, LARGEST_RATE)
    # a direction that is held turns with the body, and would lead the spin axis astray
    sun_known = inputs_ok and validity == _VALIDITY_VALID and not p.detumble_only
    error = angle_between(sun_b, p.spin.array_normal_b) if sun_known else -1.0
    whole = p.rate_of_estimator and inputs_ok and rate_source in (_RATE_GYRO, _RATE_FIELD)
    rate_b = omega_bn_b if whole else motion.omega_bn_b
    rate = norm(rate_b)
    mode_state = next_mode(p.modes, state.modes, dt, inputs_ok, sun_known, eclipse != 0, error, rate, motion.known)
    mode = mode_state.mode

    wanted_b = _ZERO
    if mode != MODE_SAFE and motion.known and usable(field):
        if p.detumble_only or mode == MODE_DETUMBLE:
            wanted_b = damping_torque(p.spin, cross(motion.derivative_b, motion.measured_b))
        elif mode != MODE_ECLIPSE or not p.coast_in_eclipse:
            wanted_b = spin_torque(p.spin, sun_b, sun_known and mode != MODE_ECLIPSE, rate_b)
    rods_saturated = 0
    torque_b = _ZERO
    dipole_out[:] = 0.0
    if since < p.acting_cycles:
        field_b = field_now(motion)
        rod_dipoles(p.rods.axes_b, wanted_b, field_b, dipole_out)
        rods_saturated = limit_dipoles(p.rods.max_dipoles, dipole_out)
        torque_b = rod_torque(p.rods.axes_b, dipole_out, field_b)
    output = ControlOutput(
        torque_b,
        _ZERO,
        _ZERO,
        error,
        rate,
        mode,
        mode_state.reason,
        False,
        False,
        0,
        rods_saturated,
        wheels_isolated=0,
        rods_isolated=0,
    )
    return MagneticState(motion, since, torque_b, mode_state), output
