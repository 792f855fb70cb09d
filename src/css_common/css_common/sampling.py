# SPDX-License-Identifier: Apache-2.0
"""Numbers between 0 and 1 from which the dispersed parameters of a case are drawn (section `sampling`).

Each is a function of seed and case, and of the design where draws are spread evenly over all cases of a study:

- random: independent numbers from the counter-based streams.
- lhs: a Latin hypercube, which has one case in each of N equal slices of every dimension.
- sobol: a scrambled Sobol sequence; powers of two of cases fill the space best.
- saltelli: what Sobol indices need (Saltelli 2010): N base points, each flown once for every dispersion and twice more.
  One more dimension is the number of the case whose initial state, noise and other draws are flown.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from css_common.dispersions import Dispersion
from css_common.random_streams import Stream, random_key, uniform4
from css_common.schema import ParameterError, Values

OWN_DRAWS = "draws of the case"
"""Name of the dimension of a Saltelli design that is not a dispersed parameter."""

_LEAST = 2.0**-33  # [-] scrambled points are multiples of 2**-32 or so, and may be 0
_OWN_CASES = 2**32


class Sample(NamedTuple):
    """What a case is drawn from."""

    points: np.ndarray  # (D,) above 0 and below 1, one for each draw of each dispersion in their order
    own_case: int  # whose draws of all other kinds it flies


def sample_of(dispersions: tuple[Dispersion, ...], sampling: Values, seed: int, case: int) -> Sample:
    """The numbers of one case.

    Args:
        dispersions: of the mission, in their order.
        sampling: values of the section.
        seed, case: of the mission.

    Raises:
        ParameterError: the design has no such case.
    """
    dimensions = sum(one.draws for one in dispersions)
    if sampling.method == "random":
        return Sample(_independent(dispersions, seed, case), case)
    if sampling.method == "sobol":
        return Sample(_inside(_sobol(dimensions, seed, case)), case)
    size = design_size(dispersions, sampling)
    if case >= size:
        raise ParameterError(
            f"mission.case: {case} given, expected a case of the {sampling.method} design, 0 to {size - 1} "
            f"(sampling.cases {sampling.cases})"
        )
    if sampling.method == "lhs":
        return Sample(_inside(_hypercube(dimensions, sampling.cases, seed)[case]), case)
    row = saltelli_rows(groups_of(dispersions), sampling.cases, seed)[case]
    return Sample(_inside(row[:-1]), min(int(row[-1] * _OWN_CASES), _OWN_CASES - 1))


def design_size(dispersions: tuple[Dispersion, ...], sampling: Values) -> int:
    """Cases that a design has; 0 for methods without a design."""
    if sampling.method == "lhs":
        return sampling.cases
    return sampling.cases * (len(dispersions) + 3) if sampling.method == "saltelli" else 0


def groups_of(dispersions: tuple[Dispersion, ...]) -> tuple[str, ...]:
    """Name of the dispersion that each dimension of a Saltelli design belongs to."""
    return (*(one.named for one in dispersions for _ in range(one.draws)), OWN_DRAWS)


def saltelli_problem(groups: tuple[str, ...]) -> dict[str, Any]:
    """The dimensions of a design as SALib wants them: numbers from 0 to 1, counted by groups."""
    names = [f"x{i}" for i in range(len(groups))]
    return {"num_vars": len(groups), "names": names, "bounds": [[0.0, 1.0]] * len(groups), "groups": list(groups)}


@lru_cache(maxsize=4)
def saltelli_rows(groups: tuple[str, ...], base: int, seed: int) -> np.ndarray:
    """(base (G + 2), D) points of the design of G groups, in the order in which SALib weighs what they give."""
    from SALib.sample import sobol

    return sobol.sample(saltelli_problem(groups), base, calc_second_order=False, seed=seed)


def _independent(dispersions: tuple[Dispersion, ...], seed: int, case: int) -> np.ndarray:
    key = random_key(seed, case)
    places = [place for one in dispersions for place in one.dimensions()]
    return np.array([uniform4(key, Stream.DISPERSION, step, index)[0] for index, step in places])


def _sobol(dimensions: int, seed: int, case: int) -> np.ndarray:
    from scipy.stats import qmc

    engine = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    if case:
        engine.fast_forward(case)
    return engine.random(1)[0]


@lru_cache(maxsize=4)
def _hypercube(dimensions: int, cases: int, seed: int) -> np.ndarray:
    from scipy.stats import qmc

    return qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)).random(cases)


def _inside(points: np.ndarray) -> np.ndarray:
    return np.clip(points, _LEAST, 1.0 - _LEAST)
