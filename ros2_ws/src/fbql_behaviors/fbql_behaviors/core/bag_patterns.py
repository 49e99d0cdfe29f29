"""Patterns from a robot's recordings: each command message with what the robot sensed at that moment (`core.senses` has the rule)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np
from fbql_common.core.command_space import Command
from fbql_common.core.errors import BadInput

from fbql_behaviors.core.bag_spec import Spec
from fbql_behaviors.core.evaluation import FOLDS
from fbql_behaviors.core.levels import class_at
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.senses import Senses

FEWEST_ROWS = 10
_NS = 1_000_000_000


class Event(NamedTuple):
    """A message of a bag, reduced to the values that are needed."""

    stamp_ns: int
    """When it was recorded."""
    topic: str
    numbers: tuple[float, ...]
    """The values that `Senses.read` returned; for the command's topic, the command."""


class BagPatterns(NamedTuple):
    """Patterns, and how many commands were used, dropped or clamped."""

    patterns: Patterns
    commands: int
    """Command messages in the bags."""
    dropped: dict[str, int]
    """Commands without a pattern, by reason."""
    clamped: dict[str, int]
    """Patterns with a value outside its limits, which counts as the limit: by feature or axis."""


def patterns_of_bags(
    spec: Spec, bags: Sequence[Sequence[Event]], every: int = 1, count: int | None = None
) -> BagPatterns:
    """Patterns of every `every`-th command, at most `count` in all, evenly taken.

    Each bag is a demonstration; a single one is divided into five consecutive parts of as many patterns, so that a tree can
    be tested on parts that it was not made from. Of messages recorded at the same time, observations come before commands.

    Raises BadInput: nothing or too little to learn from, with the reasons.
    """
    rows: list[tuple[float, ...]] = []
    commands: list[Command] = []
    numbers: list[int] = []
    dropped: Counter[str] = Counter()
    total = 0
    for number, events in enumerate(bags):
        senses = Senses(spec)
        for event in sorted(events, key=lambda event: (event.stamp_ns, event.topic == spec.command_topic)):
            if event.topic != spec.command_topic:
                senses.hear(event.topic, event.numbers, event.stamp_ns)
                continue
            total += 1
            if (total - 1) % every:
                continue
            observed = senses.observe(event.stamp_ns)
            problem = observed.problem or ("" if all(map(isfinite, event.numbers)) else "command not finite")
            if problem:
                dropped[problem] += 1
                continue
            rows.append(observed.values)
            commands.append(event.numbers)
            numbers.append(number)
    if count is not None and len(rows) > count:
        kept = [index * len(rows) // count for index in range(count)]
        rows, commands, numbers = [rows[k] for k in kept], [commands[k] for k in kept], [numbers[k] for k in kept]
    _check_rows(spec, bags, len(rows), total, dropped)
    if len(bags) == 1:
        numbers = [index * FOLDS // len(rows) for index in range(len(rows))]
    x = np.array(rows, np.float64)
    classes = [class_at(spec.commands, command) for command in commands]
    if len(set(classes)) == 1:
        axes = ", ".join(f"{axis.name} {value:g}" for axis, value in zip(spec.commands.axes, commands[0], strict=True))
        raise BadInput(
            f"command {spec.command_topic} is the same in all {len(rows)} patterns ({axes}, rounded to its levels): there is "
            "nothing to learn; record changing commands, or give the axes more levels"
        )
    patterns = Patterns(spec.features, x, np.array(classes, np.int64), np.array(numbers, np.int64), spec.commands)
    return BagPatterns(patterns, total, dict(dropped), _clamped(spec, rows, commands))


def _check_rows(spec: Spec, bags: Sequence[Sequence[Event]], rows: int, total: int, dropped: Mapping[str, int]) -> None:
    if rows >= FEWEST_ROWS:
        return
    spans = {topic: _span_s(bags, topic) for topic in (spec.command_topic, *spec.topics)}
    for topic, span in spans.items():
        if span is None:
            raise BadInput(f"topic {topic} has no message")
    first, last = spans[spec.command_topic] or (0.0, 0.0)
    if not rows and len(bags) == 1:
        for topic in spec.topics:
            begin, end = spans[topic] or (0.0, 0.0)
            if begin > last or end < first:
                raise BadInput(
                    f"no overlap in time: {spec.command_topic} is recorded from {first:.1f} to {last:.1f} s, {topic} from "
                    f"{begin:.1f} to {end:.1f} s"
                )
    reasons = "; ".join(f"{reason}: {number}" for reason, number in sorted(dropped.items()))
    raise BadInput(
        f"{rows} patterns of {total} commands on {spec.command_topic}, at least {FEWEST_ROWS} are needed"
        f"{f' (dropped: {reasons})' if reasons else ''}"
    )


def _span_s(bags: Sequence[Sequence[Event]], topic: str) -> tuple[float, float] | None:
    """From when to when a topic has messages, counted from the first event [s]."""
    stamps = [event.stamp_ns for events in bags for event in events if event.topic == topic]
    if not stamps:
        return None
    begin = min(event.stamp_ns for events in bags for event in events)
    return (min(stamps) - begin) / _NS, (max(stamps) - begin) / _NS


def _clamped(spec: Spec, rows: Sequence[tuple[float, ...]], commands: Sequence[Command]) -> dict[str, int]:
    found: dict[str, int] = {}
    for column, feature in enumerate(spec.features):
        found[feature.name] = sum(not feature.low <= row[column] < feature.high for row in rows)
    for column, axis in enumerate(spec.commands.axes):
        found[axis.name] = sum(not axis.low <= command[column] <= axis.high for command in commands)
    return {name: number for name, number in found.items() if number}
