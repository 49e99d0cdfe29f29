"""Who can be imagined, and real soccer behind the `Imagination` that fbql_model learns with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fbql.match.in_process import play
from fbql.match.trees import playing_trees
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_fusion.core.learners.dyna.learner import FbqlModel
from fbql_fusion.core.learners.ppo.learner import batch_of, batch_of_imagined
from fbql_fusion.core.learners.trajectories import Trajectory
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession, plays_instead
from fbql_fusion.core.tasks.soccer.world_model.imagination import Rewards
from fbql_fusion.core.tasks.soccer.world_model.soccer_imagination import (
    PlayingTree,
    SoccerImagination,
    why_not_imagined,
)
from fbql_fusion.policy_storage import policy_bytes, policy_from_bytes
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

NAMES = ("ball_seeking", "wall_avoiding", "approaching")
TREES = [load_tree(shipped_trees() / f"{name}.json") for name in NAMES]
PLAYING = playing_trees(TREES)
FEW = FusionParameters(
    controller="fbql_model",
    guided=3,
    seed=4,
    fbql_model_first_episodes=20,
    fbql_model_episodes=10,
    fbql_model_batch_episodes=10,
    fbql_model_refit_episodes=2,
    imagined_max_steps=60,
)


def played(episodes: int, policy: Policy | None = None, skip: int = 0, **changes: Any) -> SoccerSession:
    """A session of short real episodes after the guided ones."""
    session = SoccerSession(replace(FEW, episodes=episodes, **changes), policy, PLAYING)
    if skip:
        session.skip_to_episode(skip)
    behaviors = [Behavior(name, tree) for name, tree in zip(NAMES, TREES, strict=True)]
    play(session, WorldLoop(SimulationParameters(max_steps=200)), behaviors, lambda: True)
    return session


@pytest.mark.parametrize(
    ("trees", "words"),
    [
        (PLAYING, ""),
        ([], "it does not know the trees of the behaviors"),
        (PLAYING[:2], "it does not know the trees of the behaviors"),
        (
            [*PLAYING[:2], PlayingTree("shooting", PLAYING[2].parts)],
            "what behavior 'approaching' senses (shooting) is not one of ball_seeking, wall_avoiding, approaching",
        ),
    ],
)
def test_what_can_not_be_imagined_is_named(trees: list[PlayingTree], words: str) -> None:
    assert why_not_imagined(NAMES, trees) == words
    line = plays_instead(FEW, trees)
    assert line == (f"fbql_model can't imagine episodes, so fbql learns in its place: {words}" if words else "")
    session = SoccerSession(FEW, None, trees)
    assert isinstance(session._controller, FbqlModel) == (not words)
    assert plays_instead(replace(FEW, learn=False), trees) == "", "frozen, it imagines nothing"
    assert plays_instead(replace(FEW, controller="fbql"), trees) == ""


def test_a_policy_plays_frozen_without_the_trees_and_keeps_the_steps() -> None:
    policy = played(1).policy()
    assert policy is not None
    assert len(policy.arrays["real_marks"]) > 300
    frozen = SoccerSession(replace(FEW, learn=False, guided=0), policy).policy()
    assert frozen is not None
    assert policy_bytes(frozen) == policy_bytes(policy)
    with pytest.raises(BadInput, match=r"it does not know the trees of the behaviors; fbql can't continue from"):
        SoccerSession(FEW, policy)


def test_a_run_continued_from_its_policy_file_plays_and_learns_what_one_without_a_break_does() -> None:
    whole = played(5)
    half = played(3).policy()
    assert half is not None
    stored = policy_from_bytes(policy_bytes(half), "half")
    rest = played(2, stored, skip=6, guided=0)
    assert [(each.outcome, each.steps, each.return_) for each in whole.records[6:]] == [
        (each.outcome, each.steps, each.return_) for each in rest.records
    ]
    one, other = whole.policy(), rest.policy()
    assert one is not None
    assert other is not None
    assert policy_bytes(one) == policy_bytes(other)


@pytest.mark.parametrize("trees", [PLAYING, []])
def test_from_no_real_step_and_without_trees_nothing_is_fitted(trees: list[PlayingTree]) -> None:
    imagining = SoccerImagination(FEW, Rewards(10.0, -10.0, -0.3), trees)
    features: Any = None  # it is not looked at
    assert imagining.fit(features, np.random.default_rng(0)) is False


def test_steps_that_can_not_be_are_refused() -> None:
    policy = played(1).policy()
    assert policy is not None
    arrays = {name: array for name, array in policy.arrays.items() if name != "real_marks"}
    with pytest.raises(BadInput, match="real_"):
        SoccerSession(FEW, policy._replace(arrays=arrays), PLAYING)


def test_a_batch_of_imagined_episodes_is_that_of_the_same_real_ones() -> None:
    learner = played(1)._controller
    assert isinstance(learner, FbqlModel)
    assert learner._features is not None
    rng = np.random.default_rng(1)
    assert learner._imagination.fit(learner._features, rng)
    found = learner._imagination.play(learner._theta, 7, 4, 0.998, rng)
    learner._grow_tables()
    active = learner._features.active_features
    trajectories: list[Trajectory] = []
    first = 0
    for episode, length in enumerate(found.lengths.tolist()):
        own = slice(first, first + length)
        rows = found.rows[first + episode : first + episode + length + 1].tolist()
        numbers = (each[own].tolist() for each in (found.drivers, found.old_probs, found.rewards, found.discounts))
        masks = [(True, True, True)] * (length + 1)
        ended = bool(found.terminated[episode])
        trajectories.append(Trajectory(False, [], rows, *numbers, masks=masks, terminated=ended))
        first += length
    assert first == len(found.drivers)
    expected = batch_of(trajectories, learner._value, 0.95, active)
    for one, other in zip(batch_of_imagined(found, learner._value, 0.95, active, 3), expected, strict=True):
        assert one.dtype == other.dtype
        assert np.array_equal(one, other)
