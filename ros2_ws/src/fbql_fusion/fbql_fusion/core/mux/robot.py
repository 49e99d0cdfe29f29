"""What a mux that learns knows about its robot: the axes of its commands, and its observations in groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from typing import NamedTuple

from fbql_common.core.command_space import Axis, CommandSpace
from fbql_common.core.errors import BadInput
from fbql_common.core.field_path import FieldPath, parse_path
from fbql_common.core.twist import Twist

from fbql_fusion.core.mux.parameters import AxisParameters, ObservationParameters

FIELDS = ("linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z")
"""The fields of geometry_msgs/Twist, in the order of `Twist`."""
NAMES = tuple(field.replace(".", "_") for field in FIELDS)
"""The same as parameter names, without dots: rcl misreads a name with a dot in a file."""
DEFAULT_AXES = {"linear_x": AxisParameters(-1.0, 1.0, 5), "angular_z": AxisParameters(-2.0, 2.0, 5)}
"""The axes if none are given: those of a differential drive."""
_NS = 1_000_000_000


class Observation(NamedTuple):
    """A number that the robot senses."""

    name: str
    topic: str
    type_name: str
    path: FieldPath
    low: float
    high: float
    max_age_ns: int
    """0: any age."""

    def clamped(self, value: float) -> float:
        """The value within the limits; NaN stays."""
        return min(max(value, self.low), self.high) if not isnan(value) else value


@dataclass(frozen=True)
class Robot:
    """Axes and observations."""

    space: CommandSpace
    observations: tuple[Observation, ...]
    """Group by group."""
    lengths: tuple[int, ...]
    """Observations of each group."""

    @property
    def places(self) -> tuple[int, ...]:
        """Where each axis is in a `Twist`."""
        return tuple(FIELDS.index(axis.name) for axis in self.space.axes)

    def on_axes(self, twist: Twist) -> tuple[float, ...]:
        """A velocity on the axes."""
        return tuple([twist[place] for place in self.places])

    def twist(self, command: Sequence[float]) -> Twist:
        """The velocity of a command, 0 on other fields."""
        values = [0.0] * len(FIELDS)
        for place, x in zip(self.places, command, strict=True):
            values[place] = x
        return Twist(*values)

    def place_of(self, observation: str) -> tuple[int, int] | None:
        """Group and component of an observation; None for an unknown name."""
        for group, length in enumerate(self.lengths):
            begin = sum(self.lengths[:group])
            for component in range(length):
                if self.observations[begin + component].name == observation:
                    return group, component
        return None


def robot_of(axes: Mapping[str, AxisParameters], observations: Mapping[str, ObservationParameters]) -> Robot:
    """The robot that parameters describe. Raises BadInput."""
    given = axes or DEFAULT_AXES
    found: list[Axis] = []
    for name in sorted(given, key=lambda name: NAMES.index(name) if name in NAMES else -1):
        each, unit = given[name], "m/s" if name.startswith("linear") else "rad/s"
        if name not in NAMES:
            raise BadInput(f"parameter 'axes.{name}': not an axis of a Twist; choose one of: {', '.join(NAMES)}")
        if not each.low < each.high:
            raise BadInput(f"parameter 'axes.{name}.low' is {each.low:g}, not below 'high' ({each.high:g})")
        found.append(Axis(FIELDS[NAMES.index(name)], unit, each.low, each.high, each.levels))
    groups: dict[str, list[Observation]] = {}
    types: dict[str, str] = {}
    for name, each in observations.items():
        where = f"parameter 'observations.{name}"
        if not each.low < each.high:
            raise BadInput(f"{where}.low' is {each.low:g}, not below 'high' ({each.high:g})")
        if (other := types.setdefault(each.topic, each.type)) != each.type:
            raise BadInput(f"{where}.type' is {each.type}, but another observation of {each.topic} has {other}")
        try:
            path = parse_path(each.field)
        except BadInput as error:
            raise BadInput(f"{where}.field': {error}") from None
        made = Observation(name, each.topic, each.type, path, each.low, each.high, round(each.max_age_s * _NS))
        groups.setdefault(f"group {each.group}" if each.group else f"observation {name}", []).append(made)
    return Robot(
        CommandSpace(tuple(found)),
        tuple(each for group in groups.values() for each in group),
        tuple(len(group) for group in groups.values()),
    )
