"""Lesson 1: the last hit before a goal, found again by arrays over the same recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fbql.course.goal import RUN, check, first_goal, last_hit
from fbql_common.core.errors import BadInput
from fbql_common.core.types import DRIVER_BLEND
from fbql_recording.run import open_run
from recorded_match import record_match


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two goals. Not to be changed."""
    place = tmp_path_factory.mktemp("work")
    record_match(place / RUN, controller="subsumption", preset="tuned", seed=1, episodes=2, max_steps=600)
    return place


def answer_of(work: Path) -> tuple[str, int, int]:
    """Behavior, leaf and step of the last hit, by arrays."""
    run = open_run(work / RUN)
    columns = run.arrays()
    episode = columns["episode"][columns["goal"]][0]
    here = columns["episode"] == episode
    speed = np.hypot(columns["ball_vx_m_s"], columns["ball_vy_m_s"])[here]
    hit = np.flatnonzero(np.diff(speed) > 0.001)[-1]
    driver = columns["driver"][here][hit]
    return run.behaviors[driver], int(columns["leaf_id"][here][hit, driver]), int(columns["step"][here][hit])


def test_the_behavior_and_the_leaf_of_the_last_hit_are_right(work: Path) -> None:
    behavior, leaf, step = answer_of(work)
    verdict = check([behavior, str(leaf)], work)
    assert verdict.right
    assert f"at step {step} of episode 0 {behavior} drove by its rule" in verdict.line
    assert "steps later it was in the goal" in verdict.line


def test_another_behavior_and_another_leaf_are_wrong_and_the_hint_leads_to_the_step(work: Path) -> None:
    behavior, leaf, step = answer_of(work)
    for other in {"ball_seeking", "wall_avoiding", "approaching"} - {behavior}:
        verdict = check([other, str(leaf)], work)
        assert not verdict.right
        assert verdict.line.startswith(f"{other} did not drive at the last hit")
    verdict = check([behavior, str(leaf + 1000)], work)
    assert not verdict.right
    assert f"it was {behavior}, but not with leaf {leaf + 1000}" in verdict.line
    assert f"steps {step - 12} to {step + 12}" in verdict.line


def test_a_behavior_that_did_not_play_is_refused(work: Path) -> None:
    with pytest.raises(BadInput, match="no behavior 'goalkeeping' played; choose one of: ball_seeking, "):
        check(["goalkeeping", "1"], work)


def test_a_match_without_a_goal_is_refused(tmp_path: Path) -> None:
    record_match(tmp_path / RUN, controller="subsumption", max_steps=20)
    with pytest.raises(BadInput, match="no episode in it ended in a goal"):
        check(["ball_seeking", "1"], tmp_path)


def test_an_episode_that_ended_otherwise_before_the_goal_is_left_out(tmp_path: Path) -> None:
    record_match(tmp_path / RUN, controller="subsumption", seed=4, episodes=2, max_steps=400)
    run = open_run(tmp_path / RUN)
    assert [episode.outcome for episode in run.episodes()] == ["timeout", "goal"]
    steps = first_goal(run.steps(), "")
    assert [step.step for step in steps] == list(range(len(steps)))
    assert {step.episode for step in steps} == {1}


def test_a_blend_is_refused_because_nobody_drove_alone(work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = first_goal(open_run(work / RUN).steps(), "")
    blended = [
        step._replace(decision=step.decision._replace(driver=DRIVER_BLEND))
        for step in steps
        if step.decision is not None
    ]
    monkeypatch.setattr("fbql.course.goal.first_goal", lambda *_: blended)
    with pytest.raises(BadInput, match="no behavior drives alone; play with --controller subsumption"):
        check(["ball_seeking", "1"], work)


def test_a_goal_without_a_hit_is_refused(work: Path) -> None:
    steps = first_goal(open_run(work / RUN).steps(), "")
    with pytest.raises(BadInput, match="never hit the ball"):
        last_hit(steps[-5:])
