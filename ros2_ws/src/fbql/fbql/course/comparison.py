"""Lesson 5: whether what was learned is better than a rule, as far as the runs can tell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fbql_common.core.errors import BadInput
from fbql_recording.run import open_run

from fbql.course.verdict import Verdict, made, number_of, words_of
from fbql.report.comparison import (
    Group,
    RunResult,
    groups_of,
    has_no_recording,
    pairs_of,
    result_of,
    result_without_recording,
)

RULE, LEARNED = "rule", "learned"
"""The runs are named RULE-SEED and LEARNED-SEED."""
UNDECIDED = "undecided"
LEAST_SEEDS = 6
"""With fewer pairs p can't get below .05."""
LEVEL = 0.05
CLOSE = 0.015
"""How far a ratio may be off, as a share of it."""


def check(answer: Sequence[str], work: Path) -> Verdict:
    """Compares the answer RATIO WORD with the runs."""
    ratio, word = words_of(answer, "RATIO WORD", "0.5 undecided")
    given = number_of(ratio, "the ratio")
    if word not in (RULE, LEARNED, UNDECIDED):
        raise BadInput(f"--check: the word is '{word}'; choose {RULE}, {LEARNED} or {UNDECIDED}")
    rule, learned = (_group(work, name) for name in (RULE, LEARNED))
    if learned.runs[0].setting.get("learn") != "false":
        return Verdict(False, "the runs of learned-... went on learning; play them frozen, with --no-learn")
    if _played(rule) != _played(learned):
        return Verdict(
            False, "rule-... and learned-... played differently: give both the same --episodes and --max-steps"
        )
    (pair,) = pairs_of([rule, learned])
    if pair.seeds < LEAST_SEEDS:
        return Verdict(
            False,
            f"rule-... and learned-... share {pair.seeds} seeds; with fewer than {LEAST_SEEDS} no p is below {LEVEL}",
        )
    if pair.cost_ratio is None or pair.p is None:
        return Verdict(False, "one of the two scored no goal at all; play longer, or train longer")
    if abs(given - pair.cost_ratio) > CLOSE * pair.cost_ratio:
        hint = "compare.py prints it, with rule-... named first"
        if abs(given * pair.cost_ratio - 1.0) <= CLOSE:
            hint = "that is rule over learned; it should be learned over rule, so name rule-... first"
        return Verdict(False, f"{given:g} is not the ratio of steps per goal: {hint}")
    truth = UNDECIDED if pair.p >= LEVEL else LEARNED if pair.cost_ratio < 1.0 else RULE
    if word != truth:
        why = f"p = {pair.p:.2g}; {LEVEL} or more means that chance alone makes such a difference often enough"
        return Verdict(False, f"the ratio is right, but your conclusion is not: {why}")
    return Verdict(
        True,
        f"learned over rule: {pair.cost_ratio:.3g} of the steps per goal, p = {pair.p:.2g} over {pair.seeds} seeds "
        f"({truth}); {_cost(RULE, rule)}, {_cost(LEARNED, learned)}",
    )


def _group(work: Path, name: str) -> Group:
    """The runs of one name, which must differ in their seed alone. Raises BadInput."""
    paths = sorted(path for path in made(work).glob(f"{name}-*") if path.is_dir())
    if not paths:
        raise BadInput(f"{work / name}-...: no run there yet; the loop of the lesson plays them")
    groups, _ = groups_of([_result(path) for path in paths])
    if len(groups) > 1:
        odd = next(run.name for group in groups[1:] for run in group.runs)
        raise BadInput(
            f"{work / odd}: differs from {groups[0].runs[0].name} in more than the seed; remove it and play it again"
        )
    return groups[0]


def _result(path: Path) -> RunResult:
    return result_without_recording(path) if has_no_recording(path) else result_of(open_run(path))


def _played(group: Group) -> tuple[str | None, ...]:
    """The properties that both groups must have in common."""
    return tuple(group.runs[0].setting.get(name) for name in ("episodes", "goals", "max_steps"))


def _cost(name: str, group: Group) -> str:
    cost = group.interval("cost_per_goal")
    return f"{name} none" if cost is None else f"{name} {cost.estimate:.0f} ({cost.low:.0f} to {cost.high:.0f})"
