"""`fbql.play`, `fbql.train` and `fbql.induce`: the commands train and induce as functions of arrays and objects."""

from __future__ import annotations

import argparse
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from fbql_behaviors.core.explanation import describe_tree
from fbql_behaviors.core.patterns import Demonstration, Patterns
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.demonstration_storage import load_demonstrations
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree, save_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_fusion.controller_loading import resolve_controller
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.registry import fusion_parameters, learns
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.policy_storage import save_policy
from fbql_recording.core.columns import BLOCK_STEPS, Columns, Recorded, block_of
from fbql_recording.core.metrics import EpisodeRecord
from fbql_recording.core.steps import Step

from fbql.arguments import checked
from fbql.cli.observations import register_observations
from fbql.demonstrations.make_tree import (
    INDUCTION_SEED,
    InducedTree,
    InductionRequest,
    induced_tree,
    instructed,
    patterns_for,
    request_of,
)
from fbql.match.in_process import play_match
from fbql.match.options import match_from, plain, set_text

PathLike = str | Path


@dataclass(frozen=True)
class LearnedPolicy:
    """What a controller has learned. It fits that controller, and the behaviors and trees that it was learned with."""

    content: Policy
    """Controller, behaviors, hashes of the trees, and the learned arrays."""

    def save(self, path: PathLike) -> Path:
        """Writes the policy file (.npz), which `policy=` and the option --policy take. Returns its path.

        Raises:
            BadInput: a learned value is not finite.
            OSError: the file can't be written.
        """
        save_policy(Path(path), self.content)
        return Path(path)


@dataclass(frozen=True)
class PlayResult:
    """A match that was played."""

    summary: dict[str, Any]
    """The result, with the keys of summary.json, such as goals, success_rate, cost_per_goal [steps] and digest."""
    episodes: Columns
    """One row per episode, guided ones included: index, seed, steps, collisions_begun, collision_steps int64, return
    float64, phase (guided, learning, evaluation) and outcome (goal, own_goal, timeout) as text, all of shape [episodes]."""
    steps: Columns = field(default_factory=dict)
    """One row per step, with steps=True: the columns of `fbql_recording.core.columns.block_of`, such as robot_x_m [steps]
    in m and weights [steps, behaviors]; else empty."""
    policy: LearnedPolicy | None = None
    """What the controller knows at the end; None if it can't learn."""
    notes: tuple[str, ...] = ()
    """Lines about how the match started that may be unexpected, such as an option without effect."""
    path: Path | None = None
    """The run directory, with out=."""


