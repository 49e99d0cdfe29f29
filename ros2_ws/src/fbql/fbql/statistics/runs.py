"""Methods over their runs: ratios with intervals, and comparisons with controls on the same episodes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import nan
from typing import Any

from fbql.statistics.inference import (
    Interval,
    Sums,
    clustered_p_value,
    clustered_ratio,
    interquartile_mean,
    paired_p_value,
    probability_of_improvement,
)
from fbql.statistics.tables import Row, finite

RunCounts = Mapping[str, Any]
"""The counts of one run, with its method, tree_seed and seed."""
Runs = Mapping[tuple[int, int], RunCounts]
"""(tree seed, run seed) -> run."""


def runs_by_method(found: Iterable[RunCounts], methods: Iterable[str]) -> dict[str, Runs]:
    """Method -> its runs, in the order of `methods`; methods without a run are left out."""
    by_method: dict[str, dict[tuple[int, int], RunCounts]] = {method: {} for method in methods}
    for each in found:
        by_method[each["method"]][each["tree_seed"], each["seed"]] = each
    return {method: dict(sorted(runs.items())) for method, runs in by_method.items() if runs}


def ratio(runs: Runs, numerator: str, denominator: str) -> Interval:
    """The ratio of two counts, with an interval over tree sets and their runs."""
    return clustered_ratio(_sums(runs.values(), numerator, denominator), [tree for tree, _ in runs])


def cost_ratio(ours: Runs, theirs: Runs) -> Interval:
    """Our cost/goal over theirs, on the runs that both have; NaN where they have no goal."""
    both = [key for key in ours if key in theirs]
    if not any(theirs[key]["goals"] for key in both):
        return Interval(nan, nan, nan)
    sums = [_sums((runs[key] for key in both), "steps", "goals") for runs in (ours, theirs)]
    return clustered_ratio(sums[0], [tree for tree, _ in both], sums[1])


def cost_ratios_by_trees(ours: Runs, theirs: Runs) -> dict[int, float]:
    """Tree seed -> our cost/goal over theirs."""
    trees = sorted({tree for tree, _ in ours})
    return {tree: cost_ratio(_of(ours, tree), _of(theirs, tree)).estimate for tree in trees}


def cost_of(run: RunCounts) -> float:
    """cost/goal of a run; a run without a goal costs all its steps."""
    return run["steps"] / max(run["goals"], 1)


def cost_p_value(ours: Runs, theirs: Runs) -> float | None:
    """p of the sign-flip test, paired by run, that both cost the same; None with fewer than two pairs."""
    both = [key for key in ours if key in theirs]
    if len(both) < 2 or ours is theirs:
        return None
    return paired_p_value(*([cost_of(runs[key]) for key in both] for runs in (ours, theirs)))


def interquartile_cost(runs: Runs) -> Interval:
    """The interquartile mean of cost/goal over runs, with an interval over tree sets and their runs."""
    return interquartile_mean([cost_of(run) for run in runs.values()], [tree for tree, _ in runs])


def cost_improvement(ours: Runs, theirs: Runs) -> Interval:
    """The probability that a run of ours costs less than one of theirs on the same tree set; NaN without a pair."""
    both = [key for key in ours if key in theirs]
    if not both:
        return Interval(nan, nan, nan)
    costs = [[cost_of(runs[key]) for key in both] for runs in (ours, theirs)]
    return probability_of_improvement(*costs, [tree for tree, _ in both])


def cost_p_value_of_trees(ours: Runs, theirs: Runs) -> float | None:
    """p of the t test over tree sets that both cost the same; None with fewer than two tree sets."""
    both = [key for key in ours if key in theirs]
    trees = [tree for tree, _ in both]
    if len(set(trees)) < 2 or ours is theirs:
        return None
    return clustered_p_value(*([cost_of(runs[key]) for key in both] for runs in (ours, theirs)), trees)


def method_row(method: str, by_method: Mapping[str, Runs], controls: Mapping[str, str]) -> Row:
    """The row of a method.

    Args:
        controls: short name -> the method that is the control.
    """
    own = by_method[method]
    total = {name: sum(run[name] for run in own.values()) for name in ("episodes", "goals", "own_goals", "timeouts")}
    cost = ratio(own, "steps", "goals")
    row: Row = {
        "method": method,
        "runs": len(own),
        **total,
        "success_rate": ratio(own, "goals", "episodes").estimate,
        "cost_per_goal": cost.estimate,
        "cost_low": cost.low,
        "cost_high": cost.high,
        **_named("iqm_cost", interquartile_cost(own)),
        "steps_per_success": ratio(own, "steps_to_goals", "goals").estimate if _is_counted(own) else nan,
        "collisions_begun_per_goal": ratio(own, "collisions_begun", "goals").estimate,
        "collision_steps_per_goal": ratio(own, "collision_steps", "goals").estimate,
    }
    for name, control in controls.items():
        other = by_method.get(control, {})
        itself = control == method
        row |= {
            **_named(f"ratio_{name}", Interval(1.0, 1.0, 1.0) if itself else cost_ratio(own, other)),
            f"p_{name}": cost_p_value(own, other),
            f"p_trees_{name}": cost_p_value_of_trees(own, other),
            **_named(f"improves_{name}", Interval(nan, nan, nan) if itself else cost_improvement(own, other)),
        }
    return finite(row)


def _named(name: str, interval: Interval) -> Row:
    return {name: interval.estimate, f"{name}_low": interval.low, f"{name}_high": interval.high}


def _is_counted(runs: Runs) -> bool:
    """Whether the steps of the episodes that ended in a goal were counted separately."""
    return all("steps_to_goals" in run for run in runs.values())


def _of(runs: Runs, tree_seed: int) -> Runs:
    return {key: run for key, run in runs.items() if key[0] == tree_seed}


def _sums(runs: Iterable[RunCounts], numerator: str, denominator: str) -> Sums:
    pairs = [(run[numerator], run[denominator]) for run in runs]
    return Sums([pair[0] for pair in pairs], [pair[1] for pair in pairs])
