# SPDX-License-Identifier: Apache-2.0
"""What people may hand in: the form of a table of telemetry, and of the file that describes it."""

TELEMETRY_FORM = """\
Reads a table of telemetry: text with commas, semicolons, tabulators, bars or blanks between its fields, in UTF-8,
UTF-16 or Latin-1, with decimal commas where commas do not separate; Parquet (.parquet, .pq); Excel (.xlsx).

The first line names the columns; units may stand behind names in brackets or in a line below. Lines that begin with #
and empty lines are skipped. An empty field, `nan`, `na`, `#n/a`, `null`, `none`, `-` or `?` is a missing value, and so
is a usual fill value such as -9999 or 65535 that lies far outside of everything else.

A value that cannot be read costs itself; a line whose time cannot be read, or does not go forward with those of the
others, costs the line. Of lines that do not fit together the largest set that does is good.
"""

DESCRIPTION_FORM = """\
The description says which column is what. With cells alone the columns time, omega_x_rad_s (.. _deg_s, .. _dps; also
gyro_x, rate_x) and sun_x, sun_y, sun_z are found by their names.

YAML:
    cells:
      CSS_1: [0.7071, 0.0, 0.7071]     # column name: outward normal in the body frame
      CSS_2: {column: A2, normal: [0, 0.7, 0.7], full_scale: 2900, dark_level: 100,
              temperature: {column: T2, coefficient: 0.001, reference: 25}}
      CSS_3: {normal: [0, 0, 1], lookup: [[100, 0.0], [1500, 0.48], [3000, 1.0]], field_of_view_deg: 90}
    field_of_view_deg: 120.0           # full cone of view of a cell
    clip_normal: [0.0, 0.0, 1.0]       # body plane that hides the other half space from each cell
    full_scale: 3000.0                 # what the Sun, met head-on, adds to the dark level; or one for each cell
    dark_level: 100.0                  # what a cell reads in the dark; or one for each cell
    unit: counts                       # V, mV, uV, A, mA, uA, counts or 1, for the summary
    missing: [-9999, 65535]            # numbers that stand for missing values, instead of those found
    table: {separator: ";", decimal: ",", encoding: latin-1, sheet: Telemetry, units_row: true,
            long: {name: sensor, value: reading},                   # long: one value a line
            absent: [temp]}            # names in the header without a field in the lines below
    time: {column: t, unit: ms, scale: gps}  # or columns: [date, time], [week, seconds] of GPS
                                       # unit: s ms us ns min h d; scale: utc unix gps tai epoch boot;
                                       # epoch: 2024-03-20T12:00:00Z, from which counts count
    aiding:                            # what the spacecraft knew: estimators hear it
      rate: {columns: [gx, gy, gz], unit: deg/s, axes: [+y, -x, +z]}  # axes: body axis of each column
      field: {columns: [bx, by, bz], unit: nT}
      position: {frame: ecef, columns: [x, y, z], unit: km, velocity: [vx, vy, vz], velocity_unit: km/s}
                                       # frame: eci teme ecef geodetic (latitude, longitude in deg, height)
                                       # or {tle: [LINE1, LINE2]}
      wheels: {columns: [w1], unit: rpm, axes: [[0, 0, 1]], inertia: 0.001}
      temperatures: [{column: T2, unit: degC}]
      eclipse: {column: dark}          # 1 in the shadow, or illumination: for estimators with eclipse.source flag
    truth:                             # what estimates are held against
      sun: {columns: [sx, sy, sz]}     # in the body frame, of any length
      attitude: {columns: [q1, q2, q3, q4], order: xyzw, direction: inertial_to_body}
                                       # order: xyzw wxyz matrix; inertial_to_body: A(q) v_n = v_b
      sun_inertial: [1, 0, 0]          # where the Sun is, instead of the ephemeris
      rate, position: as above         # illumination: {column: light} or eclipse: {column: dark}
    inertia: [1, 0, 0, 0, 1, 0, 0, 0, 1]  # kg m^2 of the spacecraft, for estimators that use it
CSV: a header `cell,x,y,z` and a row for each cell.

A name is what stands there: `on`, `1`, `01` and `+X` are four cells.
"""
