# SPDX-License-Identifier: Apache-2.0
"""What a node author writes: a component. No rclpy here; `css_common.host` puts it into a lifecycle node.

A component says which parameters it has, which messages it takes and gives, and what one cycle does. The host owns
the rest: lifecycle, parameter declaration, stamp matching, message checks, diagnostics, shutdown. Replay steps the
same component without a node, which is why a replayed estimator gives the bytes that flew.
"""

import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from css_common import fault_lines, link_kinds
from css_common.codec import Sample
from css_common.epochs import mission_epoch
from css_common.fault_lines import FaultKind, Units
from css_common.link_kinds import LINK_FAULTS
from css_common.message_columns import Columns
from css_common.mission_section import DURATION, EPOCH
from css_common.readings import Readings
from css_common.schema import Table, Values, missing
from css_common.shared_sections import conflicts, section_table
from css_msgs.msg import Faults

if TYPE_CHECKING:
    from css_common.mission_node import Node

BODY = "body"
INERTIAL = "inertial"

TOLD = "link_faults"
"""Key of the output on which a host tells the faults of messages, clock and process."""


@dataclass(frozen=True)
class Input:
    """A topic that a component listens to.

    Attributes:
        key: the component's own name for it.
        topic: relative topic name.
        message_type: ROS message class.
        required: without it there is no cycle; an optional input may be silent in real time (a dead gyro).
        outlived: a mission must have it, but in real time the cycle runs without it once it has been silent for longer
            than the deadline: a control that brings its actuators to rest.
        divider: a message is due every `divider` steps.
        lengths: expected length of array fields; another length is refused at the edge.
        used: fields that the component reads and that must be finite; empty: all. Drivers leave NaN in others.
        frame: whose frame_id is expected, `BODY` or `INERTIAL`.
        readings: array fields whose elements may each be missing (NaN), and what the others may be; an element beyond
            that becomes NaN, a message without any reading is refused.
        heeded: False while the values make nothing of it (a gyro that is not to be used): its messages are then
            neither waited for nor handed over, whatever they are. May change when values do.
        switch: parameter that says so, for those who wait in vain for a message.
        once: a message is a measurement that counts once: among devices with clocks of their own the next cycle is not
            given it again.
        restamped: messages bear the time of their arrival, whatever stamp they come with.
        sensor_frame: the frame_id that is expected in the place of that of `frame`; empty: that.
        held_s: above 0 a quantity that changes slowly and is told at times of its own: nobody waits for it, and each
            cycle is given the newest message that is not after its stamp, nor older than so many seconds.
    """

    key: str
    topic: str
    message_type: type
    required: bool = True
    outlived: bool = False
    divider: int = 1
    lengths: Mapping[str, int] = field(default_factory=dict)
    used: tuple[str, ...] = ()
    frame: str = BODY
    readings: Mapping[str, Readings] = field(default_factory=dict)
    heeded: bool = True
    switch: str = ""
    once: bool = False
    restamped: bool = False
    sensor_frame: str = ""
    held_s: float = 0.0

    @property
    def may_be_silent(self) -> bool:
        """A cycle may run without it once a deadline is over."""
        return self.outlived or not self.required


@dataclass(frozen=True)
class Output:
    """A topic that a component publishes.

    Attributes:
        key: the component's own name for it.
        topic: relative topic name.
        message_type: ROS message class.
        frame: whose frame_id it carries, `BODY` or `INERTIAL`.
        divider: published every `divider` steps.
        ends_cycle: in lockstep the plant waits for it before it advances (estimates and commands).
        events: any number of messages a step, stamped when they happened; nothing can wait for them or match them.
        may_lack: array fields of which elements may be missing (NaN).
    """

    key: str
    topic: str
    message_type: type
    frame: str = BODY
    divider: int = 1
    ends_cycle: bool = False
    events: bool = False
    may_lack: tuple[str, ...] = ()


class Finding(NamedTuple):
    """What a check before the flight found.

    Attributes:
        text: key, value, what is wrong and what would be right, in one line.
        refused: the flight cannot give right numbers; else it is worth a warning.
    """

    text: str
    refused: bool = False


class Standing(NamedTuple):
    """How a component is beyond what its host sees: what it has counted and measured of a device, for diagnostics."""

    warning: str = ""  # what is not as it should be, in one line
    failing: bool = False  # nothing useful comes of it now
    figures: Mapping[str, int | float] = {}


