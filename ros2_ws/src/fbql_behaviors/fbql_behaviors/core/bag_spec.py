"""What a tree for any robot senses and commands: the specification `behavior.yaml`, and the recipe in its tree file.

    max_age_s: 0.3
    observations:
      front: {topic: /scan, field: "ranges[350:360,0:10].min", low: 0.0, high: 3.0, unit: m, inf_as: 3.0}
      goal_distance: {odometry: /odom, target: {x: 4.0, y: 1.0}, gives: distance, low: 0.0, high: 8.0}
      goal_bearing: {odometry: /odom, target: {x: 4.0, y: 1.0}, gives: bearing}
    command:
      topic: /cmd_vel
      axes:
        linear.x: {low: 0.0, high: 0.8, levels: 9}
        angular.z: {low: -1.5, high: 1.5, levels: 11}

docs/bags.md explains every key. A recipe is the same in JSON, with `types`, the message type of each topic. In JSON the names
stand in the entries (`name`), so that the order survives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import atan2, hypot, isfinite, nan, pi
from typing import Any, NamedTuple, cast

from fbql_common.core.command_space import Axis, CommandSpace
from fbql_common.core.errors import BadInput
from fbql_common.core.field_path import FieldPath, parse_path
from fbql_common.core.geometry import wrap_bearing

from fbql_behaviors.core.levels import class_count
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.tree import Tree, check_features, check_space

UNITS = {"linear": "m/s", "angular": "rad/s"}
TWIST_FIELDS = tuple(f"{part}.{axis}" for part in UNITS for axis in "xyz")
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
LEVELS = 11
"""Levels of an axis that does not say."""
MAX_AGE_S = 0.5
"""Oldest observation that is used, where the specification does not say [s]."""
MAX_CLASSES = 1_000_000
_FIELD_KEYS = {"name", "topic", "field", "low", "high", "unit", "max_age_s", "inf_as"}
_TARGET_KEYS = {"name", "odometry", "pose", "target", "gives", "low", "high", "max_age_s"}


class Reading(NamedTuple):
    """A number in the messages of a topic."""

    topic: str
    path: FieldPath
    max_age_s: float
    """Oldest message that is used [s]; 0: any."""
    inf_as: float | None = None
    """The value that +Inf counts as."""


class Target(NamedTuple):
    """A point in the robot's frame, as distance or bearing."""

    gives: str
    """distance [m] or bearing [rad]."""
    x: Reading | float
    y: Reading | float
    pose: tuple[Reading, Reading, Reading]
    """The robot's x, y [m] and yaw [rad]."""


Source = Reading | Target


