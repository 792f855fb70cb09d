# SPDX-License-Identifier: Apache-2.0
"""Fields of declared tuples (`css_common.declared`) that are made of one parameter and of nothing else."""

from typing import Any

from css_common.schema import Parameter

_TRIED = (0.625, 3)


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


def _made(source: Any, parameter: Parameter[Any], value: Any) -> Any:
    try:
        return source.build(Only(parameter, value))
    except (LookupError, AttributeError, TypeError, ValueError, ArithmeticError):
        return None
