"""The contents of a report: the steps of a run as packed blocks, and everything needed to describe them in words."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TextIO

import numpy as np
from fbql_behaviors.core.explanation import is_direction, motion_of, rules, speed_of
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.storage import tree_from_bytes
from fbql_common.core import recording_names
from fbql_common.core.errors import BadInput
from fbql_common.core.field import AXLE_M, BALL_RADIUS_M, FIELD, ROBOT_SIDE_M, WHEEL_RADIUS_M
from fbql_common.core.types import Phase
from fbql_recording.core.columns import BLOCK_STEPS, Columns, Recorded, block_of
from fbql_recording.core.episodes import Episode
from fbql_recording.core.packing import FLOAT32, Packing, pack
from fbql_recording.core.steps import Step
from fbql_recording.run import Run

from fbql.report.texts import FEATURES, plain

UNIT = 1e-4
"""Unit of every measured number: 0.1 mm, 0.1 mm/s, 1e-4 rad, 1e-4 rad/s, 1e-4 of a weight, 0.1 ms."""
_EXACT = ("q", "reward")
"""Kept as float32: their range is not known."""
_MOST = 1000
"""Most names of controllers, trees and other texts that are listed."""
_DAY_NS = 24 * 3600 * 10**9


@dataclass
class PackedSteps:
    """Steps in the form that a page takes, and what the numbers in them stand for; both grow as steps come."""

    recorded: Recorded
    trees: dict[str, Tree] = field(default_factory=dict[str, Tree])
    """By hash: those that are known."""
    episodes: list[Episode] = field(default_factory=list[Episode])
    steps: int = 0
    controllers: list[str] = field(default_factory=list[str])
    commands: list[str] = field(default_factory=list[str])
    """What commands do, in words, in order of appearance."""
    tree_hashes: list[str] = field(default_factory=list[str])
    """Of the trees that behaviors answered with, in order of appearance."""
    packings: list[tuple[Packing, ...]] = field(default_factory=list[tuple[Packing, ...]])
    zero_ns: int = 0
    """The stamp from which seconds are counted; 0 in simulated time."""

    def packed(self, steps: Sequence[Step]) -> tuple[int, int, str]:
        """A block of steps: their number, the index of its packing in `packings`, and the columns in base64."""
        columns = block_columns(self, steps)
        packings = tuple(Packing(name, unit_of(name, column)) for name, column in columns.items())
        if packings not in self.packings:
            self.packings.append(packings)
        data = base64.b64encode(pack(columns, packings)).decode()
        return len(steps), self.packings.index(packings), data


@dataclass(kw_only=True)
class Contents(PackedSteps):
    """The contents of a run's report."""

    run: Run
    notes: list[str] = field(default_factory=list[str])
    """Problems, in addition to the warnings of the run."""
    blocks: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    """For each block its number of steps, and the index of its packing in `packings`."""


def read_contents(run: Run, out: TextIO, progress: Callable[[int], None]) -> Contents:
    """Reads a run once from its first step to its last, with one block of steps in memory.

    Args:
        out: gets a line of base64 for each block.
        progress: called now and then with the number of steps read.

    Raises:
        BadInput: the run has no steps; `Corrupt`.
    """
    contents = Contents(run.recorded, run=run)
    for name, data in run.attachments.items():
        if name.startswith(recording_names.TREES):
            try:
                tree = tree_from_bytes(data)
                contents.trees[tree.hash] = tree
            except BadInput as error:
                contents.notes.append(f"{name}: {error}")
    if run.start_ns is not None and run.start_ns >= _DAY_NS:
        contents.zero_ns = run.start_ns
    block: list[Step] = []

    def watched() -> Iterator[Step]:
        for step in run.steps():
            yield step
            block.append(step)
            if len(block) == BLOCK_STEPS:
                _write(contents, block, out)
                progress(contents.steps)

    contents.episodes = run.episodes(watched())
    if block:
        _write(contents, block, out)
    if not contents.steps:
        raise BadInput(f"{run.path}: it has no steps; there is nothing to report")
    return contents


def _write(contents: Contents, steps: list[Step], out: TextIO) -> None:
    rows, packing, data = contents.packed(steps)
    contents.blocks.append((rows, packing))
    contents.steps += rows
    out.write(f"{data}\n")
    steps.clear()


def unit_of(name: str, column: Any) -> float:
    """The unit to which a column is rounded."""
    if name.split(".")[0] in _EXACT:
        return FLOAT32
    return UNIT if column.dtype == np.float64 else 1.0


