# SPDX-License-Identifier: Apache-2.0
"""The lifecycle node around a component: everything that all nodes of the graph have in common.

Parameters, topics, checks at the edge, stamp matching, scripted events, diagnostics. What a node computes is in its
component; what only the node that owns simulated time does is in `css_common.plant_host`.
"""

import contextlib
import time
import traceback
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import QoSPolicyKind
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.timer import Timer

from css_common import process_faults, ros_parameters
from css_common.codec import Sample, codec_of
from css_common.component import Component, Outgoing, Plant, Standing
from css_common.component_error import ComponentError
from css_common.diagnostics import Diagnostics, Health
from css_common.edge import REJECTED, STRANGER, Edge
from css_common.fault_services import FaultServices
from css_common.link_kinds import LINK_FAULTS
from css_common.matching import Matcher
from css_common.mission import Event, Mission
from css_common.output_port import OutputPort
from css_common.process_faults import ProcessFaults
from css_common.qos import LOOP_SUBSCRIPTION
from css_common.rcl_errors import endpoint
from css_common.ros_internals import RCLError
from css_common.schema import ParameterError, Values
from css_common.sole_subscription import SoleSubscription
from css_common.stepping import Stepper, conflict
from css_common.supervised import announced_before
from css_common.writers import writer_choice

_SUCCESS = TransitionCallbackReturn.SUCCESS
_FAILURE = TransitionCallbackReturn.FAILURE
# Durability too: drivers publish volatile, which a subscription to a topic of the loop would never match.
_OVERRIDES = QoSOverridingOptions(
    (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)
)


def rehearse(component_type: type[Component], name: str, values: Values) -> None:
    """Cycles a stand-in of a component once on empty messages, so that its kernels are compiled before the flight.

    Compiling takes seconds, loading compiled code a good part of one: not in the first cycle of a control loop.
    """
    stand_in = component_type(name, values)
    received: dict[str, Sample | None] = {}
    for source in component_type.inputs(name, values):
        codec = codec_of(source.message_type)
        lengths = {field: np.zeros(length) for field, length in source.lengths.items()}
        sample = received[source.key] = codec.sample(stand_in.epoch_ns, "", **lengths)
        codec.first_not_finite(codec.real_fields(), codec.decode(codec.encode(sample)))
    # What a component makes of empty messages is its own affair; here only that it has been through it counts.
    with contextlib.suppress(Exception):
        if isinstance(stand_in, Plant):
            stand_in.begin()
        stand_in.cycle(stand_in.epoch_ns, received)


