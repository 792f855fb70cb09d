# SPDX-License-Identifier: Apache-2.0
"""The node `flight` of a process that flies again and again: `~/reset` chooses what flies next, diagnostics tell it."""

from collections.abc import Callable
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.context import Context
from rclpy.node import Node

from css_bringup.flight_result import FlightResult
from css_common.diagnostics import Diagnostics, Health
from css_common.mission import GRAPH_NODES, Mission
from css_common.mission_file import MissionError
from css_common.schema import shown
from css_msgs.srv import ResetFlight

THE_SAME_CASE = -1
ESTIMATORS = "css_estimation"
"""Package of the estimators that are chosen by their name."""


class Wish(NamedTuple):
    """What is to fly.

    Attributes:
        mission: name or file.
        overrides: KEY=VALUE, a later one wins.
        paused: it holds at the epoch.
    """

    mission: str
    overrides: tuple[str, ...]
    paused: bool = False


class FlightDirector(Node):
    """Answers `~/reset`; to be hosted beside the nodes of a flight.

    Attributes:
        asked: what is to fly next and its mission; None while nobody has asked.
    """

    def __init__(self, context: Context, flies: Wish, mission: Mission, load: Callable[[Wish], Mission]) -> None:
        """Begins to answer.

        Args:
            context: of the flight.
            flies: what flies.
            mission: the same, as it flies.
            load: makes a mission of a wish; raises MissionError where it cannot fly.
        """
        super().__init__("flight", context=context, use_global_arguments=False)
        self.asked: tuple[Wish, Mission] | None = None
        self._flies, self._mission, self._load = flies, mission, load
        self._ended: FlightResult | None = None
        self.create_service(ResetFlight, "~/reset", self._reset)
        self._diagnostics = Diagnostics(self, self.health)

    def ended(self, result: FlightResult) -> None:
        """Takes notice that the flight is over."""
        self._ended = result

    def health(self) -> Health:
        """What flies, for /diagnostics."""
        values = self._mission.values.mission
        name, counters = f"{self._mission.name}, case {values.case}", {"case": values.case, "seed": values.seed}
        if self._ended is None:
            return Health(DiagnosticStatus.OK, f"flying {name}", counters, self._mission.epoch_ns)
        counters["cycles"] = self._ended.steps
        if self._ended.failure:
            return Health(DiagnosticStatus.ERROR, f"ended: {self._ended.failure}", counters, self._mission.epoch_ns)
        level = DiagnosticStatus.WARN if self._ended.notes else DiagnosticStatus.OK
        return Health(level, f"ended: {name}", counters, self._mission.epoch_ns)

    def _reset(self, request: Any, response: Any) -> Any:
        try:
            wish = self._wish(request)
            self.asked = (wish, self._load(wish))
        except MissionError as error:
            response.message = str(error)
        response.success = not response.message
        return response

    def _with_estimator(self, name: str) -> list[str]:
        """Overrides that put a Sun estimator in the place of the one that the control listens to."""
        graph = self._mission.values.graph
        if not name or name == graph.estimator:
            return []
        names = [node.name for node in self._mission.nodes]
        entries = list(graph.nodes)
        if name not in names and graph.estimator in names:
            entries[names.index(graph.estimator)] = f"{ESTIMATORS}/{name}"
        return [f"{GRAPH_NODES}=[{', '.join(entries)}]", f"graph.estimator={name}"]

    def _wish(self, request: Any) -> Wish:
        if request.case_number < THE_SAME_CASE:
            raise MissionError(
                f"case_number: {request.case_number} given, expected a number from 0 on, or {THE_SAME_CASE}"
            )
        for override in request.overrides:
            if "=" not in override:
                raise MissionError(f"overrides: {shown(override)} given, expected KEY=VALUE")
        kept = self._flies.overrides if request.keep else ()
        case = self._mission.values.mission.case if request.case_number == THE_SAME_CASE else request.case_number
        overrides = (*kept, *request.overrides, *self._with_estimator(request.estimator), f"mission.case={case}")
        latest = {text.partition("=")[0].strip(): text for text in overrides}
        return Wish(request.mission or self._flies.mission, tuple(latest.values()), request.paused)
