# SPDX-License-Identifier: Apache-2.0
"""Which kernels of a component fly, and what of their arguments is parameter, state, input or output."""

import copy
import inspect
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from css_common.component import Component, Plant
from css_common.mission import Mission
from css_common.mission_node import Node
from css_common.schema import Values, unknown_name
from css_environment.earth_light import new_light
from css_estimation.attitude import sun_field_attitude
from css_estimation.attitude.flight_references import References
from css_estimation.health import watched
from css_estimation.nodes.attitude_filter import AttitudeFilter
from css_estimation.nodes.coning import Coning
from css_estimation.nodes.earthlight import Earthlight
from css_estimation.nodes.slit_sun_angle import SlitPassages
from css_estimation.nodes.triad import Triad
from css_estimation.spin import slit_measurement, slit_passage
from css_estimation.sun.heading_dispatch import estimate_heading, home_of
from css_estimation.sun.sun_estimator import SunEstimator, hears_wheels
from css_estimation.sun.sun_heading import UNKNOWN_SKY, Aiding
from css_export.errors import ExportError
from sunpoint_control.controller import Controller
from sunpoint_control.held_field import NO_FIELD_MEASURED

_ZERO = (0.0, 0.0, 0.0)
PARAMETERS, STATE, MEMORY, INPUT, OUTPUT = "params", "state", "memory", "in", "out"


@dataclass(frozen=True)
class Function:
    """A kernel that flies.

    Attributes:
        name: of the library: the component's, and the kernel's where a component has several.
        component: name of the node.
        kernel: the compiled function.
        roles: of each argument; MEMORY: arrays of the state, OUTPUT: arrays that are written.
        arguments: their names.
        sample: one value of each, as before the first cycle.
        keeps_state: it returns the state after the cycle and what it gives; else only the latter.
        attribute: of the component, that holds the function which it calls.
        docs: of the arguments, by name.
        values: of the node, of which the parameters are made; None: not known.
    """

    name: str
    component: str
    kernel: Any
    roles: tuple[str, ...]
    arguments: tuple[str, ...]
    sample: tuple[Any, ...]
    keeps_state: bool
    attribute: str
    about: str
    docs: dict[str, str] = field(default_factory=dict)
    values: Values | None = None

    def places(self, role: str) -> list[int]:
        """Which arguments have a role."""
        return [i for i, given in enumerate(self.roles) if given == role]


def flying_functions(mission: Mission, names: Iterable[str] = ()) -> list[Function]:
    """The kernels of some components of a mission, or of all that are flight software.

    Raises:
        ExportError: there is no such component, or it has nothing that can be exported.
    """
    nodes = {node.name: node for node in mission.nodes}
    wanted = tuple(names)
    for name in wanted:
        if name not in nodes:
            raise ExportError(f"{mission.origin}: component {unknown_name(name, nodes)}")
    functions = []
    for node in nodes.values():
        if wanted and node.name not in wanted:
            continue
        made = list(functions_of(node))
        if wanted and not made:
            fit = ", ".join(n.name for n in nodes.values() if any(True for _ in functions_of(n))) or "none"
            raise ExportError(
                f"{mission.origin}: {node.name} has no compiled function that flies; expected one of {fit}"
            )
        functions += made
    if not functions:
        raise ExportError(f"{mission.origin}: no component is flight software that can be exported")
    return functions


def left_out(mission: Mission) -> dict[str, str]:
    """Components of a mission that belong to what flies and have no function to export, and why not."""
    return {
        node.name: _WHY_NOT.get(node.component, "it has no compiled function that flies")
        for node in mission.nodes
        if node.package in ("css_estimation", "sunpoint_control")
        and not issubclass(node.component, Plant)
        and not any(True for _ in functions_of(node))
    }


def functions_of(node: Node) -> Iterator[Function]:
    """The kernels of a component that fly; none of one that is no flight software."""
    for kind, of in _KINDS:
        if issubclass(node.component, kind):
            yield from of(node)
            return


def _sun_estimator(node: Node) -> Iterator[Function]:
    algorithm: Any = getattr(node.component, "algorithm")  # noqa: B009  # of the class, whatever a type checker knows
    values = node.values
    p = watched.watched_parameters(algorithm, values)
    own = p.own if isinstance(p, watched.Watched) else p
    found = getattr(home_of(own), "step", None) is algorithm.step
    if not found and isinstance(p, watched.Watched):
        raise ExportError(
            f"{node.name}: its parameters are of the type of another algorithm, so that no compiled function has both "
            "it and the health of its sensors; give it a type of its own"
        )
    yield Function(
        node.name,
        node.name,
        estimate_heading if found else algorithm.step,
        (PARAMETERS, STATE, MEMORY, INPUT, INPUT, INPUT),
        ("p", "state", "memory", "dt", "voltages", "aiding"),
        (
            p,
            watched.initial_state(algorithm, p),
            watched.initial_memory(algorithm, p),
            0.0,
            np.zeros(len(values.cells.normals)),
            _unaided(values),
        ),
        True,
        "_step",
        _about(node.component),
        {
            "dt": "[s] since the last step",
            "voltages": "[-] cell outputs; NaN where one is missing",
            "aiding": "what is known beside the cells",
        },
        values,
    )


def _earthlight(node: Node) -> Iterator[Function]:
    algorithm: Any = Earthlight.algorithm
    p = algorithm.parameters(node.values)
    voltages = np.zeros(len(node.values.cells.normals))
    sample = (p, algorithm.initial_state(p), algorithm.initial_memory(p), 0.0, voltages, _unaided(node.values))
    yield _stepped(node, algorithm.step, (PARAMETERS, STATE, MEMORY, INPUT, INPUT, INPUT), sample)


