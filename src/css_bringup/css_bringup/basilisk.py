# SPDX-License-Identifier: Apache-2.0
"""Basilisk in a Python environment of its own below `.cache/`, and flights in it.

Nothing of it is installed beside Sunpoint: `benchmarks/requirements-basilisk.lock` pins every package by hash, and
`benchmarks/basilisk_flight.py` is run by that environment's Python.
"""

import hashlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from css_bringup.json_process import MeasurementError, number, run_for_object

LARGEST_ERROR_DEG = 10.0
LEAST_POINTING = 0.9


class PeerFlight(NamedTuple):
    """What a flight in Basilisk cost and how good it was; angles over its sunlit time after acquisition."""

    ns_per_step: float  # CPU time
    heading_error_deg: float  # mean
    pointing: float  # share of the time with the array normal within 30 deg of the Sun
    albedo_max: float  # largest reflected light in a cell, of full Sun


class Basilisk:
    """The peer, as installed by `install`."""

    def __init__(self, home: Path) -> None:
        """Finds the benchmark's files.

        Args:
            home: the project folder.

        Raises:
            MeasurementError: they are not there.
        """
        self._home = home
        self._script = home / "benchmarks" / "basilisk_flight.py"
        self._lock = home / "benchmarks" / "requirements-basilisk.lock"
        for file in (self._script, self._lock):
            if not file.is_file():
                raise MeasurementError(f"no {file}; start it in the project folder: ./sunpoint bench monte-carlo")
        self.folder = home / ".cache" / "basilisk"
        self.version = version_in(self._lock.read_text(encoding="utf-8"))

    @property
    def installed(self) -> bool:
        """The environment is complete and made from the lock file, by the Python that runs this."""
        try:
            return self._ready_file.read_text(encoding="utf-8") == self._fingerprint()
        except OSError:
            return False

    def install(self) -> None:
        """Makes the environment anew; its packages come from the package index once, later from uv's cache.

        Raises:
            MeasurementError: there is no network, no Basilisk for this Python, no room.
        """
        log = self._home / "log" / "bench" / "basilisk.log"
        try:
            shutil.rmtree(self.folder, ignore_errors=True)
            log.parent.mkdir(parents=True, exist_ok=True)
            log.write_text("", encoding="utf-8")
            self._uv(log, "venv", "--python", sys.executable, self.folder)
            pinned = ("--require-hashes", "--only-binary", ":all:", "-r", self._lock)
            self._uv(log, "pip", "install", "--python", self._python, *pinned)
            self._ready_file.write_text(self._fingerprint(), encoding="utf-8")
        except OSError as error:
            raise MeasurementError(f"Basilisk could not be installed: {error}") from error

    def fly(self, scenario: Path, *, albedo: bool, estimator: str) -> PeerFlight:
        """One flight of a scenario (`basilisk_scenario`).

        Args:
            scenario: JSON file.
            albedo: with light reflected by the Earth.
            estimator: wls or okeefe.

        Raises:
            MeasurementError: Basilisk fails, or the flight does not do what it should.
        """
        flag = "--albedo" if albedo else "--no-albedo"
        result = self.run(self._script, scenario, flag, "--estimator", estimator)
        if result.get("heading_error_mean_deg") is None:
            raise MeasurementError("Basilisk's flight has no sunlit time after acquisition; give a longer --duration")
        steps, cpu_s = number("Basilisk", result, "steps"), number("Basilisk", result, "cpu_s")
        if steps < 1 or cpu_s <= 0.0:
            raise MeasurementError(f"Basilisk took {cpu_s:g} s for {steps:g} steps; give a longer --duration")
        flight = PeerFlight(
            ns_per_step=1e9 * cpu_s / steps,
            heading_error_deg=number("Basilisk", result, "heading_error_mean_deg"),
            pointing=number("Basilisk", result, "pointing"),
            albedo_max=number("Basilisk", result, "albedo_max"),
        )
        if wrong := complaint(flight, albedo):
            raise MeasurementError(f"Basilisk with {estimator} {wrong}; its speed would mean nothing")
        return flight

    def run(self, script: Path, *arguments: str | Path) -> dict[str, Any]:
        """The JSON object that a script prints last in Basilisk's environment.

        Raises:
            MeasurementError: it fails.
        """
        env = {name: value for name, value in os.environ.items() if name not in ("LD_LIBRARY_PATH", "VIRTUAL_ENV")}
        env["MPLCONFIGDIR"] = str(self.folder / "matplotlib")
        try:
            return run_for_object("Basilisk", [self._python, "-I", script, *arguments], env)
        except MeasurementError as error:
            if "ModuleNotFoundError" in str(error) or "does not start" in str(error):
                raise MeasurementError(f"{error}; remove {self.folder} and start again") from error
            raise

    @property
    def _python(self) -> Path:
        return self.folder / "bin" / "python"

    @property
    def _ready_file(self) -> Path:
        return self.folder / "ready"

    def _fingerprint(self) -> str:
        lock = hashlib.sha256(self._lock.read_bytes()).hexdigest()
        return f"{lock} {sys.version.split()[0]} {self.folder}\n"

    def _uv(self, log: Path, *arguments: str | Path) -> None:
        own = self._home / ".venv" / "bin" / "uv"
        uv = own if own.is_file() else shutil.which("uv")
        if uv is None:
            raise MeasurementError(f"Basilisk could not be installed: no {own} and no uv on PATH")
        done = subprocess.run([uv, *arguments], capture_output=True, text=True, errors="replace", check=False)
        with log.open("a", encoding="utf-8") as file:
            file.write(done.stdout + done.stderr)
        if done.returncode:
            raise MeasurementError(f"{install_failure(self.version, done.stderr)}; the whole output is in {log}")


def complaint(flight: PeerFlight, albedo: bool) -> str:
    """What is wrong with a flight, empty when nothing is: it must know the Sun, point at it, and see the Earth."""
    if flight.heading_error_deg > LARGEST_ERROR_DEG:
        return f"does not know the Sun: mean heading error {flight.heading_error_deg:.1f} deg"
    if flight.pointing < LEAST_POINTING:
        return f"points at the Sun only {100.0 * flight.pointing:.0f} % of the time"
    if (flight.albedo_max > 0.0) != albedo:
        return f"gives its cells at most {flight.albedo_max:.3f} of albedo"
    return ""


def version_in(lock: str) -> str:
    """The version of Basilisk in a lock file."""
    pinned = re.search(r"^bsk==([\w.]+)", lock, re.MULTILINE)
    if pinned is None:
        raise MeasurementError("benchmarks/requirements-basilisk.lock does not pin bsk")
    return pinned[1]


def install_failure(version: str, output: str) -> str:
    """Why uv could not install, from what it printed, in one line."""
    what = f"Basilisk {version} could not be installed"
    if re.search(r"requires Python|matching Python|matching platform|No interpreter", output):
        return f"{what}: it has no packages for Python {sys.version.split()[0]} on {sys.platform}"
    if re.search(r"Failed to fetch|error sending request|dns error|network was disabled", output):
        return f"{what}: no network, or the package index cannot be reached"
    lines: Sequence[str] = [line.strip() for line in output.splitlines() if line.strip()]
    found = [line for line in lines if line.startswith(("error:", "cause:", "Caused by:"))]
    return f"{what}: {' '.join(found or lines[-1:]) or 'uv said nothing'}"
