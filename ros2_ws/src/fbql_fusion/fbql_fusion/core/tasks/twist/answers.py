"""The sources of a mux as behaviors: the leaf of a source is the class of its command."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from math import prod
from typing import NamedTuple

from fbql_common.core.command_space import Command, CommandSpace


class SourceAnswer(NamedTuple):
    """The last command of a source at a moment. See `core.tasks.interface.Answer`."""

    command: Command
    leaf_id: int
    leaf_count: int
    tree_hash: str
    active: bool
    clamped: bool = False
    observation: tuple[float, ...] = ()
    """Empty: the observations belong to the moment."""


class SourceLeaves:
    """The leaves of a source: a class for each combination of the axes' levels, and one for a source that may not drive.

    A command counts as the nearest level on each axis.
    """

    def __init__(self, space: CommandSpace) -> None:
        self._standstill = space.standstill
        self._axes = [(low, (levels - 1) / (high - low), levels) for _, _, low, high, levels in space.axes]
        classes = prod(levels for *_, levels in self._axes)
        self.count = classes + 1
        self.silent = classes
        """The leaf of a source that may not drive."""
        self.hash = hashlib.sha256(json.dumps([*space.axes]).encode()).hexdigest()
        """SHA-256 of whatever defines the leaves."""
        self._no_answer = SourceAnswer(self._standstill, self.silent, self.count, self.hash, active=False)

    def leaf(self, command: Sequence[float]) -> int:
        """The class of a command."""
        leaf = 0
        for x, (low, per_unit, levels) in zip(command, self._axes, strict=True):
            nearest = int(min((x - low) * per_unit + 0.5, levels - 1)) if x > low else 0
            leaf = leaf * levels + nearest
        return leaf

    def answer(self, command: Sequence[float] | None, active: bool = True) -> SourceAnswer:
        """The answer of a source.

        Args:
            command: its last one, a value per axis; None before the first.
            active: whether it may drive.
        """
        if command is None or not active:
            return self._no_answer
        return SourceAnswer(tuple(command), self.leaf(command), self.count, self.hash, active=True)
