# SPDX-License-Identifier: Apache-2.0
"""What a description says of a table of telemetry: which column is what, in which unit, frame and time scale."""

from typing import NamedTuple

Triple = tuple[float, float, float]

SCALES = ("utc", "unix", "gps", "tai", "epoch", "boot")
DIRECTIONS = ("inertial_to_body", "body_to_inertial")
FRAMES = ("eci", "teme", "ecef", "geodetic")
BODY_AXES = ("+x", "+y", "+z")


class TableForm(NamedTuple):
    """How a table is written; empty texts and None: found by itself."""

    separator: str = ""
    decimal: str = ""
    encoding: str = ""
    sheet: str = ""
    units_row: bool | None = None
    long_name: str = ""  # column that names what stands in a line, of tables with one value a line
    long_value: str = ""
    absent: tuple[str, ...] = ()  # names of the header that have no field in the lines


PLAIN = TableForm()
"""A table of which nothing is told."""


class TimeForm(NamedTuple):
    """What the times of a table are."""

    columns: tuple[str, ...]  # one, or a date and a time, or week and seconds of GPS
    unit: str = "s"
    scale: str = "utc"
    epoch_ns: int | None = None  # instant from which counts count, in the scale; None: the scale's own


class Thermal(NamedTuple):
    """How the output of a cell goes with its temperature."""

    column: str
    coefficient: float  # relative change of the full scale per kelvin
    reference: float  # temperature of the stated full scale, in the unit of the column


class CellForm(NamedTuple):
    """One cell."""

    name: str
    column: str
    normal_b: Triple
    unit: str = ""
    full_scale: float | None = None  # above the dark level, at normal incidence at 1 AU
    dark_level: float | None = None
    lookup: tuple[tuple[float, ...], tuple[float, ...]] | None = None  # readings, growing, and outputs
    thermal: Thermal | None = None
    field_of_view_deg: float | None = None  # full cone; None: that of all cells


class VectorForm(NamedTuple):
    """Three columns that make a vector in b."""

    columns: tuple[str, str, str]
    factor: float = 1.0  # to SI
    axes: tuple[str, str, str] = BODY_AXES  # of the body, that each column measures along


class AttitudeForm(NamedTuple):
    """Columns of an attitude."""

    columns: tuple[str, ...]  # four of a quaternion, nine of a matrix by rows
    order: str  # xyzw, wxyz, matrix
    direction: str  # inertial_to_body: A(q) turns components in n into b


class PositionForm(NamedTuple):
    """Where the spacecraft is: columns, or a two-line element set."""

    frame: str
    columns: tuple[str, ...] = ()
    factor: float = 1.0  # to m, of heights alone when the frame is geodetic
    velocity: tuple[str, ...] = ()
    velocity_factor: float = 1.0
    angle_factor: float = 1.0  # to rad, of latitude and longitude
    tle: tuple[str, str] | None = None


class WheelForm(NamedTuple):
    """Speeds of reaction wheels."""

    columns: tuple[str, ...]
    factor: float
    axes_b: tuple[Triple, ...]
    inertia: float | None = None  # [kg m^2]


class ColumnForm(NamedTuple):
    """One column, with what is added to its values times a factor."""

    column: str
    factor: float = 1.0
    offset: float = 0.0


class Aiding(NamedTuple):
    """What the spacecraft knew, for estimators."""

    rate: VectorForm | None = None
    field: VectorForm | None = None
    position: PositionForm | None = None
    wheels: WheelForm | None = None
    temperatures: tuple[ColumnForm, ...] = ()
    illumination: ColumnForm | None = None  # part of the sunlight that the spacecraft says it is in
    eclipse: bool = False  # that column is 1 in the shadow


class Truth(NamedTuple):
    """What is held against estimates."""

    sun: VectorForm | None = None
    attitude: AttitudeForm | None = None
    sun_inertial: Triple | None = None  # fixed direction of the Sun in n; None: the ephemeris
    rate: VectorForm | None = None
    position: PositionForm | None = None
    illumination: ColumnForm | None = None  # fraction of the solar disc in view
    eclipse: bool = False  # that column is 1 in the shadow


USUAL_VIEW_DEG = 120.0
"""Full cone of view of a cell of which no description tells one."""


class Description(NamedTuple):
    """Everything that is said of a table."""

    cells: tuple[CellForm, ...]
    field_of_view_deg: float | None = None  # None: not told, so that it is taken for the usual
    clip_normal_b: Triple = (0.0, 0.0, 0.0)
    table: TableForm = PLAIN
    time: TimeForm | None = None  # None: by the header
    missing: tuple[float, ...] | None = None  # numbers that stand for missing values; None: found
    aiding: Aiding | None = None
    truth: Truth | None = None
    inertia: tuple[float, ...] = ()  # [kg m^2] of the spacecraft, nine by rows

    @property
    def dates_known(self) -> bool:
        """Whether stamps are dates; those of a boot at an instant that nobody told are none."""
        return self.time is None or self.time.scale != "boot" or self.time.epoch_ns is not None

    @property
    def names_roles(self) -> bool:
        """Whether it says which columns are aiding and truth; else the header tells."""
        return self.aiding is not None or self.truth is not None

    @property
    def views_known(self) -> bool:
        """Whether it says how far each cell sees."""
        return self.field_of_view_deg is not None or all(cell.field_of_view_deg is not None for cell in self.cells)

    @property
    def scaled(self) -> bool:
        """Whether it says of each cell what the Sun, met head-on, makes it read."""
        return all(cell.full_scale is not None or cell.lookup is not None for cell in self.cells)
