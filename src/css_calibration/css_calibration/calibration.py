# SPDX-License-Identifier: Apache-2.0
"""Calibration of a whole recording: which reference it has, the batch, a part that is held out, and what came of it."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from css_calibration.aids_by_truth import Linear, gyro_bias, magnetometer
from css_calibration.attitude_guess import first_track
from css_calibration.attitude_track import COMMON, COMMON_SIGMA, Track
from css_calibration.batch_fit import Fit, fit
from css_calibration.cell_data import CellData, cell_data
from css_calibration.cell_fit_model import nominal_parameters, response_of
from css_calibration.errors import CalibrationError
from css_calibration.recorded import Recorded
from css_calibration.snapshot_heading import heading_errors
from css_calibration.surroundings import Surroundings, surroundings_of
from css_calibration.unknowns import Ignorance, Unknowns, all_of, is_observed
from css_estimation.sun_filter.options import Response

ATTITUDE, SUN, BATCH = "attitude", "sun", "batch"
"""References: the true attitude, the true Sun in the body alone, or attitude from rates, field and place."""
CURVES = {"cosine": 0, "okeefe": 1}
UNTOLD = 0.95
"""A parameter of whose ignorance more than this is left is left alone; from a half on it is told with others alone."""
_MOST = {ATTITUDE: 2500, SUN: 2500, BATCH: 1000}  # instants: more tell no more than clouds let them
_ROUNDS = 2  # of fits, each with the Earth's light on the normals and attitudes of the one before
_VARIES = 1.0  # [K] of temperature, standard deviation, below which it tells nothing
_EARTH_SHOWS = 0.02
_LIT = 0.2

Tell = Callable[[str], None]


@dataclass
class Calibration:
    """What a recording told.

    Attributes:
        recorded: what it was made of, thinned.
        reference: `ATTITUDE`, `SUN` or `BATCH`.
        curve: response of the cells.
        reference_temperature: of the gains [deg C].
        data: outputs and light.
        fit: of the cells, and of the track where there is one.
        left: (N, 5) what is left of the ignorance of each parameter, 0 to 1.
        track: of a batch.
        bias, of_field: of gyro and magnetometer with a truth.
        holdout: (M,) instants that the numbers below come from; the fit behind these did not have their outputs.
        trained: that fit; None: nothing is held out.
        before, after: (H,) [rad] errors of the heading there, with nominal cells and calibrated ones.
        notes: what was assumed, left out or could not be told, one line each.
    """

    recorded: Recorded
    reference: str
    curve: str
    reference_temperature: float
    data: CellData
    fit: Fit
    left: np.ndarray
    track: Track | None
    bias: Linear | None
    of_field: Linear | None
    holdout: np.ndarray
    trained: Fit | None
    before: np.ndarray
    after: np.ndarray
    notes: list[str] = field(default_factory=list)

    @property
    def observed(self) -> np.ndarray:
        """(N, 5) parameters that the recording has told."""
        return is_observed(self.left)

    @property
    def parameters(self) -> np.ndarray:
        """(N, 5) of the cells; what the recording says nothing of is as the mission has it."""
        return told(self.fit).parameters

    @property
    def sigma(self) -> np.ndarray:
        """(N, 5) of them, 1 sigma; 0 where nothing was looked for."""
        unknowns = self.fit.unknowns
        sigma = np.zeros(unknowns.free.shape)
        cells = int(unknowns.free.sum())
        sigma[unknowns.free] = np.sqrt(np.diag(self.fit.covariance))[:cells] * unknowns.sigma[:cells]
        return sigma

    def common(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Gyro bias, field bias, scale and soft iron (12,) of a batch, and their sigmas."""
        if self.track is None:
            return None
        first = self.fit.unknowns.count
        sigma = np.sqrt(np.diag(self.fit.covariance))[first : first + COMMON] * COMMON_SIGMA
        return self.track.common(told(self.fit).x[first:]), sigma


