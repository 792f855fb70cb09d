# SPDX-License-Identifier: Apache-2.0
"""Fields of declared tuples (`css_common.declared`) that are made of one parameter and of nothing else."""

import math
from typing import Any, NamedTuple

from css_common.schema import Parameter

_TRIED = (0.625, 3)
_ROUNDING = 1e-12
_UNITS = (("deg", "rad", math.pi / 180.0), ("nT", "T", 1e-9))
"""Part of a parameter's unit, of the unit that algorithms reckon in, and the factor between."""


class Only:
    """Values of which only one is known."""

    def __init__(self, parameter: Parameter[Any], value: Any) -> None:
        self._parameter, self._value = parameter, value

    def __getitem__(self, parameter: Parameter[Any]) -> Any:
        if parameter != self._parameter:
            raise KeyError(parameter.name)
        return self._value


def as_it_stands(source: Any) -> bool:
    """Whether what a field is declared with gives the one parameter that it names unchanged."""
    (parameter,) = source.table
    if parameter.kind not in ("real", "integer"):
        return parameter.kind == "flag" and _made(source, parameter, True) is True
    return all(_made(source, parameter, value) == value for value in _TRIED)


class Conversion(NamedTuple):
    """What a field has of a parameter."""

    unit: str  # of the field
    power: int  # of the parameter in another unit; 1 or 2


def conversion(source: Any) -> Conversion | None:
    """How a field is made of the one parameter that it is declared with: its unit, squared or not. None: otherwise."""
    (parameter,) = source.table
    if parameter.kind != "real":
        return None
    places = [float(tried) for tried in _TRIED]
    values = [_made(source, parameter, place) for place in places]
    if not all(isinstance(value, float) and value > 0.0 for value in values):
        return None
    for power in (1, 2):
        factors = [value / place**power for value, place in zip(values, places, strict=True)]
        for part, own, factor in (("", "", 1.0), *_UNITS):
            known = part in parameter.unit and all(math.isclose(f, factor**power, rel_tol=_ROUNDING) for f in factors)
            if known:
                unit = parameter.unit.replace(part, own, 1) if part else parameter.unit
                squared = unit if unit == "-" else f"{unit}^2" if unit.isalpha() else f"({unit})^2"
                return Conversion(squared if power == 2 else unit, power)
    return None


def _made(source: Any, parameter: Parameter[Any], value: Any) -> Any:
    try:
        return source.build(Only(parameter, value))
    except (LookupError, AttributeError, TypeError, ValueError, ArithmeticError):
        return None
