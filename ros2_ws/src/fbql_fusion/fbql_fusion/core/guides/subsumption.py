"""Subsumption (Brooks 1986; the paper's Fig. 9): the highest layer that is triggered drives alone. Layers are data.

It is a controller, and the guide that drives the guided episodes of every other one.

The paper's text contradicts itself about the order, so the order is a parameter. Wall avoiding first, then
approaching, then ball seeking works; approaching first deadlocks at walls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fbql_common.core.geometry import approach_angle, wall_distance_and_bearing
from fbql_common.core.parameters import owned_by, parameter
from fbql_common.core.types import DRIVER_BLEND, BehaviorOutput, Phase, World

from fbql_fusion.core.controllers.interface import JointState, Selection
from fbql_fusion.core.controllers.parameters import SessionParameters

Trigger = Callable[[World, BehaviorOutput], bool]
"""Whether a behavior wants to drive, given the world state and its own answer to it."""
FROM_PRESET = -1.0
"""This value, like any negative threshold, stands for the preset's threshold."""


class Thresholds(NamedTuple):
    """When Subsumption's upper layers are triggered."""

    wall_m: float
    approach_rad: float


PRESETS = {"paper": Thresholds(0.07, 2.2), "tuned": Thresholds(0.07, 0.10)}
"""`paper`: a low threshold for walls and a high one for psi, so that ball seeking drives most of the time, as in the paper's
Fig. 9 with its many own goals. `tuned`: the fair baseline, tuned for the shipped trees on training seeds."""


@owned_by("subsumption")
@dataclass(frozen=True)
class SubsumptionParameters(SessionParameters):
    """Its layers and when they are triggered."""

    preset: str = parameter("tuned", "Subsumption's thresholds, unless given individually", choices=tuple(PRESETS))
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
    def thresholds(self) -> Thresholds:
        """The thresholds in force: the preset's, unless given."""
        preset = PRESETS[self.preset]
        return Thresholds(
            self.wall_threshold_m if self.wall_threshold_m >= 0.0 else preset.wall_m,
            self.approach_threshold_rad if self.approach_threshold_rad >= 0.0 else preset.approach_rad,
        )


class Layer(NamedTuple):
    """One layer: a behavior, and the world states in which it suppresses the layers below."""

    behavior: int
    """Index of the behavior."""
    trigger: Trigger


def trigger_of(name: str, thresholds: Thresholds) -> Trigger:
    """The trigger of a behavior.

    A behavior without its own threshold wants to drive wherever its observation lies inside its tree's root region,
    which is where its driving was demonstrated.
    """
    wall_m, approach_rad = thresholds

    def near_wall(world: World, _: BehaviorOutput) -> bool:
        return wall_distance_and_bearing(world)[0] < wall_m

    def beside_ball(world: World, _: BehaviorOutput) -> bool:
        return abs(approach_angle(world)) > approach_rad

    def inside(_: World, output: BehaviorOutput) -> bool:
        return not output.clamped

    return {"wall_avoiding": near_wall, "approaching": beside_ball}.get(name, inside)


def layers_of(parameters: SubsumptionParameters) -> tuple[Layer, ...]:
    """The layers from the highest priority to the lowest.

    A name in `layers` that is not fused makes no layer; a behavior that is not in `layers` never drives.
    """
    names = parameters.behaviors
    thresholds = parameters.thresholds
    return tuple(Layer(names.index(name), trigger_of(name, thresholds)) for name in parameters.layers if name in names)


def driver_of(layers: Sequence[Layer], world: World, outputs: Sequence[BehaviorOutput | None]) -> int:
    """Index of the behavior that drives: of the highest triggered layer whose behavior answered.

    If no trigger fires, the lowest layer whose behavior answered drives, since there is none below it.

    Returns:
        The index, or DRIVER_BLEND where no layer's behavior answered.
    """
    lowest = DRIVER_BLEND
    for behavior, trigger in layers:
        output = outputs[behavior]
        if output is not None:
            if trigger(world, output):
                return behavior
            lowest = behavior
    return lowest


class Subsumption:
    """The highest triggered layer drives alone."""

    def __init__(self, parameters: SubsumptionParameters) -> None:
        n = len(parameters.behaviors)
        self._layers = layers_of(parameters)
        self._alone = tuple(tuple(1.0 if i == driver else 0.0 for i in range(n)) for driver in range(n))
        self._nobody = (0.0,) * n

    def begin_episode(self, phase: Phase) -> None:
        """Nothing is remembered from one step to the next."""

    def select(self, world: World, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Selection:
        """Weight 1 for the driver. No behavior drives if no layer's behavior answered."""
        driver = driver_of(self._layers, world, outputs)
        return (self._alone[driver] if driver >= 0 else self._nobody), driver, (), ()
