# SPDX-License-Identifier: Apache-2.0
"""The shape of a Sun estimator's module; node, replay and Monte Carlo need nothing else of it."""

from collections.abc import Callable
from typing import Any, Protocol

from css_common.schema import Table, Values
from css_estimation.sun.sun_heading import Aiding, SunHeading


class SunAlgorithm(Protocol):
    """A module such as `wavg`.

    What `parameters` gives is a NamedTuple that the module itself defines: by its type the Monte Carlo finds it.

    Direction and body rate are both the algorithm's: `step` gives them in one `SunHeading`, with `rate_source` for
    where the rate comes from. The rate of the gyro, of successive Sun vectors and of the magnetic field is there for
    whoever wants it: `sun_tracking.finish_cycle`, with the parameters of `sun_tracking.TrackingParameters`. A filter
    with the rate in its state (`sun_filter`) writes its own instead and declares none of these but what it reads. What
    the node does follows from what is declared: with `use_gyro` it hears the gyro, with `rate.use_field` the
    magnetometer, with `use_wheels` the wheels, with `eclipse.source` or `use_orbit` it asks the flight's own sky.

    A module may also have `conflicts(values)`, as `Component.conflicts`, and, for the check of the control's gains, the
    share of a new measurement that one cycle takes in: `heading_gain(values)` for the direction, 1 without it, and
    `rate_gain(values)` for the rate, without it that of the low pass of `rate.cutoff` if this is declared, else 1.
    """

    @property
    def PARAMETERS(self) -> Table:
        """What a node with it declares."""

    @property
    def parameters(self) -> Callable[[Values], Any]:
        """The algorithm's own parameters from checked values."""

    @property
    def initial_state(self) -> Callable[[Any], Any]:
        """State before the first cycle, for given parameters."""

    @property
    def initial_memory(self) -> Callable[[Any], Any]:
        """Arrays that `step` advances in place, for given parameters; `no_memory` for an algorithm without."""

    @property
    def step(self) -> Callable[[Any, Any, Any, float, Any, Aiding], tuple[Any, SunHeading]]:
        """One cycle, a kernel.

        Args: parameters; state; memory; time [s] since the last step; voltages (N,) [-], NaN where one is missing; what
        other sensors measured and models say. Gives the state after it and what it came to.
        """


def no_memory(p: Any) -> None:
    """Of an algorithm whose state is all that it carries from cycle to cycle."""
