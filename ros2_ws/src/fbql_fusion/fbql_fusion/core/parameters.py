"""The parameters of fusion: type, default, unit, bounds and meaning, in one place."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import check, parameter

from fbql_fusion.core.fbql_parameters import FbqlParameters
from fbql_fusion.core.fbql_value_parameters import FbqlValueParameters

CONTROLLERS = ("fbql", "fbql_literal", "fbql_value", "subsumption", "uniform")
TIE_RULES = ("none", "first", "all", "random")
FROM_PRESET = -1.0
"""A threshold of this value (or any negative one) is the preset's."""
CONTROLLERS_OWN = -1
"""The value of `guided` that leaves the number of guided episodes to the controller."""
GUIDED_EPISODES = 20
"""Guided episodes of a learning controller, unless said otherwise (the paper's III.B)."""


class Thresholds(NamedTuple):
    """When Subsumption's upper layers are triggered."""

    wall_m: float
    approach_rad: float


PRESETS = {"paper": Thresholds(0.07, 2.2), "tuned": Thresholds(0.07, 0.10)}
"""`paper`: a low threshold for walls and a high one for psi, so that ball seeking drives most of the time, as in the paper's
Fig. 9 with its many own goals. `tuned`: the honest control, tuned for the shipped trees on training seeds."""


_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)


@dataclass(frozen=True)
class FusionParameters(FbqlValueParameters, FbqlParameters):
    """What fusion can be told. `docs/deviations.md` says which of these the paper leaves open."""

    controller: str = parameter("subsumption", "who fuses; fbql_literal: as the paper prints it", choices=CONTROLLERS)
    preset: str = parameter("tuned", "Subsumption's thresholds, where not given one by one", choices=tuple(PRESETS))
    behaviors: list[str] = parameter(
        ["ball_seeking", "wall_avoiding", "approaching"], "names of the behaviors that are fused, in order"
    )
    seed: int = parameter(0, "seed of the run: every episode's seed is derived from it", low=0, high=2**63 - 1)
    episodes: int = parameter(0, "episodes after the guided ones; 0: no limit", low=0)
    goals: int = parameter(0, "goals after the guided episodes; 0: no limit", low=0)
    guided: int = parameter(
        CONTROLLERS_OWN,
        "episodes in which Subsumption drives and the controller learns; -1: 20 for a controller that learns "
        "and starts without a policy, else 0",
        low=CONTROLLERS_OWN,
    )
    learn: bool = parameter(True, "whether the controller, if it can, goes on learning")

    learning_rate: float = parameter(0.1, "alpha of eq. 5", low=0.0, high=1.0)
    discount: float = parameter(0.99, "gamma of eq. 5, per step", low=0.0, high=1.0)
    weight_gain: float = parameter(0.01, "delta of eq. 6", low=0.0, high=1e9)
    weight_offset: float = parameter(10.0, "f of eq. 6: keeps Q + f positive", low=-1e9, high=1e9)
    gain_low: float = parameter(0.0, "lower bound of delta (Q + f) in eq. 6; -1e9: as printed", low=-1e9, high=0.0)
    gain_high: float = parameter(1.0, "upper bound of delta (Q + f) in eq. 6; 1e9: as printed", low=0.0, high=1e9)
    weight_floor: float = parameter(
        0.01, "no weight falls below it before they are normalised; -1e9: as printed", low=-1e9, high=1.0
    )
    tie_rule: str = parameter(
        "none",
        "which behavior is eq. 6's argmax where several have the largest Q: none of them and no weight changes, "
        "the first, all of them, or a random one",
        choices=TIE_RULES,
    )
    initial_q: float = parameter(0.0, "Q of a joint state that was never visited", low=-1e9, high=1e9)

    reward_goal: float = parameter(10.0, "reward of a goal", low=-1e9, high=1e9)
    reward_own_goal: float = parameter(-10.0, "reward of an own goal", low=-1e9, high=1e9)
    reward_collision: float = parameter(
        -5.0, "reward of a collision, once when it begins; fbql and fbql_value have their own", low=-1e9, high=1e9
    )

    wall_threshold_m: float = parameter(
        FROM_PRESET, "Subsumption avoids walls nearer than this; negative: the preset's", unit="m", low=-1.0, high=10.0
    )
    approach_threshold_rad: float = parameter(
        FROM_PRESET,
        "Subsumption approaches where |psi| is larger than this; negative: the preset's",
        unit="rad",
        low=-1.0,
        high=3.2,
    )
    layers: list[str] = parameter(
        ["wall_avoiding", "approaching", "ball_seeking"],
        "Subsumption's layers from the highest priority to the lowest; the lowest needs no trigger",
    )

    @property
    def collision_reward(self) -> float:
        """The reward of a collision begun that is in force: those that learn otherwise than printed have their own."""
        own = {"fbql": self.fbql_reward_collision, "fbql_value": self.fbql_value_reward_collision}
        return own.get(self.controller, self.reward_collision)

    @property
    def thresholds(self) -> Thresholds:
        """The thresholds in force: the preset's, where none is given."""
        preset = PRESETS[self.preset]
        return Thresholds(
            self.wall_threshold_m if self.wall_threshold_m >= 0.0 else preset.wall_m,
            self.approach_threshold_rad if self.approach_threshold_rad >= 0.0 else preset.approach_rad,
        )


def check_fusion(parameters: FusionParameters, where: str) -> None:
    """Raises BadInput naming the first parameter that is wrong by itself or beside the others."""
    check(parameters, where)
    names = parameters.behaviors
    if not names:
        raise BadInput(f"{where}: parameter 'behaviors' is empty; name at least one behavior")
    for name in names:
        if not _NAME.fullmatch(name):
            raise BadInput(
                f"{where}: parameter 'behaviors' has '{name}', which can't be a topic's name; "
                "use letters, digits and underscores"
            )
    for key, listed in (("behaviors", names), ("layers", parameters.layers)):
        twice = sorted({name for name in listed if listed.count(name) > 1})
        if twice:
            raise BadInput(f"{where}: parameter '{key}' names '{twice[0]}' twice; name it once")
    if parameters.weight_floor * len(names) > 1.0:
        raise BadInput(
            f"{where}: parameter 'weight_floor' is {parameters.weight_floor:g}; "
            f"{len(names)} behaviors leave at most {1 / len(names):g}"
        )
    known = {*names, *FusionParameters().layers}  # the usual ones stay there when others are fused
    for name in parameters.layers:
        if name not in known:
            raise BadInput(
                f"{where}: parameter 'layers' has '{name}', which is none of the behaviors ({', '.join(names)}); "
                "write it as it stands there, or take it out"
            )
    if not set(parameters.layers) & set(names):
        raise BadInput(
            f"{where}: parameter 'layers' ({', '.join(parameters.layers)}) names none of the behaviors "
            f"({', '.join(names)}); Subsumption, which also guides, has nothing to drive with"
        )
