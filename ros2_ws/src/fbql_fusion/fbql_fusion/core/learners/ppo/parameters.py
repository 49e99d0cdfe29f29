"""The parameters of PPO, which fbql and fbql_model share, and those of `controller` fbql: how long a decision is held, the prior."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import owned_by, parameter

from fbql_fusion.core.learners.parameters import PLAYS, ROUNDED, FeatureParameters


@owned_by("fbql", "fbql_model")
@dataclass(frozen=True)
class PpoUpdateParameters(FeatureParameters):
    """The parameters of eqs. 10 to 15 in `docs/fusion.md` that fbql and fbql_model share, in any task."""

    fbql_play: str = parameter(
        "held",
        "how fbql plays when it does not learn: the behavior with the largest weight drives, one drawn by the weights, "
        "or all of them blended",
        choices=PLAYS,
    )
    fbql_patience: int = parameter(
        10,
        "decisions in the same joint state of one episode after which frozen fbql draws the driver there, from weights "
        "that become more equal with each repetition; 0: never",
        low=0,
        high=1_000_000,
    )
    fbql_world_tilings: int = parameter(
        4,
        "tilings of what only the critic of fbql sees (in soccer the positions of ball and robot, and the ball's velocity), "
        "in addition to what the behaviors sense; needed only while learning, no weight depends on them; 0: the critic sees "
        "only what the behaviors sense",
        low=0,
        high=32,
    )

    fbql_discount: float = parameter(0.998, "gamma of fbql, per fbql_discount_period_s", low=0.0, high=1.0)
    fbql_trace: float = parameter(0.95, "lambda of eq. 13 (GAE), per decision", low=0.0, high=1.0)
    fbql_rate: float = parameter(0.15, "alpha of eq. 14, shared by the active features", low=0.0, high=10.0)
    fbql_value_rate: float = parameter(
        0.03, "beta of eq. 15, shared by all features that the critic sees", low=0.0, high=2.0
    )
    fbql_clip: float = parameter(
        0.4, "PPO's clip range: relative change of a weight beyond which eq. 14 stops changing it", low=0.0
    )
    fbql_guide_passes: int = parameter(4, "passes over the guided episodes", low=0, high=1000)
    fbql_imitate_failures: bool = parameter(
        False, "whether guided episodes that did not end in a goal are imitated as well"
    )
    fbql_minibatch: int = parameter(128, "decisions in a minibatch", low=1, high=100_000)
    fbql_divergence: float = parameter(
        0.05, "approximate KL divergence of a batch's weights beyond which the passes stop changing them", low=0.0
    )


@owned_by("fbql")
@dataclass(frozen=True)
class PpoParameters(PpoUpdateParameters):
    """The parameters that only fbql has, in any task."""

    fbql_prior: float = parameter(
        0.0,
        "kappa: the preference that an untrained fbql has for the behavior that the guide would choose; 0: the guide is not "
        "a feature. A policy keeps the value that it was made with",
        low=0.0,
        high=100.0,
    )
    fbql_explore: bool = parameter(
        True,
        "whether fbql explores while it learns: the driver is drawn by the weights, and held longer; otherwise it plays after the "
        "guided episodes as when it does not learn",
    )
    fbql_batch_episodes: int = parameter(
        20, "episodes in a batch; the first batches are smaller, from 3 up", low=1, high=1000
    )
    fbql_passes: int = parameter(8, "passes over a batch", low=1, high=100)

    @property
    def fbql_durations_s(self) -> tuple[float, float]:
        """How long a decision is held while fbql learns, and when it does not [s]."""
        raise NotImplementedError


@owned_by("fbql")
@dataclass(frozen=True)
class FbqlParameters(PpoParameters):
    """Those of soccer as well. The defaults were chosen on training seeds and tree sets."""

    fbql_hold_s: float = parameter(
        0.067, f"time for which fbql holds a decision while it learns{ROUNDED}", unit="s", low=0.0, high=1000.0
    )
    fbql_play_s: float = parameter(
        0.033, f"time for which fbql holds a decision when it does not learn{ROUNDED}", unit="s", low=0.0, high=1000.0
    )
    fbql_reward_collision: float = parameter(
        -0.2, "reward of a collision for fbql, once when it begins", low=-1e9, high=1e9
    )

    @property
    def fbql_durations_s(self) -> tuple[float, float]:
        """See `PpoParameters`."""
        return self.fbql_hold_s, self.fbql_play_s
