# SPDX-License-Identifier: Apache-2.0
"""A table with everything that a spacecraft knows, in units, frames and orders that are not Sunpoint's: all of it
reaches the estimators that can use it, and what nobody gave is used by none.
"""

import json
import math
from pathlib import Path

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from css_bringup.commands import replay as replay_command
from css_environment.ephemeris import build_ephemeris
from css_environment.orbit import IntegratedOrbit, keplerian_orbit, orbit_states
from css_telemetry import import_table
from css_telemetry.commands.import_csv import main

LINES = 240
EPOCH_NS = 1_709_294_418 * 10**9  # 2024-03-01T12:00:18Z, 1393329636 s of GPS
GPS_BEGIN = 1_393_329_636
RATE_B = np.radians([0.3, -0.5, 0.8])
FACES = {"px": (1, 0, 0), "mx": (-1, 0, 0), "py": (0, 1, 0), "my": (0, -1, 0), "pz": (0, 0, 1), "mz": (0, 0, -1)}

_CELLS = "\n".join(f"  css_{name}: {list(map(float, normal))}" for name, normal in FACES.items())
DESCRIPTION = (
    f"""\
cells:
{_CELLS}
"""
    + """\
table: {separator: ";", decimal: ","}
time: {column: t_gps, scale: gps}
field_of_view_deg: 180
full_scale: 3000
dark_level: 120
inertia: [0.04, 0, 0, 0, 0.04, 0, 0, 0, 0.02]
aiding:
  rate: {columns: [g1, g2, g3], unit: deg/s, axes: [+y, -x, +z]}
  field: {columns: [b1, b2, b3], unit: nT, axes: [-z, +y, +x]}
  position: {frame: ecef, columns: [xe, ye, ze], unit: km}
  wheels: {columns: [w1, w2, w3], unit: rpm, axes: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], inertia: 0.001}
  temperatures: [{column: temp, unit: K}]
truth:
  attitude: {columns: [q0, q1, q2, q3], order: wxyz, direction: body_to_inertial}
  position: {frame: ecef, columns: [xe, ye, ze], unit: km}
"""
)


def motion():
    """Times, positions in n, direction and flux of the Sun, field, and the attitudes of a body that turns evenly."""
    orbit = IntegratedOrbit(keplerian_orbit(6_878_137.0, 0.001, 51.6, 40.0, 10.0, 20.0))
    time = np.arange(LINES, dtype=float)
    r_n, _ = orbit_states(orbit, EPOCH_NS, time)
    tables = build_ephemeris(orbit, EPOCH_NS, 0.0, 300.0, step_s=1.0)
    sun = tables.sun_position_n[:LINES] - r_n
    distance = np.linalg.norm(sun, axis=1)
    # the frame turns: components go the other way
    attitude = Rotation.from_rotvec(-np.outer(time, RATE_B)) * Rotation.from_euler("xyz", [20, 130, -50], degrees=True)
    return time, r_n, sun / distance[:, None], (1.495978707e11 / distance) ** 2, tables.field_n[:LINES], attitude


def to_earth(r_n, time):
    days = 2_440_587.5 + EPOCH_NS // (86_400 * 10**9)
    utc = (EPOCH_NS % (86_400 * 10**9)) * 1e-9 / 86_400.0 + time / 86_400.0
    tt = erfa.taitt(*erfa.utctai(days, utc))
    return np.einsum("tij,tj->ti", erfa.c2t06a(*tt, days, utc, 0.0, 0.0), r_n)


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    folder = tmp_path_factory.mktemp("orbit")
    time, r_n, sun_n, flux, field_n, attitude = motion()
    sun_b, field_b = attitude.apply(sun_n), attitude.apply(field_n)
    earth = to_earth(r_n, time)
    header = (
        "t_gps;" + ";".join(f"css_{name}" for name in FACES) + ";g1;g2;g3;b1;b2;b3;xe;ye;ze;w1;w2;w3;temp;q0;q1;q2;q3"
    )
    lines = [header]
    rate = np.degrees(RATE_B)
    for k in range(LINES):
        counts = [round(120 + 3000 * flux[k] * max(0.0, float(np.dot(n, sun_b[k])))) for n in FACES.values()]
        # of A(q): components of n to b; the table has the other way, scalar first
        x, y, z, w = attitude[k].as_quat()
        b = field_b[k] * 1e9
        wheels = np.array([1000.0, -500.0, 250.0])
        numbers = [
            GPS_BEGIN + k, *counts, rate[1], -rate[0], rate[2], -b[2], b[1], b[0], *(earth[k] / 1e3), *wheels, 293.15,
            w, *(x, y, z),
        ]  # fmt: skip
        lines.append(
            ";".join(f"{number:.9g}".replace(".", ",") if i else str(number) for i, number in enumerate(numbers))
        )
    (folder / "flight.csv").write_text("\n".join(lines) + "\n")
    (folder / "flight.yaml").write_text(DESCRIPTION)
    return folder


@pytest.fixture(scope="module")
def report(table):
    return import_table(table / "flight.csv", table / "flight.yaml", table / "bag")


