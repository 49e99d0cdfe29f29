"""Frozen play: what a policy is worth on the episodes of a run seed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from fbql.match.in_process import play
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.session import Session, episode_seed
from fbql_sim.core.scripted_law import law
from fbql_sim.core.world_loop import WorldLoop
from fbql_sim.gymnasium_env import WheelsEnv

from fbql_studies.tree_play import Score

Act = Callable[[Any], Any]
"""From an observation to an action."""


def score_in(env: WheelsEnv, act: Act, run_seed: int, episodes: int) -> Score:
    """Plays so many episodes of a run seed: the same ones that a session with this seed and no guided episodes plays."""
    goals = own_goals = steps = begun = contact = 0
    for index in range(episodes):
        observation, _ = env.reset(options={"episode_seed": episode_seed(run_seed, index)})
        ended = False
        info: dict[str, Any] = {}
        while not ended:
            observation, _, terminated, truncated, info = env.step(act(observation))
            ended = terminated or truncated
            steps += info["steps"]
            begun += info["collisions_begun"]
            contact += info["collision_steps"]
        goals += info["goal"]
        own_goals += info["own_goal"]
    return Score(episodes, goals, own_goals, episodes - goals - own_goals, steps, begun, contact)


def score_of_session(
    fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop, policy: Policy | None = None
) -> Score:
    """Plays a session to its end; guided episodes don't count."""
    session = Session(fusion, policy)
    play(session, loop, behaviors, lambda: True)
    summary = session.summary()
    return Score(*(getattr(summary, name) for name in Score._fields))


def score_of_law(run_seed: int, episodes: int) -> Score:
    """What the scripted law is worth, which sees everything and has no trees."""
    env = WheelsEnv()

    def act(_observation: Any) -> tuple[float, float]:
        left, right = law(env.world)
        return left / MAX_WHEEL_RAD_S, right / MAX_WHEEL_RAD_S

    return score_in(env, act, run_seed, episodes)


def cost(score: Score) -> float:
    """Steps of all episodes for each goal; infinite without one."""
    return score.steps / score.goals if score.goals else float("inf")
