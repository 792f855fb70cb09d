# SPDX-License-Identifier: Apache-2.0
"""Kalman filter on the Sun direction: prediction, update, constraint (O'Keefe & Schaub 2013, Eqs. 3-14).

The state is the unit vector sun_b, an update takes one cell at a time: cells err independently, so updates in
sequence equal the stacked one of the paper, without a matrix inverse.
"""

from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.vectors import Vec3, dot, multiply, norm, scale
from css_estimation.sun.cell_layout import CellLayout, cosine_on, half_view_of, informs, missing_cells, view_margin
from css_estimation.sun.left_open import surely_spans_space
from css_estimation.sun.lit_cells import Gate, lit_cells
from css_estimation.symmetric import Symmetric, add_outer, at_most, congruence, product, subtract_pair, trace

_NO_DIRECTION = 1e-6


@kernel
def propagate(
    sun_b: Vec3, covariance: Symmetric, omega_bn_b: Vec3, dt: float, process_noise: float
) -> tuple[Vec3, Symmetric]:
    """State and covariance after `dt` [s] at constant rate [rad/s], exactly (Eqs. 5, 7, 8)."""
    m = rotation_vector_to_dcm(scale(dt, omega_bn_b))
    p = congruence(m, covariance)
    q = process_noise * dt
    return multiply(m, sun_b), (p[0] + q, p[1], p[2], p[3] + q, p[4], p[5] + q)


@kernel
def update_cell(
    sun_b: Vec3, covariance: Symmetric, normal_b: Vec3, output: float, cell_variance: float
) -> tuple[Vec3, Symmetric, float]:
    """State and covariance after one cell, and its normalised innovation squared (Eqs. 9-14).

    Joseph form, (I - k n^T) P (I - k n^T)^T + R k k^T, multiplied out to P - k g^T - g k^T + S k k^T with
    g = P n and S = n^T g + R: symmetric by construction and of second order in an error of the gain.
    """
    p = covariance
    g = product(p, normal_b)
    s = dot(normal_b, g) + cell_variance
    inverse = 1.0 / s
    k = scale(inverse, g)
    # one factor of the symmetric pair: k g^T + g k^T - S k k^T = k h^T + h k^T
    h = (g[0] - 0.5 * s * k[0], g[1] - 0.5 * s * k[1], g[2] - 0.5 * s * k[2])
    innovation = output - dot(normal_b, sun_b)
    sun_b = (sun_b[0] + k[0] * innovation, sun_b[1] + k[1] * innovation, sun_b[2] + k[2] * innovation)
    return sun_b, subtract_pair(p, k, h), innovation * innovation * inverse


@kernel
def update_cells(
    layout: CellLayout,
    gate: Gate,
    cell_variance: float,
    beyond_edge: bool,
    doubt: float,
    sun_b: Vec3,
    covariance: Symmetric,
    voltages,
    top: int,
) -> tuple[Vec3, Symmetric, float, int, int]:
    """Updates with every cell that the propagated `sun_b` or the gate selects.

    Args:
        beyond_edge: where the lit cells do not span space, a dark one says that the Sun's cosine is below that at the
            edge of its view, or as far below zero: with a narrow view that is a variance beside that of the cell. Else
            it is zero, as for the paper's filter: what lit cells show, dark ones hold against the light of the Earth.
        doubt: of the Sun's cosine on a cell [-]: of a dark one that has it in view by less nothing is taken, with
            `beyond_edge`.
        top: result of `brightest`, which sees the Sun.

    Returns:
        state (not yet of unit length), covariance, NIS, its degrees of freedom, mask of the cells used.
    """
    cells = layout.cells
    level = gate.level * voltages[top]
    _, lit_mask = lit_cells(layout, gate, voltages, top)
    beyond_edge = beyond_edge and not surely_spans_space(cells, lit_mask)
    predicted_b, predicted_covariance = sun_b, covariance
    nis = 0.0
    mask = 0
    count = 0
    missing = missing_cells(voltages)
    for i in range(voltages.shape[0]):
        v = voltages[i]
        margin = view_margin(layout, i, predicted_covariance)
        if not informs(layout, i, v, level, lit_mask >> i & 1 == 1, predicted_b, margin, missing):
            continue
        variance = cell_variance
        if beyond_edge:
            edge = half_view_of(layout, i)
            # nearer to dark than to the least that it reads of a Sun in its view
            if v < 0.5 * edge and lit_mask >> i & 1 == 0:
                if cosine_on(layout, i, predicted_b) < edge + doubt:
                    continue
                variance += edge * edge / 3.0
        normal_b = (cells[i].nx, cells[i].ny, cells[i].nz)
        sun_b, covariance, q = update_cell(sun_b, covariance, normal_b, v, variance)
        nis += q
        mask |= 1 << i
        count += 1
    return sun_b, covariance, nis, count, mask


@kernel
def constrain(sun_b: Vec3, predicted_b: Vec3, covariance: Symmetric, largest_variance: float) -> tuple[Vec3, Symmetric]:
    """Unit state; covariance projected on the tangent plane, e^2/2 along the Sun line, bounded.

    A state that updates brought to nothing has no direction: the unit vector `predicted_b` takes its place.
    """
    length = norm(sun_b)
    sun_b = scale(1.0 / length, sun_b) if length > _NO_DIRECTION else predicted_b
    # T P T = P - s g^T - g s^T + (s g) s s^T with T = I - s s^T, g = P s
    g = product(covariance, sun_b)
    sg = dot(sun_b, g)
    h = (g[0] - 0.5 * sg * sun_b[0], g[1] - 0.5 * sg * sun_b[1], g[2] - 0.5 * sg * sun_b[2])
    tangent = trace(covariance) - sg
    # far from convergence e^2/2 means nothing, and no axis is more uncertain than the others
    along = 0.5 * min(tangent * tangent, tangent)
    p = add_outer(subtract_pair(covariance, sun_b, h), along, sun_b)
    return sun_b, at_most(p, largest_variance)
