"""A tree that drives any robot: observations from messages in, commands out."""

from __future__ import annotations

from typing import Any, NamedTuple

from fbql_common.core.command_space import Command
from fbql_common.core.errors import BadInput
from fbql_common.core.twist import Twist

from fbql_behaviors.core.bag_spec import spec_of
from fbql_behaviors.core.senses import Senses
from fbql_behaviors.core.tree import Tree

_FIELDS = {
    "linear.x": "linear_x_m_s",
    "linear.y": "linear_y_m_s",
    "linear.z": "linear_z_m_s",
    "angular.x": "angular_x_rad_s",
    "angular.y": "angular_y_rad_s",
    "angular.z": "angular_z_rad_s",
}
"""The field of `Twist` of each axis."""


class TwistAnswer(NamedTuple):
    """A tree's answer, or why there is none."""

    twist: Twist | None
    leaf_id: int = -1
    clamped: bool = False
    """Whether the observation lay outside the root region, where the leaf at its edge answers."""
    problem: str = ""


class TwistBehavior:
    """Follows a tree's recipe, and answers with the tree's command as a Twist."""

    def __init__(self, tree: Tree) -> None:
        """Raises BadInput for a tree without a recipe."""
        if not tree.recipe:
            raise BadInput(
                f"the tree of '{tree.behavior}' has no recipe of its observations; make one with induce --bag, or play a "
                "soccer behavior with `ros2 run fbql_behaviors behavior`"
            )
        self.tree = tree
        self.spec = spec_of(tree.recipe, with_types=True)
        self.types: dict[str, str] = {topic: self.spec.content["types"][topic] for topic in self.spec.topics}
        """The message type of each topic that is sensed."""
        self._senses = Senses(self.spec)
        self._fields = [_FIELDS[axis.name] for axis in tree.commands.axes]
        self.clamped_count = 0

    def hear(self, topic: str, message: Any, now_ns: int) -> None:
        """Takes in a message that was received at a time. Raises BadInput when it lacks what the recipe reads."""
        self._senses.hear(topic, self._senses.read(topic, message), now_ns)

    def answer(self, now_ns: int) -> TwistAnswer:
        """The tree's command at a time; none while an observation is missing, too old or not finite."""
        observed = self._senses.observe(now_ns)
        if observed.problem:
            return TwistAnswer(None, problem=observed.problem)
        clamped = not self.tree.contains(observed.values)
        self.clamped_count += clamped
        leaf_id, *command = self.tree.answer(observed.values)
        return TwistAnswer(self._twist(tuple(command)), leaf_id, clamped)

    def _twist(self, command: Command) -> Twist:
        return Twist(**dict(zip(self._fields, command, strict=True)))
