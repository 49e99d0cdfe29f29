"""Fusion of one, two, four and eight behaviors: the number three stands nowhere in it."""

from __future__ import annotations

import numpy as np
import pytest
from fbql.match.in_process import play
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.storage import load_tree
from fbql_common.core.types import DRIVER_BLEND, NO_LEAF, Decision
from fbql_fusion.core.controllers.parameters import CONTROLLERS
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from places import ROOT

TREES = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees"
SHIPPED = ("ball_seeking", "wall_avoiding", "approaching")
NAMES = (*SHIPPED, *(f"another_{k}" for k in range(5)))
"""Eight names; the further behaviors are shipped trees once more."""
LEARNERS = [name for name in CONTROLLERS if name.startswith("fbql")]
COUNTS = pytest.mark.parametrize("n", [1, 2, 4, 8])


def behaviors_of(n: int) -> list[Behavior]:
    trees = [load_tree(TREES / f"{name}.json") for name in SHIPPED]
    return [Behavior(name, trees[k % 3]) for k, name in enumerate(NAMES[:n])]


def played(n: int, controller: str, **changes: object) -> tuple[SoccerSession, list[Decision]]:
    """A short match of n behaviors, and its decisions."""
    layers = [*NAMES[1:n], NAMES[0]]
    parameters = FusionParameters(
        controller=controller, behaviors=list(NAMES[:n]), layers=layers, episodes=2, seed=5, **changes
    )
    session = SoccerSession(parameters)
    loop = WorldLoop(SimulationParameters(max_steps=150))
    decisions: list[Decision] = []
    play(session, loop, behaviors_of(n), lambda: True, lambda *step: decisions.append(step[3]))
    return session, decisions


@COUNTS
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_every_controller_weighs_n_behaviors(controller: str, n: int) -> None:
    session, decisions = played(n, controller, guided=0)
    assert len(session.records) == 2
    assert len(decisions) > 100
    for decision in decisions:
        assert decision.behaviors == NAMES[:n]
        assert len(decision.joint_state) == len(decision.weights) == n
        assert len(decision.q) in (0, n)
        assert NO_LEAF not in decision.joint_state
        assert sum(decision.weights) == pytest.approx(1.0)
        assert all(weight >= 0.0 for weight in decision.weights)
        assert decision.driver == DRIVER_BLEND or decision.weights[decision.driver] == 1.0
    assert played(n, controller, guided=0)[0].digest == session.digest


@COUNTS
@pytest.mark.parametrize("controller", LEARNERS)
def test_what_is_learned_about_n_behaviors_is_kept_and_played_on(controller: str, n: int) -> None:
    session, _ = played(n, controller, guided=1)
    policy = session.policy()
    assert policy is not None
    assert policy.behaviors == NAMES[:n]
    assert len(policy.leaf_counts) == len(policy.tree_hashes) == n
    again = SoccerSession(session.parameters, policy).policy()
    assert again is not None
    assert all(np.array_equal(again.arrays[name], array) for name, array in policy.arrays.items())


@COUNTS
def test_fbql_remembers_what_was_visited_and_not_the_product_of_n_trees(n: int) -> None:
    session, decisions = played(n, "fbql", guided=1)
    policy = session.policy()
    assert policy is not None
    active = policy.arrays["waiting_active"].shape[1]
    held = round(session.parameters.fbql_hold_s * 60)
    visited = len(decisions) // held + 2 * len(session.records)
    assert active <= len(policy.arrays["keys"]) <= visited * active
    assert np.abs(policy.arrays["theta"]).max() > 0.0 or n == 1


@COUNTS
def test_equal_weights_are_the_mean_of_n_references(n: int) -> None:
    behaviors = behaviors_of(n)
    session = SoccerSession(FusionParameters(controller="uniform", behaviors=list(NAMES[:n]), episodes=1))
    begun = session.next_episode()
    assert begun is not None
    world = WorldLoop().reset(*begun)
    outputs = [behavior.answer(world) for behavior in behaviors]
    command, decision = session.decide(world, outputs)
    assert decision.weights == pytest.approx([1 / n] * n)
    assert command.left_rad_s == pytest.approx(sum(output.left_rad_s for output in outputs) / n)
    assert command.right_rad_s == pytest.approx(sum(output.right_rad_s for output in outputs) / n)


@COUNTS
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_other_behaviors_play_on_when_one_of_n_is_gone(controller: str, n: int) -> None:
    session = SoccerSession(
        FusionParameters(controller=controller, behaviors=list(NAMES[:n]), layers=list(NAMES[:n]), guided=0, episodes=1)
    )
    begun = session.next_episode()
    assert begun is not None
    loop, behaviors = WorldLoop(), behaviors_of(n)
    world = loop.reset(*begun)
    for step in range(20):
        outputs = [behavior.answer(world) for behavior in behaviors]
        gone = step % n
        command, decision = session.decide(world, [None if k == gone else each for k, each in enumerate(outputs)])
        assert decision.joint_state[gone] == NO_LEAF
        assert sum(decision.weights) == pytest.approx(0.0 if n == 1 else 1.0)
        if n == 1:
            assert (command.left_rad_s, command.right_rad_s) == (0.0, 0.0)
        world = loop.step(command.left_rad_s, command.right_rad_s)
