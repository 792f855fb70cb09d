# SPDX-License-Identifier: Apache-2.0
"""Attitude kinematics in modified Rodrigues parameters (MRP), after Schaub & Junkins.

`sigma_bn` is the attitude of frame b relative to n, `dcm_bn` the matrix that turns components in n into
components in b. Quaternions are scalar-last and here mean the same rotation as `sigma_bn`: A(q) = dcm_bn.
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, cross, dot, scale

Quat = tuple[float, float, float, float]


@kernel
def mrp_to_dcm(sigma_bn: Vec3) -> Mat3:
    """Direction cosine matrix dcm_bn of an MRP set (Schaub & Junkins, Eq. 3.152)."""
    s1, s2, s3 = sigma_bn
    q1, q2, q3 = s1 * s1, s2 * s2, s3 * s3
    s = q1 + q2 + q3
    d = 1.0 - s
    f = 1.0 / ((1.0 + s) * (1.0 + s))
    return (
        (
            (4.0 * (q1 - q2 - q3) + d * d) * f,
            (8.0 * s1 * s2 + 4.0 * s3 * d) * f,
            (8.0 * s1 * s3 - 4.0 * s2 * d) * f,
        ),
        (
            (8.0 * s2 * s1 - 4.0 * s3 * d) * f,
            (4.0 * (-q1 + q2 - q3) + d * d) * f,
            (8.0 * s2 * s3 + 4.0 * s1 * d) * f,
        ),
        (
            (8.0 * s3 * s1 + 4.0 * s2 * d) * f,
            (8.0 * s3 * s2 - 4.0 * s1 * d) * f,
            (4.0 * (-q1 - q2 + q3) + d * d) * f,
        ),
    )


@kernel
def dcm_to_quaternion(dcm: Mat3) -> Quat:
    """Unit quaternion (scalar last, non-negative) of dcm_bn by Sheppard's method: never divides by a small number."""
    trace = dcm[0][0] + dcm[1][1] + dcm[2][2]
    b1 = 1.0 + 2.0 * dcm[0][0] - trace
    b2 = 1.0 + 2.0 * dcm[1][1] - trace
    b3 = 1.0 + 2.0 * dcm[2][2] - trace
    b4 = 1.0 + trace
    largest = max(max(b1, b2), max(b3, b4))
    if largest == b4:
        q4 = 0.5 * math.sqrt(b4)
        k = 0.25 / q4
        return (k * (dcm[1][2] - dcm[2][1]), k * (dcm[2][0] - dcm[0][2]), k * (dcm[0][1] - dcm[1][0]), q4)
    if largest == b1:
        q = 0.5 * math.sqrt(b1)
        k = 0.25 / q
        x, y, z, w = q, k * (dcm[0][1] + dcm[1][0]), k * (dcm[2][0] + dcm[0][2]), k * (dcm[1][2] - dcm[2][1])
    elif largest == b2:
        q = 0.5 * math.sqrt(b2)
        k = 0.25 / q
        x, y, z, w = k * (dcm[0][1] + dcm[1][0]), q, k * (dcm[1][2] + dcm[2][1]), k * (dcm[2][0] - dcm[0][2])
    else:
        q = 0.5 * math.sqrt(b3)
        k = 0.25 / q
        x, y, z, w = k * (dcm[2][0] + dcm[0][2]), k * (dcm[1][2] + dcm[2][1]), q, k * (dcm[0][1] - dcm[1][0])
    if w < 0.0:
        return (-x, -y, -z, -w)
    return (x, y, z, w)


@kernel
def quaternion_to_mrp(q: Quat) -> Vec3:
    """MRP set with |sigma| <= 1 of a unit quaternion (scalar last)."""
    sign = 1.0 if q[3] >= 0.0 else -1.0
    k = sign / (1.0 + sign * q[3])
    return (k * q[0], k * q[1], k * q[2])


@kernel
def mrp_to_quaternion(sigma_bn: Vec3) -> Quat:
    """Unit quaternion (scalar last) of an MRP set."""
    s = dot(sigma_bn, sigma_bn)
    k = 2.0 / (1.0 + s)
    return (k * sigma_bn[0], k * sigma_bn[1], k * sigma_bn[2], (1.0 - s) / (1.0 + s))


@kernel
def dcm_to_mrp(dcm_bn: Mat3) -> Vec3:
    """MRP set with |sigma| <= 1 of a direction cosine matrix."""
    return quaternion_to_mrp(dcm_to_quaternion(dcm_bn))


