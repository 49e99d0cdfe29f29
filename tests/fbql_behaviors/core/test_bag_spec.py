"""The specification of a tree from a bag, and the recipe in its file."""

from __future__ import annotations

import json
from math import inf, isnan, nan, pi
from typing import Any

import pytest
import yaml
from fbql_behaviors.core.bag_spec import Reading, check_recipe, recipe_of, spec_of, value_of
from fbql_behaviors.core.tree import CommandLeaf, Tree
from fbql_common.core.command_space import Axis
from fbql_common.core.errors import BadInput
from robot_bags import SPEC

TARGET: dict[str, Any] = {"odometry": "/odom", "target": {"x": 3.0, "y": 4.0}}


def content(**changes: Any) -> dict[str, Any]:
    """A specification in plain data, with changes at its top."""
    return {**yaml.safe_load(SPEC), **changes}


def observing(**entry: Any) -> dict[str, Any]:
    """A specification of one observation."""
    return content(observations={"it": entry})


def test_a_specification_gives_features_and_axes_in_its_order() -> None:
    spec = spec_of(content())
    assert [feature.name for feature in spec.features] == ["right_distance", "left_distance"]
    assert spec.commands.axes == (
        Axis("linear.x", "m/s", 0.0, 0.8, 9),
        Axis("angular.z", "rad/s", -1.5, 1.5, 13),
    )
    assert (spec.topics, spec.command_topic) == (("/scan",), "/cmd_vel")


def test_each_observation_has_the_oldest_age_of_its_own_or_that_of_all() -> None:
    entry = {"topic": "scan", "field": "range", "low": 0, "high": 1}
    spec = spec_of(content(observations={"a": entry, "b": {**entry, "max_age_s": 2}}))
    assert [reading.max_age_s for reading in spec.readings] == [0.3, 2.0]
    assert spec.topics == ("/scan",)


def test_a_target_is_a_distance_and_a_bearing_in_the_robot_s_frame() -> None:
    spec = spec_of(
        content(
            observations={"far": {**TARGET, "gives": "distance", "high": 9}, "side": {**TARGET, "gives": "bearing"}}
        )
    )
    x, y, yaw = spec.readings
    values = {x: 0.0, y: 0.0, yaw: pi / 2}
    assert value_of(spec.sources[0], values) == 5.0
    assert value_of(spec.sources[1], values) == pytest.approx(-0.6435011087932844), "to the right of straight ahead"
    assert [(f.unit, f.low, f.high) for f in spec.features] == [("m", 0.0, 9.0), ("rad", -pi, pi)]


@pytest.mark.parametrize("unknown", [nan, inf, -inf])
def test_a_target_is_nowhere_while_a_number_of_it_is_not_finite(unknown: float) -> None:
    for gives, high in (("distance", 9.0), ("bearing", 3.0)):
        spec = spec_of(content(observations={"it": {**TARGET, "gives": gives, "high": high}}))
        for lost in spec.readings:
            assert isnan(value_of(spec.sources[0], {**dict.fromkeys(spec.readings, 0.0), lost: unknown}))


def test_observations_may_be_a_list_in_its_order() -> None:
    listed = [{"name": name, **entry} for name, entry in content()["observations"].items()]
    assert spec_of(content(observations=listed)) == spec_of(content())


def test_a_target_may_come_from_a_topic_whose_last_message_holds() -> None:
    target = {"topic": "/goal", "x": "pose.position.x", "y": "pose.position.y"}
    spec = spec_of(observing(odometry="/pose", pose="pose", target=target, gives="bearing"))
    assert spec.topics == ("/goal", "/pose")
    assert [reading.max_age_s for reading in spec.readings] == [0.0, 0.0, 0.3, 0.3, 0.3]


def test_yaw_is_an_angle_without_more_words() -> None:
    (feature,) = spec_of(observing(topic="/odom", field="pose.pose.orientation.yaw")).features
    assert (feature.unit, feature.low, feature.high) == ("rad", -pi, pi)


def test_a_recipe_gives_the_specification_that_it_was_made_of() -> None:
    spec = spec_of(content())
    recipe = recipe_of(spec, {"/scan": "sensor_msgs/msg/LaserScan", "/cmd_vel": "geometry_msgs/msg/Twist"})
    stored = json.loads(json.dumps(recipe, sort_keys=True))
    again = spec_of(stored, with_types=True)
    assert again[:-1] == spec[:-1]
    tree = Tree("it", spec.features, (0,), (CommandLeaf((0.0, 0.0), 1),), {}, spec.commands, stored)
    check_recipe(tree)
    with pytest.raises(BadInput, match="recipe: unknown key 'rate'"):
        check_recipe(Tree("it", spec.features, (0,), tree.leaves, {}, spec.commands, {**stored, "rate": 1}))
    stored["observations"][0]["high"] = 5.0
    with pytest.raises(BadInput, match="recipe: its observations or axes are not those of the tree"):
        check_recipe(tree)