def block_columns(contents: PackedSteps, steps: Sequence[Step]) -> Columns:
    """The columns of docs/recordings.md, flat (weights.0 is the weight of the first behavior), and some more.

    These are time_s, begins_again, and as indices tree.K (the tree that behavior K answered with), controller, command_words.
    """
    behaviors = contents.recorded.behaviors
    columns: Columns = {}
    for name, column in block_of(steps, contents.recorded).items():
        if name == "stamp_ns":
            columns["time_s"] = (column - contents.zero_ns) / 1e9
            continue
        kind, _, behavior = name.partition(".")
        key = f"{kind}.{behaviors.index(behavior)}" if behavior else name
        if column.ndim == 1:
            columns[key] = column
        else:
            columns |= {f"{key}.{index}": column[:, index] for index in range(column.shape[1])}
    columns["begins_again"] = np.array([step.begins_again for step in steps])
    columns["controller"] = np.array([_controller(contents, step) for step in steps])
    columns["command_words"] = np.array([_command_words(contents, step) for step in steps])
    for index in range(len(behaviors)):
        columns[f"tree.{index}"] = np.array([_tree(contents, step, index) for step in steps])
    return columns


def _controller(contents: PackedSteps, step: Step) -> int:
    return -1 if step.decision is None else _place(contents.controllers, step.decision.controller)


def _command_words(contents: PackedSteps, step: Step) -> int:
    if step.command is None:
        return -1
    wheels = step.command[3:5]
    return _place(contents.commands, f"{speed_of(*wheels)} {motion_of(*wheels).value}".strip())


def _tree(contents: PackedSteps, step: Step, behavior: int) -> int:
    output = step.outputs[behavior]
    return -1 if output is None else _place(contents.tree_hashes, output.tree_hash)


def _place(known: list[str], value: str) -> int:
    """The index of a value in a list, which grows if it is new; -1 if the list is full."""
    if value in known:
        return known.index(value)
    if len(known) == _MOST:
        return -1
    known.append(value)
    return len(known) - 1


def page_data(contents: PackedSteps, blocks: Sequence[tuple[int, int]]) -> dict[str, Any]:
    """The data of the page's script in addition to the blocks, as JSON values."""
    return {
        "behaviors": [plain(name) for name in contents.recorded.behaviors],
        "steps": contents.steps,
        "blocks": blocks,
        "packings": packing_data(contents),
        "episodes": [episode_data(episode) for episode in contents.episodes],
        "phases": [phase.name.lower() for phase in sorted(Phase)],
        **word_data(contents),
        "field": {
            "half_length_m": FIELD.half_length_m,
            "half_width_m": FIELD.half_width_m,
            "half_goal_m": FIELD.half_goal_m,
            "goal_depth_m": FIELD.goal_depth_m,
            "corner_m": FIELD.corner_m,
            "robot_side_m": ROBOT_SIDE_M,
            "ball_radius_m": BALL_RADIUS_M,
            "wheel_radius_m": WHEEL_RADIUS_M,
            "axle_m": AXLE_M,
        },
    }


def packing_data(contents: PackedSteps) -> list[list[tuple[Any, ...]]]:
    """How the blocks are packed, as JSON values."""
    return [[tuple(each) for each in packings] for packings in contents.packings]


def word_data(contents: PackedSteps) -> dict[str, Any]:
    """What the indices in the columns stand for, as JSON values."""
    return {
        "controllers": [plain(name) for name in contents.controllers],
        "commands": contents.commands,
        "trees": [_tree_words(contents.trees.get(tree_hash)) for tree_hash in contents.tree_hashes],
    }


def episode_data(episode: Episode) -> dict[str, Any]:
    """An episode as JSON values."""
    return {
        "index": episode.index,
        "first": episode.first_step,
        "count": episode.recorded_steps,
        "steps": episode.steps,
        "phase": episode.phase,
        "outcome": episode.outcome,
        "collisions": episode.collisions_begun,
        "return": _finite(episode.return_),
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def _tree_words(tree: Tree | None) -> dict[str, Any] | None:
    """Each leaf in words: where it is, and what the robot does there. None: the tree is not in the recording."""
    if tree is None:
        return None
    return {
        "leaves": [[plain(rule.where), plain(rule.what)] for rule in rules(tree)],
        "features": [
            [plain(feature.name), plain(feature.unit), is_direction(feature), FEATURES.get(feature.name, "")]
            for feature in tree.features
        ],
    }


def counted(episodes: Iterable[Episode]) -> list[Episode]:
    """The episodes that count: all but the guided ones."""
    return [episode for episode in episodes if episode.phase != "guided"]
