# SPDX-License-Identifier: Apache-2.0
"""Asks where somebody answers, makes the mission, writes it and says what it is worth."""

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from css_common.mission_section import name_for_files
from css_common.whole_files import write_whole
from css_design.errors import DesignError
from css_design.new_mission.items import ITEMS
from css_design.new_mission.new_mission import NewMission, new_mission, read_items
from css_design.new_mission.questions import ask
from css_design.new_mission.templates import TEMPLATES

_SUFFIXES = (".yaml", ".yml")


def run(options: argparse.Namespace) -> int:
    """Writes the mission that the options describe; the exit code."""
    if options.list:
        for name, template in TEMPLATES.items():
            print(f"{name:10}{template.description}")
        return 0
    path = _path(options)
    given = {item.name: value for item in ITEMS if (value := getattr(options, item.name)) is not None}
    read_items(given, options.template)  # what is wrong is said before anything is asked
    answers: dict[str, str] = {}
    if sys.stdin.isatty() and not options.yes:
        print(f"An empty line takes what stands in brackets, that of the template {options.template}.")
        try:
            answers = ask(given, options.template, input, print)
        except EOFError as error:
            raise DesignError("the answers ended before the questions, expected an answer or an empty line") from error
    asked, origin = read_items({**given, **answers}, options.template)
    origin |= dict.fromkeys(answers, "answered")
    made = new_mission(options.name, asked, origin)
    try:
        _write(path, made.text, options.overwrite)
    except FileExistsError as error:
        raise DesignError(_is_there(path)) from error
    except OSError as error:
        raise DesignError(f"{path}: cannot be written: {error.strerror}") from error
    _tell(made, path)
    if options.json:
        print(json.dumps(_as_object(made, path), allow_nan=False))
    return 1 if made.warnings else 0


def _path(options: argparse.Namespace) -> Path:
    name = options.name
    if name is None:
        raise DesignError("NAME: missing, expected a name for the mission, or --list")
    if name != name_for_files(name) or name.endswith(_SUFFIXES):
        raise DesignError(
            f"NAME: {name!r} given, expected a name for files such as {name_for_files(Path(name).stem)!r}"
        )
    path = options.out or Path(f"{name}.yaml")
    if path.suffix not in _SUFFIXES:
        raise DesignError(f"--out: {path} given, expected a file that ends in .yaml")
    if path.exists() and not options.overwrite:
        raise DesignError(_is_there(path))
    return path


def _is_there(path: Path) -> str:
    return f"{path}: is there already, expected a new file, another --out or --overwrite"


def _write(path: Path, text: str, overwrite: bool) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if not overwrite:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
        return
    write_whole(path, text)


def _tell(made: NewMission, path: Path) -> None:
    design = made.design
    moments = ", ".join(f"{moment:.4g}" for moment in np.linalg.eigvalsh(design.inertia))
    print(f"{made.mission.name}: {design.orbit.words}; {len(design.normals)} cells, {design.estimator}")
    print(f"  principal moments  {moments} kg m^2; array normal {_vector(design.array_normal)}")
    if design.wheels is not None and design.loop is not None:
        loop = design.loop
        print(
            f"  wheels             {design.wheels.torque:.3g} N m and {design.wheels.momentum:.3g} N m s in every "
            "direction"
        )
        print(
            f"  gains              k {loop.gains.k:g} N m, p {loop.gains.p:g} N m s: bandwidth "
            f"{loop.bandwidth / (2.0 * math.pi):.3g} Hz, limited by {loop.limit}"
        )
        settling = f"a small error falls to 2 % in {loop.settling_s:.0f} s"
        print(f"  margin             {loop.margin_db:.1f} dB of gain; {settling}")
    print(f"  integration        {design.substeps} steps a cycle of {design.asked['period']:g} s at the first rate")
    assumed = [item.flag for item in ITEMS if design.origin[item.name] in TEMPLATES]
    if assumed:
        print(f"  assumed            {', '.join(assumed)}")
    for line in made.warnings:
        print(f"warning: {line}", file=sys.stderr)
    print(f"mission: {path}")
    print(f"next: ./sunpoint fly {path}; ./sunpoint monte-carlo {path}; ./sunpoint budget {path}")


def _vector(vector: tuple[float, float, float]) -> str:
    return "(" + ", ".join(f"{part + 0.0:.3g}" for part in vector) + ")"


def _as_object(made: NewMission, path: Path) -> dict[str, Any]:
    design, loop = made.design, made.design.loop
    return {
        "mission": made.mission.name,
        "file": str(path),
        "inertia_kg_m2": design.inertia.tolist(),
        "array_normal": list(design.array_normal),
        "cells": len(design.normals),
        "estimator": design.estimator,
        "cell_sigma": design.cell_sigma,
        "substeps": design.substeps,
        "gains": None
        if loop is None
        else {
            "k_n_m": loop.gains.k,
            "p_n_m_s": loop.gains.p,
            "bandwidth_hz": loop.bandwidth / (2.0 * math.pi),
            "limited_by": loop.limit,
            "gain_margin_db": loop.margin_db,
            "settling_s": loop.settling_s,
        },
        "assumed": [item.name for item in ITEMS if design.origin[item.name] in TEMPLATES],
        "warnings": list(made.warnings),
    }
