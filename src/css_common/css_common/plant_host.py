# SPDX-License-Identifier: Apache-2.0
"""The node that owns simulated time: it starts the loop, waits for its partners and paces it.

Lockstep is event driven: the plant leaves stamp k when every awaited topic has a message stamped k. Timers only watch
(a partner that is silent is named, and after a limit the flight goes on without it) or hold back what a rate or a pause
keeps from coming.
"""

import contextlib
import math
import time
from collections.abc import Collection
from functools import partial

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.publisher import Publisher
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from css_common.codec import DecodeError, Sample, stamp_of
from css_common.component import Outgoing, Plant
from css_common.edge import HISTORY, Edge
from css_common.host import ComponentNode
from css_common.link import GAP
from css_common.pace_controls import PaceControls
from css_common.plant_pace import PlantPace
from css_common.qos import PROGRESS_TOPIC, RECORDER
from css_common.rcl_errors import endpoint
from css_common.schema import ParameterError
from css_common.sole_subscription import writers_of
from css_common.writers import Writer, local_processes, runs

_LEAD = HISTORY // 2  # steps ahead of the recorder: well within what a topic holds for it
_SLOWEST = 1e6  # wall time [s] of a step at the lowest rate
_LEASE = 30.0  # wall time [s] after which the middleware has forgotten a process that was killed


