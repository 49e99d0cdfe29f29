"""Lesson 2: demonstrations, and a tree made from them that finds the ball."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import degrees
from pathlib import Path

from fbql_behaviors.core.exercises import Attempt, exercise_of, mean_cost
from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.patterns import patterns_of
from fbql_behaviors.core.recipes import recipe_of
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.geometry import ball_distance_and_bearing

from fbql.cli.places import command_text
from fbql.course.verdict import Verdict, made, words_of
from fbql.demonstrations.origins import recordings_of
from fbql.demonstrations.practice import PracticeGround, measure, measuring_seeds
from fbql.demonstrations.replay import verify

BEHAVIOR = "ball_seeking"
DEMONSTRATIONS, TREE = "driving", f"trees/{BEHAVIOR}.json"
STARTS, NEEDED = 20, 15
_SEED = 2


def check(answer: Sequence[str], work: Path) -> Verdict:
    """Drives the demonstrations again, and lets the tree seek the ball."""
    words_of(answer, "", "")
    recordings = recordings_of([made(work / DEMONSTRATIONS)], BEHAVIOR)
    if difference := verify(recordings).first_difference:
        return Verdict(False, f"your demonstrations, driven again, come out differently: {difference}; record new ones")
    tree = load_tree(made(work / TREE))
    demonstrations = [each for recording in recordings for each in recording.demonstrations]
    recipe = recipe_of(BEHAVIOR)
    patterns = patterns_of(demonstrations, observation_of(BEHAVIOR), recipe.every, recipe.patterns)
    if tree.origin.get("patterns_sha256") != patterns.sha256:
        command = f"{command_text('induce')} {BEHAVIOR} --demos {work / DEMONSTRATIONS} --out {work / TREE}"
        return Verdict(False, f"the tree was not made from these demonstrations; make it again: {command}")
    attempts = attempts_of(tree)
    arrived = sum(attempt.arrived for attempt in attempts)
    if arrived < NEEDED:
        return Verdict(
            False,
            f"your tree reaches the ball from {arrived} of {STARTS} starts, and at least {NEEDED} are needed; at most of the "
            f"starts where it fails the ball is {_where_it_fails(attempts)}: demonstrate more of those, and make the tree again",
        )
    return Verdict(
        True,
        f"{len(demonstrations)} demonstrations, driven again, are the same in every step; your tree of {tree.leaf_count} leaves "
        f"reaches the ball from {skill_text(attempts)}; the shipped one from "
        f"{skill_text(attempts_of(load_tree(shipped_trees() / f'{BEHAVIOR}.json')))}",
    )


def attempts_of(tree: Tree) -> list[Attempt]:
    """The tree drives alone to the ball, from the same starts for every tree."""
    return measure(tree, exercise_of(BEHAVIOR), PracticeGround(BEHAVIOR), measuring_seeds(_SEED, STARTS))


def skill_text(attempts: Sequence[Attempt]) -> str:
    """How well a tree seeks the ball: `18 of 20 starts (121 steps on average)`."""
    exercise = exercise_of(BEHAVIOR)
    arrived = sum(attempt.arrived for attempt in attempts)
    mean = mean_cost(attempts, exercise)
    missed = "" if arrived == len(attempts) else f", {exercise.max_steps} for each that fails"
    return f"{arrived} of {len(attempts)} starts ({mean:.0f} steps on average{missed})"


def _where_it_fails(attempts: Sequence[Attempt]) -> str:
    """Where the ball is at most of the starts that did not reach it, as the robot sees it."""
    ground = PracticeGround(BEHAVIOR)
    seeds = measuring_seeds(_SEED, STARTS)
    failed = [ground.reset(seed) for seed, attempt in zip(seeds, attempts, strict=True) if not attempt.arrived]
    sides = Counter(_side(degrees(ball_distance_and_bearing(world)[1])) for world in failed)
    return sides.most_common(1)[0][0]


def _side(bearing_degrees: float) -> str:
    if abs(bearing_degrees) < 45.0:
        return "ahead"
    if abs(bearing_degrees) > 135.0:
        return "behind the robot"
    return "to the left" if bearing_degrees > 0.0 else "to the right"
