# SPDX-License-Identifier: Apache-2.0
"""Within what each number of a struct of parameters must lie, from the tables that nodes declare.

A field that is one parameter, as it stands or converted, has the limits of that parameter, converted likewise. Other
fields hang on several parameters or on sections of the mission: of these it is asked that they are numbers, finite
where the mission's is. So it is of a field that is declared to be of one parameter and here is of something else:
checks of a magnetometer are those of a gyro with other numbers in them.
"""

import math
import struct
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from css_common.schema import Parameter, Table, Values
from css_export.layout import Layout, Scalar, Struct, leaves, pack
from css_export.sole_parameter import Only, as_it_stands, conversion

REAL, FLAG, WHOLE, SINGLE = 0, 1, 2, 3
_LARGEST = math.nextafter(math.inf, 0.0)
_SAMPLES = 33


class Limit(NamedTuple):
    """Of some numbers of one kind that follow one another."""

    name: str
    unit: str
    low: float
    high: float
    offset: int
    kind: int
    count: int  # type: ignore[assignment]
    declared: bool  # by a parameter's own limits


def limits_of(layout: Struct, p: Any, values: Values | None = None) -> list[Limit]:
    """The limits of a struct of parameters, in the order of its fields; `p` keeps them.

    Args:
        layout: of the struct.
        p: the parameters of the mission.
        values: of the node, of which they are made; None: each field is of what it is declared with.
    """
    found = _joined(list(_limits(layout, p, values, "", 0)))
    data = pack(layout, p)
    return [limit if limit.declared else _also_infinite(limit, data) for limit in found]


def whole_numbers(limits: Iterable[Limit], data: bytes | bytearray) -> Iterator[tuple[int, int, int]]:
    """Place [bytes], least and largest value of each whole number and flag of a struct of parameters.

    Of one without limits of a parameter's own it is the value of the mission.

    Args:
        limits: of the struct.
        data: that struct with the values of the mission.
    """
    for limit in limits:
        size = {WHOLE: 8, FLAG: 1}.get(limit.kind, 0)
        for at in range(limit.offset, limit.offset + size * limit.count, size or 1):
            if limit.kind == FLAG:
                yield at, 0, 1
            elif limit.declared:
                yield at, math.ceil(limit.low), math.floor(limit.high)
            else:
                value = int.from_bytes(data[at : at + size], "little", signed=True)
                yield at, value, value


def _limits(layout: Layout, value: Any, values: Values | None, name: str, at: int) -> Iterator[Limit]:
    if isinstance(layout, Struct) and hasattr(value, "_fields"):
        sources = getattr(type(value), "_field_defaults", {})
        for field, part in zip(layout.fields, value, strict=True):
            told = f"{name}.{field.name}" if name else field.name
            source = sources.get(field.name)
            bounds = _declared(source, part) if values is None or _is_made_by(source, values, part) else None
            if bounds is not None and isinstance(field.layout, Scalar):
                unit, low, high = bounds
                yield Limit(told, unit, low, high, at + field.offset, _kind(field.layout), 1, True)
            else:
                yield from _limits(field.layout, part, values, told, at + field.offset)
        return
    for told, scalar, offset in leaves(layout, name, at):
        low, high = (0.0, 1.0) if scalar.code == "?" else (-_LARGEST, _LARGEST)
        yield Limit(told, "", low, high, offset, _kind(scalar), 1, False)


def _kind(scalar: Scalar) -> int:
    return {"d": REAL, "f": SINGLE, "?": FLAG, "q": WHOLE}[scalar.code]


def _also_infinite(limit: Limit, data: bytes | bytearray) -> Limit:
    """A limit of numbers without limits of their own, which may be infinite where one of the mission's is."""
    if limit.kind not in (REAL, SINGLE):
        return limit
    numbers = struct.unpack_from(f"<{limit.count}{'d' if limit.kind == REAL else 'f'}", data, limit.offset)
    return limit._replace(low=-math.inf, high=math.inf) if any(map(math.isinf, numbers)) else limit


def _joined(limits: list[Limit]) -> list[Limit]:
    """Numbers of an array, of which nothing differs but the place, as one entry."""
    sizes = {REAL: 8, FLAG: 1, WHOLE: 8, SINGLE: 4}
    joined: list[Limit] = []
    for limit in limits:
        last = joined[-1] if joined else None
        follows = (
            last is not None
            and limit.name.endswith("]")
            and last.name.partition("[")[0] == limit.name.partition("[")[0]
            and last.name.endswith("]")
            and (last.low, last.high, last.kind) == (limit.low, limit.high, limit.kind)
            and last.offset + last.count * sizes[last.kind] == limit.offset
        )
        if follows and last is not None:
            joined[-1] = last._replace(count=last.count + 1)
        else:
            joined.append(limit)
    return joined


def _declared(source: Any, value: Any) -> tuple[str, float, float] | None:
    """Unit, least and largest value of a field that hangs on one parameter; None where that says nothing."""
    table: Table = getattr(source, "table", ())
    if len(table) != 1 or not isinstance(value, (bool, int, float)):
        return None
    (parameter,) = table

    def made(given: Any) -> float:
        return float(source.build(Only(parameter, given)))

    try:
        bounds = _bounds(parameter, made)
    except (LookupError, AttributeError, TypeError, ValueError, ArithmeticError):
        return None  # it hangs on more than this parameter
    if bounds is None:
        return None
    made_in = conversion(source)
    if as_it_stands(source):
        return parameter.unit, *bounds
    return f"made of {parameter.name}" if made_in is None else made_in.unit, *bounds


def _is_made_by(source: Any, values: Values, value: Any) -> bool:
    """Whether a field has the value that what it is declared with makes of the values of the node."""
    try:
        return bool(source.build(values) == value)
    except (LookupError, AttributeError, TypeError, ValueError, ArithmeticError):
        return False  # of a parameter that this node does not have


def _bounds(parameter: Parameter[Any], made: Callable[[Any], float]) -> tuple[float, float] | None:
    if parameter.kind == "choice":
        values = sorted(made(choice) for choice in parameter.choices)
        return values[0], values[-1]
    if parameter.kind == "flag":
        values = sorted((made(False), made(True)))
        return values[0], values[-1]
    if parameter.kind not in ("real", "integer") or parameter.low is None or parameter.high is None:
        return None
    low, high = parameter.low, parameter.high
    if parameter.open_low:
        low = math.nextafter(low, math.inf)
    points = [low + (high - low) * i / (_SAMPLES - 1) for i in range(_SAMPLES - 1)] + [high]
    if parameter.kind == "integer":
        points = [round(point) for point in points]
    values = [made(point) for point in points]
    if values != sorted(values) and values != sorted(values, reverse=True):
        return None
    return min(values), max(values)