def test_what_the_import_says(report):
    assert report.first_ns == EPOCH_NS and report.last_ns == EPOCH_NS + (LINES - 1) * 10**9
    assert report.states is not None and report.states.known == ("sun", "attitude", "position", "illumination")
    assert report.messages == {
        "/truth": LINES, "/css/voltages": LINES, "/gyro/imu": LINES, "/mag/field": LINES, "/wheels/state": LINES,
        "/css/temperature": LINES,
    }  # fmt: skip
    _, r_n, sun_n, flux, field_n, attitude = motion()
    telemetry = report.telemetry
    np.testing.assert_allclose(telemetry.rate, np.tile(RATE_B, (LINES, 1)), rtol=1e-8)
    np.testing.assert_allclose(telemetry.field, attitude.apply(field_n), atol=1e-12)
    np.testing.assert_allclose(telemetry.wheels[0], np.array([1000.0, -500.0, 250.0]) * math.pi / 30, rtol=1e-12)
    np.testing.assert_allclose(telemetry.temperatures["temp"], 20.0, atol=1e-6)
    # nine digits of kilometres, and an Earth that turns evenly for six hours
    np.testing.assert_allclose(report.states.r_n, r_n, atol=0.5)
    np.testing.assert_allclose(report.states.sun_n, sun_n, atol=1e-8)
    turned = Rotation.from_quat(quaternions(report.states.sigma_bn))
    # A(q) turns components of n into those in b; SciPy's rotation of the same quaternion is the other way
    assert np.degrees((turned * attitude).magnitude().max()) < 1e-5
    np.testing.assert_allclose(report.states.flux, flux, rtol=1e-9)
    assert report.sun is not None and report.sun.median_deg < 1.0
    assert report.orbit["source"] == "elements" and "fitted to the positions" in report.orbit_notes[0]
    assert report.orbit["altitude"] == pytest.approx(500e3, abs=2e3)
    assert report.orbit["inclination_deg"] == pytest.approx(51.6, abs=0.01)


def quaternions(sigma):
    squares = np.sum(sigma**2, axis=1, keepdims=True)
    return np.hstack([2 * sigma, 1 - squares]) / (1 + squares)


def replayed(bag: Path, capsys, *estimators: str) -> dict:
    arguments = [str(bag), "--out", str(bag.with_name("out")), "--overwrite", "--json", "--estimators", *estimators]
    assert replay_command.main(arguments) == 0
    return json.loads(capsys.readouterr().out.splitlines()[-1])


@pytest.mark.timeout(1500)  # compiles seven estimators where none is in the cache
def test_all_of_it_reaches_the_estimators(report, capsys):
    names = ["attitude_filter", "triad", "flat", "ekf", "wavg", "wls", "sun_filter"]
    result = replayed(report.recording, capsys, *names)
    runs = {run["estimator"]: run for run in result["runs"]}
    assert list(runs) == names
    # without noise, with readings of whole counts of 3000, each of which is 0.02 deg
    for name in ("ekf", "wls", "wavg", "flat"):
        assert runs[name]["heading_error_p95_deg"] < 0.1, name
    # these two take light of the Earth off, or look for it, which the table has none of
    assert runs["sun_filter"]["heading_error_p95_deg"] < 0.5
    assert runs["attitude_filter"]["attitude_error_p95_deg"] < 0.2
    assert runs["triad"]["attitude_error_p95_deg"] < 0.05
    assert all(run["steps_without_estimate"] < 10 for run in runs.values())
    # the truth has no rates: none are shown
    assert all(run["rate_final_deg_s"] is None for run in runs.values())
    assert all(run["pointing_error_mean_deg"] is None for run in runs.values())


def test_a_wrong_direction_of_the_attitude_shows(table, capsys):
    wrong = table / "wrong.yaml"
    wrong.write_text(DESCRIPTION.replace("body_to_inertial", "inertial_to_body"))
    assert main([str(table / "flight.csv"), str(wrong), "-o", str(table / "wrong")]) == 1
    complaint = capsys.readouterr().err
    assert "beside the one that the cells see: check the order and direction of the attitude" in complaint


def test_positions_that_follow_no_orbit_make_none(table, capsys):
    wrong = table / "metres.yaml"
    wrong.write_text(DESCRIPTION.replace("frame: ecef, columns: [xe, ye, ze]", "frame: eci, columns: [ze, xe, ye]", 1))
    assert main([str(table / "flight.csv"), str(wrong), "-o", str(table / "no_orbit")]) == 0
    assert "orbit: none, positions are not used: " in capsys.readouterr().out
    bag = str(table / "no_orbit")
    assert replay_command.main([bag, "--out", str(table / "refused"), "--estimators", "attitude_filter"]) == 2
    assert "orbit.source: missing" in capsys.readouterr().err


def test_the_other_forms_of_a_place_give_the_same_orbit(table, report):
    """Geodetic, inertial and TLE columns against the fitted elements."""
    time, r_n, *_ = motion()
    earth = to_earth(r_n, time)
    longitude, latitude, height = erfa.gc2gd(1, earth)
    forms = {
        "geodetic": (
            "{frame: geodetic, columns: [a, b, c], unit: m}",
            (np.degrees(latitude), np.degrees(longitude), height),
        ),
        "eci": ("{frame: eci, columns: [a, b, c], unit: m}", r_n.T),
    }
    for name, (form, columns) in forms.items():
        lines = ["time,css_px,a,b,c"]
        lines += [
            f"{EPOCH_NS // 10**9 + k},0.5,{a!r},{b!r},{c!r}" for k, (a, b, c) in enumerate(zip(*columns, strict=True))
        ]
        (table / f"{name}.csv").write_text("\n".join(lines).replace("np.float64(", "").replace(")", "") + "\n")
        (table / f"{name}.yaml").write_text(f"cells: {{css_px: [1, 0, 0]}}\naiding: {{position: {form}}}\n")
        found = import_table(table / f"{name}.csv", table / f"{name}.yaml", table / f"bag_{name}").orbit
        for key in ("altitude", "eccentricity", "inclination_deg", "raan_deg"):
            assert found[key] == pytest.approx(report.orbit[key], rel=2e-3, abs=2e-3), (name, key)
