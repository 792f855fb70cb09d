# SPDX-License-Identifier: Apache-2.0
"""A flight with an exported library in the place of a node's compiled function is the flight without it."""

import hashlib
import json
import os
import shutil
import signal
from functools import partial
from typing import Any

import pytest
from flights import messages_by_topic, short_mission
from rich.console import Console

from css_bringup.commands import fly as fly_command
from css_bringup.composed import ComposedFlight
from css_bringup.flight_director import Wish
from css_bringup.replay_bag import mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_bringup.stand_ins import stand_ins
from css_bringup.staying import Staying, fly_and_stay
from css_common.command import USAGE
from css_common.component_error import ComponentError
from css_common.mission_file import MissionError
from css_common.stepping import Stepper
from css_export import stand_in as stand_in_of_export
from css_export.flown import flying_functions
from css_export.library import made_library, write_library
from css_export.programs import compiled_program, shared_library
from css_export.targets import TARGETS
from css_recording.bag_reader import BagReader
from css_recording.provenance import STAND_INS

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

    def own(name, body, layout="SUNPOINT_EKF_LAYOUT"):
        """A library of somebody's own, its step all but the end of it."""
        source = folder / f"{name}.c"
        source.write_text(
            '#include "sunpoint_ekf.h"\n#include <stdio.h>\n#include <stdlib.h>\n'
            + (f"const uint64_t sunpoint_ekf_layout = {layout};\n" if layout else "")
            + "void sunpoint_ekf_step(const sunpoint_ekf_params *params, sunpoint_ekf_state *state,\n"
            "    const sunpoint_ekf_in *in, sunpoint_ekf_out *out)\n{\n    static int steps;\n    (void)params;\n"
            "    (void)state;\n    (void)in;\n    steps++;\n"
            f"    out->sun_b[2] = 1.0;\n    out->covariance[0] = -1.0;\n    out->validity = 2;\n    {body}\n}}\n"
        )
        return shared_library(HOST, source, folder / f"{name}.so")

    return {
        "library": shared_library(HOST, packed, folder / "libsunpoint_ekf.so"),
        "program": compiled_program(HOST, [folder / "sunpoint_ekf_main.c"], [packed], folder / "sunpoint_ekf_main"),
        "own": own("own", 'printf("step %d\\n", steps);'),
        "unnamed": own("unnamed", "", layout=""),
        "other": own("other", "", layout="1"),
        "crashing": own("crashing", "if (steps == 30) { abort(); }"),
        "hanging": own("hanging", "while (steps == 30) { }"),
    }


def functions_of_ekf(mission):
    """The function of the estimator."""
    (function,) = flying_functions(mission, ["ekf"])
    return function


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


def test_it_flies_in_a_flight_that_stays_too(mission, files, without, tmp_path):
    asked = [f"ekf={files['own']}"]

    def end(flown, result):
        os.kill(os.getpid(), signal.SIGINT)  # noted: it ends the wait for another flight
        return len(result.notes)

    def components(flown):
        return stand_ins(flown, asked)

    staying = Staying(lambda flown: tmp_path / "bag", Console(quiet=True), end, stand_ins_of=components)
    assert fly_and_stay(Wish("okeefe_2013", (), False), mission, staying) == 0
    assert messages_by_topic(tmp_path / "bag")["/ekf/sun_estimate"] != without["/ekf/sun_estimate"]


def test_recording_and_replay_say_that_a_library_flew(mission, files, tmp_path):
    flown(mission, tmp_path / "bag", [f"ekf={files['own']}"])
    with BagReader(tmp_path / "bag") as reader:
        told = json.loads(reader.description[STAND_INS])
    assert told == {"ekf": {"file": "own.so", "sha256": hashlib.sha256(files["own"].read_bytes()).hexdigest()}}
    bag = tmp_path / "bag"
    result = replay(bag, tmp_path / "replay", mission_of_bag(bag, {}, [], None), [parse_request("ekf")], {})
    (line,) = result.shortcomings
    assert line.endswith("ekf of own.so flew, here the function of the node")


def test_a_library_that_does_not_say_its_structs_is_named(mission, files, tmp_path, capfd):
    flown(mission, tmp_path / "bag", [f"ekf={files['unnamed']}"])
    assert "unnamed.so: has no sunpoint_ekf_layout" in capfd.readouterr().err


def test_a_library_of_other_structs_does_not_fly(mission, files):
    with pytest.raises(MissionError, match=r"other\.so: made for other structs"):
        stand_ins(mission, [f"ekf={files['other']}"])


def test_a_library_of_another_processor_does_not_fly(mission, files, tmp_path):
    foreign = tmp_path / "foreign.so"
    data = bytearray(files["library"].read_bytes())
    data[18:20] = (183).to_bytes(2, "little")  # AArch64 (System V ABI)
    foreign.write_bytes(data)
    with pytest.raises(MissionError, match="a shared library of aarch64, this machine is x86_64"):
        stand_ins(mission, [f"ekf={foreign}"])


def test_a_program_with_the_most_significant_byte_first_does_not_fly(mission, files, tmp_path):
    foreign = tmp_path / "sunpoint_ekf_main"
    data = bytearray(files["program"].read_bytes())
    data[5], data[16:20] = 2, b"\x00\x02\x00\x12"  # an executable of SPARC32PLUS, as LEON3's are linked here
    foreign.write_bytes(data)
    with pytest.raises(MissionError, match="the most significant byte first: it cannot fly"):
        stand_ins(mission, [f"ekf={foreign}"])


def stepped_29_times(mission, library):
    """A step of a library in the place of `ekf`, after those that it does."""
    (node,) = (node for node in mission.nodes if node.name == "ekf")
    stand_in = stand_ins(mission, [f"ekf={library}"])["ekf"]
    stepper = Stepper(stand_in, node.name, node.canonical, mission.events, mission.epoch_ns)
    step: Any = partial(vars(stepper.component)["_step"], *functions_of_ekf(mission).sample)
    for _ in range(29):
        step()
    return step


def test_a_library_that_ends_in_a_step_ends_alone(mission, files):
    """Its process ends, not that of the graph, and why is said in a line, again and again."""
    step = stepped_29_times(mission, files["crashing"])
    for _ in range(2):
        with pytest.raises(ComponentError, match=r"crashing\.so: ended by SIGABRT$"):
            step()


def test_a_library_that_does_not_come_back_from_a_step_is_ended(mission, files, monkeypatch):
    """Nothing else would end it: it hears no interrupt, and the flight that waits for it hears none either."""
    monkeypatch.setattr(stand_in_of_export, "_PATIENCE_S", 2.0)
    step = stepped_29_times(mission, files["hanging"])
    for _ in range(2):
        with pytest.raises(ComponentError, match=r"hanging\.so: no answer within 2 s: ended$"):
            step()


def test_a_library_that_ends_in_flight_holds_nobody_up(mission, files):
    """That it has ended is known at once: no time is waited for what cannot come, and the verdict says it."""
    with ComposedFlight(mission, stand_ins=stand_ins(mission, [f"ekf={files['crashing']}"])) as flight:
        result = flight.fly()
    assert not result.failure
    assert "ekf: 171 cycles failed and gave no output" in result.notes
    assert not [note for note in result.notes if "time held" in note or "silent beyond" in note]


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