class ComponentNode(LifecycleNode):
    """Hosts one component."""

    def __init__(
        self,
        component_type: type[Component],
        name: str,
        mission: Mission,
        *,
        context: Context | None = None,
        use_global_arguments: bool = True,
    ) -> None:
        """Declares the parameters; topics come with the configure transition.

        Args:
            component_type: what to host.
            name: node name; a command-line remapping wins.
            mission: where parameter values, events and the rest of the graph come from.
            context: ROS context.
            use_global_arguments: False in a composed process, where one command line serves many nodes.

        Raises:
            ParameterError: an override that its specification refuses.
        """
        super().__init__(name, context=context, use_global_arguments=use_global_arguments)
        self.mission = mission
        self.component_type = component_type
        # component, stepper and matcher exist from configure to clean-up, and only then do messages and timers come in
        self.component: Component = None  # type: ignore[assignment]
        self.stepper: Stepper = None  # type: ignore[assignment]
        self.counters: Counter[str] = Counter()
        self.edges: dict[str, Edge] = {}
        self.matcher: Matcher = None  # type: ignore[assignment]
        self._table = component_type.table()
        try:
            self.canonical = self._declare()
        except BaseException:
            self.destroy_node()  # nobody else will: it is handed to nobody
            raise
        self.output_ports: dict[str, OutputPort] = {}
        self.subscriptions_made: list[SoleSubscription] = []
        self.refused = ""
        self._unanswered: tuple[int, dict[str, Sample | None]] | None = None
        self._forgiven: Counter[str] = Counter()  # failures before the last start, which are none of this one's
        self._seen_errors: set[str] = set()
        self._performing = False
        self._waiting_stamp: int | None = None
        self._unmet_reported = False
        self._last_stamp = 0
        self._began: tuple[float, float] | None = None
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._diagnostics = Diagnostics(self, self.health)
        self._deadline_timer: Timer | None = None
        self._overdue_stamp: int | None = None
        self._guard_lifecycle_service()
        self.fault_services = FaultServices(self)
        self._process_faults = ProcessFaults(self._say_farewell)
        ros_parameters.guard(self, self._table, self.canonical, self._tune, self._conflict)

    def next_cycle_ns(self) -> int:
        """Time [ns] after the epoch at which the next cycle is due."""
        return max(0, self._last_stamp + self.mission.period_ns - self.mission.epoch_ns)

    # Start and transitions

    def start(self) -> bool:
        """Configures and activates when the node is to start by itself; False when that failed."""
        if not self.canonical["autostart"]:
            return True
        return self.trigger_configure() == _SUCCESS and self.trigger_activate() == _SUCCESS

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Builds the component and its topics. On a conflict between parameters the node stays unconfigured."""
        return self._guarded(self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begins to cycle, from a fresh state when the node was deactivated before."""
        return self._guarded(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stops cycling; what a component publishes while idle goes on."""
        return self._guarded(self._deactivate)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Gives topics and state up."""
        return self._guarded(self._clean_up)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Gives topics and state up, whatever the state."""
        return self._guarded(self._clean_up)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Goes back to unconfigured after a transition that failed."""
        return self._guarded(self._clean_up)

    @property
    def _is_active(self) -> bool:
        return self.stepper is not None and self.stepper.is_active

    def _guarded(self, transition) -> TransitionCallbackReturn:
        # rclpy turns an exception in a transition into a silent ERROR
        try:
            transition()
        except ParameterError as error:
            self.refused = str(error)
            self.get_logger().error(self.refused)
            self._clean_up()  # a transition that is refused leads to no error state, which would do that
            return _FAILURE
        except Exception:
            if self.context.ok():  # else a signal has ended ROS under it, and that is no news
                self.get_logger().error(f"{transition.__name__.lstrip('_')} failed:\n{traceback.format_exc()}")
            return TransitionCallbackReturn.ERROR
        return _SUCCESS

    def _guard_lifecycle_service(self) -> None:
        # An invalid transition request raises out of spin in rclpy 7.1 and would end the process.
        service = self._service_change_state
        inner = service.callback

        def answer(request, response) -> Any:
            try:
                return inner(request, response)
            except Exception as error:
                self.get_logger().warning(f"lifecycle request refused: {error}")
                self.counters["lifecycle_refused"] += 1
                response.success = False
                return response

        service.callback = answer

    def _declare(self) -> dict:
        node = self.mission.node_of(self.component_type, self.get_name())
        return ros_parameters.declare(self, self._table, node.canonical)

    def _configure(self) -> None:
        self.check()
        name = self.get_name()
        self.stepper = self._stepper(name)
        self.component = self.stepper.component
        self.component.report = self.get_logger().info
        self.component.now_ns = lambda: self.get_clock().now().nanoseconds
        values = self.component.values
        inputs = self.component_type.inputs(name, values)
        if self.component_type.rehearses:
            rehearse(self.component_type, name, values)
        published = self.mission.topics
        awaited = [i.key for i in inputs if i.required or i.topic in published]
        self.matcher = Matcher(self.component, inputs, awaited)
        self.stepper.tuned = self.matcher.retune
        for output in self.component_type.all_outputs(name, values):
            with endpoint(output.topic):
                self.output_ports[output.key] = OutputPort(self, output, _OVERRIDES)
        for source in inputs:
            edge = Edge(source, values, self.get_logger().warning)
            edge.now_ns = self.component.now_ns
            self.edges[source.key] = edge
            receive = partial(self._receive, source.key, edge)
            with endpoint(source.topic):
                self._subscribe(source.message_type, source.topic, receive, edge.begin_again)
        if self.mission.values.lockstep.realtime_factor > 0.0 and any(i.may_be_silent for i in inputs):
            self._deadline_timer = self.create_timer(values.io.deadline, self._run_overdue, clock=self._steady)

    def check(self) -> None:
        """Looks whether the parameters fit together.

        Raises:
            ParameterError: they do not.
        """
        reason = self._conflict(self.canonical)
        if reason:
            raise ParameterError(reason)

    def _subscribe(
        self,
        message_type: type,
        topic: str,
        callback: Callable[[bytes], None],
        on_hand_over: Callable[[], object] = lambda: None,
        publisher: str = "",
    ) -> None:
        self.subscriptions_made.append(
            SoleSubscription(
                self,
                message_type,
                topic,
                callback,
                LOOP_SUBSCRIPTION,
                writer_choice(self.mission, topic, self.get_namespace(), node=publisher),
                overriding=_OVERRIDES,
                on_hand_over=on_hand_over,
            )
        )

    def _activate(self) -> None:
        if self.stepper.activate():
            self.counters["reactivated"] += 1
        unanswered, self._unanswered = self._unanswered, None
        if unanswered is not None:
            self._run(*unanswered)

    def _deactivate(self) -> None:
        self.stepper.deactivate()
        self.counters["deactivated"] += 1

    def _clean_up(self) -> None:
        self.stop_listening()
        for port in self.output_ports.values():
            self.destroy_publisher(port.publisher)
        if self._deadline_timer is not None:
            self.destroy_timer(self._deadline_timer)
            self._deadline_timer = None
        self.output_ports.clear()
        self.edges.clear()
        if self.component is not None:
            self.component.release()
        self.component = self.stepper = self.matcher = None  # type: ignore[assignment]
        self._overdue_stamp = self._unanswered = None
        self._forgiven = Counter(self.counters)
        self._seen_errors.clear()

    def stop_listening(self) -> None:
        """Ends all subscriptions; to be called while the executor still has the node."""
        for subscription in self.subscriptions_made:
            subscription.destroy()
        self.subscriptions_made.clear()

    def destroy_node(self) -> None:
        """Destroys the node now; rclpy alone would leave it, and its name, to the garbage collector."""
        if self.component is not None:
            self.component.release()
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def finish(self, seconds: float = 4.0) -> None:
        """Waits until listeners have what was published, so that a message is not lost with its sender.

        The middleware asks a listener that is behind again after 3 s.
        """
        limit = time.monotonic() + seconds
        try:
            for port in self.output_ports.values():
                port.publisher.wait_for_all_acked(Duration(seconds=max(0.0, limit - time.monotonic())))
        except RCLError:
            if self.context.ok():  # else a signal has ended all traffic already
                raise

    def _mark_begin(self) -> None:
        self._began = (time.perf_counter(), time.process_time())

    def summary(self) -> dict:
        """Figures of the run: wall and processor time [s] since the first cycle, last stamp, counters."""
        wall, cpu = self._began or (time.perf_counter(), time.process_time())
        return {
            "wall_s": time.perf_counter() - wall,
            "cpu_s": time.process_time() - cpu,
            "last_stamp_ns": self._last_stamp,
            "counters": self.health().counters,
        }

    # Messages

    def _receive(self, key: str, edge: Edge, data: bytes) -> None:
        if self.edges.get(key) is not edge:  # was under way when the node was cleaned up
            return
        sample = edge.accept(data)
        if sample is None:
            return
        try:
            cycles = self.matcher.offer(key, sample)
        except Exception as error:  # the component begins anew in there when time was set back
            self._report_failure(error)
            return
        for stamp_ns, received in cycles:
            self._run(stamp_ns, received)

    def _run_overdue(self) -> None:
        if self.matcher is None:  # a firing that was under way when the node was cleaned up
            return
        # Two firings apart: what was pending at the last one and still is has waited a whole deadline.
        waiting = self.matcher.oldest_pending()
        if waiting is not None and waiting == self._overdue_stamp:
            for stamp_ns, received in self.matcher.overdue():
                self.counters["deadline_missed"] += 1
                self._run(stamp_ns, received)
        self._overdue_stamp = waiting

    def _run(self, stamp_ns: int, received: dict[str, Sample | None]) -> None:
        self._last_stamp = stamp_ns
        self._let_fail(stamp_ns)
        if self._began is None:
            self._mark_begin()
        # An exception that leaves a callback ends the process, so whatever a component does wrong ends here.
        try:
            outgoing = self.stepper.step(stamp_ns, received)
            if not self._is_active:
                self._unanswered = None if outgoing or not self._awaited_in_lockstep() else (stamp_ns, received)
            self._publish(outgoing)
        except Exception as error:
            self._report_failure(error)
            self._say_that_nothing_comes(stamp_ns)
        else:
            self.counters["cycles"] += 1

    def _say_that_nothing_comes(self, stamp_ns: int) -> None:
        """Has nobody wait for the messages of a cycle that failed, where time would stand still for them."""
        if not self._awaited_in_lockstep():
            return
        try:
            self._publish(self.stepper.gaps(stamp_ns))
        except Exception as error:
            self._report_failure(error)

    def _let_fail(self, stamp_ns: int) -> None:
        """Has the faults of its process that are due."""
        link = self.stepper.link
        if link.of_process:
            self._process_faults.act(link.of_process, self.component.step_of(stamp_ns))

    def _say_farewell(self) -> None:
        self._publish({})  # its faults
        self.finish(1.0)

    def _awaited_in_lockstep(self) -> bool:
        """Whether simulated time may stand still for this node: what it leaves out it then has to make up for."""
        return self.mission.plant is not None and self.mission.values.lockstep.realtime_factor == 0.0

    def _publish(self, outgoing: Outgoing) -> None:
        for port, _, data in self.stepper.sent(self._last_stamp, outgoing):
            self.output_ports[port.key].publish(data)

    def _withhold(self, topic: str, field: str) -> None:
        self.counters["withheld_not_finite"] += 1
        self._report_once(f"{topic}: {field} is not finite, message withheld")

    def _report_failure(self, error: Exception) -> None:
        self.counters["cycle_failed"] += 1
        trace = f" {error}" if isinstance(error, ComponentError) else f"\n{''.join(traceback.format_exception(error))}"
        self._report_once(f"cycle failed, no output for this stamp:{trace}")

    def _report_once(self, text: str) -> None:
        if text not in self._seen_errors:
            self._seen_errors.add(text)
            self.get_logger().error(text + " (further ones are counted, not reported)")

    def _stepper(self, name: str) -> Stepper:
        mission = self.mission
        stepper = Stepper(self.component_type, name, self.canonical, mission.events, mission.epoch_ns)
        stepper.link.forget(announced_before())
        stepper.is_active = False
        stepper.perform = self._perform
        stepper.failed = self._report_failure
        stepper.withheld = self._withhold
        return stepper

    def _perform(self, event: Event) -> None:
        """Does what a scripted event says, by the same ways as an operator."""
        self._performing = True
        try:
            self._do(event)
        finally:
            self._performing = False

    def _do(self, event: Event) -> None:
        self.get_logger().info(f"event {event.name} at {event.time:g} s: {event.action} {event.parameter}".rstrip())
        if event.action == "set":
            (result,) = self.set_parameters([RosParameter(event.parameter, value=event.value)])
            if not result.successful:
                self.counters["events_refused"] += 1
                self.get_logger().error(f"event {event.name}: {result.reason}")
        elif event.action == "deactivate" and self._is_active:
            self.trigger_deactivate()
        elif event.action == "activate" and not self._is_active:
            self._unanswered = None  # the step of the event follows
            self.trigger_activate()

    # Parameters

    def _conflict(self, canonical: dict) -> str | None:
        reason = process_faults.refusal(canonical[LINK_FAULTS.name])
        if reason is not None:
            return f"{LINK_FAULTS.name}: {reason}"
        if self.stepper is not None:
            return self.stepper.refusal(canonical)
        return conflict(self.component_type, canonical, self.get_name())

    def _tune(self, canonical: dict) -> None:
        if self.stepper is None:
            return
        self.stepper.tune(canonical)
        if self._deadline_timer is not None:
            self._deadline_timer.timer_period_ns = self.matcher.deadline_ns
        if not self._performing:  # else a cycle is under way, and the next ones come after it
            for stamp_ns, received in self.matcher.released():
                self._run(stamp_ns, received)

    # Health

    def health(self) -> Health:
        """Level, one line and counters for /diagnostics."""
        counters: dict[str, int | float] = dict(self.counters)
        for key, edge in self.edges.items():
            counters[f"{key}.accepted"] = edge.accepted
            if edge.repeated:
                counters[f"{key}.repeated"] = edge.repeated
            for kind, count in edge.rejected.items():
                counters[f"{key}{REJECTED}{kind}"] = count
            for kind, count in edge.missing.items():
                counters[f"{key}.{kind}"] = count
        for subscription in self.subscriptions_made:
            for node, count in subscription.refused.items():
                counters[f"{subscription.topic}{STRANGER}{node}"] = count
        if self.matcher is not None:
            counters["unmatched"] = self.matcher.unmatched
            counters["time_set_back"] = self.matcher.set_back
            if self.stepper.skipped:
                counters["skipped"] = self.stepper.skipped
        level, message = self._own_state()
        standing = Standing() if self.component is None else self.component.standing()
        counters.update(standing.figures)
        if standing.warning and level != DiagnosticStatus.ERROR:
            level, message = DiagnosticStatus.ERROR if standing.failing else DiagnosticStatus.WARN, standing.warning
        left_out = () if self.component is None else self.component.left_out
        if left_out and level == DiagnosticStatus.OK:
            level, message = DiagnosticStatus.WARN, f"held for failed: {', '.join(left_out)}"
        return Health(level, message, counters, self._last_stamp, left_out)

    def _own_state(self) -> tuple[bytes, str]:
        """Level and one line, of what goes on in the node itself."""
        if any(self.counters[kind] > self._forgiven[kind] for kind in ("cycle_failed", "withheld_not_finite")):
            return DiagnosticStatus.ERROR, "cycles failed"
        if any(edge.rejected for edge in self.edges.values()):
            return DiagnosticStatus.WARN, "messages rejected"
        if any(subscription.refused for subscription in self.subscriptions_made):
            return DiagnosticStatus.WARN, "other nodes write its topics too"
        unmet = self._unmet()
        if unmet:
            return DiagnosticStatus.WARN, unmet
        state = "active" if self._is_active else "inactive"
        return DiagnosticStatus.OK, state

    def _named(self, topic: str) -> str:
        """A topic, and how to do without it."""
        assert self.matcher is not None
        switch = next(i.switch for i in self.matcher.inputs.values() if i.topic == topic)
        return f"{topic} (not when parameter {switch} is false)" if switch else topic

    def _unmet(self) -> str:
        """Which messages did not come, for cycles that did not run or have waited since the last look; warns once."""
        if self.matcher is None:
            return ""
        lines = self.matcher.complaints()
        waiting = self.matcher.oldest_pending()
        if waiting is not None and waiting == self._waiting_stamp:
            lines.append(f"stamp {waiting} ns waits for {', '.join(map(self._named, self.matcher.missing()))}")
        self._waiting_stamp = waiting
        text = "; ".join(lines)
        if text and not self._unmet_reported:
            self._unmet_reported = True
            self.get_logger().warning(f"{text} (what follows is in /diagnostics)")
        return text
