# SPDX-License-Identifier: Apache-2.0
"""What a table of telemetry holds, in Sunpoint's units and frames: for estimators, and as the truth."""

import dataclasses
import hashlib
import math
from pathlib import Path

import numpy as np

from css_recording.errors import BagError
from css_telemetry.cell_outputs import cell_outputs
from css_telemetry.columns import Readings, groups_of, read_columns
from css_telemetry.description import ColumnForm, Description
from css_telemetry.faults import Account, Counted
from css_telemetry.header import column_of, completed, is_read_by_name, long_form
from css_telemetry.motion import attitudes_of, directions_of, vectors_of
from css_telemetry.places import Place, place_of
from css_telemetry.table_files import open_table
from css_telemetry.table_text import Table, name_and_unit

LEAST_PLAUSIBLE, MOST_PLAUSIBLE = 0.1, 3.0  # largest output of any cell that is in units of full Sun


@dataclasses.dataclass
class TrueMotion:
    """Truth of a table; None: it has no such columns; NaN: missing in that line.

    Attributes:
        sun_b: (N, 3) unit vectors.
        sigma_bn: (N, 3).
        omega_bn_b: (N, 3) [rad/s].
        place: positions and velocities.
        illumination: (N,) fraction of the solar disc in view.
    """

    sun_b: np.ndarray | None = None
    sigma_bn: np.ndarray | None = None
    omega_bn_b: np.ndarray | None = None
    place: Place | None = None
    illumination: np.ndarray | None = None


@dataclasses.dataclass
class Telemetry:
    """A table that was read. None: it has no such columns; NaN: missing in that line.

    Attributes:
        description: by which it was read, complete.
        stamps_ns: (N,) [ns of UTC since 1970], growing.
        cells: (N, C) outputs, 1 for the Sun met head-on.
        rate: (N, 3) measured body rate [rad/s].
        field: (N, 3) measured magnetic field [T] in b.
        wheels: (N, W) speeds [rad/s].
        temperatures: (N,) [deg C] of each column.
        place: measured positions.
        sunlight: (N,) part of the sunlight that the spacecraft said it was in.
        truth: what estimates are held against.
        account: what became of the lines.
        ignored_columns: columns not used.
        read_as: what is unusual about the form of the table.
        scaled: the output of a cell that the Sun meets head-on was stated.
        sha256: of the file.
        doubt: what of the form of the table had to be guessed against what stands there; empty: nothing.
    """

    description: Description
    stamps_ns: np.ndarray
    cells: np.ndarray
    truth: TrueMotion
    account: Account
    ignored_columns: tuple[str, ...]
    read_as: tuple[str, ...]
    scaled: bool
    sha256: str
    rate: np.ndarray | None = None
    field: np.ndarray | None = None
    wheels: np.ndarray | None = None
    place: Place | None = None
    temperatures: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    doubt: str = ""
    sunlight: np.ndarray | None = None

    @property
    def blind(self) -> np.ndarray:
        """(N,) True at lines without any cell output."""
        return np.isnan(self.cells).all(axis=1)

    @property
    def largest_output(self) -> float:
        """The largest output of any cell; NaN when all are missing."""
        return float(np.nanmax(self.cells)) if not np.isnan(self.cells).all() else math.nan


