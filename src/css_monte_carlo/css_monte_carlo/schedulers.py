# SPDX-License-Identifier: Apache-2.0
"""Where chunks run: threads of this process, or the workers of a dask.distributed cluster."""

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, as_completed
from types import TracebackType
from typing import Any, NamedTuple, Self

from css_analysis.errors import StudyError
from css_common.processors import usable_processors
from css_monte_carlo.chunk import ChunkTask, flown_task
from css_monte_carlo.flight_threads import FlightThreads
from css_monte_carlo.study_folder import parquet_bytes


class ChunkResult(NamedTuple):
    """What comes back from a worker."""

    data: bytes  # the chunk's table as a Parquet file
    cpu_s: float


def run_task(task: ChunkTask) -> ChunkResult:
    """Flies a chunk; the same bytes wherever it runs."""
    table, cpu_s = flown_task(task)
    return ChunkResult(parquet_bytes(table), cpu_s)


class Scheduler(ABC):
    """Runs tasks; a context manager."""

    def __enter__(self) -> Self:
        return self

    @abstractmethod
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Gives up what it holds."""

    @abstractmethod
    def run(self, tasks: Mapping[str, ChunkTask]) -> Iterator[tuple[str, ChunkResult]]:
        """Results by name, in the order in which they come."""


class ThreadScheduler(Scheduler):
    """Threads of this process: the compiled loop lets them run side by side.

    Args:
        threads: None: one per processor that this process may use.
    """

    def __init__(self, threads: int | None = None) -> None:
        self._pool = FlightThreads(threads)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.__exit__(kind, error, trace)

    def run(self, tasks: Mapping[str, ChunkTask]) -> Iterator[tuple[str, ChunkResult]]:
        """Results by name, in the order in which they come."""
        futures: dict[Future[ChunkResult], str] = {
            self._pool.submit(run_task, task): name for name, task in tasks.items()
        }
        for future in as_completed(futures):
            yield futures.pop(future), future.result()


class DaskScheduler(Scheduler):
    """Workers of a dask.distributed cluster; a worker that dies costs time alone, its chunks fly elsewhere.

    Args:
        address: of the cluster's scheduler, or `local` for a cluster on this machine.
        workers: of a local cluster; None: one per processor.
        timeout_s: how long to wait for the scheduler [s].

    Raises:
        StudyError: dask is not installed, or nothing answers there.
    """

    def __init__(self, address: str, workers: int | None = None, timeout_s: float = 10.0) -> None:
        try:
            from distributed import Client, LocalCluster
        except ImportError as error:
            raise StudyError(
                "--scheduler needs dask.distributed, the extra `cluster`: "
                "./sunpoint shell -c 'uv pip install -r requirements-cluster.lock'"
            ) from error
        self._cluster: Any = None
        try:
            if address == "local":
                workers = workers or usable_processors()
                self._cluster = LocalCluster(workers, threads_per_worker=1, dashboard_address=None)
            self._client = Client(self._cluster or address, timeout=timeout_s)
        except (OSError, ValueError) as error:
            raise StudyError(f"--scheduler {address}: no dask scheduler answers there") from error

    def __exit__(self, *_: object) -> None:
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()

    def worker_processes(self) -> list[int]:
        """Process numbers of the workers, on their own machines."""
        return list(self._client.run(os.getpid).values())

    def run(self, tasks: Mapping[str, ChunkTask]) -> Iterator[tuple[str, ChunkResult]]:
        """Results by name, in the order in which they come."""
        from distributed import as_completed as arriving

        # pure=False: equal tasks of two studies do not share a fate
        futures = {self._client.submit(run_task, task, pure=False, retries=3): name for name, task in tasks.items()}
        for future, result in arriving(futures, with_results=True):
            yield futures.pop(future), result