def _unaided(values: Values) -> Aiding:
    speeds = np.zeros(len(values.wheels.axes) if hears_wheels(values) else 0)
    return Aiding(_ZERO, False, _ZERO, False, speeds, False, UNKNOWN_SKY)


def _attitude_filter(node: Node) -> Iterator[Function]:
    algorithm: Any = getattr(node.component, "algorithm")  # noqa: B009
    p = algorithm.parameters(node.values)
    references = References(_ZERO, 0.0, False, _ZERO)
    sample = (
        p,
        algorithm.initial_state(p),
        algorithm.initial_memory(p),
        0.0,
        np.zeros(len(node.values.cells.normals)),
        _ZERO,
        False,
        _ZERO,
        False,
        references,
        new_light(),
    )
    yield _stepped(node, algorithm.step, (PARAMETERS, STATE, MEMORY, *[INPUT] * 8), sample)


def _controller(node: Node) -> Iterator[Function]:
    algorithm: Any = getattr(node.component, "algorithm")  # noqa: B009
    p = algorithm.parameters(node.values)
    turns = getattr(node.component, "turns_wheels")  # noqa: B009
    wheels = np.zeros(len(node.values.wheels.axes) if turns else 0)
    sample = (
        p,
        algorithm.initial_state(p),
        algorithm.initial_memory(p),
        0.0,
        _ZERO,
        0,
        0,
        _ZERO,
        0,
        wheels,
        NO_FIELD_MEASURED,
        wheels.copy(),
        np.zeros(len(node.values.rods.axes)),
    )
    roles = (PARAMETERS, STATE, MEMORY, *[INPUT] * 8, OUTPUT, OUTPUT)
    docs = {
        "dt": "[s] since the last step",
        "sun_b": "[-] direction to the Sun as estimated",
        "validity": "of the Sun estimate, as css_msgs/SunEstimate numbers it",
        "eclipse": "of the Sun estimate, likewise",
        "omega_bn_b": "[rad/s] body rate as estimated",
        "rate_source": "of the Sun estimate, likewise",
        "wheel_speeds": "[rad/s] as measured",
        "field": "the last measurement of the magnetic field",
        "torque_out": "[N m] of the motors of the wheels",
        "dipole_out": "[A m^2] of the torque rods",
    }
    yield _stepped(node, algorithm.step, roles, sample, docs)


def _slits(node: Node) -> Iterator[Function]:
    p = slit_measurement.parameters(node.values)
    take = inspect.signature(slit_passage.take_pulse.py_func)
    measure = inspect.signature(slit_measurement.measure.py_func)
    roles = (PARAMETERS, STATE, INPUT, INPUT)
    passage = slit_passage.Passage(True, slit_passage.REASON_NONE, 0, 1, 0, 0)
    yield Function(
        f"{node.name}_take_pulse",
        node.name,
        slit_passage.take_pulse,
        roles,
        tuple(take.parameters),
        (p.passage, slit_passage.initial_state(), 0, 0),
        True,
        "_take",
        _about(slit_passage.take_pulse.py_func),
        documented(slit_passage.take_pulse.py_func),
        node.values,
    )
    yield Function(
        f"{node.name}_measure",
        node.name,
        slit_measurement.measure,
        roles,
        tuple(measure.parameters),
        (p, slit_measurement.initial_swing(p), passage, 0.0),
        True,
        "_measure",
        _about(slit_measurement.measure.py_func),
        documented(slit_measurement.measure.py_func),
        node.values,
    )


def _triad(node: Node) -> Iterator[Function]:
    kernel = sun_field_attitude.measured_attitude
    direction, covariance = _ZERO, (0.0,) * 6
    yield Function(
        node.name,
        node.name,
        kernel,
        (PARAMETERS, *[INPUT] * 6),
        tuple(inspect.signature(kernel.py_func).parameters),
        (sun_field_attitude.parameters(node.values), direction, covariance, direction, 0.0, direction, direction),
        False,
        "_attitude",
        _about(kernel.py_func),
        documented(kernel.py_func),
        node.values,
    )


def _stepped(
    node: Node, kernel: Any, roles: tuple[str, ...], sample: tuple[Any, ...], docs: dict[str, str] | None = None
) -> Function:
    told = documented(kernel.py_func) | (docs or {})
    told.setdefault("dt", "[s] since the last step")
    arguments = tuple(inspect.signature(kernel.py_func).parameters)
    about = _about(node.component)
    return Function(node.name, node.name, kernel, roles, arguments, sample, True, "_step", about, told, node.values)


def _about(source: Any) -> str:
    return (inspect.getdoc(source) or "").partition("\n")[0]


def documented(function: Callable[..., Any]) -> dict[str, str]:
    """What the docstring of a function says of its arguments, by name."""
    _, _, rest = (inspect.getdoc(function) or "").partition("Args:\n")
    told: dict[str, str] = {}
    for line in rest.splitlines():
        if not line.startswith("    "):
            break
        found = re.match(r"    ([\w, ]+): (.*)", line)
        if found:
            names = [name.strip() for name in found[1].split(",")]
            told |= dict.fromkeys(names, found[2])
    return told


def fresh(function: Function) -> tuple[Any, ...]:
    """Arguments as before the first cycle, arrays of their own."""
    return tuple(copy.deepcopy(value) for value in function.sample)


_KINDS: tuple[tuple[type[Component], Callable[[Node], Iterator[Function]]], ...] = (
    (SunEstimator, _sun_estimator),
    (Earthlight, _earthlight),
    (AttitudeFilter, _attitude_filter),
    (Controller, _controller),
    (SlitPassages, _slits),
    (Triad, _triad),
)
_WHY_NOT: dict[type[Component], str] = {
    Coning: "it fits whole legs of a flight by numpy and scipy, on the ground as in flight: no step of it is compiled",
}