class Spec(NamedTuple):
    """What is sensed and commanded."""

    features: tuple[Feature, ...]
    sources: tuple[Source, ...]
    """Where the value of each feature comes from."""
    command_topic: str
    commands: CommandSpace
    """The axes are fields of Twist."""
    content: dict[str, Any]
    """The specification as JSON values, from which `spec_of` makes the same."""

    @property
    def readings(self) -> tuple[Reading, ...]:
        """Every number that is taken out of messages, once."""
        found: dict[Reading, None] = {}
        for source in self.sources:
            parts = (source,) if isinstance(source, Reading) else (source.x, source.y, *source.pose)
            found.update((part, None) for part in parts if isinstance(part, Reading))
        return tuple(found)

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics of the observations, once each."""
        return tuple(dict.fromkeys(reading.topic for reading in self.readings))


def spec_of(content: Any, with_types: bool = False) -> Spec:
    """The specification in plain data. Raises BadInput naming the entry.

    `with_types`: a recipe, which has the message type of each topic.
    """
    top = _mapping(content, "", {"max_age_s", "observations", "command", *(("types",) if with_types else ())})
    max_age_s = _number(top, "max_age_s", "", MAX_AGE_S, low=0.0)
    features: list[Feature] = []
    sources: list[Source] = []
    kept: list[dict[str, Any]] = []
    for name, entry in _named(top.get("observations"), "observations"):
        feature, source = _observation(name, entry, max_age_s)
        features.append(feature)
        sources.append(source)
        kept.append({"max_age_s": max_age_s, **entry, "name": name})
    topic, axes = _command(top.get("command"))
    space = CommandSpace(tuple(axes))
    check_space(space)
    if class_count(space) > MAX_CLASSES:
        raise BadInput(f"command: {class_count(space)} combinations of levels; at most {MAX_CLASSES} are supported")
    command = {"topic": topic, "axes": [axis._asdict() for axis in axes]}
    normal: dict[str, Any] = {"max_age_s": max_age_s, "observations": kept, "command": command}
    if with_types:
        types = top.get("types")
        normal["types"] = {topic: _text(types, topic, "types") for topic in _mapping(types, "types")}
    spec = Spec(tuple(features), tuple(sources), topic, space, normal)
    check_features(spec.features)
    if topic in spec.topics:
        raise BadInput(
            f"observations: {topic} is the command's topic; a tree that senses its own command only repeats it"
        )
    if with_types and (missing := [topic for topic in spec.topics if topic not in normal["types"]]):
        raise BadInput(f"types: the type of {missing[0]} is missing")
    return spec


def recipe_of(spec: Spec, types: Mapping[str, str]) -> dict[str, Any]:
    """The recipe that a tree file holds: the specification with the message type of each topic."""
    return {**spec.content, "types": {topic: types[topic] for topic in (*spec.topics, spec.command_topic)}}


def check_recipe(tree: Tree) -> None:
    """Raises BadInput unless a tree's recipe can be followed, and gives what the tree senses and commands."""
    try:
        spec = spec_of(tree.recipe, with_types=True)
    except BadInput as error:
        raise BadInput(f"recipe: {error}") from None
    if (spec.features, spec.commands) != (tree.features, tree.commands):
        raise BadInput("recipe: its observations or axes are not those of the tree")


def value_of(source: Source, values: Mapping[Reading, float]) -> float:
    """The value of a feature, from the numbers of its readings; NaN where one is not finite."""
    if isinstance(source, Reading):
        return values[source]
    x, y = (values[part] if isinstance(part, Reading) else part for part in (source.x, source.y))
    at_x, at_y, yaw = (values[part] for part in source.pose)
    dx, dy = x - at_x, y - at_y
    if not isfinite(dx + dy + yaw):
        return nan
    return hypot(dx, dy) if source.gives == "distance" else wrap_bearing(atan2(dy, dx) - yaw)


def _observation(name: str, entry: dict[str, Any], max_age_s: float) -> tuple[Feature, Source]:
    where = f"observations.{name}"
    is_target = "target" in entry
    _mapping(entry, where, _TARGET_KEYS if is_target else _FIELD_KEYS)
    max_age_s = _number(entry, "max_age_s", where, max_age_s, low=0.0)
    if not is_target:
        inf_as = _number(entry, "inf_as", where) if entry.get("inf_as") is not None else None
        source = Reading(_topic(entry, "topic", where), _path(entry, "field", where), max_age_s, inf_as)
        unit = _text(entry, "unit", where, "rad" if source.path.ending == "yaw" else "")
        is_angle = source.path.ending == "yaw"
    else:
        source = _target(entry, where, max_age_s)
        is_angle = source.gives == "bearing"
        unit = "rad" if is_angle else "m"
    low = _number(entry, "low", where, -pi if is_angle else 0.0 if is_target else None)
    return Feature(name, unit, low, _number(entry, "high", where, pi if is_angle else None)), source


def _target(entry: dict[str, Any], where: str, max_age_s: float) -> Target:
    gives = _text(entry, "gives", where)
    if gives not in ("distance", "bearing"):
        raise BadInput(f"{where}: 'gives' is '{gives}'; choose distance or bearing")
    odometry, pose = _topic(entry, "odometry", where), _text(entry, "pose", where, "pose.pose")
    robot = [Reading(odometry, _parsed(f"{pose}.{end}", where), max_age_s) for end in ("position.x", "position.y", "orientation.yaw")]  # fmt: skip
    target = _mapping(entry["target"], f"{where}.target", {"topic", "x", "y", "max_age_s"})
    where = f"{where}.target"
    x: Reading | float
    y: Reading | float
    if "topic" in target:
        age_s = _number(target, "max_age_s", where, 0.0, low=0.0)
        topic = _topic(target, "topic", where)
        x, y = (Reading(topic, _path(target, key, where), age_s) for key in ("x", "y"))
    else:
        x, y = _number(target, "x", where), _number(target, "y", where)
    return Target(gives, x, y, (robot[0], robot[1], robot[2]))


