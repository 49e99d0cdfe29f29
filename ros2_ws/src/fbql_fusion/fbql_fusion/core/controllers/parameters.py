"""The parameters that every controller has: what is fused, for how long, and what is rewarded."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import parameter

CONTROLLERS = ["fbql", "fbql_literal", "fbql_value", "subsumption", "uniform"]
"""The names of the controllers: those of this package, then those that were registered (`core.registry`)."""
UP_TO_THE_CONTROLLER = -1
"""The value of `guided` that leaves the number of guided episodes to the controller."""
GUIDED_EPISODES = 20
"""Default number of guided episodes of a learning controller (the paper's III.B)."""


@dataclass(frozen=True)
class SessionParameters:
    """A controller's own parameters are a dataclass that inherits from this one."""

    controller: str = parameter(
        "subsumption", "controller that fuses the behaviors; fbql_literal: as printed in the paper", choices=CONTROLLERS
    )
    behaviors: list[str] = parameter(
        ["ball_seeking", "wall_avoiding", "approaching"], "names of the behaviors that are fused, in order"
    )
    seed: int = parameter(0, "seed of the run: every episode's seed is derived from it", low=0, high=2**63 - 1)
    episodes: int = parameter(0, "episodes after the guided ones; 0: no limit", low=0)
    goals: int = parameter(0, "goals after the guided episodes; 0: no limit", low=0)
    guided: int = parameter(
        UP_TO_THE_CONTROLLER,
        "episodes in which Subsumption drives and the controller learns; -1: 20 for a controller that learns "
        "and starts without a policy, else 0",
        low=UP_TO_THE_CONTROLLER,
    )
    learn: bool = parameter(True, "whether a controller that can learn continues to learn")

    reward_goal: float = parameter(10.0, "reward of a goal", low=-1e9, high=1e9)
    reward_own_goal: float = parameter(-10.0, "reward of an own goal", low=-1e9, high=1e9)
    reward_collision: float = parameter(
        -5.0, "reward of a collision, once when it begins; fbql and fbql_value have their own", low=-1e9, high=1e9
    )
