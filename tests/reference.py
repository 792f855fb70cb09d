# SPDX-License-Identifier: Apache-2.0
"""Makes the reference recording anew: `./sunpoint shell -c "python tests/reference.py"`.

To be done when an algorithm changes on purpose; `test_replay.py` compares every later replay with its numbers.
"""

import json
import shutil
import tempfile
from pathlib import Path

from flights import fly_composed, short_mission

from css_bringup.replay_bag import mission_of_bag, replay
from css_bringup.replay_pass import parse_request

REFERENCE = Path(__file__).parents[1] / "bags" / "reference"
NUMBERS = REFERENCE / "expected.json"
ESTIMATORS = ["ekf", "ekf:gyro=off", "wavg", "wavg:gyro=off"]
KEPT = ("estimator", "gyro", "flown", "power_positive_s", "heading_error_mean_deg", "heading_error_p95_deg")


def main() -> None:
    """Flies, replays and stores the numbers."""
    shutil.rmtree(REFERENCE, ignore_errors=True)
    result = fly_composed(short_mission(150.0, "mission.case=7"), REFERENCE)
    assert not result.failure and result.messages_lost == 0
    with tempfile.TemporaryDirectory() as folder:
        mission = mission_of_bag(REFERENCE, {}, [], None)
        replayed = replay(REFERENCE, Path(folder) / "replay", mission, map(parse_request, ESTIMATORS), {})
    runs = [{key: run[key] for key in KEPT} for run in replayed.runs]
    NUMBERS.write_text(json.dumps({"estimators": ESTIMATORS, "runs": runs}, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
