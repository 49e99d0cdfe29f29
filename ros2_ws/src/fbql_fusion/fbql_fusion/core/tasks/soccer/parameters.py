"""The parameters of soccer as a task: the rewards, and how long to play."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import parameter

from fbql_fusion.core.controllers.parameters import SessionParameters


@dataclass(frozen=True)
class SoccerParameters(SessionParameters):
    """Parameters of every soccer controller."""

    goals: int = parameter(0, "goals after the guided episodes; 0: no limit", low=0)

    reward_goal: float = parameter(10.0, "reward of a goal", low=-1e9, high=1e9)
    reward_own_goal: float = parameter(-10.0, "reward of an own goal", low=-1e9, high=1e9)
    reward_collision: float = parameter(
        -5.0,
        "reward of a collision, once when it begins; fbql, fbql_model and fbql_value have their own",
        low=-1e9,
        high=1e9,
    )

    @property
    def success_limit(self) -> int:
        """Goals after which the session ends; 0: no limit."""
        return self.goals
