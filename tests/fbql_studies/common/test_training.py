"""Training, its course, the frozen twins, and frozen play on the same episodes."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from fbql_studies.common.learning_curves import growth, learning
from fbql_studies.common.methods import LEARNERS
from fbql_studies.common.play import LAWS, Score, frozen, laws_played
from fbql_studies.common.training import after_guidance, size_of, train, training_of
from studies import shipped

MAX_STEPS = 120
GUIDED = 8
"""Guided episodes of 1000 steps in which a guide scores: a learner by values learns of nothing else."""


@pytest.fixture(scope="module")
def loop() -> WorldLoop:
    return WorldLoop(SimulationParameters(max_steps=MAX_STEPS))


@pytest.fixture(scope="module")
def long_loop() -> WorldLoop:
    return WorldLoop(SimulationParameters(max_steps=1000))


@pytest.mark.parametrize(("learner", "floats"), [("fbql", 3 + 1), ("fbql_value", 4)])
def test_a_training_is_counted_whole_and_its_course_in_pieces(
    learner: str, floats: int, loop: WorldLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fbql_studies.common.training.CURVE_EPISODES", 4)
    trained = train(training_of(5, 10, learner, guided=4), shipped(), loop)
    assert [part["episodes"] for part in trained.curve] == [4, 4, 2]
    assert all(part["goals"] + part["own_goals"] + part["timeouts"] == part["episodes"] for part in trained.curve)
    met = [part["joint_states"] for part in trained.curve]
    assert met == sorted(met)
    assert 0 < met[0] < met[-1] == trained.size["joint_states"] < trained.size["leaf_product"]
    assert trained.size["features"] == len(trained.policy.arrays["keys"])
    keys = trained.policy.arrays["keys"].nbytes
    assert trained.size["bytes"] == 8 * trained.size["features"] * floats + keys


@pytest.mark.parametrize(("learner", "table", "updates"), [("fbql", "theta", 0), ("fbql_value", "values", 1)])
def test_what_was_only_guided_learned_from_the_guide_and_nothing_more(
    learner: str, table: str, updates: int, long_loop: WorldLoop
) -> None:
    policy = after_guidance(training_of(5, 10, learner, guided=GUIDED), shipped(), long_loop)
    assert np.abs(policy.arrays[table]).max() > 0.0
    assert policy.arrays["counts"].tolist() == [0, updates]
    assert size_of(policy)["features"] > 100


@pytest.mark.parametrize("learner", LEARNERS)
def test_frozen_play_meets_the_same_episodes_whatever_plays_and_repeats(learner: str, loop: WorldLoop) -> None:
    fusion = training_of(5, 10, learner, guided=3)
    trained = train(fusion, shipped(), loop)
    once = frozen(fusion, shipped(), loop, 77, 3, trained.policy)
    assert frozen(fusion, shipped(), loop, 77, 3, trained.policy) == once
    assert frozen(fusion, shipped(), loop, 77, 3) != once, "it is not what was learned that plays"
    assert once["episodes"] == 3


def test_either_law_plays_the_episodes_of_the_run_seed() -> None:
    pytest.importorskip("gymnasium", reason="an optional extra, which is in requirements/test.txt")
    from fbql_studies.peers.play import score_of_law

    for method, found in laws_played(WorldLoop(), 77, 2).items():
        assert score_of_law(77, 2, LAWS[method]) == Score.of(found)
        assert found["goals"] == 2
        assert found["steps"] == found["steps_to_goals"]


def test_learning_curves_are_sums_over_runs_and_leave_out_what_has_no_goal() -> None:
    curve = [
        {"episodes": 100, "goals": 0, "steps": 400, "joint_states": 10},
        {"episodes": 50, "goals": 50, "steps": 100, "joint_states": 30},
    ]
    runs = {(1, seed): {"curve": curve, "size": {"leaf_product": 99}} for seed in range(3)}
    found = learning({"fbql": runs}, {})["trained"]["fbql"]
    assert found["episodes"] == [100, 150]
    assert found["cost"] == [[None, 2.0]] * 3
    assert found["success"] == [[0.0, 1.0]] * 3
    assert growth({"fbql": runs})["fbql"]["joint_states"] == [[10.0, 30.0]] * 3
