# SPDX-License-Identifier: Apache-2.0
"""Studies end with the same bytes however they are run, and refuse what is not theirs."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from css_analysis.errors import StudyError
from css_analysis.study_summary import rows_of
from css_common.mission import load_mission
from css_common.testing import DEADLINE
from css_monte_carlo import chunk, study
from css_monte_carlo.chunk import ChunkTask
from css_monte_carlo.schedulers import ChunkResult, DaskScheduler, Scheduler, ThreadScheduler, run_task
from css_monte_carlo.study import Configuration, read_study, run_study
from css_monte_carlo.study_summary import study_object

# A coarse cycle keeps flights short; what is tested here does not depend on it.
MISSION = load_mission("okeefe_2013").with_overrides(["mission.period=1.0", "mission.duration=120.0"])
CONFIGURATIONS = (
    Configuration("ekf", True),
    Configuration("ekf", False, ("css_array.scale_cell_error=0.1",)),
)
CASES = 7


def fly(folder, cases=CASES, **options):
    return run_study(MISSION, CONFIGURATIONS, cases, folder, **options)


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study flown in one go by one thread."""
    folder = tmp_path_factory.mktemp("studies") / "whole"
    return fly(folder, threads=1)


class Stops(Scheduler):
    """Ends in the middle, like a user's Ctrl-C."""

    def __init__(self, after: int) -> None:
        self.after = after

    def __exit__(self, *_: object) -> None:
        pass

    def run(self, tasks: Mapping[str, ChunkTask]) -> Iterator[tuple[str, ChunkResult]]:
        for i, (name, task) in enumerate(tasks.items()):
            if i == self.after:
                raise KeyboardInterrupt
            yield name, run_task(task)


def test_tables_hold_every_case_and_time(whole):
    assert whole.cases.num_rows == 2 * CASES
    assert whole.cases.column_names[:4] == ["estimator", "gyro", "overrides", "case"]
    ekf = rows_of(whole.cases, estimator="ekf", gyro=False, overrides="css_array.scale_cell_error=0.1")
    assert ekf["case"].to_pylist() == list(range(CASES))
    heading = rows_of(whole.percentiles, gyro=True, quantity="heading_error_deg")
    assert heading["time_s"].to_pylist() == [float(t) for t in range(120)]
    assert set(heading["count"].to_pylist()) == {CASES}
    assert np.all(heading["p05"].to_numpy() <= heading["p95"].to_numpy())


def test_configurations_share_their_draws(whole):
    start = rows_of(whole.percentiles, quantity="rate_deg_s", time_s=0.0)["mean"].to_pylist()
    assert len(start) == 2 and start[0] == start[1]


def test_summary_is_that_of_the_cases(whole):
    result = study_object(whole, 2.0, 3.0)
    assert (result["mission"], result["cases"], result["steps"]) == ("okeefe_2013", CASES, 120)
    assert result["cpu_ns_per_case_step"] == pytest.approx(1e9 * whole.cpu_s / (2 * CASES * 120))
    on, off = result["configurations"]
    assert (on["gyro"], off["gyro"], off["overrides"]) == ("on", "off", ["css_array.scale_cell_error=0.1"])
    cases = rows_of(whole.cases, gyro=True)
    acquired = [s for s in cases["acquired_s"].to_pylist() if s is not None]
    assert on["power_positive_fraction"] == pytest.approx(len(acquired) / CASES)
    assert on["converging_max_s"] == max(s for s in cases["converging_s"].to_pylist() if s is not None)
    assert on["rate_50min_deg_s"] is None


@pytest.mark.parametrize("chunk_cases", [1, 3, 100])
def test_bytes_do_not_depend_on_threads_or_chunks(whole, tmp_path, monkeypatch, chunk_cases):
    monkeypatch.setattr(study, "CHUNK_CASES", chunk_cases)
    fly(tmp_path / "other", threads=3)
    assert contents(tmp_path / "other") == contents(whole.folder)


def test_interrupted_study_goes_on_and_ends_with_the_same_bytes(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "CHUNK_CASES", 2)
    with pytest.raises(KeyboardInterrupt):
        fly(tmp_path / "s", scheduler=Stops(after=3))
    assert len(list((tmp_path / "s" / "chunks").iterdir())) == 3
    with pytest.raises(StudyError, match="holds no complete study"):
        read_study(tmp_path / "s")
    told = []
    resumed = fly(tmp_path / "s", progress=lambda done, total: told.append((done, total)))
    assert told[0] == (6, 2 * CASES) and told[-1] == (2 * CASES, 2 * CASES)
    assert resumed.flown == (2 * CASES - 6) * 120
    assert contents(tmp_path / "s") == contents(whole.folder)


