# SPDX-License-Identifier: Apache-2.0
"""Studies: many cases of a mission in several configurations, resumable, with the same bytes however they are run."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from css_analysis.configured_mission import configured, is_attitude_filter
from css_analysis.flight_metrics import Windows, windows_of
from css_analysis.study_record import StudyRecord, read_record
from css_common.kernel import study_hash
from css_common.mission import Mission, MissionError
from css_common.preflight import preflight, report
from css_monte_carlo import chunk
from css_monte_carlo.attitude_guess import takes_guess
from css_monte_carlo.case_missions import drawn_names
from css_monte_carlo.chunk import ChunkTask
from css_monte_carlo.direct_flight import refuse_what_needs_the_graph
from css_monte_carlo.drawn_faults import COLUMN, has_faults
from css_monte_carlo.measures import ATTITUDE, HEADING, Measure
from css_monte_carlo.mission_parts import NoPlace, parts_of
from css_monte_carlo.percentiles import over_cases
from css_monte_carlo.schedulers import Scheduler, ThreadScheduler
from css_monte_carlo.study_folder import StudyFolder

CHUNK_CASES = 20
"""Cases of one chunk: a second or two of work for an orbit."""

MISSION_FILE = "mission.yaml"
"""What a study of dispersed parameters flies, as a file: `fly` flies any of its cases."""

Progress = Callable[[int, int], None]
"""Called with cases done and cases in all."""


class Configuration(NamedTuple):
    """One way to fly all cases."""

    estimator: str  # whose estimates are measured: a Sun estimator, which controls, or an attitude filter
    gyro: bool
    overrides: tuple[str, ...] = ()  # `key=value` on top of the mission, such as a point of a sweep

    def applied(self, mission: Mission) -> Mission:
        """The mission that it flies.

        Raises:
            MissionError: there is no such estimator or key.
        """
        # the estimator first: only then does the mission know its keys
        return configured(mission, estimator=self.estimator, gyro=self.gyro).with_overrides(self.overrides)

    @property
    def columns(self) -> dict[str, Any]:
        """What names it in the tables of a study."""
        return {"estimator": self.estimator, "gyro": self.gyro, "overrides": " ".join(self.overrides)}


@dataclass(frozen=True)
class Study(StudyRecord):
    """A complete study, and what it cost.

    Attributes:
        cpu_s: processor time of the loop in this run, 0 for a study that was there.
        flown: case-steps flown in this run.
        warnings: what the checks before the flights found doubtful, in this run.
    """

    cpu_s: float = 0.0
    flown: int = 0
    warnings: tuple[str, ...] = ()


def read_study(folder: str | Path) -> Study:
    """A study that lies in a folder.

    Raises:
        StudyError: it is not there, not complete or damaged.
    """
    record = read_record(folder)
    return Study(record.folder, record.manifest, record.cases, record.percentiles)


def run_study(
    mission: Mission,
    configurations: Iterable[Configuration],
    cases: int,
    folder: str | Path,
    *,
    first_case: int = 0,
    sample_s: float = 1.0,
    guess_deg: float = 0.0,
    threads: int | None = None,
    progress: Progress | None = None,
    scheduler: Scheduler | None = None,
) -> Study:
    """Flies cases first_case, first_case + 1, ... in every configuration; what an earlier start finished is kept.

    Args:
        mission: what flies; its case is ignored.
        folder: a new or empty folder, or that of the same study begun before.
        sample_s: time between samples of the percentiles [s].
        guess_deg: attitude filters begin with an attitude that errs by so many degrees about each axis, 1 sigma; 0: as
            their parameters say.
        threads: flights at a time in this process; None: one per processor.
        progress: told after each chunk.
        scheduler: where chunks run; None: threads of this process.

    Raises:
        MissionError: a configuration does not fit the mission, a check before the flight refuses it, or it measures
            nothing.
        StudyError: the folder cannot be used.
    """
    configurations = tuple(configurations)
    missions = [configuration.applied(mission) for configuration in configurations]
    for flies in missions:
        refuse_what_needs_the_graph(flies)
    stepped = [_why_stepped(flown, c.estimator) for flown, c in zip(missions, configurations, strict=True)]
    if guess_deg > 0.0:
        for configuration, flies, reason in zip(configurations, missions, stepped, strict=True):
            _check_guess(flies, configuration.estimator, reason)
    doubts = [line for flown in missions for line in preflight(flown)]
    doubts += [f"{reason}; flown node by node, some hundred times slower" for reason in stepped if reason]
    warnings = tuple(dict.fromkeys(doubts))
    report(warnings)
    sample_every = max(1, round(sample_s / (mission.period_ns * 1e-9)))
    store = StudyFolder(Path(folder))
    named = zip(configurations, missions, strict=True)
    filters = list(dict.fromkeys(c.estimator for c, flown in named if is_attitude_filter(flown, c.estimator)))
    manifest = _manifest(mission, configurations, cases, first_case, sample_every)
    # only where there is something to say: a study of Sun estimators is the same without
    manifest |= {"attitude_filters": filters} if filters else {}
    manifest |= {"guess_deg": guess_deg} if guess_deg > 0.0 else {}
    store.prepare(manifest)
    if mission.dispersions:
        store.keep(MISSION_FILE, mission.text())
    if store.complete:
        return replace(read_study(folder), warnings=warnings)
    ranges = [_ranges(first_case, first_case + cases, 1 if reason else CHUNK_CASES) for reason in stepped]
    tasks = {
        _chunk_name(i, first, count): ChunkTask(
            flown.text(), flown.origin, first, count, sample_every, configuration.estimator, guess_deg
        )
        for i, (configuration, flown) in enumerate(zip(configurations, missions, strict=True))
        for first, count in ranges[i]
    }
    waiting = {name: task for name, task in tasks.items() if not store.has_chunk(name)}
    total = cases * len(configurations)
    done = total - sum(task.cases for task in waiting.values())
    if progress is not None:
        progress(done, total)
    cpu_s, flown_steps = 0.0, 0
    with scheduler or ThreadScheduler(threads) as workers:
        for name, flown in workers.run(waiting):
            store.write_chunk(name, flown.data)
            cpu_s += flown.cpu_s
            flown_steps += waiting[name].cases * mission.steps
            done += waiting[name].cases
            if progress is not None:
                progress(done, total)
    parts = [
        _Part(
            configuration,
            ATTITUDE if configuration.estimator in filters else HEADING,
            windows_of(flown),
            (*((COLUMN,) if has_faults(flown) else ()), *drawn_names(flown)),
            [_chunk_name(i, *chunk) for chunk in ranges[i]],
        )
        for i, (configuration, flown) in enumerate(zip(configurations, missions, strict=True))
    ]
    store.finish(
        _merged_cases(store, parts),
        _merged_percentiles(store, parts, sample_every * mission.period_ns * 1e-9),
    )
    return replace(read_study(folder), cpu_s=cpu_s, flown=flown_steps, warnings=warnings)


def _why_stepped(mission: Mission, estimator: str) -> str | None:
    """Why the compiled loop has no place for a mission; None if it has."""
    try:
        parts_of(mission, estimator)
    except NoPlace as reason:
        return str(reason)
    return None


def _check_guess(mission: Mission, estimator: str, why_stepped: str | None) -> None:
    if why_stepped and is_attitude_filter(mission, estimator) and not takes_guess(mission, estimator):
        raise MissionError(f"{why_stepped}: attitude filters can be given no guess")


def _ranges(first_case: int, end: int, size: int) -> list[tuple[int, int]]:
    """First case and number of cases of each chunk."""
    return [(first, min(size, end - first)) for first in range(first_case, end, size)]


def _chunk_name(configuration: int, first: int, count: int) -> str:
    return f"{configuration:04d}-{first:010d}-{first + count - 1:010d}"


def _manifest(
    mission: Mission, configurations: Sequence[Configuration], cases: int, first_case: int, sample_every: int
) -> dict[str, Any]:
    return {
        "format": 1,
        "mission": mission.name,
        "mission_text": mission.with_overrides(["mission.case=0"]).text(),
        "first_case": first_case,
        "cases": cases,
        "steps": mission.steps,
        "sample_every_steps": sample_every,
        "configurations": [configuration.columns for configuration in configurations],
        # results of other sources or compilers must not be mixed
        "algorithms": study_hash(chunk.__name__),
        "versions": {name: version(name) for name in ("numba", "numpy", "pyerfa", "ppigrf", "pyarrow")},
    }


class _Part(NamedTuple):
    """A configuration with its chunks."""

    configuration: Configuration
    measure: Measure
    windows: Windows
    further: tuple[str, ...]  # columns beside those of the measure
    chunks: list[str]


def _merged_cases(store: StudyFolder, parts: Sequence[_Part]) -> pa.Table:
    tables = []
    for part in parts:
        measured = [quantity.study_column for quantity in part.measure.quantities(part.windows)]
        columns = ["case", *measured, *part.further]
        table = pa.concat_tables([store.read_chunk(name, columns) for name in part.chunks]).combine_chunks()
        tables.append(_labelled(part.configuration, table))
    # a sweep may change what is measured, and estimators of each kind have columns of their own
    return pa.concat_tables(tables, promote_options="default").combine_chunks()


def _merged_percentiles(store: StudyFolder, parts: Sequence[_Part], sample_s: float) -> pa.Table:
    tables = []
    for part in parts:
        for quantity in part.measure.sampled:
            # one quantity of one configuration at a time: a study may be far larger than memory
            rows = [store.read_chunk(name, [quantity]).column(0).combine_chunks() for name in part.chunks]
            samples = np.concatenate([r.flatten().to_numpy().reshape(len(r), -1) for r in rows])
            over = over_cases(samples)
            length = samples.shape[1]
            table = pa.table(
                {
                    "quantity": pa.array([quantity] * length),
                    "time_s": pa.array(sample_s * np.arange(length)),
                    "count": pa.array(over.pop("count"), pa.int64()),
                    **{name: pa.array(values, pa.float64(), from_pandas=True) for name, values in over.items()},
                }
            )
            tables.append(_labelled(part.configuration, table))
    return pa.concat_tables(tables).combine_chunks()


def _labelled(configuration: Configuration, table: pa.Table) -> pa.Table:
    labels = {name: pa.array([value] * table.num_rows) for name, value in configuration.columns.items()}
    return pa.table(labels | {name: table.column(name) for name in table.column_names})