@checked
def play(
    controller: str | None = None,
    *,
    episodes: int | None = None,
    goals: int | None = None,
    guided: int | None = None,
    seed: int = 0,
    learn: bool = True,
    preset: str | None = None,
    policy: PathLike | LearnedPolicy | Policy | None = None,
    trees: PathLike | Mapping[str, PathLike | Tree] | None = None,
    observations: Sequence[str] = (),
    max_steps: int = 4000,
    parameters: Mapping[str, Any] | None = None,
    steps: bool = False,
    out: PathLike | None = None,
) -> PlayResult:
    """Plays a match in this process, as the command `fbql train` does: the same arguments give the same digest.

    Args:
        controller: fbql (the default), fbql_model, fbql_value, fbql_literal, subsumption, uniform, one that was registered or is
            installed, or FILE.py:NAME. With `preset` alone it is subsumption.
        episodes: end after this many episodes, not counting guided ones.
        goals: end after this many goals; without `episodes` 10.
        guided: guided episodes that come first: 20 for a controller that learns and starts untrained, else 0.
        seed: of the run; every episode's seed is derived from it.
        learn: whether the controller keeps learning, if it can.
        preset: thresholds of Subsumption, tuned or paper.
        policy: what to start from: a file, a policy of an earlier result, or "none". By default the controller fbql starts
            from the shipped policy, if it has the shipped trees and is not guided; other controllers start untrained.
        trees: directory with NAME.json of each behavior, or behavior -> tree or file, for those that differ from the
            shipped ones.
        observations: FILE.py:NAME of what your own behaviors sense.
        max_steps: steps after which an episode is truncated (a timeout).
        parameters: other parameters of fusion and simulation by name (docs/parameters.md).
        steps: whether to keep every step, about 0.5 kB each.
        out: run directory to write; it must not exist. By default no file is written.

    Raises:
        BadInput: something can't be used; nothing was played.
    """
    kept = _Steps() if steps else None
    with _tree_directory(trees) as directory:
        arguments = argparse.Namespace(
            controller=controller,
            preset=preset,
            episodes=plain(episodes),
            goals=plain(goals),
            guided=plain(guided),
            max_steps=plain(max_steps),
            seed=plain(seed),
            learn=plain(learn),
            policy=str(policy) if isinstance(policy, str | Path) else None if policy is None else "none",
            trees=directory,
            observation=list(observations),
            set=[f"{name}={set_text(value)}" for name, value in (parameters or {}).items()],
            out=None if out is None else Path(out),
        )
        given = policy.content if isinstance(policy, LearnedPolicy) else policy if isinstance(policy, Policy) else None
        with _errors_name_arguments():
            match = match_from(arguments, has_policy=given is not None)
        observer = None if kept is None else kept.add
        match, session, summary = play_match(match, given, write=out is not None, step_decided=observer)
    learned, lost = None, ()
    try:
        learned = session.policy()
    except BadInput as error:  # of a controller of the user's own: the match was played all the same
        lost = (f"what was learned is lost: {error}",)
    return PlayResult(
        summary=summary._asdict(),
        episodes=_episode_columns(session.records),
        steps={} if kept is None else kept.columns(session),
        policy=None if learned is None else LearnedPolicy(learned),
        notes=(*match.notes, *lost),
        path=None if out is None else match.out,
    )


@checked
def train(controller: str = "fbql", *, learn: bool = True, **arguments: Any) -> PlayResult:
    """Plays a match in which the controller learns: `play` with learn=True. The result has the learned policy.

    Start untrained with policy="none", which by default adds 20 guided episodes at the beginning.

    Args:
        controller: one that learns.
        learn: must be true.
        arguments: of `play`.

    Raises:
        BadInput: the controller does not learn, or something can't be used.
    """
    if not learn:
        raise BadInput("train with learn=False does not learn; use play")
    name = resolve_controller(controller).name
    if not learns(fusion_parameters(name)(controller=name)):
        raise BadInput(f"controller '{controller}' does not learn; use play")
    return play(controller, **arguments)


@dataclass(frozen=True)
class InductionResult:
    """A decision tree, and how it was found."""

    tree: Tree
    value: float
    """Value of the root [nat]: as learned by method rl, exact for the others."""
    rmse_levels: float | None
    """Cross-validated error of the wheel velocities [levels of 6.29 rad/s]; None with fewer than two demonstrations."""
    curve: Sequence[float]
    """Value of the root after each trial of method rl [nat]; empty for the others."""
    patterns: Patterns
    seconds: float
    """Time that the induction took [s]."""

    @property
    def leaves(self) -> int:
        """Number of leaves."""
        return self.tree.leaf_count

    def explain(self) -> str:
        """Each leaf in words, one line per leaf: where it is, and what the robot does there."""
        return describe_tree(self.tree)

    def save(self, path: PathLike) -> Path:
        """Writes the tree file (.json), which the behavior's node and `trees=` take. Returns its path. Raises OSError."""
        save_tree(Path(path), self.tree)
        return Path(path)


