"""The behavior node: world states in, the tree's reference wheel velocities out.

Owns: one tree. Does not own: time, the order of steps, the use of its references.
Subscribes `world`; publishes `behaviors/<name>`. It keeps no state between steps, so a repeated world state gets the
same answer. Parameters: `BehaviorNodeParameters`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import parameter
from fbql_common.core.text import one_line
from fbql_common.core.topic_names import WORLD, behavior_topic
from fbql_common.core.types import World
from fbql_common.declare import declare_parameters
from fbql_common.inputs import Input
from fbql_common.qos import STEP_QOS
from fbql_common.spin import GraphNode, spin
from fbql_common.watch import WorldWatch
from fbql_common.wire import decode_world, encode_output
from fbql_msgs.msg import BehaviorOutput

from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.observation_loading import find_observation
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree


@dataclass(frozen=True)
class BehaviorNodeParameters:
    """Parameters of a behavior node."""

    tree_file: str = parameter("", "tree file to run; empty: the shipped tree of this behavior")
    name: str = parameter("", "name of the behavior, and so its topic behaviors/<name>; empty: the tree file's")
    observation: str = parameter(
        "",
        "FILE.py:NAME of the Observation that your own behavior's tree was made with; empty: this package's, "
        "or an installed one's",
    )


PARAMETERS = (BehaviorNodeParameters,)


class BehaviorNode(GraphNode):
    """One behavior, with the shipped tree for `behavior_name`, or the one in `tree_file`."""

    def __init__(self, behavior_name: str = "", **options: Any) -> None:
        super().__init__(behavior_name or "behavior", **options)
        parameters = declare_parameters(self, BehaviorNodeParameters)
        path = Path(parameters.tree_file) if parameters.tree_file else _shipped(behavior_name)
        tree = load_tree(path)
        observation = find_observation(tree.behavior, parameters.observation)
        self._behavior = Behavior(parameters.name or behavior_name or tree.behavior, tree, observation)
        self._publisher = self.create_publisher(BehaviorOutput, behavior_topic(self._behavior.name), STEP_QOS)
        self._input = Input(self, World, WORLD, decode_world, self._on_world, STEP_QOS)
        self._watch = WorldWatch(self, self._input)
        self.get_logger().info(
            one_line(f"{self._behavior.name}: {tree.leaf_count} leaves, tree {tree.hash[:12]}, from {path.name}")
        )

    def _on_world(self, world: World, _data: bytes) -> None:
        if not self._watch.accept(world):
            return
        try:
            output = self._behavior.answer(world)
        except BadInput as error:
            self._input.drop(str(error))
            return
        self._publisher.publish(encode_output(output))

    def close(self) -> None:
        if self._behavior.clamped_count:
            self.get_logger().info(
                f"{self._behavior.clamped_count} observations lay outside the tree's root region and were clamped"
            )


def _shipped(behavior_name: str) -> Path:
    if not behavior_name:
        raise BadInput("behavior: no tree to run; name one with --ros-args -p tree_file:=FILE")
    return shipped_trees() / f"{behavior_name}.json"


def ball_seeking() -> int:
    """Runs the ball-seeking behavior."""
    return spin([partial(BehaviorNode, "ball_seeking")])


def wall_avoiding() -> int:
    """Runs the wall-avoiding behavior."""
    return spin([partial(BehaviorNode, "wall_avoiding")])


def approaching() -> int:
    """Runs the approaching behavior."""
    return spin([partial(BehaviorNode, "approaching")])


def behavior() -> int:
    """Runs any tree: `--ros-args -p tree_file:=FILE`."""
    return spin([BehaviorNode])
