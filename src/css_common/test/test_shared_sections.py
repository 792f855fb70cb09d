# SPDX-License-Identifier: Apache-2.0
"""Sections of missions: their defaults, what conflicts in them, and how packages bring their own."""

import pytest

from css_common import actuator_sections, sections
from css_common.places import SECTIONS_INDEX
from css_common.schema import checked_values, default_values, shaped_values
from css_common.shared_sections import conflicts, section_table, shared_parameters, shared_sections


@pytest.mark.parametrize("name", shared_sections())
def test_every_shared_default_passes_its_own_check(name):
    table = section_table(name)
    canonical = checked_values(table, {})
    for parameter in table:
        assert parameter.check(parameter.default) == pytest.approx(canonical[parameter.name], abs=0.0, nan_ok=True)
        assert parameter.description
        assert parameter.unit
        if parameter.kind == "real" and parameter.name.endswith("_deg"):
            assert parameter.unit == "deg"
    assert list(conflicts(shaped_values(table, canonical))) == []


def test_shared_names_are_unique_and_stand_in_their_section():
    names = [p.name for section in shared_sections().values() for p in section.table]
    assert len(set(names)) == len(names)
    for name, section in shared_sections().items():
        assert all(p.name.startswith(f"{name}.") or p.name == "autostart" for p in section.table)


ORBIT = {"orbit__source": "elements", "orbit__altitude": 400e3}
CONFLICTS = [
    ("orbit", {"orbit__source": "elements"}, "orbit.altitude: missing, expected a number [m], at least 100000"),
    ("orbit", {**ORBIT, "orbit__altitude": 5e4}, "orbit.altitude: 50000 given, expected a number [m], at least 100000"),
    ("mission", {"mission__epoch": "tomorrow"}, "mission.epoch: 'tomorrow' is not a UTC instant"),
    ("mission", {"mission__epoch": "1969-12-31T00:00:00Z"}, "mission.epoch: "),
    ("mission", {"mission__epoch": "2038-01-19T03:00:00Z", "mission__duration": 5550.0}, "mission.epoch: "),
    ("orbit", {"orbit__source": "tle"}, "orbit.tle_line1: expected the 69 characters"),
    (
        "orbit",
        {**ORBIT, "orbit__eccentricity": 0.5},
        "0.5 given, which with orbit.altitude 400000 m puts",
    ),
    ("orbit", {**ORBIT, "orbit__eccentricity": 0.05}, "at 61 km; expected at most 0.0442, a perigee of 100 km"),
    ("spacecraft", {"spacecraft__inertia": [1.0, 0.1, 0, 0, 1, 0, 0, 0, 1]}, "spacecraft.inertia: not symmetric"),
    ("spacecraft", {"spacecraft__inertia": [1.0, 0, 0, 0, -1, 0, 0, 0, 1]}, "spacecraft.inertia: eigenvalue -1 given"),
    ("spacecraft", {"spacecraft__inertia": [1.0, 0, 0, 0, 1, 0, 0, 0, 3]}, "break the triangle inequality"),
    ("spacecraft", {"spacecraft__array_normal": [0, 0, 0.5]}, "spacecraft.array_normal: length 0.5 given"),
    ("wheels", {"wheels__axes": [1, 0, 0, 0, 1, 0]}, "wheels.axes: 2 rows given, expected 3 to 32"),
    ("wheels", {"wheels__axes": [1, 0, 0, 0, 1, 0, 0, -1, 0]}, "wheels.axes: they span 2 of 3 directions"),
    ("rods", {"rods__axes": [1, 1, 0]}, "rods.axes: row 0 has length 1.41421"),
    ("io", {"io__body_frame": "b" * 256}, "io.body_frame: "),
    ("io", {"io__inertial_frame": "ä" * 128}, "io.inertial_frame: "),
]


@pytest.mark.parametrize(("section", "changes", "expected"), CONFLICTS)
def test_values_that_conflict_are_named(section, changes, expected):
    changes = {k: [float(x) for x in v] if isinstance(v, list) else v for k, v in changes.items()}
    found = list(conflicts(default_values(section_table(section), **changes)))
    assert any(expected in line for line in found), found
    assert all("\n" not in line for line in found)


def test_inertia_of_a_flat_plate_passes():
    plate = [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0]
    assert not list(conflicts(default_values(sections.SPACECRAFT, spacecraft__inertia=plate)))


def test_a_spacecraft_without_wheels_has_no_axes():
    axes = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    fitted, bare = (
        default_values(actuator_sections.WHEELS, wheels__fitted=word, wheels__axes=axes) for word in (True, False)
    )
    assert actuator_sections.wheel_axes(fitted).shape == (3, 3)
    assert actuator_sections.wheel_axes(bare).shape == (0, 3)


def installed(tmp_path, monkeypatch, package, source):
    """Makes a package that brings sections the only one that is installed."""
    folder = tmp_path / "python" / package
    folder.mkdir(parents=True)
    (folder / "__init__.py").touch()
    (folder / "sections.py").write_text(source)
    mark = tmp_path / "prefix" / SECTIONS_INDEX / package
    mark.parent.mkdir(parents=True)
    mark.touch()
    monkeypatch.syspath_prepend(tmp_path / "python")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'nothing'}:{tmp_path / 'prefix'}")


BROUGHT = """
from css_common.schema import real
from css_common.section import Section

def conflicts(tank):
    if tank.fuel > tank.volume:
        yield f"tank.fuel: {tank.fuel:g} given, expected at most tank.volume"

TABLE = (real("tank.volume", 1.0, "m^3", "what goes in"), real("tank.fuel", 0.5, "m^3", "what is in"))
SECTIONS = {"NAME": Section(TABLE, conflicts)}
"""


def test_a_package_brings_sections(tmp_path, monkeypatch):
    installed(tmp_path, monkeypatch, "brings_a_tank", BROUGHT.replace("NAME", "tank"))
    assert list(shared_sections()) == [*sections.SECTIONS, "tank"]
    assert shared_parameters()["tank.fuel"].default == 0.5
    values = default_values(section_table("tank"), tank__fuel=2.0)
    assert list(conflicts(values)) == ["tank.fuel: 2 given, expected at most tank.volume"]


def test_a_section_that_is_there_already_is_refused(tmp_path, monkeypatch):
    installed(tmp_path, monkeypatch, "brings_an_orbit", BROUGHT.replace("NAME", "orbit"))
    with pytest.raises(LookupError, match="brings_an_orbit brings the mission section orbit, which another"):
        shared_sections()


def test_a_section_that_nobody_brings_is_named(monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    assert list(shared_sections()) == list(sections.SECTIONS)
    with pytest.raises(LookupError, match=r"no package in AMENT_PREFIX_PATH has the mission section cells, expected"):
        section_table("cells")
