"""Subsumption (the paper's Fig. 9): the highest layer that is triggered drives alone. Layers are data.

The paper's text contradicts itself about the order, so the order is a parameter. Wall avoiding first, then
approaching, then ball seeking works; approaching first deadlocks at walls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from fbql_common.core.geometry import approach_angle, wall_distance_and_bearing
from fbql_common.core.types import DRIVER_BLEND, BehaviorOutput, World

from fbql_fusion.core.parameters import FusionParameters, Thresholds

Trigger = Callable[[World, BehaviorOutput], bool]
"""Whether a behavior wants to drive, by the world state and its own answer to it."""


class Layer(NamedTuple):
    """One layer: a behavior, and the world states in which it suppresses the layers below."""

    behavior: int
    """Index of the behavior."""
    trigger: Trigger


def trigger_of(name: str, thresholds: Thresholds) -> Trigger:
    """When a behavior wants to drive.

    A behavior without a threshold here wants to wherever its observation lies inside of its tree's root region: that is
    where it was shown what to do.
    """
    wall_m, approach_rad = thresholds

    def near_wall(world: World, _: BehaviorOutput) -> bool:
        return wall_distance_and_bearing(world)[0] < wall_m

    def beside_ball(world: World, _: BehaviorOutput) -> bool:
        return abs(approach_angle(world)) > approach_rad

    def inside(_: World, output: BehaviorOutput) -> bool:
        return not output.clamped

    return {"wall_avoiding": near_wall, "approaching": beside_ball}.get(name, inside)


def layers_of(parameters: FusionParameters) -> tuple[Layer, ...]:
    """The layers from the highest priority to the lowest.

    A name in `layers` that is not fused makes no layer; a behavior that is not in `layers` never drives.
    """
    names = parameters.behaviors
    thresholds = parameters.thresholds
    return tuple(Layer(names.index(name), trigger_of(name, thresholds)) for name in parameters.layers if name in names)


def driver_of(layers: Sequence[Layer], world: World, outputs: Sequence[BehaviorOutput | None]) -> int:
    """Index of the behavior that drives: of the highest triggered layer whose behavior answered.

    Where no trigger fires, the lowest layer whose behavior answered drives: below it there is nobody.

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