class Smoothing(NamedTuple):
    """Share of a new measurement that one cycle of an estimator takes in; 1: all of it."""

    rate: float = 1.0  # of the body rate
    heading: float = 1.0  # of the direction to the Sun, while no gyro propagates it


class Cycles(NamedTuple):
    """Steps that follow one another and hold nothing out of the ordinary.

    Attributes:
        stamps_ns: (M,) of each.
        columns: messages of each input that is not silent.
        rows: (K,) the steps to which each of the K messages of an input belongs, rising.
    """

    stamps_ns: np.ndarray
    columns: Mapping[str, Columns]
    rows: Mapping[str, np.ndarray]

    def spread(self, key: str, field: str) -> tuple[np.ndarray, np.ndarray] | None:
        """A field of an input for each step, zero where there is none, and whether there is one, (M,); None: silent."""
        if key not in self.columns:
            return None
        given = getattr(self.columns[key], field)
        values = np.zeros((len(self.stamps_ns), *given.shape[1:]), given.dtype)
        there = np.zeros(len(self.stamps_ns), np.bool_)
        values[self.rows[key]] = given
        there[self.rows[key]] = True
        return values, there


Received = Mapping[str, Any]
"""Input key to `Sample`; None for an optional input that is silent and for one that is not due."""
Outgoing = Mapping[str, Sample | tuple[Sample, ...]]
"""Output key to its message of the step, or to those of an output of events."""


def _unheard(text: str) -> None:
    """Where the reports of a component without a host go."""


class Component:
    """One part of the flight graph, cycled once per step.

    Attributes:
        report: takes a line for the log; a host makes it the node's.
        now_ns: time of the clock that stamps are of [ns]; a host makes it the node's.
        left_out: names of the units that it holds for failed, such as `cell.3`.

    Class attributes:
        shared: mission sections whose values the component reads (`shared_sections`), besides mission and io.
        parameters: its own parameters.
        fault_kinds: what its units may do wrong (`fault_lines`); it then has the parameter `faults`.
        rehearses: a stand-in may be cycled before the flight; not of what reaches out of the process.
    """

    shared: ClassVar[tuple[str, ...]] = ()
    parameters: ClassVar[Table] = ()
    fault_kinds: ClassVar[tuple[FaultKind, ...]] = ()
    rehearses: ClassVar[bool] = True
    _read_by_host: ClassVar[tuple[str, ...]] = ("mission", "io")
    _needed_by_host: ClassVar[tuple[str, ...]] = ()

    def __init__(self, name: str, values: Values) -> None:
        self.name = name
        self.values = values
        self.report: Callable[[str], object] = _unheard
        self.now_ns: Callable[[], int] = time.time_ns
        self.left_out: tuple[str, ...] = ()
        self.period_ns = round(values.mission.period * 1e9)
        self.epoch_ns = mission_epoch(values.mission)
        self.frames = {
            output.key: values.io.body_frame if output.frame == BODY else values.io.inertial_frame
            for output in self.all_outputs(name, values)
        }
        self.configure()

    @classmethod
    def table(cls) -> Table:
        """All parameters of the node: shared sections first, then its own."""
        sections = dict.fromkeys((*cls._read_by_host, *cls.shared))
        return tuple(p for section in sections for p in section_table(section)) + tuple(cls.parameters)

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        """Topics it listens to; the first is the one that paces it when inputs have clocks of their own."""
        return ()

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        """Topics it publishes."""
        return ()

    @classmethod
    def all_outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        """Topics that it and its host publish."""
        told = (Output(TOLD, f"faults/{name}/link", Faults, events=True),) if values[LINK_FAULTS] else ()
        return (*cls.outputs(name, values), *told)

    @classmethod
    def needed(cls, values: Values) -> Iterable[str]:
        """Names of parameters without a default that it cannot do without; they have an example in their table."""
        return ()

    @classmethod
    def asked_for(cls, values: Values) -> Iterable[str]:
        """Names of all parameters without a default that it or its host cannot do without."""
        return dict.fromkeys((*cls.needed(values), *cls._needed_by_host))

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        """What is wrong between parameters, one message each."""
        return ()

    @classmethod
    def fault_units(cls, values: Values) -> Units:
        """Names of the units that may have the faults of `fault_kinds`, by their sort."""
        return {}

    @classmethod
    def link_units(cls, name: str, values: Values) -> Units:
        """Names of what may fail of any node, its messages, clock and process, by their sort (`link_kinds`)."""
        return link_kinds.units(name, cls.outputs(name, values), issubclass(cls, Plant))

    @classmethod
    def preflight(cls, node: "Node", graph: Mapping[str, "Node"]) -> Iterable[Finding]:
        """What a flight with these values would do that physics or numerics forbid; see `css_common.preflight`.

        Unlike `conflicts`, which make a mission invalid wherever it is read, these keep it from being flown: a
        recording of such a flight can still be replayed.

        Args:
            node: this component's node.
            graph: all nodes of the mission by name.
        """
        return ()

    @classmethod
    def smoothing(cls, values: Values) -> Smoothing:
        """How an estimator with these values lags behind what it measures, for those who close a loop around it."""
        return Smoothing()

    def standing(self) -> Standing:
        """What its host cannot know of how it is."""
        return Standing()

    def configure(self) -> None:
        """Builds algorithm parameters and the initial state from `self.values`."""

    def release(self) -> None:
        """Gives up what it holds outside of the process: the node is done with it."""

    def tune(self, values: Values) -> None:
        """Takes new values of tunable parameters in flight; the state stays."""
        self.values = values

    def untimely(self, values: Values) -> str | None:
        """Why it cannot take values in flight that it could have begun with, or None."""
        return None

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        """One step: the inputs of one stamp (None for what is silent or not due) to the outputs of that stamp."""
        raise NotImplementedError

    def cycle_through(self, steps: Cycles) -> Mapping[str, Columns] | None:
        """Many steps at once, to the messages of all of them by output: the same as `cycle` would give for each.

        For those who have the inputs already, as replay has. A component need not offer it: None, and nothing is done.
        """
        return None

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        """What it still publishes while deactivated; nothing unless overridden."""
        return {}

    def step_of(self, stamp_ns: int) -> int:
        """Number of the control cycle at a stamp, counted from the mission epoch."""
        return round((stamp_ns - self.epoch_ns) / self.period_ns)

    def steps_of(self, stamps_ns: np.ndarray) -> np.ndarray:
        """The same for stamps (M,)."""
        return np.rint((stamps_ns - self.epoch_ns) / self.period_ns).astype(np.int64)

    def message(self, key: str, stamp_ns: int, **fields: Any) -> Sample:
        """A message for output `key`; every field of its type must be given."""
        return Sample(stamp_ns, self.frames[key], **fields)


