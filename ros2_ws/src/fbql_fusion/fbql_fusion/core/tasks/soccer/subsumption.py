"""Subsumption (Brooks 1986; the paper's Fig. 9): the highest layer that is triggered drives alone. Layers are data.

It is the guide of soccer: a controller of its own, and the driver of the guided episodes of every other one.

The paper's text contradicts itself about the order, so the order is a parameter. Wall avoiding first, then
approaching, then ball seeking works; approaching first deadlocks at walls.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from fbql_common.core.geometry import approach_angle, wall_distance_and_bearing
from fbql_common.core.parameters import owned_by, parameter
from fbql_common.core.types import World

from fbql_fusion.core.guides.layers import Layer, Trigger, driver_of
from fbql_fusion.core.tasks.interface import Answer, Answers
from fbql_fusion.core.tasks.soccer.parameters import SoccerParameters

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
class SubsumptionParameters(SoccerParameters):
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


def trigger_of(name: str, thresholds: Thresholds) -> Trigger:
    """The trigger of a behavior.

    A behavior without its own threshold wants to drive wherever its observation lies inside its tree's root region,
    which is where its driving was demonstrated.
    """
    wall_m, approach_rad = thresholds

    def near_wall(world: World, _: Answer) -> bool:
        return wall_distance_and_bearing(world)[0] < wall_m

    def beside_ball(world: World, _: Answer) -> bool:
        return abs(approach_angle(world)) > approach_rad

    def inside(_: World, output: Answer) -> bool:
        return not output.clamped

    return {"wall_avoiding": near_wall, "approaching": beside_ball}.get(name, inside)


def layers_of(parameters: SubsumptionParameters) -> tuple[Layer, ...]:
    """The layers from the highest priority to the lowest.

    A name in `layers` that is not fused makes no layer; a behavior that is not in `layers` never drives.
    """
    names = parameters.behaviors
    thresholds = parameters.thresholds
    return tuple(Layer(names.index(name), trigger_of(name, thresholds)) for name in parameters.layers if name in names)


class Subsumption:
    """The highest triggered layer drives alone. See `core.tasks.interface.Guide`."""

    def __init__(self, parameters: SubsumptionParameters) -> None:
        self._layers = layers_of(parameters)

    def driver(self, world: World, answers: Answers) -> int:
        """Index of the driver; DRIVER_BLEND if no layer's behavior answered."""
        return driver_of(self._layers, world, answers)
