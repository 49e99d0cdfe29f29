"""The learners of the study of peers: their updates, their budget, and that they repeat."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="an optional extra, which is in requirements/test.txt")

from fbql_studies.common.methods import FBQL
from fbql_studies.common.play import Score
from fbql_studies.common.tuning import TUNING_SEED, grid
from fbql_studies.peers import learners
from fbql_studies.peers.controls import Controls
from fbql_studies.peers.course import SLICES, Course
from fbql_studies.peers.learners import FBQL_LITERAL, PPO_BLEND, TABULAR, TrainingPlan, learn
from fbql_studies.peers.tabular import TabularParameters, TabularQ, train
from fbql_studies.peers.team_env import SelectionEnv, shipped_behaviors

HERE, THERE = np.array([1, 2, 3]), np.array([1, 2, 4])


def test_q_moves_by_the_learning_rate_towards_its_target_and_no_other_q_moves() -> None:
    q = TabularQ(3, TabularParameters(learning_rate=0.25, initial_q=1.0))
    q.update(HERE, 1, 5.0)
    assert q.row(HERE) == [1.0, 2.0, 1.0]
    q.update(HERE, 1, 5.0)
    assert q.row(HERE) == [1.0, 2.75, 1.0]
    assert q.row(THERE) == [1.0, 1.0, 1.0]
    assert len(q) == 1, "looking made a row"


def test_the_best_behavior_is_selected_ties_are_drawn_and_epsilon_draws_all() -> None:
    q = TabularQ(3, TabularParameters(initial_q=0.0))
    select = partial(q.select, HERE, rng=np.random.default_rng(0))
    assert {select(0.0) for _ in range(50)} == {0, 1, 2}
    q.update(HERE, 0, -1.0)
    assert {select(0.0) for _ in range(50)} == {1, 2}
    q.update(HERE, 2, 1.0)
    assert {select(0.0) for _ in range(50)} == {2}
    assert {select(1.0) for _ in range(50)} == {0, 1, 2}


def test_tabular_training_repeats_bit_for_bit_and_stops_at_its_budget() -> None:
    tables: list[dict[bytes, list[float]]] = []
    for _ in range(2):
        env = SelectionEnv(shipped_behaviors(), hold_steps=10, reward_collision=-0.3)
        q, course = train(env, 6000, 3, TabularParameters())
        tables.append(q._rows)
        assert 6000 <= course.steps < 6010
    assert tables[0] == tables[1]
    assert len(tables[0]) > 50


def test_a_course_counts_steps_of_all_environments_and_episodes_where_they_end() -> None:
    course = Course(budget=100, environments=2)
    step = {"steps": 10, "goal": False, "own_goal": False}
    course.add(step, False, 0)
    course.add(step, True, 1)
    course.add({**step, "goal": True}, True, 0)
    assert [tuple(ended) for ended in course.episodes] == [(20, 10, "timeout"), (30, 20, "goal")]
    assert (course.share, course.is_over) == (0.3, False)
    slices = course.slices()
    assert len(slices) == SLICES
    assert slices[4] == {"episodes": 1, "goals": 0, "own_goals": 0, "timeouts": 1, "steps": 10}
    assert slices[6] == {"episodes": 1, "goals": 1, "own_goals": 0, "timeouts": 0, "steps": 20}
    course.add({**step, "steps": 500, "own_goal": True}, True, 1)
    assert course.is_over
    assert course.slices()[-1]["own_goals"] == 1


def test_constant_weights_are_tried_on_a_whole_grid_of_the_simplex() -> None:
    found = grid(3)
    assert len(found) == len(set(found)) == 21
    assert all(sum(weights) == pytest.approx(1.0) for weights in found)
    assert (0.2, 0.0, 0.8) in found


def test_constant_weights_are_the_best_of_the_training_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fbql_studies.common.tuning.WALL_M", (0.07,))
    monkeypatch.setattr("fbql_studies.common.tuning.APPROACH_RAD", (0.15,))
    monkeypatch.setattr("fbql_studies.common.tuning.GRID", 1)
    controls = Controls(shipped_behaviors(), budget=1)
    assert controls.thresholds == (0.07, 0.15)
    assert controls.weights in grid(3)
    assert len(grid(3)) == 3
    played = controls.play(run_seed=1100, episodes=1)
    names = {(1.0, 0.0, 0.0): "ball_seeking", (0.0, 1.0, 0.0): "wall_avoiding", (0.0, 0.0, 1.0): "approaching"}
    assert played["constant blend"] == played[f"{names[controls.weights]} alone"]


def small(budget: int) -> TrainingPlan:
    return TrainingPlan(shipped_behaviors(), budget, training_seed=50, evaluation_seed=1050, episodes=2)


@pytest.mark.parametrize("method", [TABULAR, FBQL_LITERAL, FBQL])
def test_a_learner_trains_for_its_budget_and_plays_frozen_on_the_evaluation(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fbql_studies.peers.learners.CHOOSING_EPISODES", 1)
    found = [learn(method, small(3000)) for _ in range(2)]
    for learned in found:
        assert 3000 <= learned.course.steps < 3000 + 4000
        assert learned.score.episodes == 2
        assert learned.training_s > 0.0
    assert (found[0].score, found[0].played, found[0].course.slices()) == (
        found[1].score,
        found[1].played,
        found[1].course.slices(),
    )


@pytest.mark.parametrize(("episodes", "choosing"), [(2, 2), (100, 20)])
def test_the_cheapest_way_to_play_is_chosen_on_training_episodes_and_then_judged_on_others(
    episodes: int, choosing: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, int, int]] = []

    def played(_env: object, way: str, seed: int, count: int) -> Score:
        asked.append((way, seed, count))
        return Score(count, count, 0, 0, {"slow": 9, "fast": 5}[way] * count, 0, 0)

    monkeypatch.setattr(learners, "score_in", played)
    acts: dict[str, Any] = {way: (None, lambda _seed, way=way: way) for way in ("slow", "fast")}
    plan = TrainingPlan([], 1, training_seed=50, evaluation_seed=1050, episodes=episodes)
    found = learners._played(acts, Course(1), 0.0, plan)
    assert asked == [("slow", TUNING_SEED, choosing), ("fast", TUNING_SEED, choosing), ("fast", 1050, episodes)]
    assert (found.played, found.score.steps) == ("fast", 5 * episodes)


def test_ppo_trains_for_its_budget_and_repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stable_baselines3", reason="an optional extra: requirements/peers.txt")
    monkeypatch.setattr("fbql_studies.peers.learners.CHOOSING_EPISODES", 1)
    found = [learn(PPO_BLEND, small(25_000)) for _ in range(2)]
    for learned in found:
        assert 25_000 <= learned.course.steps < 25_000 + 8 * 10
    assert (found[0].score, found[0].played) == (found[1].score, found[1].played)
