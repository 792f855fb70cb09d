# SPDX-License-Identifier: Apache-2.0
"""A flight with an exported library in the place of a node's compiled function is the flight without it."""

import shutil

import pytest
from flights import messages_by_topic, short_mission

from css_bringup.commands import fly as fly_command
from css_bringup.composed import ComposedFlight
from css_bringup.stand_ins import stand_ins
from css_common.command import USAGE
from css_common.mission_file import MissionError
from css_export.flown import flying_functions
from css_export.library import made_library, write_library
from css_export.programs import compiled_program, shared_library
from css_export.targets import TARGETS

HOST = TARGETS["x86_64"]
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")


@pytest.fixture(scope="module")
def mission():
    """A short flight whose estimator has no health of its sensors, which takes long to compile."""
    return short_mission(20.0, "ekf.health.enabled=false")


@pytest.fixture(scope="module")
def files(mission, tmp_path_factory):
    """The estimator as a shared library, as a program, and as a library that somebody else has written."""
    folder = tmp_path_factory.mktemp("libraries")
    (function,) = flying_functions(mission, ["ekf"])
    library = made_library(mission, function)
    write_library(library, [library.for_target(HOST)], folder)
    packed = folder / HOST.name / "libsunpoint_ekf.a"
    own = folder / "own.c"
    own.write_text(
        '#include "sunpoint_ekf.h"\n'
        "void sunpoint_ekf_step(const sunpoint_ekf_params *params, sunpoint_ekf_state *state,\n"
        "    const sunpoint_ekf_in *in, sunpoint_ekf_out *out)\n{\n    (void)params;\n    (void)state;\n    (void)in;\n"
        "    out->sun_b[2] = 1.0;\n    out->covariance[0] = -1.0;\n    out->validity = 2;\n}\n"
    )
    return {
        "library": shared_library(HOST, packed, folder / "libsunpoint_ekf.so"),
        "program": compiled_program(HOST, [folder / "sunpoint_ekf_main.c"], [packed], folder / "sunpoint_ekf_main"),
        "own": shared_library(HOST, own, folder / "own.so"),
    }


def flown(mission, bag, asked=()):
    """Messages of a flight by topic."""
    with ComposedFlight(mission, bag, stand_ins=stand_ins(mission, asked)) as flight:
        result = flight.fly()
    assert not result.failure
    assert result.notes == []
    return messages_by_topic(bag)


@pytest.fixture(scope="module")
def without(mission, tmp_path_factory):
    """Messages of the flight without a library."""
    return flown(mission, tmp_path_factory.mktemp("without") / "bag")


@pytest.mark.parametrize("kind", ["library", "program"])
def test_the_same_flight(mission, files, without, kind, tmp_path):
    assert flown(mission, tmp_path / "bag", [f"ekf={files[kind]}"]) == without
    assert len(without["/ekf/sun_estimate"]) == 200


def test_it_is_the_library_that_flies(mission, files, without, tmp_path):
    own = flown(mission, tmp_path / "bag", [f"ekf={files['own']}"])
    assert own["/ekf/sun_estimate"] != without["/ekf/sun_estimate"]
    assert own["/wheels/torque_command"] != without["/wheels/torque_command"]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("ekf", "expected NODE=FILE"),
        ("efk=somewhere.so", "did you mean ekf"),
        ("ekf=/nowhere/at_all.so", "no such file"),
        ("gyro={library}", "no compiled function"),
        ("mrp_control={library}", "sunpoint_mrp_control_step"),
        ("ekf={text}", "expected a shared library or a program"),
    ],
)
def test_what_cannot_fly_is_refused(mission, files, tmp_path, asked, said):
    text = tmp_path / "text.so"
    text.write_text("no library")
    with pytest.raises(MissionError, match=said):
        stand_ins(mission, [asked.format(library=files["library"], text=text)])


def test_libraries_fly_in_one_process(capsys):
    with pytest.raises(SystemExit) as ended:
        fly_command.main(["okeefe_2013", "--processes", "--component", "ekf=somewhere.so"])
    assert ended.value.code == USAGE
    assert "one process" in capsys.readouterr().err
