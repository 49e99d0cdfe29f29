"""The parameters of the controller fbql_model: when it imagines, and how much. Those of its model belong to the task."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import owned_by, parameter

from fbql_fusion.core.learners.parameters import ROUNDED
from fbql_fusion.core.learners.ppo.parameters import PpoUpdateParameters

DATA = ("all", "guided")
"""The real episodes that the model is fitted to: see `fbql_model_data`."""


@owned_by("fbql_model")
@dataclass(frozen=True)
class FbqlModelParameters(PpoUpdateParameters):
    """The parameters that only fbql_model has. The defaults were tuned in a prototype and confirmed on other seeds."""

    fbql_model_first_episodes: int = parameter(
        6000, "episodes that fbql_model imagines after the guided ones", low=0, high=10_000_000
    )
    fbql_model_episodes: int = parameter(
        1500, "episodes that fbql_model imagines each time after that", low=0, high=10_000_000
    )
    fbql_model_refit_episodes: int = parameter(
        10,
        "real episodes after which fbql_model fits its model again and imagines; 0: never after the first time",
        low=0,
        high=1_000_000,
    )
    fbql_model_data: str = parameter(
        "all",
        "the real episodes that the model is fitted to: all, or only the guided ones, so that just as much is imagined "
        "but nothing is learned from the others",
        choices=DATA,
    )
    fbql_model_batch_episodes: int = parameter(60, "imagined episodes in a batch", low=1, high=10_000)
    fbql_model_passes: int = parameter(4, "passes of fbql_model over a batch", low=1, high=100)
    fbql_model_hold_s: float = parameter(
        0.067,
        f"time for which fbql_model holds a decision in imagined episodes{ROUNDED}",
        unit="s",
        low=0.0,
        high=1000.0,
    )
    fbql_model_play_s: float = parameter(
        0.033, f"time for which fbql_model holds a decision in real episodes{ROUNDED}", unit="s", low=0.0, high=1000.0
    )
    fbql_model_reward_collision: float = parameter(
        -0.2, "reward of a collision for fbql_model, once when it begins", low=-1e9, high=1e9
    )
