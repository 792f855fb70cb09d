# SPDX-License-Identifier: Apache-2.0
"""What is asked of a spacecraft: the one table of options, questions, units and defaults."""

from dataclasses import dataclass
from typing import Any

from css_design.errors import DesignError
from css_design.new_mission.values import (
    NONE,
    Parser,
    directions,
    number,
    numbers,
    optional,
    plain,
    word,
)


@dataclass(frozen=True)
class Item:
    """One thing that is asked.

    Attributes:
        name: of the option, with underscores.
        unit: of its numbers, empty for words.
        question: what it is.
        form: what may be written, for help and question.
        parse: reads it.
    """

    name: str
    unit: str
    question: str
    form: str
    parse: Parser

    @property
    def flag(self) -> str:
        """Its option."""
        return f"--{self.name.replace('_', '-')}"

    def read(self, text: str) -> Any:
        """The value of a text.

        Raises:
            DesignError: it is none; names the option.
        """
        try:
            return self.parse(text)
        except DesignError as error:
            unit = f" [{self.unit}]" if self.unit else ""
            raise DesignError(f"{self.flag}: {error}{unit}") from error


ITEMS = (
    Item("size", "m", "size of the box along x, y, z", "X,Y,Z", numbers((3,), 0.01, 100.0)),
    Item("mass", "kg", "mass, deployed panels included", "M", number(0.01, 1e5)),
    Item(
        "inertia",
        "kg m^2",
        "inertia about the centre of mass: three moments, nine numbers row by row, or none: from size and mass",
        f"IX,IY,IZ|{NONE}",
        optional(numbers((3, 9), -1e6, 1e6)),
    ),
    Item(
        "cells",
        "",
        "where the Sun sensor cells look: faces, vectors with commas between them, or all six faces",
        "+x,-x,0.7/0/0.7|all",
        directions,
    ),
    Item(
        "panels",
        "",
        "deployed panels as hinge face:sunny side:length in m[:cells on it], with blanks between them",
        f"'+y:+z:0.3:1 -y:+z:0.3'|{NONE}",
        optional(plain),
    ),
    Item(
        "array_normal",
        "",
        "normal of the solar arrays; auto: that of the panels, of the largest face, or for a spacecraft that spins "
        "the axis of its largest moment",
        "+z|0/0.6/0.8|auto",
        plain,
    ),
    Item("wheels", "", "reaction wheels: along the axes, or four in a pyramid", f"3|4|{NONE}", word("3", "4", NONE)),
    Item("wheel_momentum", "N m s", "largest momentum of a wheel", "H", number(1e-7, 1e3)),
    Item("wheel_torque", "N m", "largest torque of a wheel", "T", number(1e-8, 1e2)),
    Item("wheel_speed", "rpm", "largest speed of a wheel", "N", number(1.0, 1e6)),
    Item("rods", "A m^2", "torque rods along the axes: dipole of each", f"M|{NONE}", optional(number(1e-4, 1e4))),
    Item("gyro", "deg/s", "gyro: noise of a sample, 1 sigma", f"S|{NONE}", optional(number(0.0, 100.0))),
    Item("gyro_bias", "deg/h", "its bias, 1 sigma", "B", number(0.0, 1e5)),
    Item("magnetometer", "nT", "magnetometer: noise of a sample, 1 sigma", f"S|{NONE}", optional(number(0.0, 1e5))),
    Item("field_of_view", "deg", "full cone of view of a cell", "A", number(10.0, 180.0)),
    Item("cell_noise", "-", "noise of a cell, 1 sigma, of full Sun", "S", number(0.0, 0.3)),
    Item("cell_bits", "bits", "converter of the cells, over twice the full Sun; 0: continuous", "N", number(0, 24)),
    Item("cell_scale", "-", "error of the scale of a cell, 1 sigma", "S", number(0.0, 0.5)),
    Item("cell_tilt", "deg", "tilt of a cell's normal about each of two axes, 1 sigma", "A", number(0.0, 20.0)),
    Item(
        "orbit",
        "",
        "orbit: sso ALTITUDE_KM LOCAL_TIME_OF_ASCENDING_NODE, elements ALTITUDE_KM INCLINATION_DEG [NODE_DEG "
        "[ECCENTRICITY]], or tle FILE",
        "'sso 500 10:30'",
        plain,
    ),
    Item("epoch", "UTC", "start of the flight; auto: that of the element set, else 2026-06-01", "ISO|auto", plain),
    Item("tip_off", "deg/s", "body rate at the start, in any direction", "W", number(0.0, 3600.0)),
    Item("period", "s", "control cycle", "H", number(0.001, 10.0)),
    Item("orbits", "orbits", "length of the flight", "N", number(0.01, 1000.0)),
    Item(
        "estimator",
        "",
        "Sun estimator; auto: sun_filter with wheels, wls with rods alone",
        "auto|ekf|sun_filter|wls|wavg",
        word("auto", "ekf", "sun_filter", "wls", "wavg"),
    ),
)
"""In the order in which they are asked."""

BY_NAME = {item.name: item for item in ITEMS}
