"""The layout for Foxglove and the configuration for RViz name topics, types, fields and frames that are there."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from importlib import import_module
from math import isclose
from typing import Any

import pytest
import yaml
from fbql_behaviors.behavior_node import BehaviorNode
from fbql_common.core.topic_names import DECISION, WHEEL_COMMAND, WORLD, behavior_topic
from fbql_common.core.types import FIELD_FRAME
from fbql_msgs.msg import BehaviorOutput, FusionDecision, WheelCommand, WorldState
from fbql_sim.simulator_node import SimulatorNode
from fbql_sim.views import markers_msg
from hand_driven import shipped_tree, world_at
from places import ROOT
from visualization_msgs.msg import Marker

VIEWS = ROOT / "ros2_ws" / "src" / "fbql_sim" / "views"
RVIZ = yaml.safe_load((VIEWS / "fbql.rviz").read_text())["Visualization Manager"]
LAYOUT = json.loads((VIEWS / "fbql.foxglove.json").read_text())
DISPLAYS = {
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/Pose": "geometry_msgs/msg/PoseStamped",
}
BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")
OTHERS = {f"/{WHEEL_COMMAND}": WheelCommand, f"/{DECISION}": FusionDecision}
"""What fusion publishes: it takes a run to start it."""


@pytest.fixture
def published(bench) -> dict[str, Any]:
    """The class of every topic of the graph, as the nodes themselves tell it."""
    nodes = [bench.add(SimulatorNode)]
    nodes += [bench.add(BehaviorNode, name, tree_file=str(shipped_tree(name))) for name in BEHAVIORS]
    found: dict[str, Any] = dict(OTHERS)
    for node in nodes:
        for topic, (kind, *_) in node.get_publisher_names_and_types_by_node(node.get_name(), node.get_namespace()):
            package, _, name = kind.split("/")
            found[topic.removeprefix(bench.namespace)] = getattr(import_module(f"{package}.msg"), name)
    assert found[f"/{WORLD}"] is WorldState and found[f"/{behavior_topic('approaching')}"] is BehaviorOutput
    return found


def texts_in(value: Any) -> Iterator[str]:
    """Every text that stands in a layout, as a value or a name."""
    if isinstance(value, dict):
        yield from value
        yield from texts_in(list(value.values()))
    elif isinstance(value, list):
        for each in value:
            yield from texts_in(each)
    elif isinstance(value, str):
        yield value


def test_rviz_shows_what_is_published_with_the_same_quality_of_service(published):
    assert RVIZ["Global Options"]["Fixed Frame"] == FIELD_FRAME
    assert len(RVIZ["Displays"]) == 4
    for display in RVIZ["Displays"]:
        topic = display["Topic"]
        kind = published[topic["Value"]]
        assert DISPLAYS[display["Class"]] == f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
        assert (topic["Reliability Policy"], topic["Durability Policy"], topic["Depth"]) == ("Reliable", "Volatile", 10)


def test_foxglove_shows_topics_and_fields_that_are_published(published):
    topics = [text for text in texts_in(LAYOUT["configById"]) if text.startswith("/")]
    assert len(topics) > 20
    for text in topics:
        topic, _, field = text.partition(".")
        kind = published[topic]
        if field:
            name, index = re.fullmatch(r"(\w+)(\[\d+\])?", field).groups()
            is_sequence = kind.get_fields_and_field_types()[name].startswith("sequence")
            assert is_sequence == (index is not None), text
            assert index is None or int(index[1:-1]) < len(BEHAVIORS)


def test_weights_in_foxglove_are_labelled_in_the_order_of_the_graph():
    for panel in ("Plot!weights", "Plot!q"):
        assert [path["label"] for path in LAYOUT["configById"][panel]["paths"]] == list(BEHAVIORS)


def test_every_panel_has_its_place_once():
    def leaves(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else [*leaves(node["first"]), *leaves(node["second"])]

    assert sorted(leaves(LAYOUT["layout"])) == sorted(LAYOUT["configById"])


def test_markers_can_be_drawn_in_the_frame_that_both_look_at():
    markers = markers_msg(world_at(0, 3)).markers
    assert LAYOUT["configById"]["3D!field"]["followTf"] == FIELD_FRAME
    assert len({(marker.ns, marker.id) for marker in markers}) == len(markers) == 6
    for marker in markers:
        assert marker.header.frame_id == FIELD_FRAME
        assert marker.color.a == 1.0
        turn = marker.pose.orientation
        assert isclose(turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2, 1.0, abs_tol=1e-9)
        assert marker.scale.x > 0 and (marker.type == Marker.LINE_LIST or (marker.scale.y > 0 and marker.scale.z > 0))
        assert marker.lifetime.sec == marker.lifetime.nanosec == 0
        assert len(marker.points) % 2 == 0