def test_an_interrupt_gives_up_what_flies_and_the_study_goes_on(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "CHUNK_CASES", 2)
    monkeypatch.setattr(chunk, "BLOCK_STEPS", 1)
    flown: list[int] = []
    in_the_air = threading.Event()

    def fly_block(*arguments):
        flown.append(1)
        if len(flown) > 200:  # in the middle of the second chunk
            in_the_air.set()
            time.sleep(0.1)
        return fly_a_block(*arguments)

    def interrupt(done, total):
        if done == 2:
            assert in_the_air.wait(DEADLINE)
            raise KeyboardInterrupt

    fly_a_block = chunk.fly_block
    monkeypatch.setattr(chunk, "fly_block", fly_block)
    with pytest.raises(KeyboardInterrupt):
        fly(tmp_path / "s", threads=1, progress=interrupt)
    assert len(flown) < 235, "it ended before its last step"
    monkeypatch.undo()
    assert fly(tmp_path / "s").flown > 0
    assert contents(tmp_path / "s") == contents(whole.folder)


def test_complete_study_is_read_not_flown(whole):
    again = fly(whole.folder, scheduler=Stops(after=0))
    assert again.flown == 0 and again.cases.equals(whole.cases)
    assert study_object(again, 1.0, 1.0)["cpu_ns_per_case_step"] is None


def test_killed_process_leaves_a_study_that_goes_on(whole, tmp_path, monkeypatch):
    program = f"""
from css_common.mission import load_mission
from css_monte_carlo import study
from css_monte_carlo.study import Configuration, run_study
study.CHUNK_CASES = 1
mission = load_mission("okeefe_2013").with_overrides({["mission.period=1.0", "mission.duration=120.0"]!r})
configurations = [Configuration(*c) for c in {[tuple(c) for c in CONFIGURATIONS]!r}]
run_study(
    mission, configurations, {CASES}, {str(tmp_path / "s")!r}, threads=1,
    progress=lambda done, total: print(done, flush=True),
)
"""
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, env=os.environ)
    assert process.stdout is not None
    for line in process.stdout:
        if int(line) >= 3:
            process.send_signal(signal.SIGKILL)
            break
    process.wait()
    assert 3 <= len([f for f in (tmp_path / "s" / "chunks").iterdir() if not f.name.startswith(".")]) < 2 * CASES
    assert not (tmp_path / "s" / "percentiles.parquet").exists()
    monkeypatch.setattr(study, "CHUNK_CASES", 1)  # as in that process
    assert fly(tmp_path / "s").flown < 2 * CASES * 120
    assert contents(tmp_path / "s") == contents(whole.folder)


def test_any_case_can_be_flown_by_itself(whole, tmp_path):
    single = fly(tmp_path / "one", cases=1, first_case=5)
    expected = rows_of(whole.cases, case=5)
    assert single.cases.equals(expected.combine_chunks())


def test_other_parameters_are_refused(whole, tmp_path):
    with pytest.raises(StudyError, match=r"holds a study with other parameters \(cases: 7, not 8\)"):
        fly(whole.folder, cases=CASES + 1)
    with pytest.raises(StudyError, match=r"other parameters \(mission_text\)"):
        run_study(MISSION.with_overrides(["mission.seed=2"]), CONFIGURATIONS, CASES, whole.folder)
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(StudyError, match="holds files but no study"):
        fly(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(StudyError, match="cannot be written"):
        fly(tmp_path / "file" / "s")
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged" / "study.json").write_text("{")
    with pytest.raises(StudyError, match="damaged"):
        fly(tmp_path / "damaged")


def test_threads_give_the_results_of_one_flight_each(whole):
    tasks = {"a": ChunkTask(MISSION.text(), "a", 0, 2, 1), "b": ChunkTask(MISSION.text(), "a", 2, 1, 1)}
    with ThreadScheduler(2) as workers:
        results = dict(workers.run(tasks))
    assert {name: run_task(task).data for name, task in tasks.items()} == {n: r.data for n, r in results.items()}


def test_cluster_with_a_worker_that_is_killed_gives_the_same_bytes(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "CHUNK_CASES", 1)
    killed: list[Any] = []

    def kill_one(done: int, total: int) -> None:
        if done >= 2 and not killed:
            worker = next(iter(scheduler.worker_processes()))
            os.kill(worker, signal.SIGKILL)
            killed.append(worker)

    scheduler = DaskScheduler("local", workers=2)
    fly(tmp_path / "s", scheduler=scheduler, progress=kill_one)
    assert killed
    assert contents(tmp_path / "s") == contents(whole.folder)


def test_scheduler_that_does_not_answer_is_named():
    with pytest.raises(StudyError, match=r"--scheduler tcp://127.0.0.1:9: no dask scheduler answers there"):
        DaskScheduler("tcp://127.0.0.1:9", timeout_s=0.5)