@kernel
def mrp_shadow(sigma_bn: Vec3) -> Vec3:
    """The one of the two equivalent MRP sets with |sigma| <= 1."""
    s = dot(sigma_bn, sigma_bn)
    if s > 1.0:
        return scale(-1.0 / s, sigma_bn)
    return sigma_bn


@kernel
def mrp_add(sigma_bn: Vec3, sigma_fb: Vec3) -> Vec3:
    """Attitude sigma_fn of first `sigma_bn`, then `sigma_fb`, with |sigma| <= 1 (Schaub & Junkins, Eq. 3.157)."""
    a, b = sigma_bn, sigma_fb
    a2, b2 = dot(a, a), dot(b, b)
    denominator = 1.0 + a2 * b2 - 2.0 * dot(a, b)
    if denominator < 0.1:
        # the sum is near a full turn, where this set is singular and its shadow is not
        a = scale(-1.0 / a2, a)
        a2 = 1.0 / a2
        denominator = 1.0 + a2 * b2 - 2.0 * dot(a, b)
    c = cross(b, a)
    k = 1.0 / denominator
    return mrp_shadow(
        (
            k * ((1.0 - a2) * b[0] + (1.0 - b2) * a[0] - 2.0 * c[0]),
            k * ((1.0 - a2) * b[1] + (1.0 - b2) * a[1] - 2.0 * c[1]),
            k * ((1.0 - a2) * b[2] + (1.0 - b2) * a[2] - 2.0 * c[2]),
        )
    )


@kernel
def mrp_subtract(sigma_bn: Vec3, sigma_rn: Vec3) -> Vec3:
    """Attitude sigma_br of b relative to r, with |sigma| <= 1."""
    return mrp_add((-sigma_rn[0], -sigma_rn[1], -sigma_rn[2]), sigma_bn)


@kernel
def mrp_rate(sigma_bn: Vec3, omega_bn_b: Vec3) -> Vec3:
    """Time derivative of the MRP set [1/s]: 1/4 [(1 - s.s) I + 2 [s x] + 2 s s^T] omega."""
    s, w = sigma_bn, omega_bn_b
    k = 0.25 * (1.0 - dot(s, s))
    p = 0.5 * dot(s, w)
    c = cross(s, w)
    return (
        k * w[0] + 0.5 * c[0] + p * s[0],
        k * w[1] + 0.5 * c[1] + p * s[1],
        k * w[2] + 0.5 * c[2] + p * s[2],
    )


@kernel
def rotation_vector_to_dcm(phi: Vec3) -> Mat3:
    """exp(-[phi x]): the frame turned by the angle |phi| [rad] about phi (Rodrigues), exact also for tiny angles."""
    angle2 = dot(phi, phi)
    angle = math.sqrt(angle2)
    if angle < 1e-4:
        a = 1.0 - angle2 / 6.0
        b = 0.5 - angle2 / 24.0
    else:
        a = math.sin(angle) / angle
        b = (1.0 - math.cos(angle)) / angle2
    x, y, z = phi
    return (
        (1.0 - b * (y * y + z * z), b * x * y + a * z, b * x * z - a * y),
        (b * x * y - a * z, 1.0 - b * (x * x + z * z), b * y * z + a * x),
        (b * x * z + a * y, b * y * z - a * x, 1.0 - b * (x * x + y * y)),
    )


@kernel
def rotation_vector_to_mrp(phi: Vec3) -> Vec3:
    """MRP set with |sigma| <= 1 of the frame turned by the angle |phi| [rad] about phi, exact also for tiny angles."""
    angle2 = dot(phi, phi)
    if angle2 < 1e-8:
        return scale(0.25 + angle2 / 192.0, phi)
    angle = math.sqrt(angle2)
    # whole turns are none
    least = angle - 2.0 * math.pi * math.floor(0.5 * angle / math.pi + 0.5)
    return scale(math.tan(0.25 * least) / angle, phi)


@kernel
def mrp_angle(sigma_bn: Vec3) -> float:
    """Angle [rad], 0 to pi, of the rotation from n to b."""
    s = math.sqrt(dot(sigma_bn, sigma_bn))
    angle = 4.0 * math.atan(s)
    return angle if angle <= math.pi else 2.0 * math.pi - angle


@kernel
def mrp_to_rotation_vector(sigma_bn: Vec3) -> Vec3:
    """Rotation vector [rad], of length up to pi, of an MRP set with |sigma| <= 1."""
    s = math.sqrt(dot(sigma_bn, sigma_bn))
    return scale(4.0 * math.atan(s) / s if s > 1e-8 else 4.0, sigma_bn)
