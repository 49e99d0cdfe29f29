"""The complete parameters of a mux that may learn, and the session that they describe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, cast

from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import from_mapping, limits_of

from fbql_fusion.core.guides.priorities import Priorities, Within
from fbql_fusion.core.mux.config import MuxConfig, mux_config, rank
from fbql_fusion.core.mux.parameters import (
    AxisParameters,
    LearnedMuxParameters,
    LockParameters,
    MuxParameters,
    ObservationParameters,
    SourceParameters,
)
from fbql_fusion.core.mux.robot import Robot, robot_of
from fbql_fusion.core.mux_session import MuxSession
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters
from fbql_fusion.core.tasks.twist.task import MuxTask

NODE = "twist_mux"
"""The node's name, under which its parameters are recorded."""
GROUPS: dict[str, type[Any]] = {
    "topics": SourceParameters,
    "locks": LockParameters,
    "observations": ObservationParameters,
    "axes": AxisParameters,
}
"""The declarations of parameters PREFIX.NAME.FIELD, by their prefixes."""


@dataclass(frozen=True)
class MuxDescription:
    """Every parameter of a mux."""

    settings: MuxParameters
    learned: LearnedMuxParameters
    learning: MuxLearningParameters
    topics: Mapping[str, SourceParameters]
    locks: Mapping[str, LockParameters]
    observations: Mapping[str, ObservationParameters]
    axes: Mapping[str, AxisParameters]

    @property
    def config(self) -> MuxConfig:
        """Its sources and locks. Raises BadInput."""
        return mux_config(self.settings, self.topics, self.locks)

    @property
    def robot(self) -> Robot:
        """Its axes and observations. Raises BadInput."""
        return robot_of(self.axes, self.observations)

    @property
    def is_learned(self) -> bool:
        """Whether a session decides who drives; without it the mux is twist_mux."""
        return self.learning.learn or bool(self.learned.policy)

    def values(self) -> dict[str, Any]:
        """Everything as plain values, from which `description_of` makes the same."""
        groups = {prefix: {name: asdict(each) for name, each in getattr(self, prefix).items()} for prefix in GROUPS}
        return {**asdict(self.settings), **asdict(self.learned), **asdict(self.learning), **groups}


def description_of(values: Mapping[str, Any], where: str) -> MuxDescription:
    """The parameters in plain values, as `MuxDescription.values` gives them; those that are missing have their defaults.

    Raises BadInput.
    """
    parts: list[Any] = [
        from_mapping(kind, {name: values[name] for name in limits_of(kind) if name in values}, where)
        for kind in (MuxParameters, LearnedMuxParameters, MuxLearningParameters)
    ]
    groups: dict[str, Any] = {}
    for prefix, declaration in GROUPS.items():
        given: Any = values.get(prefix, {})
        if not isinstance(given, dict) or not all(
            isinstance(each, dict) for each in cast("dict[Any, Any]", given).values()
        ):
            raise BadInput(f"{where}: '{prefix}' is not a mapping of names to their parameters")
        entries = cast("dict[str, dict[str, Any]]", given)
        groups[prefix] = {
            name: from_mapping(declaration, each, where, f"{prefix}.{name}.") for name, each in entries.items()
        }
    return MuxDescription(*parts, **groups)


def session_of(mux: MuxDescription, policy: Policy | None) -> MuxSession:
    """The session that decides among the sources of a mux.

    Raises:
        BadInput: parameters that are wrong, or a policy that does not belong to them.
    """
    sources = {source.name: source for source in mux.config.sources}
    safety = mux.learned.safety_priority
    ordinary = [name for name, source in sources.items() if 0 < rank(source) < safety]
    names = list(mux.learning.behaviors) or ordinary
    for name in names:
        if name not in sources:
            raise BadInput(
                f"parameter 'behaviors' has '{name}', which is not one of the sources ({', '.join(sources)})"
            )
        if name not in ordinary:
            raise BadInput(
                f"parameter 'behaviors' has '{name}', whose priority is {rank(sources[name])}; it must be above 0 and "
                f"below safety_priority ({safety}) to be chosen"
            )
    robot = mux.robot
    conditions = [_condition(name, mux.topics[name], robot) for name in names]
    guide = Priorities([rank(sources[name]) for name in names], conditions)
    parameters = replace(mux.learning, behaviors=names)
    task = MuxTask(robot.space, parameters.decision_period_s, robot.lengths)
    return MuxSession(parameters, task, guide, policy)


def _condition(name: str, source: SourceParameters, robot: Robot) -> Within | None:
    if not source.guide_observation:
        return None
    if source.guide_low > source.guide_high:
        raise BadInput(
            f"parameter 'topics.{name}.guide_low' is {source.guide_low:g}, above 'guide_high' ({source.guide_high:g})"
        )
    place = robot.place_of(source.guide_observation)
    if place is None:
        raise BadInput(
            f"parameter 'topics.{name}.guide_observation' is '{source.guide_observation}', which is not one of the observations "
            f"({', '.join(each.name for each in robot.observations) or 'there are none'})"
        )
    return Within(*place, source.guide_low, source.guide_high)
