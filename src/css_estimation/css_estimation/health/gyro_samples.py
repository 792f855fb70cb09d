# SPDX-License-Identifier: Apache-2.0
"""The samples of all three axes of a gyro: which rate to go on with, and which axis fails by what it reads alone."""

from css_common.health import (
    EVIDENCE_NOISE,
    EVIDENCE_RANGE,
    EVIDENCE_STUCK,
    KIND_DEAD,
    KIND_FROZEN,
    KIND_INTERMITTENT,
    KIND_NOISY,
    KIND_SPIKES,
    KIND_STUCK,
    KIND_UNKNOWN,
    hold,
    rename,
)
from css_common.kernel import kernel
from css_common.vectors import Vec3, norm
from css_estimation.health.rate_checks import (
    MOST_REFUSED,
    SAMPLE_JUMPED,
    SAMPLE_NOISY,
    SAMPLE_RANGE,
    SAMPLE_SPIKY,
    SAMPLE_STUCK,
    RateChecks,
    check_sample,
    has_noise,
    longest_run,
    restless,
    step_seen,
)

_SPELLS = 2  # of zeros that make an axis an intermittent one

READING_GOOD, READING_JUMPED, READING_ABSENT, READING_FAILED = range(4)


@kernel
def _kind(p: RateChecks, axis, status: int) -> int:
    if status == SAMPLE_STUCK:
        if axis.raw == 0.0:
            return KIND_INTERMITTENT if axis.zeros >= _SPELLS else KIND_DEAD
        return KIND_STUCK if axis.came_by_jump != 0 else KIND_FROZEN
    if status == SAMPLE_SPIKY:
        # between spikes the samples are as they should be
        return KIND_NOISY if restless(p, axis) else KIND_SPIKES
    return KIND_NOISY if status == SAMPLE_NOISY else KIND_UNKNOWN


@kernel
def _accuse(p: RateChecks, axis, row, status: int, step: int, resolution: float) -> None:
    """Holds an axis for failed by its samples, or names anew what has failed already."""
    kind = _kind(p, axis, status)
    if row.held != 0:
        if row.kind != kind:
            rename(row, kind)
    elif status == SAMPLE_STUCK:
        hold(
            row, kind, EVIDENCE_STUCK, float(axis.equal), float(longest_run(p, axis, resolution) - 1), step - axis.equal
        )
    elif status == SAMPLE_RANGE:
        hold(row, kind, EVIDENCE_RANGE, axis.gap, p.patience, step)
    elif status == SAMPLE_SPIKY:
        hold(row, kind, EVIDENCE_NOISE, axis.refused, MOST_REFUSED, step)
    else:
        hold(row, kind, EVIDENCE_NOISE, axis.change / p.difference, p.largest_change, step)


@kernel
def check_samples(p: RateChecks, axes, verdicts, dt: float, step: int, gyro_b: Vec3, rate_b: Vec3) -> tuple[Vec3, int]:
    """The rate to go on with [rad/s], and what is to be thought of the reading.

    Args:
        axes: (3,) of GYRO_AXIS, advanced.
        verdicts: (3,) of VERDICT; an axis whose samples cannot be is held for failed.
        dt: [s] since the last reading.
        gyro_b: the reading.
        rate_b: last good one.

    Returns:
        The reading, with the last good value where a spike or no number was; READING_*.
    """
    speed, resolution = norm(rate_b), step_seen(axes)
    reading = READING_GOOD
    for i in range(3):
        status = check_sample(p, axes[i], dt, gyro_b[i], speed, resolution)
        if status == SAMPLE_JUMPED:
            reading = max(reading, READING_JUMPED)
        elif status == SAMPLE_RANGE and (axes[i].seen == 0 or axes[i].gap <= p.patience):
            reading = max(reading, READING_ABSENT if axes[i].seen == 0 else READING_GOOD)
        elif status == SAMPLE_STUCK and not has_noise(axes):
            continue
        elif status in (SAMPLE_STUCK, SAMPLE_RANGE, SAMPLE_SPIKY, SAMPLE_NOISY):
            reading = READING_FAILED
            _accuse(p, axes[i], verdicts[i], status, step, resolution)
    return (axes[0].good, axes[1].good, axes[2].good), reading