def _command(content: Any) -> tuple[str, list[Axis]]:
    command = _mapping(content, "command", {"topic", "axes"})
    axes: list[Axis] = []
    for name, entry in _named(command.get("axes"), "command.axes"):
        where = f"command.axes.{name}"
        if name not in TWIST_FIELDS:
            raise BadInput(f"{where}: not a field of a Twist; it has {', '.join(TWIST_FIELDS)}")
        _mapping(entry, where, {"name", "low", "high", "levels", "unit"})
        low, high = _number(entry, "low", where), _number(entry, "high", where)
        levels = entry.get("levels", LEVELS)
        if type(levels) is not int:
            raise BadInput(f"{where}: 'levels' is {levels!r}, not a whole number")
        axes.append(Axis(name, UNITS[name.partition(".")[0]], low, high, levels))
    return _topic(command, "topic", "command"), axes


def _named(content: Any, where: str) -> list[tuple[str, dict[str, Any]]]:
    """The entries of a mapping of names, or of a list of entries that have a `name`."""
    if isinstance(content, dict):
        given = [(name, entry) for name, entry in cast("dict[str, Any]", content).items()]
    elif isinstance(content, list):
        given = [(_text(entry, "name", f"{where}[{k}]"), entry) for k, entry in enumerate(cast("list[Any]", content))]
    else:
        given = []
    if not given:
        raise BadInput(f"'{where}' is missing or empty; expected names with their entries (docs/bags.md)")
    for name, _ in given:
        if not name.isprintable() or not name.strip() or [each for each, _ in given].count(name) > 1:
            raise BadInput(f"{where}: '{name}' is not a name in one line, or occurs twice")
    return [(name, _mapping(entry, f"{where}.{name}")) for name, entry in given]


def _mapping(content: Any, where: str, known: Sequence[str] | set[str] = ()) -> dict[str, Any]:
    at = f"{where}: " if where else ""
    if not isinstance(content, dict):
        raise BadInput(f"{at}expected names with values, not {content!r}")
    mapping = cast("dict[str, Any]", content)
    unknown = [key for key in mapping if known and key not in known]
    if unknown:
        raise BadInput(f"{at}unknown key '{unknown[0]}'; known are: {', '.join(sorted(known))}")
    return mapping


def _number(content: dict[str, Any], key: str, where: str, default: float | None = None, low: float = -1e12) -> float:
    value = content.get(key, default)
    at = f"{where}: " if where else ""
    if isinstance(value, bool) or not isinstance(value, int | float):
        missing = "missing" if key not in content else f"{value!r}"
        raise BadInput(f"{at}'{key}' is {missing}; expected a number")
    if not low <= value <= 1e12:
        raise BadInput(f"{at}'{key}' is {value}, outside of [{low:g}, 1e+12]")
    return float(value)


def _text(content: Any, key: str, where: str, default: str | None = None) -> str:
    value = _mapping(content, where).get(key, default)
    if not isinstance(value, str) or not value.isprintable():
        raise BadInput(
            f"{where}: '{key}' is {'missing' if value is None else repr(value)}; expected a text in one line"
        )
    return value


def _topic(content: dict[str, Any], key: str, where: str) -> str:
    topic = _text(content, key, where)
    if not topic.strip("/"):
        raise BadInput(f"{where}: '{key}' is '{topic}', which is not the name of a topic")
    return topic if topic.startswith("/") else f"/{topic}"


def _path(content: dict[str, Any], key: str, where: str) -> FieldPath:
    return _parsed(_text(content, key, where), where)


def _parsed(text: str, where: str) -> FieldPath:
    try:
        return parse_path(text)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
