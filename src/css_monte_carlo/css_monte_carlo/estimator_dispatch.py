# SPDX-License-Identifier: Apache-2.0
"""One compiled loop for every Sun estimator: which one is called follows from the type of its parameters.

A kernel that is handed to another as an argument cannot be cached on disk. The parameters of an estimator are a
NamedTuple defined in its own module, so their type names the module whose `step` belongs to them, and the compiler
settles the call when it compiles the loop for that type.
"""

import sys

from numba.extending import overload


def estimate(p, state, dt, voltages, aiding, eclipse_predicted):
    """One cycle of the estimator that owns the parameters `p`; arguments in `css_estimation.sun.sun_algorithm`."""
    return sys.modules[type(p).__module__].step(p, state, dt, voltages, aiding, eclipse_predicted)


@overload(estimate)
def _estimate(p, state, dt, voltages, aiding, eclipse_predicted):
    step = sys.modules[p.instance_class.__module__].step

    def call(p, state, dt, voltages, aiding, eclipse_predicted):
        return step(p, state, dt, voltages, aiding, eclipse_predicted)

    return call
