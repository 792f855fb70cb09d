# SPDX-License-Identifier: Apache-2.0
"""The truth of a table line by line as the message `truth` has it, and which parts of it are known.

Where no attitude is known, body and inertial frame are taken for one, so that the Sun direction in the body is the one
of the table; what is not known is zero, and `TrueStates.known` does not name it.
"""

from dataclasses import dataclass

import numpy as np

from css_common.attitude import mrp_to_dcm
from css_common.kernel import kernel
from css_common.vectors import multiply, row, transpose
from css_environment.constants import ASTRONOMICAL_UNIT
from css_environment.eclipse import conical_illumination
from css_environment.sun import sun_positions
from css_telemetry.telemetry import Telemetry

SUN, ATTITUDE, RATE, POSITION, ILLUMINATION = "sun", "attitude", "rate", "position", "illumination"


@dataclass
class TrueStates:
    """Fields of `css_msgs/SpacecraftState` of the K lines that have a truth.

    Attributes:
        rows: (K,) lines.
        known: which parts are known; of the others the fields are zero, of the illumination one.
        sun_n, sigma_bn, omega_bn_b, r_n, v_n: (K, 3).
        flux, illumination: (K,).
    """

    rows: np.ndarray
    known: tuple[str, ...]
    sun_n: np.ndarray
    sigma_bn: np.ndarray
    omega_bn_b: np.ndarray
    r_n: np.ndarray
    v_n: np.ndarray
    flux: np.ndarray
    illumination: np.ndarray


def true_states(telemetry: Telemetry) -> TrueStates | None:
    """The truth of the lines that have one; None: the table has none."""
    truth = telemetry.truth
    if truth.sun_b is None and truth.sigma_bn is None:
        return None
    count = len(telemetry.stamps_ns)
    there = np.ones(count, np.bool_)
    if truth.sigma_bn is not None:
        there &= np.isfinite(truth.sigma_bn).all(axis=1)
    else:
        assert truth.sun_b is not None
        there &= np.isfinite(truth.sun_b).all(axis=1)
    rows = np.flatnonzero(there)
    known = [SUN] if truth.sigma_bn is None else [SUN, ATTITUDE]
    sigma = np.zeros((len(rows), 3)) if truth.sigma_bn is None else truth.sigma_bn[rows]
    r_n, v_n = _place(telemetry, rows)
    if r_n is not None:
        known.append(POSITION)
    sun_position = sun_positions(
        int(telemetry.stamps_ns[0]), (telemetry.stamps_ns[rows] - telemetry.stamps_ns[0]) * 1e-9
    )
    line = sun_position if r_n is None else sun_position - r_n
    distance = np.linalg.norm(line, axis=1)
    sun_n = _sun_n(telemetry, rows, sigma, line / distance[:, np.newaxis])
    omega = np.zeros((len(rows), 3))
    if truth.omega_bn_b is not None and np.isfinite(truth.omega_bn_b[rows]).all():
        known.append(RATE)
        omega = truth.omega_bn_b[rows]
    illumination, is_known = _illumination(telemetry, rows, r_n, sun_n, distance)
    if is_known:
        known.append(ILLUMINATION)
    zeros = np.zeros((len(rows), 3))
    flux = (ASTRONOMICAL_UNIT / distance) ** 2 if ATTITUDE in known else np.ones(len(rows))
    return TrueStates(
        rows,
        tuple(known),
        sun_n,
        sigma,
        omega,
        zeros if r_n is None else r_n,
        zeros if v_n is None else v_n,
        flux,
        illumination,
    )


def _place(telemetry: Telemetry, rows: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Positions and velocities, where all are known; n is n only where the attitude is known."""
    place = telemetry.truth.place
    if place is None or telemetry.truth.sigma_bn is None or not np.isfinite(place.r_n[rows]).all():
        return None, None
    return place.r_n[rows], place.v_n[rows] if np.isfinite(place.v_n[rows]).all() else None


def _sun_n(telemetry: Telemetry, rows: np.ndarray, sigma: np.ndarray, ephemeris: np.ndarray) -> np.ndarray:
    """The Sun in n: that of the table turned by its attitude, else the direction that was told, else the ephemeris."""
    form, truth = telemetry.description.truth, telemetry.truth
    told = form.sun_inertial if form is not None else None
    sun_n = np.broadcast_to(told, ephemeris.shape).copy() if told is not None else ephemeris.copy()
    if truth.sun_b is not None:
        has = np.isfinite(truth.sun_b[rows]).all(axis=1)
        turned = np.zeros_like(sun_n)
        _turned_to_n(sigma, np.where(has[:, np.newaxis], truth.sun_b[rows], 0.0), turned)
        sun_n[has] = turned[has]
    return sun_n


def _illumination(
    telemetry: Telemetry, rows: np.ndarray, r_n: np.ndarray | None, sun_n: np.ndarray, distance: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Fraction of the solar disc in view, and whether it is known; of a place on an orbit by the Earth's shadow."""
    given = telemetry.truth.illumination
    if given is not None:
        return np.where(np.isnan(given[rows]), 1.0, given[rows]), bool(np.isfinite(given[rows]).all())
    if r_n is None:
        return np.ones(len(rows)), False
    illumination = np.empty(len(rows))
    _shadow(r_n, sun_n, distance, illumination)
    return illumination, True


@kernel
def _turned_to_n(sigma_bn, vectors_b, vectors_n_out) -> None:
    for i in range(sigma_bn.shape[0]):
        v = multiply(transpose(mrp_to_dcm(row(sigma_bn, i))), row(vectors_b, i))
        vectors_n_out[i, 0], vectors_n_out[i, 1], vectors_n_out[i, 2] = v


@kernel
def _shadow(r_n, sun_n, distance, illumination_out) -> None:
    for i in range(r_n.shape[0]):
        illumination_out[i] = conical_illumination(row(r_n, i), row(sun_n, i), distance[i])


def sun_b_of(states: TrueStates) -> np.ndarray:
    """(K, 3) directions to the Sun in b."""
    sun_b = np.empty_like(states.sun_n)
    _turned_to_b(states.sigma_bn, states.sun_n, sun_b)
    return sun_b


@kernel
def _turned_to_b(sigma_bn, vectors_n, vectors_b_out) -> None:
    for i in range(sigma_bn.shape[0]):
        v = multiply(mrp_to_dcm(row(sigma_bn, i)), row(vectors_n, i))
        vectors_b_out[i, 0], vectors_b_out[i, 1], vectors_b_out[i, 2] = v
