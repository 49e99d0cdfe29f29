"""Lesson 6: the student's own controller or behavior: it plays, plays the same again, and is worth something."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fbql_behaviors.core.observation import Observation
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.observation_loading import load_observation
from fbql_common.core.errors import BadInput
from fbql_common.own_code import load_module, split_source
from fbql_fusion.controller_loading import resolve_controller
from fbql_fusion.core.controllers.parameters import SessionParameters
from fbql_fusion.core.registry import fusion_parameters, learns

from fbql.api import induce, play, train
from fbql.cli.words import counted
from fbql.course.verdict import Verdict, words_of

MATCH: Mapping[str, Any] = {"episodes": 10, "max_steps": 1500, "seed": 6}
LESSONS: Mapping[str, Any] = {"episodes": 30, "max_steps": 1500, "seed": 5}
"""The match that a learner trains in, after its guided episodes."""
PATTERNS = 400
LEAST_SHARE = 0.01
"""Of the steps; the student's behavior must drive in at least this share."""


def check(answer: Sequence[str], work: Path) -> Verdict:
    """Plays with the code of FILE.py, or FILE.py:NAME."""
    (source,) = words_of(answer, "FILE.py", "runs/course/my_controller.py")
    path, name = split_source(source)
    module = vars(load_module(path, "a controller or an Observation"))
    named = [module[name]] if name in module else list(module.values())
    is_behavior = any(isinstance(value, Observation) for value in named)
    return _check_behavior(source) if is_behavior else _check_controller(source)


def _check_controller(source: str) -> Verdict:
    """It scores more than equal weights do from the same starts, and plays the same again with the same seed."""
    ours, again = (_played(source) for _ in range(2))
    if ours["digest"] != again["digest"]:
        return Verdict(False, _not_the_same("the controller"))
    equal = play("uniform", **MATCH).summary
    if ours["goals"] <= equal["goals"]:
        return Verdict(
            False,
            f"it scored {_result(ours)}; equal weights scored {_result(equal)} from the same starts: score more than they do "
            "(as in lesson 1: who should drive at a wall, who beside the ball, who behind it?)",
        )
    return Verdict(
        True,
        f"it scored {_result(ours)}; equal weights {_result(equal)} from the same starts; the same seed gives the same match",
    )


def _played(source: str) -> Mapping[str, Any]:
    """The summary of a match; a learner learns before it, and plays it frozen."""
    name = resolve_controller(source).name
    if not learns(fusion_parameters(name)(controller=name)):
        return play(source, **MATCH).summary
    learned = train(source, policy="none", **LESSONS)
    return play(source, policy=learned.policy, learn=False, **MATCH).summary


def _check_behavior(source: str) -> Verdict:
    """Its tree is more than one command, it drives now and then, and it plays the same again with the same seed."""
    behavior, observation, _ = load_observation(source)
    if behavior in SessionParameters().behaviors:
        raise BadInput(f"{source}: '{behavior}' is a behavior of the project; give yours another name")
    if observation.instructor is None:
        raise BadInput(
            f"{source}: '{behavior}' has no instructor; the check makes its tree from the instructor's demonstrations"
        )
    found = induce(behavior, observations=[source], patterns=PATTERNS)
    if found.leaves < 2:
        return Verdict(
            False,
            f"the tree of {behavior} is a single leaf, the same command everywhere: what it senses must tell apart the "
            "places where the instructor drives differently",
        )
    ours, again = (_team(source, behavior, found.tree) for _ in range(2))
    if ours.summary["digest"] != again.summary["digest"]:
        return Verdict(False, _not_the_same("what it senses"))
    share = float((ours.steps["driver"] == ours.steps["weights"].shape[1] - 1).mean())
    if share < LEAST_SHARE:
        return Verdict(
            False,
            f"{behavior} drove in {100 * share:.1f} % of the steps of a match, and at least {100 * LEAST_SHARE:g} % are needed: it drives "
            "only inside the ranges of its features; widen them",
        )
    without = play("subsumption", **MATCH).summary
    return Verdict(
        True,
        f"the tree of {behavior} has {found.leaves} leaves; it drove in {100 * share:.0f} % of the steps, and the team scored "
        f"{_result(ours.summary)}; without it {_result(without)}; the same seed gives the same match",
    )


def _team(source: str, behavior: str, tree: Tree) -> Any:
    """A match of the usual behaviors and this one, which is the highest layer."""
    usual = SessionParameters().behaviors
    layers = {"behaviors": [*usual, behavior], "layers": [behavior, "wall_avoiding", "approaching", "ball_seeking"]}
    return play("subsumption", trees={behavior: tree}, observations=[source], parameters=layers, steps=True, **MATCH)


def _not_the_same(what: str) -> str:
    return (
        f"the same seed gave two different matches: {what} must depend on its arguments alone; take random numbers from the "
        "generator that it is given"
    )


def _result(summary: Mapping[str, Any]) -> str:
    steps = "" if summary["cost_per_goal"] is None else f", {summary['cost_per_goal']:.0f} steps per goal"
    return f"{counted(summary['goals'], 'goal')} in {counted(summary['episodes'], 'episode')}{steps}"
