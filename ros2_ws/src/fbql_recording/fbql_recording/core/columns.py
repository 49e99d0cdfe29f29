"""Steps as columns: NumPy arrays with one row per step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.types import NO_LEAF, BehaviorOutput, World
from numpy.typing import NDArray

from fbql_recording.core.steps import Step

Columns = dict[str, NDArray[Any]]
BLOCK_STEPS = 4096
"""Steps that are turned into columns at a time: the memory needed in addition to the columns themselves."""
_NAN = float("nan")
_FLOATS = World._fields[3:15]
_FLAGS = World._fields[15:]
_NO_FLOATS, _NO_FLAGS = (_NAN,) * len(_FLOATS), (False,) * len(_FLAGS)


class Recorded(NamedTuple):
    """The parts that a recording contains: columns of anything else are left out, so that "n/a" is not taken for 0."""

    world: bool
    behaviors: tuple[str, ...]
    """Names of the behaviors, in order."""
    outputs: bool
    command: bool
    decision: bool


def columns_of(steps: Iterable[Step], recorded: Recorded) -> Columns:
    """The columns of all steps. See `block_of`."""
    blocks = list(blocks_of(steps, recorded)) or [block_of([], recorded)]
    widths = {name: max(block[name].shape[1:] for block in blocks) for name in blocks[0]}
    return {name: np.concatenate([_widened(block[name], widths[name]) for block in blocks]) for name in widths}


def blocks_of(steps: Iterable[Step], recorded: Recorded) -> Iterator[Columns]:
    """The columns, in blocks of BLOCK_STEPS steps."""
    rest = iter(steps)
    while block := list(islice(rest, BLOCK_STEPS)):
        yield block_of(block, recorded)


def block_of(steps: Sequence[Step], recorded: Recorded) -> Columns:
    """The columns of some steps; m steps, n behaviors.

    Always: stamp_ns, episode, step, int64 [m]. From the world state, under the names of `World`: float64 [m] and
    bool [m]. command_left_rad_s, command_right_rad_s float64 [m]. From the decision: phase int64 [m] (-1: n/a),
    driver int64 [m] (-1: blend), reward float64 [m], degraded bool [m]; joint_state int64 [m, n], q and weights
    float64 [m, n]. From the behaviors' answers: leaf_id int64 [m, n] (-1: no answer), reference_left_rad_s and
    reference_right_rad_s float64 [m, n], clamped bool [m, n], and for each behavior observation.NAME float64 [m, k].
    has_world, has_command, has_decision bool [m] state whether the message is there: if it is not, and where nothing
    was learned, floats are NaN.
    """
    columns: Columns = {
        name: np.array([getattr(step, name) for step in steps], np.int64) for name in ("stamp_ns", "episode", "step")
    }
    if recorded.world:
        columns["has_world"] = np.array([step.world is not None for step in steps], bool)
        floats = _floats([_NO_FLOATS if step.world is None else step.world[3:15] for step in steps], len(_FLOATS))
        flags = [_NO_FLAGS if step.world is None else step.world[15:] for step in steps]
        columns |= {name: floats[:, index] for index, name in enumerate(_FLOATS)}
        by_flag = np.array(flags, bool).reshape(-1, len(_FLAGS))
        columns |= {name: by_flag[:, index] for index, name in enumerate(_FLAGS)}
    if recorded.command:
        columns["has_command"] = np.array([step.command is not None for step in steps], bool)
        wheels = _floats([(_NAN, _NAN) if step.command is None else step.command[3:5] for step in steps], 2)
        columns |= {f"command_{side}_rad_s": wheels[:, index] for index, side in enumerate(("left", "right"))}
    if recorded.decision:
        columns |= _decisions(steps, len(recorded.behaviors))
    if recorded.outputs:
        columns |= _outputs(steps, recorded.behaviors)
    return columns


def flat(columns: Columns, behaviors: Sequence[str]) -> Columns:
    """One-dimensional columns only: "weights" [m, n] becomes "weights.NAME" [m] for each behavior's name."""
    result: Columns = {}
    for name, column in columns.items():
        if column.ndim == 1:
            result[name] = column
        elif name.startswith("observation."):
            result |= {f"{name}.{index}": column[:, index] for index in range(column.shape[1])}
        else:
            result |= {f"{name}.{behavior}": column[:, index] for index, behavior in enumerate(behaviors)}
    return result


def _decisions(steps: Sequence[Step], n: int) -> Columns:
    decisions = [step.decision for step in steps]
    nothing = (_NAN,) * n
    return {
        "has_decision": np.array([decision is not None for decision in decisions], bool),
        "phase": np.array([-1 if decision is None else decision.phase for decision in decisions], np.int64),
        "driver": np.array([-1 if decision is None else decision.driver for decision in decisions], np.int64),
        "reward": np.array([_NAN if decision is None else decision.reward for decision in decisions], np.float64),
        "degraded": np.array([decision is not None and decision.degraded for decision in decisions], bool),
        "joint_state": np.array(
            [_of_n(None if d is None else d.joint_state, n, (NO_LEAF,) * n) for d in decisions], np.int64
        ).reshape(-1, n),
        "q": _floats([_of_n(None if d is None else d.q, n, nothing) for d in decisions], n),
        "weights": _floats([_of_n(None if d is None else d.weights, n, nothing) for d in decisions], n),
        "learned_weights": _floats([_of_n(None if d is None else d.learned_weights, n, nothing) for d in decisions], n),
    }


def _outputs(steps: Sequence[Step], behaviors: Sequence[str]) -> Columns:
    n = len(behaviors)
    answers = [step.outputs for step in steps]

    def each(value: Any, field: str) -> list[list[Any]]:
        return [[value if answer is None else getattr(answer, field) for answer in row] for row in answers]

    columns: Columns = {
        "leaf_id": np.array(each(NO_LEAF, "leaf_id"), np.int64).reshape(-1, n),
        "reference_left_rad_s": _floats(each(_NAN, "left_rad_s"), n),
        "reference_right_rad_s": _floats(each(_NAN, "right_rad_s"), n),
        "clamped": np.array(each(False, "clamped"), bool).reshape(-1, n),
    }
    for index, name in enumerate(behaviors):
        columns[f"observation.{name}"] = _observations([row[index] for row in answers])
    return columns


def _observations(answers: Sequence[BehaviorOutput | None]) -> NDArray[np.float64]:
    width = max((len(answer.observation) for answer in answers if answer is not None), default=0)
    nothing = (_NAN,) * width
    rows = [_of_n(None if answer is None else answer.observation, width, nothing) for answer in answers]
    return _floats(rows, width)


def _of_n[T](values: tuple[T, ...] | None, n: int, nothing: tuple[T, ...]) -> tuple[T, ...]:
    return values if values is not None and len(values) == n else nothing


def _floats(rows: Sequence[Sequence[float]], width: int) -> NDArray[np.float64]:
    return np.array(rows, np.float64).reshape(len(rows), width)


def _widened(block: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """A block of missing observations, as wide as the others."""
    if block.shape[1:] == shape:
        return block
    wide: NDArray[Any] = np.full((len(block), *shape), _NAN)
    wide[:, : block.shape[1]] = block
    return wide