class PlantNode(ComponentNode):
    """Hosts a `Plant`.

    Attributes:
        pace: how fast simulated time may go; `~/pause`, `~/resume`, `~/play_next_stamp` and the parameter `rate` change
            it in flight.
    """

    component: Plant

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self.done = False
        self.failed = ""
        self._stamp = 0
        self._answers: dict[str, Sample | None] = {}
        self._awaited: dict[str, str] = {}
        self._divided = False
        self._lost: set[str] = set()
        self._held_back: Outgoing | None = None
        self._begun = False
        self._recorded_ns: int | None = None
        self._waiting_since = time.monotonic()
        self._looked = self._silent_for = 0.0
        self._looked_at = 0
        self._warned: set[str] = set()
        self._startup_timer: Timer | None = None
        self._pace_timer: Timer | None = None
        self._go_on_timer: Timer = None  # type: ignore[assignment]  # exists from configure to clean-up
        self._watch: Timer | None = None
        self._clock_publisher: Publisher | None = None
        factor = self.canonical["lockstep.realtime_factor"]
        self.pace = PlantPace(factor or math.inf, self._on_change_of_pace)
        try:
            self._controls = PaceControls(self, self.pace)
        except ValueError as error:
            self.destroy_node()
            raise ParameterError(str(error)) from error

    @property
    def stamp_ns(self) -> int:
        """Simulated time now."""
        return self._stamp

    @property
    def begun(self) -> bool:
        """True once all partners were there and the first messages are out."""
        return self._begun

    @property
    def answered(self) -> bool:
        """Nobody owes an answer to the stamp that the flight has reached."""
        return not self._begun or all(key in self._answers for key in self._needed())

    def next_cycle_ns(self) -> int:
        """Time [ns] after the epoch of the stamp that the flight has reached: its cycle is yet to come."""
        return max(0, self._stamp - self.mission.epoch_ns)

    def halt(self) -> None:
        """Ends the flight at the stamp it has reached: partners may still answer it, no step follows."""
        self.done = True

    def _configure(self) -> None:
        super()._configure()
        lockstep = self.component.values.lockstep
        consumed = {i.topic: i.key for i in self.component.inputs(self.get_name(), self.component.values)}
        awaited = self.mission.awaited
        # key of an answer: the component's own name for what it consumes, the topic for what is only awaited
        self._awaited = {consumed.get(topic, topic): topic for topic in awaited}
        self._divided = any(self.mission.outputs[topic].divider > 1 for topic in awaited)
        for topic in awaited:
            if topic not in consumed:
                with endpoint(topic):
                    self._subscribe(self.mission.topics[topic], topic, partial(self._note, topic, self.component))
        if lockstep.wait_for_recorder:
            self._recorded_ns = self.mission.epoch_ns - self.component.period_ns
            self._subscribe(Header, PROGRESS_TOPIC, self._note_recorded, publisher=RECORDER)
        if lockstep.publish_clock:
            self._clock_publisher = self.create_publisher(Clock, "/clock", 10)
        self._watch_every = min(0.5, 0.5 * lockstep.warn_after)
        self._watch = self.create_timer(self._watch_every, self._watch_partners, clock=self._steady)
        # A step in which nobody is waited for goes on by a timer: the executor must get to partners that come back.
        self._go_on_timer = self.create_timer(1e-4, self._go_on, clock=self._steady)
        self._go_on_timer.cancel()

    def _activate(self) -> None:
        # no fresh state here: a plant that was deactivated has paused, and time goes on where it stood
        self.stepper.is_active = True
        self._waiting_since = time.monotonic()
        if self._begun:
            self._go_on_timer.reset()
            self._on_change_of_pace()
        else:
            self._startup_timer = self.create_timer(0.01, self._try_to_begin, clock=self._steady)

    def _deactivate(self) -> None:
        super()._deactivate()
        self._end_startup()

    def _clean_up(self) -> None:
        self._end_startup()
        for timer in (self._pace_timer, self._go_on_timer, self._watch):
            if timer is not None:
                self.destroy_timer(timer)
        self._pace_timer = self._watch = None
        self._go_on_timer = None  # type: ignore[assignment]
        if self._clock_publisher is not None:
            self.destroy_publisher(self._clock_publisher)
            self._clock_publisher = None
        self._begun = False
        self._held_back = None
        self._answers.clear()
        self._lost.clear()
        self._warned.clear()
        self._recorded_ns = None
        super()._clean_up()

    def _end_startup(self) -> None:
        if self._startup_timer is not None:
            self.destroy_timer(self._startup_timer)
            self._startup_timer = None

    # Start

    def _try_to_begin(self) -> None:
        if self._startup_timer is None or self.done:  # firings of the timer that were under way when it was destroyed
            return
        absent = self._absent_partners()
        rivals = self._rivals()
        lockstep = self.component.values.lockstep
        waited, limit = time.monotonic() - self._waiting_since, lockstep.startup_limit
        if absent and waited < limit:
            if waited > lockstep.warn_after and not self._warned.issuperset(absent):
                self._warned.update(absent)
                self.get_logger().warning(f"the flight has not begun: {'; '.join(absent)}")
            return
        running = local_processes() if rivals else frozenset()
        # a flight that has just ended may still be leaving, and one that was killed is known until its lease ends
        leaving = lockstep.warn_after if any(runs(writer, running) for _, writer in rivals) else _LEASE
        if rivals and waited < leaving:
            return
        self._end_startup()
        if rivals:
            self.failed = (
                f"another node publishes {', '.join(f'{topic} ({writer.node})' for topic, writer in rivals)}: two "
                "flights in one ROS_DOMAIN_ID answer each other; end the other one or set another ROS_DOMAIN_ID"
            )
        elif absent:
            self.failed = f"after {limit:g} s still absent: {'; '.join(absent)}"
        if self.failed:
            self.get_logger().error(self.failed)
            self.done = True
            return
        self._begun = True
        self._warned.clear()
        self._mark_begin()
        try:
            outgoing = self.component.begin()
        except Exception as error:
            self._fail(error)
        else:
            self._go_to(self.mission.epoch_ns, outgoing)

    def _rivals(self) -> list[tuple[str, Writer]]:
        """Other writers of what this node alone should write, where its listeners might take one for it."""
        rivals: list[tuple[str, Writer]] = []
        own_name = self.get_fully_qualified_name()
        for port in self.output_ports.values():
            writers = writers_of(self, port.topic)
            # one whose node is not known yet may be of a second flight, and is waited for
            others = [writer for writer in writers if writer.node not in (own_name, "")]
            if self.mission.values.io.writers == "graph" and len(writers) - len(others) < 2:
                continue  # no listener mistakes another node for this one
            rivals += [(port.topic, writer) for writer in others or writers[1:]]
        return rivals

    def _absent_partners(self) -> list[str]:
        absent = []
        recorders = self.component.values.lockstep.recorders
        for port in self.output_ports.values():
            expected = recorders + sum(
                any(i.topic == port.topic for i in node.inputs)
                for node in self.mission.nodes
                if node.component is not self.component_type
            )
            found = port.publisher.get_subscription_count()
            if found < expected:
                absent.append(f"{port.topic} has {found} of {expected} listeners")
        for topic in self._awaited.values():
            if self.count_publishers(topic) == 0:
                absent.append(f"{topic} has no publisher")
        return absent

    # The loop

    def _go_to(self, stamp_ns: int, outgoing: Outgoing) -> None:
        self._stamp = self._last_stamp = stamp_ns
        self._answers.clear()
        self._warned.clear()
        self._waiting_since = time.monotonic()
        self.counters["cycles"] += 1
        self._let_fail(stamp_ns)
        try:
            self.stepper.apply_due(stamp_ns)
            if self._clock_publisher is not None:
                seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
                self._clock_publisher.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))
            self._publish(outgoing)
        except Exception as error:
            self._fail(error)
            return
        if not self._needed():
            self._go_on_timer.reset()

    def _go_on(self) -> None:
        if self._go_on_timer is None:  # a firing that was under way when the node was cleaned up
            return
        self._go_on_timer.cancel()
        self._advance_if_answered()

    def _fail(self, error: Exception) -> None:
        self._report_failure(error)
        self.failed = f"the plant failed at stamp {self._stamp}: {error}"
        self.done = True

    def _receive(self, key: str, edge: Edge, data: bytes) -> None:
        if self.edges.get(key) is not edge:  # was under way when the node was cleaned up
            return
        if edge.source.topic in self._lost:
            # it is back: whatever it says next counts, and the loop waits for it again
            edge.guard.last = None
        sample = edge.accept(data)
        if sample is not None:
            given = None if sample.frame_id == GAP else sample
            self._take(key, edge.source.topic, sample.stamp_ns, given)

    def _note_recorded(self, data: bytes) -> None:
        with contextlib.suppress(DecodeError):
            self._recorded_ns = stamp_of(data)
            self._advance_if_answered()

    def _is_ahead_of_recorder(self) -> bool:
        recorded = self._recorded_ns
        return recorded is not None and self._stamp - recorded > _LEAD * self.component.period_ns

    def _note(self, topic: str, component: Plant, data: bytes) -> None:
        if component is not self.component:  # was under way when the node was cleaned up
            return
        try:
            stamp_ns = stamp_of(data)
        except DecodeError:
            self.counters["malformed_answers"] += 1
            return
        self._take(topic, topic, stamp_ns, None)

    def _take(self, key: str, topic: str, stamp_ns: int, sample: Sample | None) -> None:
        if topic in self._lost:
            # Whatever stamp it answers, it is alive: time must hold for it, or it would never catch up.
            self._lost.discard(topic)
            self.get_logger().info(f"{topic} is back")
        if stamp_ns != self._stamp:
            self.counters["answers_for_another_stamp"] += 1
            return
        self._answers.setdefault(key, sample)  # once it was said that nothing comes, it is too late
        self._advance_if_answered()

    def _advance_if_answered(self) -> None:
        if not self._begun or self.done or not self._is_active or self._held_back is not None:
            return
        if self.answered and not self._is_ahead_of_recorder():
            self._advance()

    def _needed(self) -> Collection[str]:
        if not self._divided and not self._lost:
            return self._awaited
        outputs = self.mission.outputs
        step = self.component.step_of(self._stamp)
        return [
            key
            for key, topic in self._awaited.items()
            if topic not in self._lost and step % outputs[topic].divider == 0
        ]

    def _advance(self) -> None:
        stamp_ns = self._stamp
        keys = self.matcher.inputs
        try:
            outgoing = self.component.cycle(stamp_ns, {key: self._answers.get(key) for key in keys})
        except Exception as error:
            self._fail(error)
            return
        if self.component.finished:
            self.done = True
        elif self.pace.free:
            self._go_to(stamp_ns + self.component.period_ns, outgoing)
        else:
            self._held_back = outgoing
            self._begin_to_pace()

    def _begin_to_pace(self) -> None:
        """Has the wall clock hold time back from the first answer on: until then partners are still starting."""
        if self.pace.paused:
            if self.pace.take_granted():
                self._let_go()
        elif self._pace_timer is None:
            period = min(max(self.component.period_ns * 1e-9 / self.pace.rate, 1e-4), _SLOWEST)
            self._pace_timer = self.create_timer(period, self._on_pace, clock=self._steady)

    def _on_pace(self) -> None:
        if self._pace_timer is None or not self._is_active or self.done:
            return
        if self._held_back is not None:
            self._let_go()
        elif self._begun:
            self.counters["deadline_missed"] += 1

    def _let_go(self) -> None:
        outgoing, self._held_back = self._held_back, None
        assert outgoing is not None
        self._go_to(self._stamp + self.component.period_ns, outgoing)

    def _on_change_of_pace(self) -> None:
        """Holds back, or lets go what is held back, as the pace says now."""
        if self._pace_timer is not None:
            self.destroy_timer(self._pace_timer)
            self._pace_timer = None
        if self._held_back is None or not self._is_active or self.done:
            return  # the next step will ask
        if self.pace.free:
            self._let_go()
        else:
            self._begin_to_pace()

    def _own_state(self) -> tuple[bytes, str]:
        level, message = super()._own_state()
        if level != DiagnosticStatus.OK or not self._is_active:
            return level, message
        if self.done:
            return level, self.failed or "the flight has ended"
        return level, "paused" if self.pace.paused else message

    # Partners that fall silent

    def _silence(self) -> float:
        """Wall time [s] of waiting while this node looked on; time in which it did not run itself is no silence."""
        now = time.monotonic()
        begin = max(self._waiting_since, self._looked, now - 2.0 * self._watch_every)
        self._looked = now
        self._silent_for = (self._silent_for if self._looked_at == self._stamp else 0.0) + now - begin
        self._looked_at = self._stamp
        return self._silent_for

    def _watch_partners(self) -> None:
        if not self._begun or self.done or not self._is_active or self._held_back is not None:
            return
        silent_for = self._silence()
        lockstep = self.component.values.lockstep
        missing = [self._awaited[key] for key in self._needed() if key not in self._answers]
        not_recorded = not missing and self._is_ahead_of_recorder()
        if not_recorded:
            missing = [PROGRESS_TOPIC]
        if silent_for < lockstep.warn_after or not missing:
            return
        # the recorder gives up a topic after the same limit, and must get to say so
        if silent_for >= 2.0 * lockstep.hold_limit and not_recorded:
            self.failed = f"the recorder has said nothing for {silent_for:.1f} s"
            self.get_logger().error(self.failed)
            self.done = True
        elif silent_for >= lockstep.hold_limit and not not_recorded:
            self.get_logger().error(
                f"no {', '.join(missing)} for {silent_for:.1f} s: going on without, actuators at rest until it is back"
            )
            self._lost.update(missing)
            self.counters["partners_lost"] += len(missing)
            self._advance()
        elif not self._warned.issuperset(missing):
            self._warned.update(missing)
            self.counters["time_held"] += 1
            self.get_logger().warning(
                f"simulated time holds at {(self._stamp - self.mission.epoch_ns) / 1e9:.1f} s: "
                f"waiting for {', '.join(missing)}"
            )