ENTRY: dict[str, Any] = {"topic": "/scan", "field": "range", "low": 0.0, "high": 1.0}
AXIS = {"linear.x": {"low": 0, "high": 1}}
REFUSED = {
    "nothing": (None, "expected names with values, not None"),
    "a key at the top": (content(rate=3), "unknown key 'rate'; known are: command, max_age_s, observations"),
    "no observations": (content(observations={}), "'observations' is missing or empty"),
    "a key of an observation": (observing(**ENTRY, fild="x"), "observations.it: unknown key 'fild'"),
    "no field": (observing(topic="/scan", low=0, high=1), "observations.it: 'field' is missing"),
    "no bounds": (observing(topic="/scan", field="range"), "observations.it: 'low' is missing; expected a number"),
    "a text as a bound": (observing(**{**ENTRY, "low": "0"}), "observations.it: 'low' is '0'; expected a number"),
    "bounds the wrong way": (observing(**{**ENTRY, "low": 2.0}), "low 2.0 must be below high 1.0"),
    "no path": (observing(**{**ENTRY, "field": "a..b"}), "observations.it: 'a..b' is not the path of a field"),
    "no topic": (observing(**{**ENTRY, "topic": "/"}), "'topic' is '/', which is not the name of a topic"),
    "neither distance nor bearing": (observing(**TARGET, gives="yaw"), "'gives' is 'yaw'; choose distance or bearing"),
    "a target without y": (
        observing(odometry="/o", target={"x": 1}, gives="bearing"),
        "observations.it.target: 'y' is missing",
    ),
    "a negative age": (content(max_age_s=-1), "'max_age_s' is -1, outside of"),
    "an age that is no number": (content(max_age_s=float("nan")), "'max_age_s' is nan, outside of"),
    "no command": (content(command=None), "command: expected names with values"),
    "no axis": (content(command={"topic": "/c", "axes": {}}), "'command.axes' is missing or empty"),
    "a strange axis": (
        content(command={"topic": "/c", "axes": {"linear.q": {"low": 0, "high": 1}}}),
        "command.axes.linear.q: not a field of a Twist; it has linear.x",
    ),
    "one level": (
        content(command={"topic": "/c", "axes": {"linear.x": {"low": 0, "high": 1, "levels": 1}}}),
        "command axis 'linear.x': 1 levels; expected 2 to",
    ),
    "a limit of nothing": (
        content(command={"topic": "/c", "axes": {"linear.x": {"low": 1, "high": 1}}}),
        "command axis 'linear.x': low 1.0 must be below high 1.0",
    ),
    "too many classes": (
        content(command={"topic": "/c", "axes": {f"linear.{k}": {"low": 0, "high": 1, "levels": 1000} for k in "xyz"}}),
        "1000000000 combinations of levels; at most 1000000",
    ),
    "levels that are no whole number": (
        content(command={"topic": "/c", "axes": {"linear.x": {"low": 0, "high": 1, "levels": 9.0}}}),
        "command.axes.linear.x: 'levels' is 9.0, not a whole number",
    ),
    "observations that are neither names nor a list": (content(observations=3), "'observations' is missing or empty"),
    "an observation without a name": (content(observations=[ENTRY]), "observations[0]: 'name' is missing"),
    "one name twice": (
        content(observations=[{**ENTRY, "name": "it"}, {**ENTRY, "name": "it"}]),
        "observations: 'it' is not a name in one line, or occurs twice",
    ),
    "a name of two lines": (content(observations={"a\nb": ENTRY}), "is not a name in one line"),
    "an empty name": (content(observations={" ": ENTRY}), "is not a name in one line"),
    "an age beyond all numbers": (content(max_age_s=1.1e12), "'max_age_s' is 1100000000000.0, outside of [0, 1e+12]"),
    "the command as an observation": (
        content(observations={"it": ENTRY}, command={"topic": "/scan", "axes": AXIS}),
        "/scan is the command's topic",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_specification_that_cannot_be_followed_is_refused_with_the_place(name: str) -> None:
    given, problem = REFUSED[name]
    with pytest.raises(BadInput) as refused:
        spec_of(given)
    assert problem in str(refused.value)


def test_a_recipe_needs_the_type_of_each_topic() -> None:
    with pytest.raises(BadInput, match="types: the type of /scan is missing"):
        spec_of({**content(), "types": {"/cmd_vel": "geometry_msgs/msg/Twist"}}, with_types=True)


def test_a_reading_that_two_observations_share_is_read_once() -> None:
    spec = spec_of(content(observations={"a": ENTRY, "b": {**ENTRY, "high": 2.0}}))
    assert len(spec.readings) == 1
    assert isinstance(spec.sources[0], Reading)
