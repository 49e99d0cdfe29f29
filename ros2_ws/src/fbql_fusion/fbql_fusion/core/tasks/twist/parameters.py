"""The parameters of a mux that learns: when it decides, among which sources, and how it learns."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import check, owned_by, parameter

from fbql_fusion.core.controllers.parameters import MUX_CONTROLLERS, SessionParameters
from fbql_fusion.core.learners.parameters import ROUNDED
from fbql_fusion.core.learners.ppo.parameters import PpoParameters
from fbql_fusion.core.learners.value.parameters import ValueParameters

_SHARED = ("fbql", "fbql_value")


@dataclass(frozen=True)
class DecisionParameters(SessionParameters):
    """What is decided, and when. Parameters of learning that have other defaults than in soccer follow below."""

    controller: str = parameter(
        "fbql",
        "what decides which source drives; priorities: the rules of twist_mux, applied at each decision",
        choices=MUX_CONTROLLERS,
    )
    behaviors: list[str] = parameter(
        [], "names of the sources to choose from, in order; empty: all below safety_priority"
    )
    guided: int = parameter(
        0, "episodes at the beginning in which the priorities drive and the controller learns", low=0
    )
    learn: bool = parameter(
        False,
        "whether the mux learns from rewards which source should drive; without it and without a policy it is twist_mux",
    )
    decision_period_s: float = parameter(
        0.1, "time from one decision to the next, by the node's clock", unit="s", low=0.001, high=60.0
    )
    hold_s: float = parameter(
        0.4,
        f"time for which a source is held while the mux learns{ROUNDED.replace('steps', 'decision periods')}",
        unit="s",
        low=0.0,
        high=1000.0,
    )
    play_s: float = parameter(
        0.3,
        f"time for which a source is held when it does not learn{ROUNDED.replace('steps', 'decision periods')}",
        unit="s",
        low=0.0,
        high=1000.0,
    )


@owned_by(*_SHARED)
@dataclass(frozen=True)
class MuxFeatures(DecisionParameters):
    """Defaults of the features in a mux."""

    fbql_mirror: bool = parameter(
        False,
        "whether situations that mirror each other (left and right) share their tiles; only right if no source prefers a side",
    )
    fbql_discount_period_s: float = parameter(
        0.1, "time that gamma of fbql and of fbql_value is stated for", unit="s", low=1e-6, high=1e6
    )


@owned_by("fbql")
@dataclass(frozen=True)
class MuxPpo(MuxFeatures):
    """Defaults of `fbql` in a mux."""

    fbql_discount: float = parameter(0.995, "gamma of fbql, per fbql_discount_period_s", low=0.0, high=1.0)
    fbql_world_tilings: int = parameter(
        0, "tilings of what only the critic of fbql sees; in a mux there is no such thing", low=0, high=32
    )


@owned_by("fbql_value")
@dataclass(frozen=True)
class MuxValue(MuxFeatures):
    """Defaults of `fbql_value` in a mux."""

    fbql_value_discount: float = parameter(0.995, "gamma of fbql_value, per fbql_discount_period_s", low=0.0, high=1.0)


@dataclass(frozen=True)
class MuxLearningParameters(MuxPpo, MuxValue, PpoParameters, ValueParameters):
    """All of them. The defaults are those of a study of a robot that finds its way through rooms."""

    @property
    def fbql_durations_s(self) -> tuple[float, float]:
        """See `PpoParameters`."""
        return self.hold_s, self.play_s

    @property
    def fbql_value_durations_s(self) -> tuple[float, float]:
        """See `ValueParameters`."""
        return self.hold_s, self.play_s


def check_mux_learning(parameters: MuxLearningParameters, where: str) -> None:
    """Raises BadInput naming the first parameter that is wrong by itself or in combination with others."""
    check(parameters, where)
    names = parameters.behaviors
    if not names:
        raise BadInput(f"{where}: there is no source below safety_priority, so there is nothing to decide")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BadInput(f"{where}: parameter 'behaviors' names '{twice[0]}' twice; name it once")
