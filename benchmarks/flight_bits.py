# SPDX-License-Identifier: Apache-2.0
"""What cases of a study come to, stage by stage, written to a file; `aarch64.py` compares those of two processors.

`python benchmarks/flight_bits.py MISSION ESTIMATOR CASES SECONDS FILE.npz [keep|take CARRIED.pickle]`

`keep` writes what the functions of `CARRIED` gave, `take` gives their results again instead of calling them: whether
they alone are why two flights differ.
"""

import functools
import math
import pickle
import random
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import erfa
import numpy as np

from css_common.mission import load_mission
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.mission_flight import MissionFlight

_DRAWS = 20_000
CARRIED = ((erfa, "epv00"), (erfa, "c2t06a"))
"""Functions of other compiled libraries that a flight calls before it begins, and that round as they were compiled."""


def elementary_functions() -> dict[str, np.ndarray]:
    """Results of the functions of the C library, as kernels call them, of numpy and erfa, at up to 20 000 places."""
    source = random.Random(1)
    wide = np.array([source.uniform(-10.0, 10.0) for _ in range(_DRAWS)])
    unit = wide / 10.0
    positive = np.abs(wide) + 1e-9
    places: dict[str, tuple[np.ndarray, ...]] = {
        "sin": (wide,), "cos": (wide,), "tan": (wide,), "asin": (unit,), "acos": (unit,), "atan": (wide,),
        "exp": (wide,), "log": (positive,), "sqrt": (positive,), "sinh": (wide,), "cosh": (wide,), "tanh": (wide,),
        "cbrt": (wide,), "erf": (unit,), "expm1": (unit,), "log1p": (positive,),
        "atan2": (wide, unit), "hypot": (wide, unit), "pow": (positive, unit), "fmod": (wide, unit),
    }  # fmt: skip
    found = {}
    for name, arguments in places.items():
        function = getattr(math, name)
        found[f"libm {name}"] = np.array([function(*each) for each in zip(*arguments, strict=True)])
    for name in ("sin", "cos", "exp", "log", "arctan2", "power"):
        given = (positive, unit) if name in ("arctan2", "power") else (positive,)
        found[f"numpy {name}"] = getattr(np, name)(*given)
    square = np.resize(unit, (100, 12, 12))
    found["numpy matmul"] = square @ square
    found["numpy linalg.inv"] = np.linalg.inv(square + 12.0 * np.eye(12))
    found["numpy linalg.pinv"] = np.linalg.pinv(square[:, :, :4])
    days = 100.0 * unit[:200]  # thousands of terms each
    found["erfa epv00"] = np.stack([part["p"] for part in erfa.epv00(2451545.0, days)])
    found["erfa c2t06a"] = erfa.c2t06a(2451545.0, days, 2451545.0, days, 0.0, 0.0)
    return found


def carry(how: str, file: Path) -> None:
    """Replaces the functions of `CARRIED` by such as keep their results, or take those of another processor."""
    kept: dict[str, list[Any]] = pickle.loads(file.read_bytes()) if how == "take" else {n: [] for _, n in CARRIED}
    for module, name in CARRIED:
        results = iter(list(kept[name]))

        def call(*arguments: Any, real: Any, name: str, results: Iterator[Any]) -> Any:
            if how == "take":
                return next(results)
            kept[name].append(real(*arguments))
            file.write_bytes(pickle.dumps(kept))
            return kept[name][-1]

        setattr(module, name, functools.partial(call, real=getattr(module, name), name=name, results=results))


def leaves(value: Any, path: str) -> Iterator[tuple[str, np.ndarray]]:
    """Numbers in nested tuples and records, by where they are."""
    names = getattr(value, "_fields", None)
    if isinstance(value, tuple):
        for name, inner in zip(names or map(str, range(len(value))), value, strict=True):
            yield from leaves(inner, f"{path}.{name}")
    elif isinstance(value, np.ndarray) and value.dtype.names:
        for name in value.dtype.names:
            yield f"{path}.{name}", np.ascontiguousarray(value[name])
    elif isinstance(value, (np.ndarray, int, float, np.generic)):
        yield path, np.asarray(value)


def main(mission: str, estimator: str, cases: str, seconds: str, file: str, how: str = "", carried: str = "") -> None:
    """Flies, and writes every stage under a name that begins with its number."""
    stages = {f"1 functions {name}": values for name, values in elementary_functions().items()}
    if how:
        carry(how, Path(carried))
    flight = MissionFlight(load_mission(mission, [f"mission.duration={seconds}"]), estimator)
    numbers = np.arange(int(cases))
    drawn, initial = flight.cases(numbers, 0.0)
    stages |= {f"2 draws{path}": values for path, values in leaves((drawn, initial), "")}
    stages |= {f"3 surroundings{path}": v for path, v in leaves(flight.surroundings.block(0, flight.steps - 1), "")}
    flown = fly_cases(flight, numbers, 1, traced=True)
    stages["4 flight"] = flown.trace
    stages |= {f"5 sums{path}": values for path, values in leaves(flown.tallies, "")}
    np.savez(file, **stages)  # type: ignore[arg-type]


if __name__ == "__main__":
    main(*sys.argv[1:])
