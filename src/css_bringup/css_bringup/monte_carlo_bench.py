# SPDX-License-Identifier: Apache-2.0
"""Processor time of a step of a case: Sunpoint's Monte Carlo and Basilisk, the same scenario in one run.

Both fly okeefe_2013 over the built-in zonal Earth, with albedo and without. Sunpoint flies many cases at once,
Basilisk, which has no batches, the first of them. Kinds are interleaved, so that a slow minute of the machine falls on
all of them, and medians compared.
"""

import argparse
import json
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from css_analysis.readable_table import ReadableTable
from css_bringup.basilisk import LARGEST_ERROR_DEG, Basilisk
from css_bringup.basilisk_scenario import basilisk_scenario, write_zonal_earth
from css_bringup.json_process import MeasurementError, number, run_for_object
from css_bringup.options import console
from css_bringup.processes import executable_path
from css_bringup.report import print_json
from css_common import places
from css_common.mission import load_mission

MISSION = "okeefe_2013"
KINDS = {"albedo": True, "no_albedo": False}
_OURS = "Sunpoint's Monte Carlo"


class Measurement(NamedTuple):
    """One run of one side."""

    ns: float  # CPU time per step and case
    heading_error_deg: float  # mean


Side = Callable[[bool], Measurement]
"""Flies once, with albedo or without."""


def run(arguments: argparse.Namespace) -> None:
    """Measures and prints.

    Raises:
        MissionError: the duration is wrong, or the Monte Carlo is not installed.
        MeasurementError: one side cannot be measured, or its flights are no good.
    """
    mission = load_mission(MISSION, [f"mission.duration={arguments.duration}"])
    monte_carlo = executable_path("css_monte_carlo", "monte_carlo")
    basilisk = Basilisk(places.home().absolute())
    if not basilisk.installed:
        with console.status(f"installing Basilisk {basilisk.version} in {basilisk.folder} (130 MB to download, once)"):
            basilisk.install()
    with tempfile.TemporaryDirectory(prefix="sunpoint_bench_") as folder:
        earth, scenario = Path(folder, "zonal_earth.csv"), Path(folder, "scenario.json")
        write_zonal_earth(earth)
        scenario.write_text(json.dumps(basilisk_scenario(mission, earth)), encoding="utf-8")

        def peer(albedo: bool) -> Measurement:
            flight = basilisk.fly(scenario, albedo=albedo, estimator=arguments.peer_estimator)
            return Measurement(flight.ns_per_step, flight.heading_error_deg)

        def ours(albedo: bool) -> Measurement:
            command = monte_carlo_command(monte_carlo, arguments, albedo)
            with tempfile.TemporaryDirectory(dir=folder) as out:
                return our_measurement(run_for_object(_OURS, [*command, "--out", f"{out}/study"]))

        sides = {"peer": peer, "ours": ours}
        with _progress(len(KINDS) * len(sides) * arguments.repeats) as announce:
            measured = measure(sides, arguments.repeats, announce)
    console.print(table(measured, basilisk.version, arguments))
    if arguments.json:
        print_json(figures(measured))


def monte_carlo_command(executable: str, arguments: argparse.Namespace, albedo: bool) -> list[str]:
    """The study that is flown here."""
    return [
        executable, MISSION,
        "--cases", str(arguments.cases),
        "--estimators", arguments.estimator,
        "--gyro", "on",
        "--duration", str(arguments.duration),
        "--set", f"css_array.albedo.enabled={'true' if albedo else 'false'}",
        "--set", "css_array.albedo.factor=1.0",  # the Earth as it is, as in Basilisk
        "--no-report",
        "--json",
    ]  # fmt: skip


def our_measurement(result: Mapping[str, Any]) -> Measurement:
    """What a study's result says of its only configuration.

    Raises:
        MeasurementError: figures are missing, or the flights do not know the Sun.
    """
    ns = number(_OURS, result, "cpu_ns_per_case_step")
    configurations = result.get("configurations")
    if not isinstance(configurations, list) or len(configurations) != 1 or not isinstance(configurations[0], dict):
        raise MeasurementError(f"{_OURS} gave no list of one configuration, expected that of one estimator with gyro")
    if configurations[0].get("heading_error_mean_deg") is None:
        raise MeasurementError(f"{_OURS}: no flight reaches the Sun; give a longer --duration")
    error = number(_OURS, configurations[0], "heading_error_mean_deg")
    if ns <= 0.0 or error > LARGEST_ERROR_DEG:
        raise MeasurementError(f"{_OURS}: {ns:g} ns a step with a mean heading error of {error:.1f} deg mean nothing")
    return Measurement(ns, error)


Measured = Mapping[str, Mapping[str, Sequence[Measurement]]]
"""By kind and side."""


def measure(sides: Mapping[str, Side], repeats: int, announce: Callable[[str, str], None]) -> Measured:
    """Flies every kind on every side, interleaved; `announce` hears kind and side before each flight."""
    measured: dict[str, dict[str, list[Measurement]]] = {kind: {side: [] for side in sides} for kind in KINDS}
    for _ in range(repeats):
        for kind, albedo in KINDS.items():
            for name, side in sides.items():
                announce(kind, name)
                measured[kind][name].append(side(albedo))
    return measured


def figures(measured: Measured) -> dict[str, dict[str, float]]:
    """Medians and their ratio, as `--json` prints them."""
    result = {}
    for kind, sides in measured.items():
        ours, peer = (median(one.ns for one in sides[side]) for side in ("ours", "peer"))
        result[kind] = {"ours_ns": round(ours, 1), "peer_ns": round(peer, 1), "ratio": round(peer / ours, 1)}
    return result


def table(measured: Measured, version: str, arguments: argparse.Namespace) -> ReadableTable:
    """The figures for people."""
    shown = ReadableTable(
        f"CPU time of a step of a case, {MISSION}, {arguments.duration:g} s, medians of {arguments.repeats}"
    )
    shown.add_name()
    for heading in (
        f"Basilisk {version},\n{arguments.peer_estimator} [ns]", "heading\nerror [deg]",
        f"Sunpoint,\n{arguments.estimator} [ns]", "heading\nerror [deg]", "ratio",
    ):  # fmt: skip
        shown.add_number(heading)
    for kind, row in figures(measured).items():
        peer_error, our_error = (
            f"{median(one.heading_error_deg for one in measured[kind][side]):.2f}" for side in ("peer", "ours")
        )
        peer, ours, ratio = (f"{row[key]:.0f}" for key in ("peer_ns", "ours_ns", "ratio"))
        shown.add_texts([kind.replace("_", " "), peer, peer_error, ours, our_error, ratio])
    return shown


@contextmanager
def _progress(flights: int) -> Iterator[Callable[[str, str], None]]:
    bar = Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        console=console, transient=True, disable=not console.is_terminal,
    )  # fmt: skip
    with bar:
        task, done = bar.add_task("", total=flights), iter(range(flights))

        def announce(kind: str, side: str) -> None:
            name = "Basilisk" if side == "peer" else "Sunpoint"
            bar.update(task, completed=next(done), description=f"{name}, {kind.replace('_', ' ')}")

        yield announce
