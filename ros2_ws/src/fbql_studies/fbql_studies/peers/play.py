"""Frozen play in the Gymnasium environments, on the episodes of a run seed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_fusion.core.session import episode_seed
from fbql_sim.core.scripted_law import UNTUNED, LawConstants, law
from fbql_sim.gymnasium_env import WheelsEnv

from fbql_studies.common.play import Score

Act = Callable[[Any], Any]
"""From an observation to an action."""


def score_in(env: WheelsEnv, act: Act, run_seed: int, episodes: int) -> Score:
    """The score on the first episodes of a run seed: those of a session with this seed and no guided episodes."""
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


def score_of_law(run_seed: int, episodes: int, constants: LawConstants = UNTUNED) -> Score:
    """The score of the scripted law, which sees everything and has no trees."""
    env = WheelsEnv()

    def act(_observation: Any) -> tuple[float, float]:
        left, right = law(env.world, constants)
        return left / MAX_WHEEL_RAD_S, right / MAX_WHEEL_RAD_S

    return score_in(env, act, run_seed, episodes)