class Plant(Component):
    """The component that owns simulated time: it publishes the first stamp and advances when all have answered."""

    finished: bool = False
    _read_by_host: ClassVar[tuple[str, ...]] = ("mission", "io", "lockstep")
    _needed_by_host: ClassVar[tuple[str, ...]] = (EPOCH.name, DURATION.name)

    @classmethod
    def fastest_start(cls, values: Values) -> float:
        """Largest body rate [rad/s] at the epoch; 0 where the plant does not say."""
        return 0.0

    def begin(self) -> Outgoing:
        """Messages of step 0."""
        raise NotImplementedError

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        """Inputs stamped k (None: the partner is lost) to the messages stamped k + 1.

        At the end it sets `finished`; what it returns with that is not sent, for nobody would answer it.
        """
        raise NotImplementedError


def missing_values(component_type: type[Component], values: Values) -> Iterator[str]:
    """What a component needs and has not been given, one message each."""
    return missing(component_type.table(), values, component_type.asked_for(values))


def all_conflicts(
    component_type: type[Component], values: Values, name: str, in_force: Collection[str] = ()
) -> Iterator[str]:
    """What is wrong between the values of a component; what is missing comes first, for the rest builds on it.

    Args:
        in_force: lines of faults that it has already: they are not parsed again with every parameter that is set.
    """
    yield from missing_values(component_type, values)
    yield from conflicts(values)
    if component_type.fault_kinds:
        units = component_type.fault_units(values)
        lines = values[fault_lines.FAULTS]
        yield from fault_lines.conflicts(lines, component_type.fault_kinds, units, in_force=in_force)
    if values[LINK_FAULTS]:
        units = component_type.link_units(name, values)
        yield from fault_lines.conflicts(values[LINK_FAULTS], link_kinds.KINDS, units, LINK_FAULTS.name, in_force)
    yield from component_type.conflicts(values)