def reference_of(recorded: Recorded, asked: str = "auto") -> str:
    """What the attitude or the Sun is known by.

    Raises:
        CalibrationError: the recording has nothing of the kind, or not what is asked for; says what is needed.
    """
    has_batch = len(recorded.gyro_ns) > 0 and recorded.field_b is not None and recorded.r_n is not None
    has_truth = recorded.sun_b is not None
    if asked == "truth" and not has_truth:
        raise CalibrationError(
            f"{recorded.origin}: no true Sun, expected the Sun in the body (css_msgs/SpacecraftState)"
        )
    if asked != "batch" and has_truth:
        return ATTITUDE if recorded.dcm_bn is not None else SUN
    if has_batch:
        return BATCH
    missing = [
        name
        for name, there in (
            ("rates (sensor_msgs/Imu)", len(recorded.gyro_ns) > 0),
            ("magnetic field (sensor_msgs/MagneticField)", recorded.field_b is not None),
            (f"the place ({recorded.no_place or 'section orbit of the mission'})", recorded.r_n is not None),
        )
        if not there
    ]
    raise CalibrationError(
        f"{recorded.origin}: nothing to hold the cells against: expected the Sun in the body, or rates, magnetic field "
        f"and place together; missing: {', '.join(missing)}"
    )


def calibrate(
    recorded: Recorded,
    *,
    reference: str = "auto",
    curve: str = "auto",
    holdout: float = 0.25,
    tell: Tell = lambda _: None,
) -> Calibration:
    """Calibrates cells, and with them what aids them.

    Args:
        recorded: whole recording.
        reference: auto (a truth if there is one), truth, or batch.
        curve: response of the cells, of `CURVES`; auto: the one that explains the outputs better.
        holdout: share of the sunlight, at its end, whose outputs show what the calibration is worth.
        tell: takes a line about each step.

    Raises:
        CalibrationError: the recording cannot calibrate.
    """
    kind = reference_of(recorded, reference)
    tell(f"reference: {kind}")
    thin = _thinned(recorded, kind)
    around = surroundings_of(thin, with_field=kind != SUN and thin.field_b is not None)
    track = None
    if kind == BATCH:
        tell("first guess of the attitude")
        track, rows = first_track(thin, around)
        thin = thin.at(rows)
        around = surroundings_of(thin, with_field=True)
    warmth, warm_notes = _temperature(thin)
    notes = [*recorded.notes, *warm_notes]
    frame = _Frame(thin, around, kind, track, warmth)
    chosen, data, result = _best_curve(frame, curve, tell, notes)
    held = _held_out(data, holdout)
    trained, before, after = _worth(frame, chosen, data, result, held, tell)
    left = left_of(result)
    bias = gyro_bias(recorded) if kind != BATCH else None
    of_field = magnetometer(thin, around) if kind == ATTITUDE else None
    if kind == SUN and recorded.field_b is not None:
        notes.append("magnetometer: left alone, its errors need the place, by which the field is known")
    if kind == SUN:
        notes.append("the light of the Earth is not predicted, for the place is not known: it is in the error bars")
    return Calibration(
        thin, kind, chosen, warmth, data, result, left, track, bias, of_field, held, trained, before, after, notes
    )


@dataclass
class _Frame:
    """What all fits of a recording have in common."""

    recorded: Recorded
    around: Surroundings
    kind: str
    track: Track | None
    warmth: float

    def data(self, response: Response, fit_before: Fit | None) -> CellData:
        dcm_bn, sun_b = self.recorded.dcm_bn, self.recorded.sun_b
        parameters = None if fit_before is None else fit_before.parameters
        if self.track is not None:
            x = np.zeros(self.track.count) if fit_before is None else fit_before.x[fit_before.unknowns.count :]
            dcm_bn, _ = self.track.attitudes(x)
            sun_b = np.einsum("kij,kj->ki", dcm_bn, self.track.sun_n)
        assert sun_b is not None
        return cell_data(self.recorded, self.around, sun_b, dcm_bn, response, self.warmth, parameters)

    def fitted(
        self, response: Response, usable: np.ndarray | None = None, start: Fit | None = None
    ) -> tuple[CellData, Fit]:
        """Rounds of fits."""
        before = start
        for _ in range(_ROUNDS):
            data = self.data(response, before)
            if usable is not None:
                data.usable &= usable
            unknowns = self._unknowns(data)
            same = before is not None and before.unknowns.earth == unknowns.earth
            before = fit(data, unknowns, self.track, before.x if same and before is not None else None)
        assert before is not None
        return data, _beside_earth(before)

    def _unknowns(self, data: CellData) -> Unknowns:
        if not data.usable.any():
            raise CalibrationError(
                f"{self.recorded.origin}: no output of a cell whose light is known, expected some minutes in sunlight"
            )
        varies = self.recorded.temperature is not None and float(np.std(self.recorded.temperature)) > _VARIES
        earth = bool(np.max(data.albedo, initial=0.0) > _EARTH_SHOWS)
        return all_of(data.voltages.shape[1], temperature=varies, earth=earth, ignorance=Ignorance())


