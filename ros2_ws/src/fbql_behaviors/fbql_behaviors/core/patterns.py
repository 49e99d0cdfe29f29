"""Demonstrations and patterns: validated, frozen data (section II.A).

A demonstration is a recording of world states and the commands given in them. A pattern is one moment of it from the view
of a behavior: attributes (the observation) and a class (the quantized command: a wheel pair, or of another command space).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from fbql_common.core.command_space import CommandSpace
from fbql_common.core.errors import BadInput
from fbql_common.core.field import WHEELS
from fbql_common.core.types import WheelCommand, World

from fbql_behaviors.core.levels import class_count
from fbql_behaviors.core.observation import Feature, Observation
from fbql_behaviors.core.quantizer import wheel_class_of

IMBALANCE = 1000
"""Ratio between the patterns of the commonest and the rarest class that is worth a warning."""
UNSEEN_SHARE = 0.1
"""Share of patterns whose class only one demonstration shows, above which it is worth a warning."""
MAX_PATTERNS = 5_000_000
PATTERN_BYTES = 250
"""Memory that induction takes per pattern, roughly [bytes]."""


@dataclass(frozen=True)
class Demonstration:
    """One recording: the world states in order, and the command given in each of them."""

    worlds: tuple[World, ...]
    commands: tuple[WheelCommand, ...]

    def __post_init__(self) -> None:
        if len(self.worlds) != len(self.commands):
            raise BadInput(f"demonstration has {len(self.worlds)} world states but {len(self.commands)} commands")


@dataclass(frozen=True)
class Patterns:
    """Attributes and classes, ready for induction.

    features: d features, in the order of the columns.
    x: attributes, float64 [n, d], finite; units are those of the features.
    wheel_class: int64 [n], the class of each command (`core.levels`); of a wheel pair 0 .. 840.
    demonstration: int64 [n], the demonstration of each pattern; cross-validation holds out whole demonstrations.
    commands: the command space of the classes.

    Raises BadInput when any of this does not hold.
    """

    features: tuple[Feature, ...]
    x: npt.NDArray[np.float64]
    wheel_class: npt.NDArray[np.int64]
    demonstration: npt.NDArray[np.int64]
    commands: CommandSpace = WHEELS

    def __post_init__(self) -> None:
        n = len(self.x)
        if n == 0:
            raise BadInput("no patterns: there is nothing to learn a tree from; record demonstrations first")
        if n > MAX_PATTERNS:
            raise BadInput(
                f"{n} patterns, whose induction would take about {n * PATTERN_BYTES / 2**30:.1f} GiB of memory; "
                f"at most {MAX_PATTERNS} are supported, take fewer of them"
            )
        if self.x.shape != (n, len(self.features)):
            raise BadInput(f"patterns have shape {self.x.shape}; expected [n, {len(self.features)}] for these features")
        if self.wheel_class.shape != (n,) or self.demonstration.shape != (n,):
            raise BadInput(f"{n} patterns need as many classes and demonstration numbers")
        bad = np.argwhere(~np.isfinite(self.x))
        if len(bad):
            row, column = int(bad[0, 0]), int(bad[0, 1])
            name = self.features[column].name
            raise BadInput(f"pattern row {row}: feature '{name}' is {self.x[row, column]}; remove or correct the row")
        classes = class_count(self.commands)
        bad = np.flatnonzero((self.wheel_class < 0) | (self.wheel_class >= classes))
        if len(bad):
            row, what = bad[0], "wheel class" if self.commands == WHEELS else "class"
            raise BadInput(f"pattern row {row}: {what} {self.wheel_class[row]} is outside of 0 .. {classes - 1}")
        for array in (self.x, self.wheel_class, self.demonstration):
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.x)

    @property
    def sha256(self) -> str:
        """SHA-256 over the features' names and units, the axes of another command space than the wheels', the attributes
        and the classes (little-endian)."""
        digest = hashlib.sha256()
        for feature in self.features:
            digest.update(f"{feature.name} {feature.unit}\n".encode())
        for axis in () if self.commands == WHEELS else self.commands.axes:
            digest.update(f"{axis!r}\n".encode())
        digest.update(np.ascontiguousarray(self.x, dtype="<f8").tobytes())
        digest.update(np.ascontiguousarray(self.wheel_class, dtype="<i8").tobytes())
        return digest.hexdigest()

    def warnings(self) -> list[str]:
        """Warnings, one line each, about patterns that can be used but look wrong."""
        if len(self) == 1:
            return ["there is one pattern only: the tree will be a single leaf"]
        _, counts = np.unique(self.wheel_class, return_counts=True)
        if len(counts) == 1:
            return ["all patterns are of one class: the tree will be a single leaf"]
        warnings: list[str] = []
        if counts.max() >= IMBALANCE * counts.min():
            warnings.append(
                f"the commonest class has {counts.max()} patterns, the rarest {counts.min()}: the rare ones will hardly count"
            )
        unseen = self._count_shown_once()
        if unseen > UNSEEN_SHARE * len(self):
            warnings.append(
                f"{unseen} of {len(self)} patterns are of classes that occur in only one demonstration: "
                "when that one is held out they are unseen; record more demonstrations"
            )
        for column, feature in enumerate(self.features):
            if self.x[:, column].min() == self.x[:, column].max():
                warnings.append(f"feature '{feature.name}' never changes: the tree cannot use it")
        return warnings

    def _count_shown_once(self) -> int:
        """The number of patterns whose class only one demonstration shows; 0 when there is only one demonstration."""
        shown = np.unique(np.stack((self.wheel_class, self.demonstration)), axis=1)
        if len(np.unique(shown[1])) < 2:
            return 0
        classes, demonstrations = np.unique(shown[0], return_counts=True)
        return int(np.isin(self.wheel_class, classes[demonstrations == 1]).sum())

    def select(self, rows: npt.NDArray[np.bool_]) -> Patterns:
        """The patterns whose row is true in `rows` [n]."""
        return Patterns(self.features, self.x[rows], self.wheel_class[rows], self.demonstration[rows], self.commands)


def patterns_from_rows(
    features: tuple[Feature, ...],
    rows: Sequence[Sequence[object]],
    wheel_class: Sequence[int],
    demonstration: Sequence[int] | None = None,
) -> Patterns:
    """Patterns from rows of attributes, each checked. Raises BadInput naming the first bad row."""
    for index, row in enumerate(rows):
        if len(row) != len(features):
            raise BadInput(f"pattern row {index}: {len(row)} attributes; expected {len(features)}")
        for feature, value in zip(features, row, strict=True):
            if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
                raise BadInput(f"pattern row {index}: feature '{feature.name}' is {value!r}, which is not a number")
    if len(rows) != len(wheel_class):
        raise BadInput(f"{len(rows)} rows of attributes but {len(wheel_class)} wheel classes")
    x = np.array(rows, dtype=np.float64).reshape(len(rows), len(features))
    numbers = np.zeros(len(rows), np.int64) if demonstration is None else np.array(demonstration, np.int64)
    return Patterns(features, x, np.array(wheel_class, np.int64), numbers)


def patterns_of(
    demonstrations: Sequence[Demonstration], observation: Observation, every: int = 1, count: int | None = None
) -> Patterns:
    """The patterns of demonstrations: every `every`-th moment of each, at most `count` in all (evenly taken).

    Moments outside the root region are left out: there the behavior is not defined.
    """
    rows: list[tuple[float, ...]] = []
    classes: list[int] = []
    numbers: list[int] = []
    for number, demonstration in enumerate(demonstrations):
        for world, command in zip(demonstration.worlds[::every], demonstration.commands[::every], strict=True):
            observed = observation.sense(world)
            if not observation.contains(observed):
                continue
            rows.append(observed)
            classes.append(wheel_class_of(command.left_rad_s, command.right_rad_s))
            numbers.append(number)
    if count is not None and len(rows) > count:
        # integer arithmetic: the same rows on every machine
        kept = [index * len(rows) // count for index in range(count)]
        rows, classes, numbers = [rows[k] for k in kept], [classes[k] for k in kept], [numbers[k] for k in kept]
    return patterns_from_rows(observation.features, rows, classes, numbers)
