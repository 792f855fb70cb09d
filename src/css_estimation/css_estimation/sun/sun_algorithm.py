# SPDX-License-Identifier: Apache-2.0
"""The shape of a Sun estimator's module; node, replay and Monte Carlo need nothing else of it."""

from collections.abc import Callable
from typing import Any, Protocol

from css_common.schema import Table, Values
from css_estimation.sun.sun_heading import Aiding, SunHeading


class SunAlgorithm(Protocol):
    """A module such as `wavg`.

    What `parameters` gives is a NamedTuple that the module itself defines: by its type the Monte Carlo finds it.
    A module may also have `conflicts(values)`, as `Component.conflicts`, and `heading_gain(values)`, the share of a new
    measurement in its estimate, for the check of the control's gains.
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
