# SPDX-License-Identifier: Apache-2.0
"""What people may hand in: the form of a table of telemetry, and of the file that says which columns are cells."""

TELEMETRY_FORM = """\
Reads a table of telemetry: time, cell outputs, body rate, Sun vector.

The first line names the columns; a unit may stand behind a name in brackets. Separator: comma, semicolon, tabulator,
bar or blanks; numbers may have decimal commas where commas do not separate. Lines that begin with # and empty lines
are skipped. An empty field, `nan`, `na`, `null`, `none` or `-` is a missing value, and so is a usual fill value such
as -9999 or 65535 that lies far outside of everything else.

time, timestamp                seconds (or --time-unit), or ISO 8601 instants (UTC without an offset), also by day
                               of year (2024-001T00:00:00)
<names of the cell layout>     cell outputs
omega_x_rad_s, omega_y_..      body rate about each axis; also gyro_x or rate_x, and deg_s or dps for degrees
sun_x, sun_y, sun_z            direction from the spacecraft to the Sun in the body frame, of any length

Lines must go forward in time: of those that do not fit together the largest set that does is good, the others are
broken.
"""

LAYOUT_FORM = """\
Reads which columns of a telemetry table are sun sensor cells, and where the cells look.

YAML:
    cells:
      CSS_1: [0.7071, 0.0, 0.7071]     # column name: outward normal in the body frame
      CSS_2: [0.0, 0.7071, 0.7071]
    field_of_view_deg: 120.0           # optional: full cone of view of a cell
    clip_normal: [0.0, 0.0, 1.0]       # optional: body plane that hides the other half space from each cell
    dark_level: 100.0                  # optional: what a cell gives in the dark, in the unit of the table
    full_scale: {CSS_1: 2900, CSS_2: 3000}  # optional: what the Sun, met head-on, adds to that
CSV: a header `cell,x,y,z` and a row for each cell.

A name is what stands there: `on`, `1`, `01` and `+X` are four cells. `dark_level` and `full_scale` are one number for
all cells, or one for each.
"""

TIME_UNITS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""Nanoseconds in the units that times can have."""
