"""The parameters that every controller has: what is fused, for how long, and what is rewarded."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import parameter

CONTROLLERS = ["fbql", "fbql_literal", "fbql_model", "fbql_value", "subsumption", "uniform"]
"""The names of the controllers of this package, then of those that were registered (`core.registry`)."""
MUX_CONTROLLERS = ["fbql", "fbql_value", "priorities", "uniform"]
"""The same for a mux of velocity commands."""
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
    guided: int = parameter(
        UP_TO_THE_CONTROLLER,
        "episodes in which Subsumption drives and the controller learns; -1: 20 for a controller that learns "
        "and starts without a policy, else 0",
        low=UP_TO_THE_CONTROLLER,
    )
    learn: bool = parameter(True, "whether a controller that can learn continues to learn")

    @property
    def success_limit(self) -> int:
        """Successes after which the session ends; 0: no limit."""
        return 0


def guided_episodes(parameters: SessionParameters, learning: bool, has_policy: bool) -> int:
    """The number of guided episodes in force.

    Args:
        learning: whether the controller learns in this run.
        has_policy: whether it starts from a policy.
    """
    own = GUIDED_EPISODES if learning and not has_policy else 0
    return parameters.guided if parameters.guided >= 0 else own
