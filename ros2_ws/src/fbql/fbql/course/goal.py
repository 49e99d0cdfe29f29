"""Lesson 1: who drove when the ball was hit for the last time before a goal, and by which rule."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import hypot
from pathlib import Path

from fbql_behaviors.core.explanation import rules
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, Decision, World
from fbql_recording.core.steps import Step
from fbql_recording.run import open_run

from fbql.course.verdict import Verdict, leaf_of, made, words_of
from fbql.replay.recomputation import recorded_trees

RUN = "goals"
SEEN_M_S = 0.001
"""The resolution of speeds in the report [m/s]."""
NEAR = 12
"""Half the width of the stretch of steps that a hint names."""


def check(answer: Sequence[str], work: Path) -> Verdict:
    """Compares the answer BEHAVIOR LEAF with the recording."""
    behavior, leaf = words_of(answer, "BEHAVIOR LEAF", "ball_seeking 12")
    leaf_id = leaf_of(leaf)
    run = open_run(made(work / RUN))
    if behavior not in run.behaviors:
        raise BadInput(f"--check: no behavior '{behavior}' played; choose one of: {', '.join(run.behaviors)}")
    steps = first_goal(run.steps(), str(run.path))
    place = last_hit(steps)
    choices = [_driven(step) for step in steps[place : place + 2]]
    hit, episode = steps[place].step, steps[place].episode
    where = f"episode {episode}, steps {max(hit - NEAR, 0)} to {hit + NEAR}"
    if behavior not in [output.name for output in choices]:
        return Verdict(
            False,
            f"{behavior} did not drive at the last hit: in the report, in {where}, look for the last step after which "
            '"ball rolls" gets larger, and read who drives there',
        )
    if (behavior, leaf_id) not in [(output.name, output.leaf_id) for output in choices]:
        return Verdict(
            False,
            f"it was {behavior}, but not with leaf {leaf_id}: in the report, in {where}, stop at the last step after which "
            f'"ball rolls" gets larger, and read the leaf of {behavior} there',
        )
    output = next(each for each in choices if (each.name, each.leaf_id) == (behavior, leaf_id))
    tree = recorded_trees(run).get(output.tree_hash)
    rule = "" if tree is None else f' by its rule "{rules(tree)[leaf_id].sentence}"'
    return Verdict(
        True,
        f"at step {hit} of episode {episode} {behavior} drove{rule}; the ball left at {_speed(steps[place + 1]):.2f} m/s, "
        f"and {steps[-1].step - hit} steps later it was in the goal",
    )


def first_goal(steps: Iterable[Step], where: str) -> list[Step]:
    """The steps of the first episode that ended in a goal. Raises BadInput if there is none."""
    episode: list[Step] = []
    for step in steps:
        if step.step == 0:
            episode = []
        episode.append(step)
        if step.world is not None and step.world.goal:
            return episode
    raise BadInput(f"{where}: no episode in it ended in a goal; play with --goals 3")


def last_hit(steps: Sequence[Step]) -> int:
    """The index of the last step from which to the next one the ball got faster: it was hit. Raises BadInput."""
    for place in range(len(steps) - 2, -1, -1):
        if _speed(steps[place + 1]) > _speed(steps[place]) + SEEN_M_S:
            return place
    raise BadInput("the robot never hit the ball before this goal; play again with another --seed")


def _speed(step: Step) -> float:
    world = _world(step)
    return hypot(world.ball_vx_m_s, world.ball_vy_m_s)


def _world(step: Step) -> World:
    if step.world is None:
        raise BadInput(f"step {step.step} of episode {step.episode} has no world state; play and record again")
    return step.world


def _driven(step: Step) -> BehaviorOutput:
    """The answer of the behavior that drove. Raises BadInput if none did so alone."""
    decision: Decision | None = step.decision
    output = None if decision is None or decision.driver < 0 else step.outputs[decision.driver]
    if output is None:
        raise BadInput(
            f"step {step.step} of episode {step.episode}: no behavior drives alone; play with --controller subsumption"
        )
    return output
