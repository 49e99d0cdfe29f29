"""The parameters of `controller` fbql_value. Its features are those of `fbql`."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import owned_by, parameter

from fbql_fusion.core.learners.parameters import PLAYS, ROUNDED, FeatureParameters


@owned_by("fbql_value")
@dataclass(frozen=True)
class ValueParameters(FeatureParameters):
    """The parameters of eqs. 16 to 20 in `docs/fusion.md`, in any task."""

    fbql_value_play: str = parameter(
        "held",
        "how fbql_value plays when it does not learn: the behavior with the largest weight drives, one drawn by the "
        "weights, or all of them blended",
        choices=PLAYS,
    )
    fbql_value_patience: int = parameter(
        10,
        "decisions in the same joint state of one episode after which frozen fbql_value draws the driver there, from "
        "weights that become more equal with each repetition; 0: never",
        low=0,
        high=1_000_000,
    )

    fbql_value_discount: float = parameter(0.997, "gamma of fbql_value, per fbql_discount_period_s", low=0.0, high=1.0)
    fbql_value_trace: float = parameter(0.95, "lambda of eq. 20, per decision", low=0.0, high=1.0)
    fbql_value_temperature_first: float = parameter(0.03, "tau of eq. 16 at the start", low=1e-6, high=1e9)
    fbql_value_temperature_last: float = parameter(0.01, "value to which tau of eq. 16 decays", low=1e-6, high=1e9)
    fbql_value_exploration_first: float = parameter(0.05, "eps of eq. 16 at the start", low=0.0, high=1.0)
    fbql_value_exploration_last: float = parameter(0.01, "value to which eps of eq. 16 decays", low=0.0, high=1.0)
    fbql_value_rate_first: float = parameter(
        0.002, "alpha of eq. 20 at the start, shared by the active features", low=0.0, high=1.0
    )
    fbql_value_rate_last: float = parameter(0.00075, "value to which alpha of eq. 20 decays", low=0.0, high=1.0)
    fbql_value_shared_rate: float = parameter(0.05, "beta of eq. 20, shared by the active features", low=1e-9, high=1.0)
    fbql_value_halving: float = parameter(
        300.0, "e_half of eq. 18: episodes after which tau, eps and alpha have decayed halfway", low=1e-3, high=1e9
    )
    fbql_value_batch_episodes: int = parameter(
        20, "episodes in a batch of fbql_value; the first batches are smaller, from 3 up", low=1, high=1000
    )
    fbql_value_passes: int = parameter(8, "passes of fbql_value over a batch", low=1, high=100)
    fbql_value_minibatch: int = parameter(128, "decisions in a minibatch of fbql_value", low=1, high=100_000)

    @property
    def fbql_value_durations_s(self) -> tuple[float, float]:
        """How long a decision is held while fbql_value learns, and when it does not [s]."""
        raise NotImplementedError


@owned_by("fbql_value")
@dataclass(frozen=True)
class FbqlValueParameters(ValueParameters):
    """Those of soccer as well. The defaults were chosen on training seeds and tree sets."""

    fbql_value_hold_s: float = parameter(
        0.133, f"time for which fbql_value holds a decision while it learns{ROUNDED}", unit="s", low=0.0, high=1000.0
    )
    fbql_value_play_s: float = parameter(
        0.133,
        f"time for which fbql_value holds a decision when it does not learn{ROUNDED}",
        unit="s",
        low=0.0,
        high=1000.0,
    )
    fbql_value_reward_collision: float = parameter(
        -0.1, "reward of a collision for fbql_value, once when it begins", low=-1e9, high=1e9
    )

    @property
    def fbql_value_durations_s(self) -> tuple[float, float]:
        """See `ValueParameters`."""
        return self.fbql_value_hold_s, self.fbql_value_play_s
