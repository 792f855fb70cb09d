# SPDX-License-Identifier: Apache-2.0
"""What surrounds the spacecraft at each step, the same for all cases: computed once, read by every flight.

A flight is cut into blocks of steps, so that the tables of one stay small however long the mission is.
"""

import threading
from collections import OrderedDict
from typing import NamedTuple

import numpy as np

from css_common.epochs import mission_epoch
from css_common.kernel import kernel, outer_kernel
from css_common.schema import Values
from css_environment import ephemeris
from css_environment.albedo_vector import PATCHES, earth_light_sources
from css_environment.earth_light import EarthView, gather_light, look_at_earth, new_earth_view, new_light
from css_environment.ephemeris import EnvironmentState, Ephemeris
from css_environment.mission_environment import MissionEnvironment
from css_environment.orbit import Orbit
from css_estimation.attitude.flight_references import FlightReferences, References
from css_estimation.sun.flight_sky import FlightSky, flight_sky
from css_estimation.sun.sky_table import aligned_table, sky_table
from css_sim.flight_environment import flight_environment

BLOCK_STEPS = 1200
"""Steps of one block."""

_KEPT_BYTES = 192_000_000

STATE = np.dtype(
    [
        ("r_n", np.float64, 3),
        ("v_n", np.float64, 3),
        ("sun_n", np.float64, 3),
        ("field_n", np.float64, 3),
        ("dcm_en", np.float64, 9),
        ("solar_flux", np.float64),
        ("illumination", np.float64),
    ],
    align=True,
)
"""`EnvironmentState` of one step."""

REFERENCE = np.dtype(
    [("sun_n", np.float64, 3), ("field_n", np.float64, 3), ("intensity", np.float64), ("sunlit", np.bool_)], align=True
)
"""`References` of one step."""


class Surroundings(NamedTuple):
    """Tables of one block of K steps."""

    states: np.ndarray  # (K,) of STATE
    sky: np.ndarray  # (K,) of `sky_table.SKY`, what the Sun estimator's own models say; (1,) when it has none
    sky_light: np.ndarray  # (K, 192) light of the Earth by them; (1, 192) when it predicts none
    attitude_sky: np.ndarray  # (K,) of SKY, what an attitude filter that is aided so says; (1,) without one
    attitude_sky_light: np.ndarray  # (K, 192) light of the Earth by it; (1, 192) when it predicts none
    references: np.ndarray  # (K,) of REFERENCE, what the attitude filter's models say; (0,) without one
    predicted_light: np.ndarray  # (K, 192) patches of light by them; (1, 192) when no filter takes albedo off
    light: np.ndarray  # (K, 192) patches of light of the Earth; (1, 192) when each case has its own Earth, or none
    views: EarthView  # (K, ...) the Earth seen from the orbit, for cases that sum patches of their own; else (0, ...)


@kernel
def state_at(states, k: int) -> EnvironmentState:
    """The environment of a step."""
    s = states[k]
    d = s.dcm_en
    return EnvironmentState(
        (s.r_n[0], s.r_n[1], s.r_n[2]),
        (s.v_n[0], s.v_n[1], s.v_n[2]),
        (s.sun_n[0], s.sun_n[1], s.sun_n[2]),
        s.solar_flux,
        s.illumination,
        (s.field_n[0], s.field_n[1], s.field_n[2]),
        ((d[0], d[1], d[2]), (d[3], d[4], d[5]), (d[6], d[7], d[8])),
    )


@kernel
def references_at(table, k: int) -> References:
    """What the attitude filter's models say at a step."""
    r = table[k]
    return References(
        (r.sun_n[0], r.sun_n[1], r.sun_n[2]),
        r.intensity,
        r.sunlit,
        (r.field_n[0], r.field_n[1], r.field_n[2]),
    )


@outer_kernel
def view_at(views: EarthView, k: int) -> EarthView:
    """The Earth as seen at a step."""
    return EarthView(views.frame[k], views.circles[k], views.light[k], views.cell[k], views.disc[k])


@kernel
def gather_light_at(views: EarthView, k: int, reflectivity, light_out) -> None:
    """Light of an Earth of its own (rows, columns), as seen at a step: (192,), written."""
    view = EarthView(views.frame[k], views.circles[k], views.light[k], views.cell[k], views.disc[k])
    gather_light(view, reflectivity, light_out)


@outer_kernel
def _tabulate_states(tables: Ephemeris, elapsed_s, states) -> None:
    for k in range(states.shape[0]):
        e = ephemeris.at(tables, elapsed_s[k])
        s = states[k]
        for i in range(3):
            s.r_n[i], s.v_n[i], s.sun_n[i], s.field_n[i] = e.r_n[i], e.v_n[i], e.sun_n[i], e.field_n[i]
            for j in range(3):
                s.dcm_en[3 * i + j] = e.dcm_en[i][j]
        s.solar_flux, s.illumination = e.solar_flux, e.illumination


@outer_kernel
def _tabulate_light(model: int, states, view: EarthView, reflectivity, light) -> None:
    for k in range(states.shape[0]):
        e = state_at(states, k)
        earth_light_sources(model, view, e.r_n, e.sun_n, e.solar_flux, e.dcm_en, reflectivity, light[k])


