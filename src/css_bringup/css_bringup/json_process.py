# SPDX-License-Identifier: Apache-2.0
"""Programs that a measurement starts: their result is the JSON object on their last line."""

import json
import math
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


class MeasurementError(Exception):
    """A measurement that cannot be made or means nothing; the message is one line."""


def run_for_object(who: str, command: Sequence[str | Path], env: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Runs a program to its end; the object on the last line that it prints.

    Args:
        who: name of the program for messages.
        command: program and arguments.
        env: its environment; None: that of this process.

    Raises:
        MeasurementError: it cannot be started, fails, or prints no JSON object at the end.
    """
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", env=env, check=False)
    except OSError as error:
        raise MeasurementError(f"{who} does not start: {command[0]}: {error.strerror}") from error
    if done.returncode:
        said = _last_line(done.stderr) or _last_line(done.stdout) or "without a word"
        raise MeasurementError(f"{who} failed with exit code {done.returncode}: {said}")
    last = _last_line(done.stdout)
    try:
        value = json.loads(last)
    except ValueError:
        value = None
    if not isinstance(value, dict):
        raise MeasurementError(f"{who} ended with '{last[:80]}', expected a JSON object on the last line")
    return value


def number(who: str, value: Mapping[str, Any], key: str) -> float:
    """A finite number of a result.

    Raises:
        MeasurementError: it is missing or no such number.
    """
    found = value.get(key)
    if isinstance(found, bool) or not isinstance(found, int | float) or not math.isfinite(found):
        raise MeasurementError(f"{who} gave {found!r} for {key}, expected a number")
    return float(found)


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1].strip() if lines else ""
