"""The match without ROS: the same core objects as the graph, one after the other in one loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_fusion.core.session import Session
from fbql_sim.core.world_loop import WorldLoop

StepObserver = Callable[[World, Sequence[BehaviorOutput], WheelCommand, Decision], None]


def play(
    session: Session,
    loop: WorldLoop,
    behaviors: Sequence[Behavior],
    episode_ended: Callable[[], bool],
    step_decided: StepObserver | None = None,
) -> None:
    """Plays a session to its end.

    Args:
        behaviors: in the order of the session's.
        episode_ended: called after every episode; False ends the match there.
        step_decided: called after every decision, if given.
    """
    answers = [behavior.answer for behavior in behaviors]
    while (begun := session.next_episode()) is not None:
        world = loop.reset(*begun)
        while True:
            outputs = [answer(world) for answer in answers]
            command, decision = session.decide(world, outputs)
            if step_decided is not None:
                step_decided(world, outputs, command, decision)
            if world.terminated or world.truncated:
                break
            world = loop.step(command.left_rad_s, command.right_rad_s)
        if not episode_ended():
            return