@outer_kernel
def _tabulate_views(states, views: EarthView, rows: int, columns: int) -> None:
    for k in range(states.shape[0]):
        e = state_at(states, k)
        look_at_earth(view_at(views, k), e.r_n, e.sun_n, e.solar_flux, e.dcm_en, rows, columns)


class SurroundingsTables:
    """The blocks of a mission, made when they are first asked for; threads may share one.

    Args:
        plant: values of the node that owns the truth (its orbit, shadow and field).
        heading: values of the Sun estimator that flies (its own models); None: none flies.
        attitude: values of the attitude filter that flies (its own models); None: none flies.
        aided: values of an attitude filter that is aided as Sun estimators are, in the place of `attitude`.
        reflectivity: (rows, columns) of the Earth that all cases share; None without albedo.
        own_earth: each case has its own reflectivities, on a grid of that shape.
        field: something feels the geomagnetic field.
        albedo_model: `albedo_vector.PATCHES`, `VECTOR` or `NADIR`.
        orbit: the true one, where cases differ in theirs; None: that of the plant.
    """

    def __init__(
        self,
        plant: Values,
        heading: Values | None,
        attitude: Values | None,
        aided: Values | None,
        reflectivity: np.ndarray | None,
        own_earth: bool = False,
        field: bool = True,
        albedo_model: int = PATCHES,
        orbit: Orbit | None = None,
    ) -> None:
        self._environment: MissionEnvironment = flight_environment(plant, field, orbit)
        self._sky: FlightSky | None = None if heading is None else flight_sky(heading)
        self._attitude_sky: FlightSky | None = None if aided is None else flight_sky(aided)
        self._models: FlightReferences | None = None if attitude is None else FlightReferences(attitude)
        self._predicts_light: bool = attitude is not None and attitude.albedo.compensate
        self._period_ns = round(plant.mission.period * 1e9)
        self._epoch_ns = mission_epoch(plant.mission)
        self._reflectivity = reflectivity
        self._own_earth = own_earth
        self._albedo_model = albedo_model
        self._blocks: OrderedDict[tuple[int, int], Surroundings] = OrderedDict()
        self._bytes = 0
        self._lock = threading.Lock()

    def block(self, first: int, count: int) -> Surroundings:
        """The tables of `count` steps from step `first` on."""
        key = (first, count)
        with self._lock:
            if key in self._blocks:
                self._blocks.move_to_end(key)
                return self._blocks[key]
            block = self._make(first, count)
            self._blocks[key] = block
            self._bytes += _size(block)
            while self._bytes > _KEPT_BYTES and len(self._blocks) > 1:
                self._bytes -= _size(self._blocks.popitem(last=False)[1])
            return block

    def states(self, first: int, count: int) -> np.ndarray:
        """(K,) of STATE for `count` steps from step `first` on."""
        states = np.zeros(count, STATE)
        elapsed_s = (first + np.arange(count)) * self._period_ns * 1e-9
        segments = np.floor(elapsed_s / ephemeris.SEGMENT_S)
        for segment in np.unique(segments):
            part = segments == segment
            rows = slice(int(np.argmax(part)), int(np.argmax(part)) + int(np.count_nonzero(part)))
            _tabulate_states(self._environment.tables(elapsed_s[rows.start]), elapsed_s[rows], states[rows])
        return states

    def _make(self, first: int, count: int) -> Surroundings:
        states = self.states(first, count)
        grid = self._reflectivity
        has_light = grid is not None and not self._own_earth
        light = aligned_table(count if has_light else 1, len(new_light()))
        has_views = grid is not None and self._own_earth and self._albedo_model == PATCHES
        views = _views(count if has_views else 0)
        if grid is not None and has_views:
            _tabulate_views(states, views, *grid.shape)
        elif grid is not None and has_light:
            _tabulate_light(self._albedo_model, states, new_earth_view(), grid, light)
        stamps_ns = [self._epoch_ns + (first + k) * self._period_ns for k in range(count)]
        skies = (*sky_table(self._sky, stamps_ns), *sky_table(self._attitude_sky, stamps_ns))
        return Surroundings(states, *skies, *self._modelled(first, count), light, views)

    def _modelled(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """What the attitude filter's models say, and the light that they predict."""
        references = np.zeros(count if self._models is not None else 0, REFERENCE)
        light = aligned_table(count if self._predicts_light else 1, len(new_light()))
        for k in range(len(references)):
            assert self._models is not None
            r = self._models.at((first + k) * self._period_ns * 1e-9)
            references[k] = r.sun_n, r.field_n, r.intensity, r.sunlit
            # in the shadow the light stays as it was; nobody reads it there
            if self._predicts_light and r.sunlit:
                light[k] = self._models.light
        return references, light


def _views(count: int) -> EarthView:
    return EarthView(*(np.zeros((count, *a.shape), a.dtype) for a in new_earth_view()))


def _size(block: Surroundings) -> int:
    *tables, views = block
    return sum(a.nbytes for a in (*tables, *views))
