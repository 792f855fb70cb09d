# SPDX-License-Identifier: Apache-2.0
"""One compiled loop for every Sun estimator: the type of its parameters says what is called.

A kernel that is handed to another as an argument cannot be cached on disk. The parameters of an estimator are a
NamedTuple defined in its own module, so their type names the module whose `step` belongs to them, and the compiler
settles the call when it compiles the loop for that type. None in the place of parameters is an estimator that a flight
does not have: nothing is compiled for it. Those of an algorithm behind the health of its sensors are of
`health.watched`, which calls the algorithm in turn.
"""

import sys
from types import ModuleType
from typing import Any

from numba.core import types
from numba.extending import overload


def estimate_heading(p, state, memory, dt, voltages, aiding):
    """State and `SunHeading` after one cycle of a Sun estimator; arguments in `css_estimation.sun.sun_algorithm`."""
    return _heading_step(home_of(p))(p, state, memory, dt, voltages, aiding)


def home_of(p: Any) -> ModuleType | None:
    """The module that defines the type of a value, or of a numba type; None for None."""
    if p is None or isinstance(p, types.NoneType):
        return None
    return sys.modules[getattr(p, "instance_class", type(p)).__module__]


@overload(estimate_heading, jit_options={"forceinline": True})
def _overload_heading(p, state, memory, dt, voltages, aiding):
    return _heading_step(home_of(p))


def _heading_step(home):
    if home is None:
        return lambda p, state, memory, dt, voltages, aiding: (None, None)
    if hasattr(home, "watched_heading"):
        return home.watched_heading
    step = home.step

    def call(p, state, memory, dt, voltages, aiding):
        return step(p, state, memory, dt, voltages, aiding)

    return call
