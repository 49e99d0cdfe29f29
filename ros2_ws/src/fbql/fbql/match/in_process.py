"""The match without ROS: the same core objects as the graph, in one loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from time import monotonic
from typing import NamedTuple

from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.observation_loading import find_observation
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, Decision, Phase, WheelCommand, World
from fbql_common.files import removed_on_failure
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.core.tasks.soccer.world_model.soccer_imagination import PlayingTree
from fbql_fusion.policy_storage import learned_bytes, load_policy
from fbql_fusion.shipped import shipped_policy
from fbql_recording.core.metrics import Summary
from fbql_recording.run_directory import RunDirectory, own_revision, software_versions
from fbql_sim.core.world_loop import WorldLoop

from fbql.cli.output import complain
from fbql.match.options import Match, make_run_directory
from fbql.match.trees import playing_trees

StepObserver = Callable[[World, Sequence[BehaviorOutput], WheelCommand, Decision], None]


class Parts(NamedTuple):
    """The objects that play a match."""

    session: SoccerSession
    loop: WorldLoop
    behaviors: list[Behavior]
    """In the order of the session's."""


class Played(NamedTuple):
    """A match that was played."""

    match: Match
    """With the run directory, if one was created."""
    session: SoccerSession
    summary: Summary


def parts_of(match: Match, policy: Policy | None = None) -> Parts:
    """Loads the trees and the policy of a match, and makes what plays it.

    Args:
        policy: takes the place of the match's policy file.

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
    trees = playing_trees(behavior.tree for behavior in behaviors)
    session = SoccerSession(match.fusion, policy, trees) if policy is not None else _session_of(match, trees)
    return Parts(session, WorldLoop(match.simulation), behaviors)


def _session_of(match: Match, trees: Sequence[PlayingTree]) -> SoccerSession:
    policy = None if match.policy is None else load_policy(match.policy)
    try:
        return SoccerSession(match.fusion, policy, trees)
    except BadInput as error:
        if policy is None:
            raise
        hint = "; it is the shipped one: --policy none starts untrained" if match.policy == shipped_policy() else ""
        raise BadInput(f"{match.policy}: {error}{hint}") from None


def own_observation(match: Match, name: str) -> dict[str, str]:
    """The parameter that names a behavior's observation to its node, where the user gave a file."""
    source = match.observations.get(load_tree(match.behaviors[name]).behavior) if match.observations else None
    return {"observation": source} if source else {}


def rehearse(match: Match, policy: Policy | None = None) -> None:
    """Plays the first step, so that any mismatch shows before anything is written. Raises BadInput."""
    session, loop, behaviors = parts_of(match, policy)
    begun = session.next_episode()
    assert begun is not None
    world = loop.reset(*begun)
    session.decide(world, [behavior.answer(world) for behavior in behaviors])


def play(
    session: SoccerSession,
    loop: WorldLoop,
    behaviors: Sequence[Behavior],
    episode_ended: Callable[[], bool],
    step_decided: StepObserver | None = None,
) -> None:
    """Plays a session to its end.

    Args:
        behaviors: in the order of the session's.
        episode_ended: called after every episode; False ends the match there.
        step_decided: called after every decision, if given. Without it, behaviors whose answer nobody needs, because another
            one is being held, are not asked.
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
            while step_decided is None and (driver := session.held_driver) >= 0:
                held = session.hold(world, answers[driver](world))
                if held is None:
                    break
                world = loop.step(*held)
        if not episode_ended():
            return


def play_match(
    match: Match,
    policy: Policy | None = None,
    *,
    write: bool = True,
    episode_ended: Callable[[SoccerSession, float], bool] = lambda _session, _elapsed_s: True,
    step_decided: StepObserver | None = None,
) -> Played:
    """Plays a match and writes its run directory: the command `train`, and `fbql.play`.

    Args:
        policy: takes the place of the match's policy file.
        write: False: no file is written.
        episode_ended: called after every episode with the session and the time since the start [s]; False ends the match.
        step_decided: called after every decision, if given.

    Raises:
        BadInput: something does not fit together, or the run directory can't be made; nothing was played.
    """
    rehearse(match, policy)
    session, loop, behaviors = parts_of(match, policy)
    files = None
    if write:
        match = make_run_directory(match)
        with removed_on_failure(match.out):
            files = RunDirectory(match.out, _config(match), list(match.behaviors.values()), complain)
    begun_s = monotonic()

    def ended() -> bool:
        if files is not None:
            files.add_episode(session.records[-1])
        return episode_ended(session, monotonic() - begun_s)

    play(session, loop, behaviors, ended, step_decided)
    wall_s = monotonic() - begun_s
    if files is None:
        return Played(match, session, session.summary(wall_s))
    files.write_policy(lambda: learned_bytes(session))
    summary = session.summary(wall_s, messages_recorded=0, incomplete=files.failed)
    files.write_summary(summary)
    files.close()
    return Played(match, session, summary._replace(incomplete=files.failed))


def status_of(session: SoccerSession, elapsed_s: float) -> dict[str, str]:
    """The fields of `match.result.status_line` after an episode."""
    record = session.records[-1]
    outcomes = [each.outcome for each in session.records if each.phase is not Phase.GUIDED]
    return {
        "episode": str(record.index),
        "phase": record.phase.name.lower(),
        "step": str(record.steps),
        "goals": str(outcomes.count("goal")),
        "own_goals": str(outcomes.count("own_goal")),
        "timeouts": str(outcomes.count("timeout")),
        "steps_per_s": f"{session.steps / elapsed_s:.0f}",
        "weights": "",
    }


def _config(match: Match) -> dict[str, object]:
    trees = {name: {"tree_file": str(path), **own_observation(match, name)} for name, path in match.behaviors.items()}
    return {
        "versions": software_versions(),
        "git_revision": own_revision(),
        "parameters": {
            "simulator": asdict(match.simulation),
            "fusion": {
                **asdict(match.fusion),
                "policy": str(match.policy or ""),
                "controller_file": match.controller_file,
            },
            **trees,
        },
    }
