"""The policy that ships: it fits the trees that ship, plays well without learning, and its command makes it again."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace

import pytest
from bringup_run import Run
from fbql.match.in_process import play
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.storage import load_tree
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.policy_storage import load_policy
from fbql_recording.core.metrics import Summary
from fbql_sim.core.world_loop import WorldLoop
from places import ROOT

TREES = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees"
POLICY = ROOT / "ros2_ws/src/fbql_fusion/fbql_fusion/policies/fbql.npz"
TRAINING = ("--policy", "none", "--seed", "1", "--episodes", "6000")
"""As the package's README says it."""
SEED = 2000
"""A run seed that neither training nor tuning used."""


def played(parameters: FusionParameters, policy: bool) -> Summary:
    behaviors = [Behavior(name, load_tree(TREES / f"{name}.json")) for name in parameters.behaviors]
    session = SoccerSession(replace(parameters, seed=SEED, episodes=30), load_policy(POLICY) if policy else None)
    play(session, WorldLoop(), behaviors, lambda: True)
    return session.summary()


def test_the_policy_that_ships_plays_better_than_the_best_thresholds() -> None:
    fused = played(FusionParameters(controller="fbql", learn=False), policy=True)
    priorities = played(FusionParameters(controller="subsumption"), policy=False)
    assert fused.goals >= 29
    assert fused.cost_per_goal is not None and priorities.cost_per_goal is not None
    assert fused.cost_per_goal < 0.85 * priorities.cost_per_goal


def test_the_readme_names_the_policy_and_the_command_that_makes_it() -> None:
    text = (ROOT / "ros2_ws/src/fbql_fusion/README.md").read_text()
    assert hashlib.sha256(POLICY.read_bytes()).hexdigest() in text
    assert f"python3 scripts/train.py {' '.join(TRAINING)}" in text.replace(" \\\n   ", "")


@pytest.mark.long
def test_its_command_makes_the_policy_again(start: Callable[..., Run]) -> None:
    run = start(*TRAINING, script="train.py")
    assert run.exit_code(1800) == 0
    assert (run.out / "policy.npz").read_bytes() == POLICY.read_bytes()
