# SPDX-License-Identifier: Apache-2.0
"""Keeps every pytest process, and the processes it starts, in a ROS domain of its own; settles hypothesis.

Two graphs in one domain answer each other's stamps. A run of pytest, each of its xdist workers, and flights of any
user on the same machine therefore hold a domain each, until they end. Loaded for all tests of the project, with or
without ROS, and before any of them imports rclpy.
"""

import atexit
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

sys.path.append(str(Path(__file__).parent / "src" / "css_common"))  # also where nothing is built

from css_common import domains, network

os.environ.pop(network.NETWORK, None)
network.stay_on_this_machine(os.environ)
_held = domains.hold_for_tests(os.environ)
DOMAIN = _held.domain
_logs = tempfile.mkdtemp(prefix="sunpoint-test-logs-")
atexit.register(shutil.rmtree, _logs, ignore_errors=True)

os.environ["ROS_LOG_DIR"] = _logs
# Without it rclpy stores a value of the wrong type as garbage, without a word.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"

# Workers share the processors already; a decomposition of a small matrix by threads that wait for each other takes
# twenty times as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Two runs of the same sources try the same examples. `--hypothesis-profile=explore` looks for new ones.
# No deadlines: the first call of a kernel compiles it, and wall time is no property of the code under test.
settings.register_profile("sunpoint", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=2000)
settings.load_profile("sunpoint")


if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A runner in the background ignores the interrupt, and so would every process that a test starts and interrupts.
    signal.signal(signal.SIGINT, signal.default_int_handler)