@checked
def induce(
    behavior: str,
    demonstrations: PathLike | Sequence[PathLike] | Sequence[Demonstration] | Patterns | None = None,
    *,
    method: str | None = None,
    seed: int = INDUCTION_SEED,
    every: int | None = None,
    patterns: int | None = None,
    leaves: int | None = None,
    observations: Sequence[str] = (),
    **parameters: Any,
) -> InductionResult:
    """Induces a behavior's decision tree from demonstrations, as the command `fbql induce` does.

    Args:
        demonstrations: recordings (files, or directories of them), demonstrations, or patterns. By default the behavior's
            scripted instructor demonstrates, as often as the behavior's recipe says.
        method: rl (trials), dp (exact) or cart (needs scikit-learn); by default what the recipe says.
        seed: of the trials.
        every: take every n-th step of a demonstration as a pattern.
        patterns: take at most this many patterns.
        leaves: number of leaves of method cart.
        observations: FILE.py:NAME of what your own behaviors sense.
        parameters: other parameters of the induction, such as split_cost or objective (docs/parameters.md).

    Raises:
        BadInput: an unknown behavior, a value out of range, or demonstrations that can't be used.
    """
    register_observations(observations, [behavior])
    numbers = {"seed": seed, "every": every, "patterns": patterns, "leaves": leaves, **parameters}
    request = request_of(behavior, method=method, **{name: plain(value) for name, value in numbers.items()})
    found = demonstrations if isinstance(demonstrations, Patterns) else _patterns(request, demonstrations)
    made: InducedTree = induced_tree(request, found)
    return InductionResult(made.tree, made.value, made.rmse_levels, made.curve, found, made.seconds)


def _patterns(request: InductionRequest, given: Any) -> Patterns:
    if given is None:
        return patterns_for(request, instructed(request))
    items = [given] if isinstance(given, str | Path) else list(given)
    demonstrations: list[Demonstration] = []
    for item in items:
        if isinstance(item, Demonstration):
            demonstrations.append(item)
        else:
            demonstrations += load_demonstrations(Path(item), request.behavior)
    return patterns_for(request, demonstrations)


@contextmanager
def _errors_name_arguments() -> Iterator[None]:
    """A context in which an error names an argument as `play` spells it, not as the commands do."""
    try:
        yield
    except BadInput as error:
        as_argument = re.sub(r"^--(?:set )?([a-z][\w-]*)", lambda option: option[1].replace("-", "_"), str(error))
        raise BadInput(as_argument) from None


@contextmanager
def _tree_directory(trees: PathLike | Mapping[str, PathLike | Tree] | None) -> Iterator[Path | None]:
    """A directory with the tree file of each behavior; a temporary one for trees given one by one."""
    if not isinstance(trees, Mapping):
        yield None if trees is None else Path(trees)
        return
    with tempfile.TemporaryDirectory(prefix="fbql-trees-") as name:
        directory = Path(name)
        for file in shipped_trees().glob("*.json"):
            (directory / file.name).write_bytes(file.read_bytes())
        for behavior, tree in trees.items():
            path = directory / f"{behavior}.json"
            path.unlink(missing_ok=True)
            save_tree(path, tree if isinstance(tree, Tree) else load_tree(Path(tree)))
        yield directory


class _Steps:
    """Collects steps as columns, a block at a time."""

    def __init__(self) -> None:
        self._block: list[Step] = []
        self._blocks: list[Columns] = []
        self._behaviors: tuple[str, ...] = ()

    def add(self, world: World, outputs: Sequence[BehaviorOutput], command: WheelCommand, decision: Decision) -> None:
        self._behaviors = tuple(decision.behaviors)
        self._block.append(Step(world.stamp_ns, world.episode, world.step, world, tuple(outputs), command, decision))
        if len(self._block) == BLOCK_STEPS:
            self._finish_block()

    def columns(self, session: SoccerSession) -> Columns:
        self._behaviors = session.behaviors
        if self._block or not self._blocks:
            self._finish_block()
        return {name: np.concatenate([block[name] for block in self._blocks]) for name in self._blocks[0]}

    def _finish_block(self) -> None:
        recorded = Recorded(world=True, behaviors=self._behaviors, outputs=True, command=True, decision=True)
        self._blocks.append(block_of(self._block, recorded))
        self._block.clear()


def _episode_columns(records: Sequence[EpisodeRecord]) -> Columns:
    return {
        "index": np.array([each.index for each in records], np.int64),
        "phase": np.array([each.phase.name.lower() for each in records], np.str_),
        "seed": np.array([each.seed for each in records], np.int64),
        "outcome": np.array([each.outcome for each in records], np.str_),
        "steps": np.array([each.steps for each in records], np.int64),
        "collisions_begun": np.array([each.collisions_begun for each in records], np.int64),
        "collision_steps": np.array([each.collision_steps for each in records], np.int64),
        "return": np.array([each.return_ for each in records], np.float64),
    }
