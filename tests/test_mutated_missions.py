# SPDX-License-Identifier: Apache-2.0
"""A few hundred of the damaged inputs of `benchmarks/mutated_missions.py`: each is accepted, or refused in one line."""

import importlib.util
from pathlib import Path

from presence import present

FILE = Path(__file__).parents[1] / "benchmarks" / "mutated_missions.py"


def test_damaged_missions_parameter_files_and_overrides(tmp_path):
    spec = importlib.util.spec_from_file_location("mutated_missions", FILE)
    mutated_missions = importlib.util.module_from_spec(present(spec))
    present(present(spec).loader).exec_module(mutated_missions)
    trial = mutated_missions.run(200, seed=3, folder=tmp_path, fly_every=1000)
    assert trial.failures == []
    assert trial.counts["accepted"] + trial.counts["refused"] == 200
    assert min(trial.counts["accepted"], trial.counts["refused"]) >= 20
