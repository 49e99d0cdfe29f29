"""The match without ROS: the same core objects as the graph, one after the other in one loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.observation_loading import find_observation
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_fusion.core.session import Session
from fbql_fusion.policy_storage import load_policy
from fbql_fusion.shipped import shipped_policy
from fbql_sim.core.world_loop import WorldLoop

from fbql.match.options import Match

StepObserver = Callable[[World, Sequence[BehaviorOutput], WheelCommand, Decision], None]


class Parts(NamedTuple):
    """What a match is made of."""

    session: Session
    loop: WorldLoop
    behaviors: list[Behavior]
    """In the order of the session's."""


def parts_of(match: Match) -> Parts:
    """Loads the trees and the policy of a match, and makes what plays it.

    Raises:
        BadInput: a file or a parameter that can't be used, or a policy of another controller, behaviors or trees.
    """
    behaviors: list[Behavior] = []
    for name, path in match.behaviors.items():
        tree = load_tree(path)
        if name in OBSERVATIONS and tree.behavior != name:
            raise BadInput(f"{path}: a tree of behavior '{tree.behavior}', not of '{name}'; use the right file")
        try:
            observation = find_observation(tree.behavior, match.observations.get(tree.behavior, ""))
            behaviors.append(Behavior(name, tree, observation))
        except BadInput as error:
            raise BadInput(f"{path}: {error}") from None
    return Parts(_session_of(match), WorldLoop(match.simulation), behaviors)


def _session_of(match: Match) -> Session:
    policy = None if match.policy is None else load_policy(match.policy)
    try:
        return Session(match.fusion, policy)
    except BadInput as error:
        if policy is None:
            raise
        ships = "; it is the one that ships: --policy none starts without" if match.policy == shipped_policy() else ""
        raise BadInput(f"{match.policy}: {error}{ships}") from None


def own_observation(match: Match, name: str) -> dict[str, str]:
    """The parameter of a behavior's node that says what it senses, where the user said it."""
    source = match.observations.get(load_tree(match.behaviors[name]).behavior) if match.observations else None
    return {"observation": source} if source else {}


def rehearse(match: Match) -> None:
    """Plays the first step, so that whatever does not fit together shows before anything is begun. Raises BadInput."""
    session, loop, behaviors = parts_of(match)
    begun = session.next_episode()
    assert begun is not None
    world = loop.reset(*begun)
    session.decide(world, [behavior.answer(world) for behavior in behaviors])


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
