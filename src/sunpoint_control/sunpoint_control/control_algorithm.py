# SPDX-License-Identifier: Apache-2.0
"""The shape of a control law's module; node and Monte Carlo need nothing else of it."""

from collections.abc import Callable, Iterable
from typing import Any, Protocol

from css_common.schema import Table, Values
from sunpoint_control.control_output import ControlOutput
from sunpoint_control.wheel_tracks import ControlMemory


class ControlAlgorithm(Protocol):
    """A module such as `sun_pointing_control`.

    What `parameters` gives is a NamedTuple that the module itself defines: by its type the Monte Carlo finds it.
    """

    @property
    def PARAMETERS(self) -> Table:
        """What a node with it declares."""

    @property
    def parameters(self) -> Callable[[Values], Any]:
        """The algorithm's own parameters from checked values."""

    @property
    def conflicts(self) -> Callable[[Values], Iterable[str]]:
        """What is wrong between parameters, one message each."""

    @property
    def initial_state(self) -> Callable[[Any], Any]:
        """State before the first cycle, for given parameters."""

    @property
    def initial_memory(self) -> Callable[[Any], ControlMemory]:
        """Arrays before the first cycle, changed in place by every one; each flight needs its own."""

    @property
    def step(self) -> Callable[..., tuple[Any, ControlOutput]]:
        """One cycle, a kernel.

        Args: parameters; state; memory; time [s] since the last step; direction, validity, eclipse, body rate [rad/s]
        and rate source of the Sun estimate; wheel speeds (n,) [rad/s]; `HeldField`; motor torques (n,) [N m] and
        dipoles (m,) [A m^2], both written. Gives the state after it and what was decided.
        """
