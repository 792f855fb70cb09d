# SPDX-License-Identifier: Apache-2.0
"""One cycle of the Sun-pointing control: mode, torque, allocation to the wheels, momentum dumping.

Whatever the mode, a cycle without information about the body rate asks for no torque: turning blindly does
more harm than coasting.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from css_common.declared import builder, made, part, table_of
from css_common.kernel import kernel
from css_common.schema import Values, choice
from css_common.vectors import Vec3, add, cross, multiply, norm, scale, subtract
from sunpoint_control import modes, wheel_tracks
from sunpoint_control.control_output import ControlOutput
from sunpoint_control.health_parameters import HealthParameters
from sunpoint_control.held_field import HeldField
from sunpoint_control.modes import (
    MODE_DETUMBLE,
    MODE_ECLIPSE,
    MODE_SAFE,
    MODE_SUN_SEARCH,
    REASON_FAULT,
    ModeParameters,
    ModeState,
    next_mode,
    search_rate,
)
from sunpoint_control.momentum_dumping import ENABLED, DumpingParameters, add_dumping
from sunpoint_control.mrp_sun_pointing import (
    PointingParameters,
    damping_torque,
    error_mrp,
    integrate_error,
    spin_reference,
    tracking_torque,
)
from sunpoint_control.plausible import LARGEST_DIRECTION, LARGEST_FIELD, LARGEST_RATE, within
from sunpoint_control.reallocation import acts_across, reallocate
from sunpoint_control.torque_rods import rod_torque
from sunpoint_control.wheel_allocation import WHEELS_OUT, AllocationParameters, allocate, limit_torques, wheel_momentum
from sunpoint_control.wheel_health import (
    all_as_built,
    follow_health,
    note_commands,
    out_of_use,
    speeds_taken,
    uncommanded_torque,
)
from sunpoint_control.wheel_tracks import ControlMemory
from sunpoint_control.wheel_trials import add_trials

# The numbers of css_msgs/SunEstimate.
_VALIDITY_NONE = 0
_VALIDITY_VALID = 2
_RATE_NONE = 0
_RATE_GYRO = 1

_ECLIPSE = {"coast": 0, "rate_damp": 1, "hold_attitude": 2}
_COAST = _ECLIPSE["coast"]
_HOLD = _ECLIPSE["hold_attitude"]

_LARGEST_SPEED = 1e6  # [rad/s] beyond it a reading is a fault

_ZERO: Vec3 = (0.0, 0.0, 0.0)


class ControlParameters(NamedTuple):
    """All of the control."""

    pointing: PointingParameters = part(PointingParameters)
    eclipse_behaviour: int = made(
        _ECLIPSE.__getitem__,
        choice(
            "eclipse_behaviour",
            "rate_damp",
            tuple(_ECLIPSE),
            "in the shadow: no torque, rate damping, or pointing at the propagated Sun",
            tunable=True,
        ),
    )
    allocation: AllocationParameters = part(AllocationParameters)
    modes: ModeParameters = part(ModeParameters)
    dumping: DumpingParameters = part(DumpingParameters)
    health: HealthParameters = part(HealthParameters)


PARAMETERS = table_of(ControlParameters)
parameters = builder(ControlParameters)


class ControlState(NamedTuple):
    """Carried from cycle to cycle."""

    integral: Vec3  # [N m s] K int(sigma_br) dt
    spin: float  # [rad/s] rate of the reference about the Sun line
    modes: ModeState


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between parameters, one message each."""
    yield from modes.conflicts(values)
    if not values.wheels.fitted:
        yield "wheels.fitted: false, but the control turns the spacecraft with its wheels"
    count = len(values.wheels.axes)
    for index in values[WHEELS_OUT]:
        if index >= count:
            yield f"wheels_out: wheel {index} given, the mission has wheels 0 to {count - 1}"
    if values[ENABLED] and not values.rods.fitted:
        yield "dumping.enabled: true, but rods.fitted says that the spacecraft has no torque rods"


def initial_state(p: ControlParameters) -> ControlState:
    """No error integrated yet, acquiring the Sun."""
    return ControlState(_ZERO, 0.0, modes.initial_state())


def initial_memory(p: ControlParameters) -> ControlMemory:
    """All wheels as they were built."""
    return wheel_tracks.new_memory(len(p.allocation.wheels))


