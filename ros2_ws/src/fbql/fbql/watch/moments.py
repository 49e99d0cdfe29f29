"""From the messages of a match to the moment that is shown: where everything is, who drives and why, the score so far."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from fbql_behaviors.core.explanation import Rule, rules
from fbql_behaviors.core.tree import Tree
from fbql_common.core.topic_names import DECISION, WHEEL_COMMAND, WORLD
from fbql_common.core.types import BehaviorOutput, Decision, Phase, WheelCommand, World
from fbql_common.wire import NS, Rejected, decode_command, decode_decision, decode_output, decode_world

from fbql.watch.picture import TRAIL_EVERY, TRAIL_POINTS, Trail

TOPIC = re.compile(rf"(?:^|/)({WORLD}|{DECISION}|{WHEEL_COMMAND}|behaviors/[^/]+)\Z")
"""The topics of a step, in any namespace; the group is the name within the namespace."""


@dataclass
class Score:
    """Outcomes of the episodes that ended; guided ones do not count, as in a summary."""

    goals: int = 0
    own_goals: int = 0
    timeouts: int = 0
    last: str = ""
    """The episode that ended last, in words, guided or not."""


@dataclass
class Moments:
    """The latest moment of a match, from its messages as they come.

    Args:
        trees: those that behaviors may answer with; without its tree an answer has no rule.
    """

    trees: Iterable[Tree] = ()
    world: World | None = None
    command: WheelCommand | None = None
    score: Score = field(default_factory=Score)

    def __post_init__(self) -> None:
        self._rules = {tree.hash: rules(tree) for tree in self.trees}
        self._outputs: dict[str, BehaviorOutput] = {}
        self._decision: Decision | None = None
        self._began_ns: int | None = None
        self._robot: deque[tuple[float, float]] = deque(maxlen=TRAIL_POINTS)
        self._ball: deque[tuple[float, float]] = deque(maxlen=TRAIL_POINTS)

    def hear(self, topic: str, data: bytes) -> None:
        """Takes a message; those of other topics, and those that no node would act on, change nothing."""
        found = TOPIC.search(topic)
        if found is None:
            return
        try:
            if found[1] == WORLD:
                self._take_world(decode_world(data))
            elif found[1] == DECISION:
                self._decision = decode_decision(data)
            elif found[1] == WHEEL_COMMAND:
                self.command = decode_command(data)
            else:
                output = decode_output(data)
                self._outputs[output.name] = output
        except Rejected:
            return

    @property
    def decision(self) -> Decision | None:
        """The latest decision of this episode."""
        decision, world = self._decision, self.world
        return decision if decision and world and decision.episode == world.episode else None

    @property
    def has_ended(self) -> bool:
        """Whether this is the end of an episode, and its decision is here."""
        world, decision = self.world, self.decision
        return world is not None and world.ended and decision is not None and decision.step == world.step

    @property
    def seconds(self) -> float | None:
        """Simulated time since the episode began [s]; None where its beginning was not heard."""
        if self.world is None or self._began_ns is None:
            return None
        return (self.world.stamp_ns - self._began_ns) / NS

    @property
    def trail(self) -> Trail:
        """Where robot and ball have been in this episode."""
        return Trail(self._robot, self._ball)

    def rule(self, behavior: str) -> Rule | None:
        """The rule that a behavior's latest answer followed; None where it did not answer, or its tree is not known."""
        output = self._outputs.get(behavior)
        known = () if output is None else self._rules.get(output.tree_hash, ())
        return known[output.leaf_id] if output and output.leaf_id < len(known) else None

    def _take_world(self, world: World) -> None:
        before = self.world
        self.world = world
        if before is not None and world.stamp_ns == before.stamp_ns and world.episode == before.episode:
            return  # published again, because nobody has answered yet
        if before is None or before.episode != world.episode or world.step <= before.step:
            self._robot.clear()
            self._ball.clear()
            self._began_ns = world.stamp_ns if world.step == 0 else None
        if world.step % TRAIL_EVERY == 0:
            self._robot.append((world.robot_x_m, world.robot_y_m))
            self._ball.append((world.ball_x_m, world.ball_y_m))
        if world.ended:
            self._count(world)

    def _count(self, world: World) -> None:
        outcome = "goal" if world.goal else "own goal" if world.own_goal else "timeout"
        seconds = self.seconds
        after = f"{world.step} steps" if seconds is None else f"{seconds:.1f} s"
        self.score.last = f"episode {world.episode}: {outcome} after {after}"
        if self.decision is not None and self.decision.phase == Phase.GUIDED:
            return
        self.score.goals += outcome == "goal"
        self.score.own_goals += outcome == "own goal"
        self.score.timeouts += outcome == "timeout"