def read_telemetry(
    path: Path,
    description: Description,
    *,
    epoch_ns: int | None = None,
    full_scale: float | None = None,
    time_unit: str | None = None,
) -> Telemetry:
    """Reads a table.

    A value that cannot be read costs itself, a line without a time the line: `Telemetry.account` counts both.

    Args:
        path: text, Parquet or Excel.
        description: which column is what; one of cells alone leaves time, rates and Sun to the header.
        epoch_ns: instant from which counts of time count; None: as the description says, else 1970.
        full_scale: what a cell gives above its dark level at normal incidence at 1 AU, by which outputs are divided;
            None: what the description says, else 1.
        time_unit: of counts of time; None: what description or header say, else s.

    Raises:
        BagError: the file cannot be read, a column is missing, or no line can be used; says where, and what was
            expected.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error
    table = open_described(path, content, description)
    try:
        description, notes = completed(table, description, time_unit, epoch_ns)
    except ValueError as error:
        pivot = long_form(table, {cell.column for cell in description.cells})
        raise BagError(f"{path}: line {table.header_line}: {error}{pivot}") from error
    if full_scale is None and not description.scaled:
        _refuse_different_units(table, description)
    readings = read_columns(table, description)
    return _telemetry(readings, description, full_scale, table, notes, hashlib.sha256(content).hexdigest())


def open_described(path: Path, content: bytes, description: Description) -> Table:
    """The table in a file, by what a description says of its form."""
    names = {"time", "timestamp", "sun_x", "sun_y", "sun_z", *(cell.column for cell in description.cells)}
    times = description.time.columns if description.time is not None else ("time",)
    named = names | set(times) | {name for group in groups_of(description) for name in group.columns}

    def is_used(name: str) -> bool:
        known = name in named or name_and_unit(name)[0] in named
        return known or (not description.names_roles and is_read_by_name(name))

    # in the long form the columns are names in the lines
    knows = None if description.table.long_name else is_used
    return open_table(path, content, names | set(times), description.table, times, knows)


def _refuse_different_units(table: Table, description: Description) -> None:
    """Cells in different units need a full scale each, by which they are one again."""
    places = [column_of(table, cell.column) for cell in description.cells]
    units = {table.units[index]: index for index in places if index is not None}
    if len(units) > 1:
        first, second = (table.header[index] for index in list(units.values())[:2])
        raise BagError(
            f"{table.path}: line {table.header_line}: the cells {first} and {second} have different units, expected "
            "one, or a full scale for each"
        )


def _telemetry(
    readings: Readings,
    description: Description,
    full_scale: float | None,
    table: Table,
    notes: list[str],
    sha256: str,
) -> Telemetry:
    aiding, lines, account = description.aiding, readings.lines, readings.account
    units = {
        unit: None for cell in description.cells if (unit := cell.unit or _unit_of(table, cell.column)) not in ("", "1")
    }
    telemetry = Telemetry(
        description,
        readings.stamps_ns,
        cell_outputs(readings, description, full_scale),
        _truth(readings, description),
        account,
        readings.ignored,
        (
            *table.read_as,
            *(["newest line first"] if readings.newest_first else []),
            *notes,
            *(f"cell outputs in {unit}" for unit in units),
        ),
        full_scale is not None or description.scaled,
        sha256,
        doubt=table.doubt,
    )
    if aiding is not None:
        telemetry.rate = None if aiding.rate is None else vectors_of(readings, aiding.rate)
        telemetry.field = None if aiding.field is None else vectors_of(readings, aiding.field)
        if aiding.wheels is not None:
            telemetry.wheels = readings.matrix(aiding.wheels.columns) * aiding.wheels.factor
        if aiding.position is not None and aiding.position.columns:
            telemetry.place = place_of(readings, aiding.position)
        if aiding.illumination is not None:
            telemetry.sunlight = _sunlight(readings, aiding.illumination, eclipse=aiding.eclipse)
        for form in aiding.temperatures:
            telemetry.temperatures[form.column] = readings.values[form.column] * form.factor + form.offset
    _count_missing(telemetry, lines)
    return telemetry


def _unit_of(table: Table, name: str) -> str:
    index = column_of(table, name)
    return "" if index is None else table.units[index]


def _truth(readings: Readings, description: Description) -> TrueMotion:
    form = description.truth
    if form is None:
        return TrueMotion()
    illumination = None
    if form.illumination is not None:
        illumination = _sunlight(readings, form.illumination, eclipse=form.eclipse)
    return TrueMotion(
        None if form.sun is None else directions_of(readings, form.sun),
        None if form.attitude is None else attitudes_of(readings, form.attitude),
        None if form.rate is None else vectors_of(readings, form.rate),
        None if form.position is None or not form.position.columns else place_of(readings, form.position),
        illumination,
    )


def _sunlight(readings: Readings, form: ColumnForm, *, eclipse: bool) -> np.ndarray:
    """(N,) part of the sunlight, of a column that tells it or the shadow."""
    told = np.clip(readings.values[form.column], 0.0, 1.0)
    return 1.0 - told if eclipse else told


def _count_missing(telemetry: Telemetry, lines: np.ndarray) -> None:
    account, blind = telemetry.account, telemetry.blind
    account.note_missing("lines used without any cell output", lines, blind)
    account.note_missing(
        "missing cell outputs in the other lines", lines, np.where(blind, 0, np.isnan(telemetry.cells).sum(axis=1))
    )
    truth = telemetry.truth
    kinds = {
        "lines used without a rate": telemetry.rate,
        "lines used without a field": telemetry.field,
        "lines used without the wheels": telemetry.wheels,
        "lines used without a position": None if telemetry.place is None else telemetry.place.r_n,
        "lines used without a Sun vector": truth.sun_b,
        "lines used without an attitude": truth.sigma_bn,
    }
    for what, values in kinds.items():
        if values is not None:
            account.note_missing(what, lines, np.isnan(values).any(axis=1))


def refuse_unscaled(telemetry: Telemetry, source: Path) -> None:
    """Refuses a table without cell outputs, and one that is plainly in another unit while no full scale was stated.

    Raises:
        BagError: naming the largest output and what would be right.
    """
    largest = telemetry.largest_output
    if math.isnan(largest):
        raise BagError(f"{source}: every cell output is missing{_because(telemetry.account.repaired)}")
    if not telemetry.scaled and not LEAST_PLAUSIBLE <= largest <= MOST_PLAUSIBLE:
        raise BagError(
            f"{source}: the largest cell output is {largest:.3g}, expected about 1, which is a cell that the Sun meets "
            "head-on: say what such a cell reads by --full-scale or by full_scale in the layout, and what it reads in "
            "the dark by dark_level there; --full-scale 1 takes the outputs as they are"
        )


def _because(faults: dict[str, Counted]) -> str:
    first = min(faults.values(), key=lambda found: found.first_line, default=None)
    return "" if first is None else f": line {first.first_line}: {first.detail}"
