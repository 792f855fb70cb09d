# SPDX-License-Identifier: Apache-2.0
"""What an algorithm takes from a mission, stated once: a NamedTuple whose defaults are the parameters it is built of.

    class Options(NamedTuple):
        gain: float = given(real("gain", 0.5, "-", "share of a new measurement"))
        limit: float = made(math.radians, real("limit_deg_s", 10.0, "deg/s", "bound on the rate"))  # [rad/s]
        layout: CellLayout = computed(cell_layout)
        tracking: TrackingParameters = part(TrackingParameters)

`table_of(Options)` is the table that nodes declare, missions are checked against and READMEs show;
`built(Options, values)` is what the kernels get. A type checker follows a value from its
specification through the conversion to the field. No field of such a tuple may be left out where one is made by hand.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar, cast, overload

from css_common.schema import Parameter, Table, Values

T = TypeVar("T")
A = TypeVar("A")
B = TypeVar("B")
C = TypeVar("C")


@dataclass(frozen=True)
class _Source(Generic[T]):
    """Where a field comes from."""

    table: Table
    build: Callable[[Values], T]


def given(parameter: Parameter[T]) -> T:
    """A field that is a parameter as it stands."""
    return cast(T, _Source((parameter,), lambda values: values[parameter]))


@overload
def made(convert: Callable[[A], T], a: Parameter[A], /) -> T: ...
@overload
def made(convert: Callable[[A, B], T], a: Parameter[A], b: Parameter[B], /) -> T: ...
@overload
def made(convert: Callable[[A, B, C], T], a: Parameter[A], b: Parameter[B], c: Parameter[C], /) -> T: ...
def made(convert: Callable[..., Any], *parameters: Parameter[Any]) -> Any:
    """A field that is converted from parameters, for instance to another unit."""
    return _Source(parameters, lambda values: convert(*(values[parameter] for parameter in parameters)))


def computed(build: Callable[[Values], T], *parameters: Parameter[Any]) -> T:
    """A field that depends on several values, such as sections of the mission.

    Args:
        parameters: those of them that are the algorithm's own.
    """
    return cast(T, _Source(parameters, build))


def part(kind: type[T]) -> T:
    """A field that is declared in the same way."""
    return cast(T, _Source(table_of(kind), lambda values: built(kind, values)))


def table_of(kind: type, **defaults: Any) -> Table:
    """The parameters of a declared NamedTuple, each once, in the order of its fields.

    Args:
        defaults: other defaults by dotted name, with `__` for the dot.
    """
    others = {name.replace("__", "."): default for name, default in defaults.items()}
    table = merged(*(source.table for source in _sources(kind).values()))
    return tuple(replace(p, default=others[p.name]) if p.name in others else p for p in table)


def built(kind: type[T], values: Values) -> T:
    """A declared NamedTuple of checked values."""
    return kind(**{name: source.build(values) for name, source in _sources(kind).items()})


def builder(kind: type[T]) -> Callable[[Values], T]:
    """What builds a declared NamedTuple of checked values."""
    return lambda values: built(kind, values)


def merged(*tables: Table) -> Table:
    """One table of several, every parameter once."""
    return tuple({p.name: p for table in tables for p in table}.values())


def _sources(kind: Any) -> dict[str, _Source[Any]]:
    return kind._field_defaults
