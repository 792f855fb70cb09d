# SPDX-License-Identifier: Apache-2.0
"""What a mission disperses is drawn by seed, case and name alone, is physical, and refused where it means nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from css_common.drawn_mission import drawn
from css_common.mission import MissionError, load_mission, mission_from_text

INERTIA = "dispersions.spacecraft.inertia.each=normal:0.05"
NOISE = "dispersions.css_array.noise=uniform:0.0:0.02"


def of_case(case, *overrides, mission="okeefe_2013"):
    return drawn(load_mission(mission, [*overrides, f"mission.case={case}"]))


def test_a_mission_without_dispersions_stays_the_same():
    mission = load_mission("okeefe_2013")
    assert drawn(mission).mission is mission


def test_draws_stand_in_the_place_of_the_missions_values():
    mission = of_case(3, INERTIA, NOISE).mission
    assert not mission.dispersions and "dispersions" not in mission.text()
    assert 0.0 < mission.node("css_array").values.noise < 0.02
    inertia = mission.values.spacecraft.inertia
    assert np.all(inertia == inertia.T) and not np.allclose(
        inertia, load_mission("okeefe_2013").values.spacecraft.inertia
    )
    # what was drawn is what a recording of the flight reads back
    again = mission_from_text(mission.text(), "text")
    np.testing.assert_array_equal(again.values.spacecraft.inertia, inertia)


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_a_draw_depends_on_its_own_name_alone(case):
    alone, together = of_case(case, NOISE), of_case(case, INERTIA, NOISE)
    assert alone.values["css_array.noise"] == together.values["css_array.noise"]
    dipole = "dispersions.dynamics.disturbances.dipole"
    second, each = of_case(case, f"{dipole}.1=normal:0:0.1"), of_case(case, f"{dipole}.each=normal:0:0.1", NOISE)
    key = dipole.removeprefix("dispersions.")
    assert second.values[key] == [0.0, each.values[key][1], 0.0] and len(set(each.values[key])) == 3
    assert of_case(case, NOISE, "mission.seed=2").values != alone.values


def test_the_truth_alone_can_differ():
    mission = of_case(1, "dispersions.dynamics.spacecraft.inertia=normal:0.1").mission
    known, true = (mission.node(name).values.spacecraft.inertia for name in ("mrp_control", "dynamics"))
    nominal = load_mission("okeefe_2013").values.spacecraft.inertia
    np.testing.assert_array_equal(known, nominal)
    # one factor for the whole list
    np.testing.assert_allclose(true, nominal * (true[0, 0] / nominal[0, 0]), rtol=1e-14)
    assert true[0, 0] != nominal[0, 0]


@pytest.mark.parametrize("method", ["lhs", "sobol"])
def test_even_designs_fill_every_slice(method):
    cases = 16
    design = (NOISE, INERTIA, f"sampling.method={method}", f"sampling.cases={cases}")
    noise = [of_case(case, *design).values["css_array.noise"] / 0.02 for case in range(cases)]
    assert sorted(int(cases * share) for share in noise) == list(range(cases))


def test_a_case_beyond_the_design_is_refused():
    with pytest.raises(MissionError, match=r"mission.case: 8 given, expected a case of the lhs design, 0 to 7"):
        of_case(8, NOISE, "sampling.method=lhs", "sampling.cases=8")


def test_a_saltelli_design_exchanges_one_group_at_a_time():
    design = (NOISE, INERTIA, "sampling.method=saltelli", "sampling.cases=4")
    rows = [of_case(row, *design) for row in range(4 * 5)]
    values = [(*row.values.values(), row.mission.values.mission.case) for row in rows[:5]]
    first, last = values[0], values[-1]
    for group in range(3):
        row = values[1 + group]
        assert [k for k in range(3) if row[k] != first[k]] == [group]
        assert row[group] == last[group]
    with pytest.raises(MissionError, match="expected a case of the saltelli design, 0 to 19"):
        of_case(20, *design)


@pytest.mark.parametrize(
    ("override", "error"),
    [
        ("dispersions.css_array.noize=normal:0.1", "unknown; did you mean css_array.noise"),
        ("dispersions.css_array.noise=normal:0.1", r"relative to the mission's value, which is 0\.0"),
        ("dispersions.css_array.noise=uniform:2:3", "2.5 given, expected at least 0 and at most 1"),
        ("dispersions.mission.case=uniform:0:9", "the same in all cases"),
        ("dispersions.graph.estimator=choice:ekf:wavg", "the same in all cases"),
        ("dispersions.spacecraft.inertia.9=normal:0.1", r"9 numbers, expected \.0 to \.8"),
        ("dispersions.css_array.noise.0=uniform:0:1", r"one value, expected no \.0"),
        ("dispersions.css_array.degradation_mode=uniform:0:1", "holds no numbers, expected choice"),
        ("dispersions.css_array.degradation_mode=choice:common:none", "one of common, per_cell"),
        ("dispersions.css_array.noise=often", "expected normal:S"),
    ],
)
def test_what_means_nothing_is_refused(override, error):
    with pytest.raises(MissionError, match=error):
        load_mission("okeefe_2013", [override])


def test_one_number_is_drawn_once():
    with pytest.raises(MissionError, match="draws the same number"):
        load_mission("okeefe_2013", [INERTIA, "dispersions.spacecraft.inertia=normal:0.1"])


def test_a_draw_that_cannot_fly_names_its_case():
    with pytest.raises(MissionError, match=r"case 1 draws what cannot fly.*triangle inequality"):
        of_case(1, "dispersions.spacecraft.inertia.8=uniform:30.0:31.0")


def test_choices_are_words_of_the_parameter():
    seen = {
        of_case(case, "dispersions.css_array.degradation_mode=choice:common:per_cell").lines()[0] for case in range(20)
    }
    assert seen == {"css_array.degradation_mode = common", "css_array.degradation_mode = per_cell"}