def _beside_earth(result: Fit) -> Fit:
    """A fit that has looked for the light of an Earth that nobody predicts: it would pass for dark levels."""
    if result.beside_earth is None:
        return result
    x, covariance = result.beside_earth
    return replace(result, x=x, covariance=covariance)


def _thinned(recorded: Recorded, kind: str) -> Recorded:
    """As many instants as tell something, evenly over the recording; in a batch such that have a field."""
    rows = np.arange(len(recorded.stamp_ns))
    if kind == BATCH:
        assert recorded.field_b is not None
        measured = np.isfinite(recorded.field_b).all(axis=1)
        rows = rows[measured] if measured.any() else rows
    count = min(len(rows), _MOST[kind])
    return recorded.at(np.unique(rows[np.linspace(0, len(rows) - 1, count).astype(np.int64)]))


def _temperature(recorded: Recorded) -> tuple[float, list[str]]:
    if recorded.temperature is None:
        return 20.0, []
    mean = round(float(np.mean(recorded.temperature)), 1)
    if float(np.std(recorded.temperature)) <= _VARIES:
        return mean, [f"temperature coefficients: left alone, the temperature hardly varies about {mean:g} deg C"]
    return mean, []


def _best_curve(frame: _Frame, curve: str, tell: Tell, notes: list[str]) -> tuple[str, CellData, Fit]:
    tried: dict[str, tuple[CellData, Fit]] = {}
    for name in CURVES if curve == "auto" else [curve]:
        tell(f"batch with the response {name}")
        tried[name] = frame.fitted(response_of(CURVES[name]))
    misfit = {name: _misfit(*both) for name, both in tried.items()}
    best = min(misfit, key=lambda name: misfit[name])
    if len(tried) > 1:
        others = ", ".join(f"{name} {value:.4f}" for name, value in misfit.items())
        notes.append(f"response of the cells: {best}, by the median residual of lit outputs ({others})")
    return (best, *tried[best])


def _misfit(data: CellData, result: Fit) -> float:
    """Median size of the residuals of lit outputs, outliers among them."""
    lit = np.isfinite(result.residuals) & data.seen & (data.voltages > _LIT)
    return float(np.median(np.abs(result.residuals[lit]))) if lit.any() else 0.0


def _held_out(data: CellData, share: float) -> np.ndarray:
    """Instants at the end of the recording, with a share of those at which the Sun is on a cell."""
    lit = (data.usable & data.seen).any(axis=1)
    if share <= 0.0 or not lit.any():
        return np.zeros(len(lit), np.bool_)
    return data.time > np.quantile(data.time[lit], 1.0 - share)


def _worth(
    frame: _Frame, curve: str, data: CellData, result: Fit, held: np.ndarray, tell: Tell
) -> tuple[Fit | None, np.ndarray, np.ndarray]:
    """What the rest tells, and errors of the heading over the part that is held out, by the mission and by it."""
    if not held.any() or held.all():
        return None, np.zeros(0), np.zeros(0)
    tell("batch without the part that is held out")
    _, trained = frame.fitted(response_of(CURVES[curve]), ~held[:, None], result)
    rest = data.some(held)
    calibrated = told(trained)
    after = heading_errors(rest, calibrated.parameters, calibrated.earth)
    before = heading_errors(rest, nominal_parameters(data.voltages.shape[1]), 1.0)
    both = np.isfinite(before) & np.isfinite(after)
    return trained, before[both], after[both]


def told(result: Fit) -> Fit:
    """A fit in which parameters that the recording says nothing of are as the mission has them.

    The others are then what it tells of them beside such ones: what it told of them together with values that are not
    kept would be wrong by what those had taken on, as scales are too small beside a dark level of an unpredicted Earth.
    """
    left, free = left_of(result), result.unknowns.free
    dropped = np.zeros(len(result.x), np.bool_)
    dropped[: int(free.sum())] = left[free] >= UNTOLD
    of_dropped = result.covariance[:, dropped]
    x = result.x - of_dropped @ np.linalg.solve(of_dropped[dropped], result.x[dropped])
    return replace(result, x=np.where(dropped, 0.0, x))


def left_of(result: Fit) -> np.ndarray:
    """(N, 5) what is left of the ignorance of each parameter; 1 where nothing was looked for."""
    unknowns = result.unknowns
    left = np.ones(unknowns.free.shape)
    cells = int(unknowns.free.sum())
    left[unknowns.free] = np.sqrt(np.diag(result.covariance))[:cells]
    return left
