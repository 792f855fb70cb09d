# SPDX-License-Identifier: Apache-2.0
"""The calls of a kernel in a recorded flight, made again: its arguments and what it gave, as the structs of C.

The component is stepped over the recording as its node was: the same checks at the edge, the same matching of stamps,
the same scripted events. That these are the calls of the flight shows in the messages, which are compared with those
that were recorded.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from css_common.codec import codec_of
from css_common.edge import Edge
from css_common.matching import Matcher
from css_common.mission import Mission
from css_common.mission_node import Node
from css_common.stepping import Stepper
from css_export.c_main import BEGIN, PARAMETERS, STEP, state_hash, word
from css_export.errors import ExportError
from css_export.flown import INPUT, OUTPUT, Function
from css_export.flown import PARAMETERS as PARAMETERS_ROLE
from css_export.flown import STATE as STATE_ROLE
from css_export.layout import Struct, other_order, pack
from css_export.library import Library, state_values
from css_recording.bag_metadata import absolute
from css_recording.bag_reader import BagReader


@dataclass
class Calls:
    """What a library is to be given, and what it is to give.

    Attributes:
        stream: as `c_main` describes it.
        inputs: struct of inputs of each step.
        outputs: struct of outputs after each step.
        hashes: of the state after it.
        hashes_of_big_endian: as a processor has it whose numbers begin with the most significant byte; where asked for.
        messages: that the component gave, and of them those that are the bytes that were recorded.
        begun: steps before which the state was set up anew.
    """

    stream: bytearray = field(default_factory=bytearray)
    inputs: list[bytes] = field(default_factory=list)
    outputs: list[bytes] = field(default_factory=list)
    hashes: list[int] = field(default_factory=list)
    hashes_of_big_endian: list[int] = field(default_factory=list)
    messages: int = 0
    as_recorded: int = 0
    begun: list[int] = field(default_factory=list)

    @property
    def steps(self) -> int:
        """How many there are."""
        return len(self.outputs)


class Listener:
    """Stands between a component and a kernel, and keeps what passes."""

    def __init__(self, library: Library, most: int | None = None, *, big_endian: bool = False) -> None:
        """Listens to the kernel of a library, for at most so many steps."""
        self._big_endian = big_endian
        self.calls = Calls()
        self._library = library
        self._structs = library.interface.structs
        self._most = most
        function = library.function
        self._parameters = bytes(self._packed(PARAMETERS_ROLE, function.sample))
        self._fresh = bytes(pack(self._structs[STATE_ROLE], state_values(function, function.sample)))
        self._state = self._fresh

    @property
    def is_full(self) -> bool:
        """No more steps are wanted."""
        return self._most is not None and self.calls.steps >= self._most

    def around(self, kernel: Callable[..., Any]) -> Callable[..., Any]:
        """The kernel, listened to."""

        def call(*arguments: Any) -> Any:
            if self.is_full:
                return kernel(*arguments)
            self._note_before(arguments)
            result = kernel(*arguments)
            self._note_after(arguments, result)
            return result

        return call

    def _packed(self, role: str, arguments: tuple[Any, ...]) -> bytearray:
        function = self._library.function
        value: Any = tuple(arguments[i] for i in function.places(role))
        return pack(self._structs[role], value[0] if role == PARAMETERS_ROLE else value)

    def _note_before(self, arguments: tuple[Any, ...]) -> None:
        function, calls = self._library.function, self.calls
        given = bytes(pack(self._structs[STATE_ROLE], state_values(function, arguments)))
        if given != self._state:
            if given != self._fresh:
                raise ExportError(
                    f"{function.name}: its state before step {calls.steps} is neither that after the step before nor a "
                    "fresh one; only a component that leaves its state alone can be compared"
                )
            calls.stream += word(BEGIN)
            calls.begun.append(calls.steps)
        parameters = bytes(self._packed(PARAMETERS_ROLE, arguments))
        if parameters != self._parameters:
            calls.stream += word(PARAMETERS) + parameters
            self._parameters = parameters
        calls.inputs.append(bytes(self._packed(INPUT, arguments)))
        calls.stream += word(STEP) + calls.inputs[-1]

    def _note_after(self, arguments: tuple[Any, ...], result: Any) -> None:
        function, calls = self._library.function, self.calls
        output, after = result, arguments
        if function.keeps_state:
            after = list(arguments)  # type: ignore[assignment]
            after[function.places(STATE_ROLE)[0]], output = result  # type: ignore[index]
        self._state = bytes(pack(self._structs[STATE_ROLE], state_values(function, tuple(after))))
        calls.hashes.append(state_hash(self._state))
        if self._big_endian:
            turned = other_order(self._structs[STATE_ROLE], self._state)
            calls.hashes_of_big_endian.append(state_hash(turned, ">u8"))
        calls.outputs.append(bytes(packed_output(function, self._structs[OUTPUT], arguments, output)))


def packed_output(function: Function, struct: Struct, arguments: tuple[Any, ...], output: Any) -> bytearray:
    """The struct of outputs of a call: arrays that were written, and what the kernel gave."""
    written = tuple(arguments[i] for i in function.places(OUTPUT))
    given = tuple(output) if hasattr(output, "_fields") else (output,)
    return pack(struct, written + given)


def listen(
    reader: BagReader,
    mission: Mission,
    library: Library,
    most: int | None = None,
    through: Callable[[Callable[..., Any]], Callable[..., Any]] | None = None,
    *,
    big_endian: bool = False,
) -> Calls:
    """The calls of a library's kernel in a recorded flight.

    Args:
        reader: of the recording.
        mission: that flew.
        library: of the kernel.
        most: steps.
        through: gives what is asked in the place of the kernel.
        big_endian: hashes of the state as such a processor has it are wanted, too.

    Raises:
        ExportError: the recording lacks the inputs of the component.
    """
    listener = Listener(library, most, big_endian=big_endian)
    node = mission.node(library.function.component)
    stepper = Stepper(node.component, node.name, node.canonical, mission.events, mission.epoch_ns)
    if through is not None:
        attach(stepper.component, library.function.attribute, through)
    attach(stepper.component, library.function.attribute, listener.around)
    flown = _recorded(reader, node)
    for stamp_ns, received in _cycles(reader, node, stepper):
        for port, sample, data in stepper.sent(stamp_ns, stepper.step(stamp_ns, received)):
            known = flown.get((absolute(port.topic), sample.stamp_ns))
            if known is not None:
                listener.calls.messages += 1
                listener.calls.as_recorded += known == data
        if listener.is_full:
            break
    return listener.calls


def attach(component: Any, attribute: str, around: Callable[[Callable[..., Any]], Callable[..., Any]]) -> None:
    """Puts something in the place of a function that a component calls, now and whenever it begins anew."""
    configure = component.configure

    def configured() -> None:
        configure()
        setattr(component, attribute, around(getattr(component, attribute)))

    component.configure = configured
    setattr(component, attribute, around(getattr(component, attribute)))


def _recorded(reader: BagReader, node: Node) -> dict[tuple[str, int], bytes]:
    """What the node said in flight, by topic and stamp."""
    topics = {absolute(output.topic) for output in node.outputs if not output.events}
    topics &= {entry.topic.name for entry in reader.topics if entry.count}
    codecs = {absolute(output.topic): codec_of(output.message_type) for output in node.outputs}
    messages = reader.messages(topics) if topics else ()
    return {(m.topic, codecs[m.topic].decode(m.data).stamp_ns): m.data for m in messages}


def _cycles(reader: BagReader, node: Node, stepper: Stepper) -> Iterator[tuple[int, Any]]:
    recorded = {entry.topic.name for entry in reader.topics if entry.count}
    sources = [i for i in node.inputs if absolute(i.topic) in recorded]
    missing = [i.topic for i in node.inputs if i.required and i not in sources]
    if missing:
        raise ExportError(
            f"{reader.path}: {node.name} needs {', '.join(missing)}; the recording has "
            f"{', '.join(sorted(recorded)) or 'nothing'}"
        )
    matcher = Matcher(stepper.component, node.inputs, tuple(i.key for i in sources))
    stepper.tuned = matcher.retune
    edges = {absolute(i.topic): Edge(i, node.values, lambda line: None) for i in sources}
    for message in reader.messages(edges.keys()):
        edge = edges[message.topic]
        sample = edge.accept(message.data)
        if sample is not None:
            yield from matcher.offer(edge.source.key, sample)