# What takes longest, mostly to compile, and is shown by others of its kind too. `./sunpoint test` leaves it out;
# `./sunpoint test -m long` runs it, and so does naming its file.
_LONG = (
    "src/css_analysis/test/test_flight_figures.py::test_several_flights_are_compared",
    "src/css_design/test/test_budget.py::test_noise_of_a_new_cubesat_does_not_add_up_in_the_loop",
    "src/css_design/test/test_budget.py::test_scale_and_tilt_of_cells_against_the_geometry",
    "src/css_design/test/test_budget.py::test_the_open_loop_is_the_loop_to_the_last_bit",
    "src/css_design/test/test_new_mission.py::test_six_faces_acquire_the_sun",
    "src/css_docs/test/test_figures.py::test_what_a_figure_says",
    "src/css_estimation/test/test_mode_log.py",
    "src/css_estimation/test/test_sun_estimator_components.py::test_a_magnetometer_that_says_off_and_a_silent_one_are_the_same[sunline_",
    "src/css_estimation/test/test_sun_estimator_components.py::test_message_fits_its_type[sunline_",
    "src/css_estimation/test/test_sun_estimators_on_any_input.py::test_any_sequence[sunline_suekf",
    "src/css_export/test/test_every_mission_can_be_exported.py",
    "src/css_export/test/test_exported_kernels.py::test_an_unscented_filter_has_no_way_to_an_exception[sunline_s",
    "src/css_export/test/test_shipped_mathematics.py::test_every_function_gives_the_same_bits_on_all_processors",
    "src/css_monte_carlo/test/test_attitude_monte_carlo.py::test_a_case_is_the_flight_of_the_nodes_bit_for_bit[bes",
    "src/css_monte_carlo/test/test_attitude_monte_carlo.py::test_a_case_is_the_flight_of_the_nodes_bit_for_bit[by the",
    "src/css_monte_carlo/test/test_attitude_monte_carlo.py::test_a_case_is_the_flight_of_the_nodes_bit_for_bit[no gy",
    "src/css_monte_carlo/test/test_attitude_monte_carlo.py::test_the_nodes_estimate_something[no gyro",
    "src/css_monte_carlo/test/test_attitude_studies.py",
    "src/css_monte_carlo/test/test_cubesat_safe_mode.py",
    "src/css_monte_carlo/test/test_drawn_faults.py::test_a_study_keeps_them_whichever_way_it_flies",
    "src/css_monte_carlo/test/test_healthy_flights.py",
    "src/css_monte_carlo/test/test_instruction_sets.py",
    "src/css_monte_carlo/test/test_monte_carlo_flies_as_the_components.py::test_every_estimator_is_the_same[gyro-sunline_suekf",
    "src/css_monte_carlo/test/test_monte_carlo_flies_as_the_components.py::test_every_estimator_is_the_same[gyro-sunline_ukf",
    "src/css_monte_carlo/test/test_monte_carlo_flies_as_the_components.py::test_every_estimator_is_the_same[gyro-wls",
    "src/css_monte_carlo/test/test_monte_carlo_flies_as_the_components.py::test_every_estimator_is_the_same[no gyro-s",
    "src/css_monte_carlo/test/test_monte_carlo_flies_as_the_components.py::test_every_estimator_is_the_same[no gyro-wl",
    "src/css_monte_carlo/test/test_monte_carlo_flies_as_the_components.py::test_every_step_is_the_same[nobody controls",
    "src/css_monte_carlo/test/test_monte_carlo_flies_as_the_components.py::test_safe_hold_is_the_same_from_the_shadow_into_the_sun[py",
    "src/css_monte_carlo/test/test_monte_carlo_flies_as_the_components.py::test_torque_rods_alone_are_the_same[cubesat_3u_sun_filter",
    "src/css_papers/test/test_best_page.py::test_a_short_flight_gives_a_page",
    "src/css_papers/test/test_okeefe_page.py::test_a_few_real_flights",
    "src/css_papers/test/test_wrong_in_silence.py",
    "tests/bootstrap/test_preparation.py::test_interruption_stops_everything_that_was_started[15",
    "tests/test_attached_console.py",
    "tests/test_calibration_of_flights.py",
    "tests/test_check_of_flights.py",
    "tests/test_clark_safe_hold.py",
    "tests/test_components.py::test_messages_fit_their_types_and_come_again_the_same[clark_",
    "tests/test_components.py::test_messages_fit_their_types_and_come_again_the_same[cubesat_",
    "tests/test_components.py::test_messages_fit_their_types_and_come_again_the_same[okeefe_calibration",
    "tests/test_components.py::test_messages_fit_their_types_and_come_again_the_same[okeefe_earthlight",
    "tests/test_components.py::test_messages_fit_their_types_and_come_again_the_same[sunline_",
    "tests/test_components.py::test_messages_fit_their_types_and_come_again_the_same[wavg",
    "tests/test_console_in_a_browser.py::test_a_flight_driven",
    "tests/test_console_in_a_browser.py::test_a_recording",
    "tests/test_console_in_a_browser.py::test_several",
    "tests/test_console_in_a_browser.py::test_the_keyboard",
    "tests/test_damaged_bags.py::test_forty_damaged_recordings_give_nothing_wrong",
    "tests/test_documents.py::test_long_blocks_run",
    "tests/test_faults_in_flight.py::test_a_switched_sensor_forgets_where_it_froze_and_other_changes_do_not",
    "tests/test_faults_in_flight.py::test_the_compiled_loop_flies_the_same",
    "tests/test_flights_one_after_another.py",
    "tests/test_freezes.py::test_what_cannot_be_replaced_ends_the_flight_with_its_log_and_a_whole_recording",
    "tests/test_fresh_setup_without_ros.py",
    "tests/test_harm_in_faulted_flights.py",
    "tests/test_hil_flight.py::test_lost_late_and_damaged_frames_are_safe_counted_and_said",
    "tests/test_killed_supervisor.py::test_nothing_is_left_of_a_flight_whose_supervisor_is_killed[some",
    "tests/test_link_faults.py::test_a_flight_is_the_same_in_processes",
    "tests/test_link_faults.py::test_processes_die_hang_and_are_slow_at_their_time",
    "tests/test_masks_of_attitude_filters.py",
    "tests/test_monte_carlo_flies_as_the_graph.py::test_a_dispersed_case_equals_that_of_the_composed_graph[so",
    "tests/test_monte_carlo_flies_as_the_graph.py::test_a_harder_truth_equals_the_composed_graph",
    "tests/test_monte_carlo_flies_as_the_graph.py::test_every_step_of_a_case_equals_that_of_the_composed_graph[s",
    "tests/test_monte_carlo_flies_as_the_graph.py::test_every_step_of_a_case_equals_that_of_the_composed_graph[w",
    "tests/test_monte_carlo_flies_as_the_graph.py::test_readings_that_a_calibration_corrects_equal",
    "tests/test_monte_carlo_flies_as_the_graph.py::test_safe_hold_with_magnetometer_and_rods_equals_the_composed_graph",
    "tests/test_monte_carlo_flies_as_the_graph.py::test_torque_rods_without_wheels_and_gyro_equal_the_composed_graph",
    "tests/test_mutations.py",
    "tests/test_own_estimator.py::test_its_rate_is_the_one_at_which_the_sun_turns",
    "tests/test_own_estimator.py::test_the_compiled_loop_flies_the_same",
    "tests/test_preflight.py::test_a_rate_that_builds_up_ends_the_flight_by_name",
    "tests/test_processes.py::test_a_killed_recorder_ends_the_run_and_its_recording_is_recovered",
    "tests/test_processes.py::test_flight_waits_for_a_recorder_that_is_stopped",
    "tests/test_processes.py::test_the_second_death_ends_the_run_with_the_log",
    "tests/test_processes.py::test_without_the_plant_the_run_ends",
    "tests/test_replay_stretches.py",
    "tests/test_site.py::TestWhole",
    "tests/test_site.py::test_what_is_wrong_with_a_page_is_found_and_named",
    "tests/test_three_hosts.py",
    "tests/test_without_ros.py::test_budgets",
    "tests/test_without_ros.py::test_layouts",
    "tests/test_without_ros.py::test_pages_of_papers",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks the tests that take longest."""
    for item in items:
        if item.nodeid.startswith(_LONG):
            item.add_marker(pytest.mark.long)


@pytest.fixture(autouse=True)
def _signals_as_they_were() -> Iterator[None]:
    """A node that ends in this process leaves signals ignored, and processes of later tests would inherit that."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def pytest_report_header() -> str:
    """Names the domain, for a look at a test that hangs: `ROS_DOMAIN_ID=N ros2 node list`."""
    return f"ROS_DOMAIN_ID: {DOMAIN}"