@kernel
def step(
    p: ControlParameters,
    state: ControlState,
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
) -> tuple[ControlState, ControlOutput]:
    """One cycle.

    Args:
        dt: time since the last cycle [s].
        sun_b, validity, eclipse, omega_bn_b, rate_source: fields of the Sun estimate.
        wheel_speeds: (n,) relative to the body [rad/s].
        memory: what is known of the wheels, changed.
        field: the measured magnetic field.
        torque_out: (n,) motor torques [N m], written.
        dipole_out: (m,) rod dipoles [A m^2], written; may be empty without rods.
    """
    dt = dt if 0.0 < dt < math.inf else 0.0
    inputs_ok = (
        within(sun_b, LARGEST_DIRECTION) and within(omega_bn_b, LARGEST_RATE) and within(wheel_speeds, _LARGEST_SPEED)
    )
    sigma_br = _ZERO
    error = -1.0
    rate = 0.0
    momentum_b = _ZERO
    allocation = p.allocation
    isolated, spanned, as_built = 0, 3, True
    if inputs_ok:
        rate = norm(omega_bn_b)
        if p.health.enabled:
            follow_health(p.health, allocation.wheels, memory, dt, wheel_speeds, omega_bn_b, rate_source == _RATE_GYRO)
        speeds_taken(memory, wheel_speeds)
        momentum_b = wheel_momentum(allocation.wheels, memory.speeds, omega_bn_b)
        if validity != _VALIDITY_NONE:
            sigma_br, error = error_mrp(sun_b, p.pointing.axis_b)
    else:
        memory.body[0].running = 0
    if p.health.enabled and not all_as_built(memory):
        as_built = False
        isolated = out_of_use(memory)
        spanned = reallocate(p.allocation.wheels, isolated, memory.tracks, memory.allocation)
        allocation = AllocationParameters(p.allocation.keep_direction, memory.allocation)
    rate_known = inputs_ok and rate_source != _RATE_NONE
    mode_state = next_mode(
        p.modes,
        state.modes,
        dt,
        inputs_ok,
        inputs_ok and validity == _VALIDITY_VALID,
        eclipse != 0,
        error,
        rate,
        rate_known,
        spanned < 2,
    )
    mode = mode_state.mode

    torque_b = _ZERO
    z = state.integral
    spin = state.spin
    deadband = False
    feedback = False
    if rate_known and mode != MODE_SAFE:
        attitude_known = error >= 0.0 and mode != MODE_DETUMBLE and mode != MODE_SUN_SEARCH
        if mode == MODE_ECLIPSE:
            attitude_known = attitude_known and p.eclipse_behaviour == _HOLD
        if attitude_known:
            reference, spin = spin_reference(p.pointing, sun_b, state.spin, dt)
            if error < p.pointing.deadband:
                deadband = True
                if p.pointing.damp_in_deadband:
                    torque_b = damping_torque(p.pointing, omega_bn_b, reference.omega_rn_b)
            else:
                feedback = True
                torque_b, z = tracking_torque(p.pointing, sigma_br, omega_bn_b, state.integral, momentum_b, reference)
        elif mode == MODE_SUN_SEARCH:
            wanted_rate = search_rate(p.modes, mode_state.search_time)
            torque_b = damping_torque(p.pointing, omega_bn_b, wanted_rate)
        elif mode != MODE_ECLIPSE or p.eclipse_behaviour != _COAST:
            # in the shadow a spin goes on about the axis that was on the Sun
            spinning = mode == MODE_ECLIPSE and spin != 0.0
            wanted_rate = scale(spin, p.pointing.axis_b) if spinning else _ZERO
            torque_b = damping_torque(p.pointing, omega_bn_b, wanted_rate)

    allocated_b = torque_b
    if isolated != 0 and rate_known and mode != MODE_SAFE:
        allocated_b = subtract(torque_b, uncommanded_torque(memory, p.allocation.wheels))
    if spanned == 2 and rate_known and mode != MODE_SAFE and acts_across(allocation.wheels, p.pointing.axis_b):
        # the body may go on turning about that axis, and the momentum of the wheels must not turn with it
        turning = add(multiply(p.pointing.inertia_b, omega_bn_b), momentum_b)
        allocated_b = add(allocated_b, cross(omega_bn_b, turning))
    allocate(allocation, allocated_b, torque_out)
    wheels_saturated = limit_torques(allocation, torque_out)
    integral = state.integral
    if feedback and wheels_saturated == 0:
        # held in the deadband, in the shadow and at a torque limit: what cannot act must not wind up
        integral = integrate_error(p.pointing, integral, sigma_br, dt)

    rods_saturated = 0
    dumping = False
    dipole_out[:] = 0.0
    allowed = mode == MODE_ECLIPSE or (mode != MODE_SAFE and not p.dumping.in_eclipse_only)
    if p.dumping.enabled and allowed and field.valid and inputs_ok and within(field.field_b, LARGEST_FIELD):
        rods_saturated, dumping = add_dumping(
            p.dumping, allocation, memory.speeds, field.field_b, torque_out, dipole_out
        )
    if p.health.enabled:
        if not as_built and (mode != MODE_SAFE or mode_state.reason == REASON_FAULT):
            add_trials(memory, torque_out)
        rods_b = rod_torque(p.dumping.rods.axes_b, dipole_out, field.field_b) if dumping else _ZERO
        note_commands(memory, torque_out, rods_b)
    output = ControlOutput(
        torque_b,
        z,
        momentum_b,
        error,
        rate,
        mode,
        mode_state.reason,
        deadband,
        dumping,
        wheels_saturated,
        rods_saturated,
        wheels_isolated=isolated,
        rods_isolated=0,
    )
    return ControlState(integral, spin, mode_state), output
