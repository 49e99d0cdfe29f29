"""The tables of the study of trees: summaries over the seeds, and how they are written."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import nan
from statistics import median
from typing import Any

from fbql.statistics.inference import Interval, paired_p_value, ratio_of_sums
from fbql.statistics.tables import Row, Table, between, finite, number, tabulate
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_behaviors.core.recipes import RECIPES

from fbql_studies.common.pattern_sets import OBJECTIVES
from fbql_studies.common.play import Score
from fbql_studies.common.team_play import FIXED_ONLY, PRESETS, PRESETS_ONLY, SETTINGS, spoken
from fbql_studies.runner.study import Result
from fbql_studies.trees.methods import BANDS, SHIPPED, TRIALS, methods_of

CARTS = ("cart", "cart by entropy")
"""The methods whose errors are the reference, with as many leaves as the exact tree of the weighted objective."""
SHOWN = (
    "weighted rl 50",
    "weighted dp",
    "printed rl 50",
    "printed dp",
    "weighted dp, printed's limits",
    "cart",
    "cart by entropy",
    "cart, cross-validated",
    "optimal, 8 leaves",
    "optimal",
    "one leaf",
)
"""The methods that have their own rows; the others differ in the number of trials."""
ENDINGS = ("", ", Q from 0")
COSTS = (0.0, 0.002, 0.006, 0.01, 0.025, 0.06, 0.1, 0.2, 0.3, 0.4)
"""The costs of a split that are shown [nat]; the recipes' are among them or near."""
TOLERANCE = 0.12
"""By how much the held-out error of the exact weighted tree may exceed CART's."""

COLUMNS = {
    "method": "how the trees were made; in play, the trees of all three behaviors",
    "behavior": "whose tree",
    "n": "how many demonstration seeds are put together",
    "leaves": "leaves of the tree, median over the seeds",
    "leaves_low": "the fewest",
    "leaves_high": "the most",
    "rmse_levels": "root mean squared error of the references on demonstrations that were held out [levels], median",
    "rmse_low": "the least",
    "rmse_high": "the largest",
    "rmse_rad_s": "the median in rad/s",
    "rmse_training": "the same error on the demonstrations that the tree was made of [levels], median",
    "rmse_to_cart": "rmse_levels over that of CART by squared error with as many leaves as the exact tree of the weighted objective, median",
    "rmse_to_cart_by_entropy": "the same to CART by entropy",
    "value_to_dp": "the objective's value of the tree over the optimum's, median; null where it has none",
    "belief_to_dp": "what the learner believes its value to be, over the optimum's, median; null where it has none",
    "seconds": "time that making the tree took [s], median",
    "thresholds": "the thresholds of the Subsumption that fused the trees",
    "episodes": "episodes over all seeds",
    "success_rate": "goals / episodes",
    "success_low": "the lower end of its 95 % interval, a bootstrap over the seeds; ends and p are null with one seed",
    "success_high": "the upper end",
    "cost_per_goal": "steps of all episodes / goals",
    "cost_low": "the lower end of its 95 % interval",
    "cost_high": "the upper end; null where it is infinite",
    "own_goals": "own goals / episodes",
    "timeouts": "timeouts / episodes",
    "collisions_begun": "how often the robot began to touch a wall / episodes",
    "collision_steps": "steps in which it touched one / episodes",
    "cost_to_shipped": "mean of each seed's steps / goals over the mean of those of the trees that ship, made alike; null where a seed has no "
    "goal",
    "ratio_low": "the lower end of its 95 % interval",
    "ratio_high": "the upper end",
    "p": "p of the sign-flip test, paired by seed, that both cost the same",
    "sized_by": "what bounds the tree: the cost of a split with this objective, or CART's number of leaves",
    "limit": "that cost [nat], or number",
    "median_leaves": "leaves, median over the seeds",
    "median_rmse_levels": "held-out error [levels], median over the seeds",
    "objective": "which objective the trees were made with",
    "leaves_of_seeds_1_to_8": "leaves of the trees of these demonstration seeds",
    "band": "how many there should be",
    "inside": "how many of the trees have so many",
}
"""Column -> its meaning."""


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    trees = {(row["method"], row["behavior"]): row for row in rows if "rmse_levels" in row}
    found = {spoken(behavior): _trees([trees[key] for key in _shown(trees, behavior)]) for behavior in RECIPES}
    found["error over that of CART at equal leaves"] = _equal_leaves(
        [trees["weighted dp", behavior] for behavior in RECIPES if ("weighted dp", behavior) in trees]
    )
    found["cost of a split"] = _costs([row for row in rows if row.get("sized_by") in OBJECTIVES])
    played = {(row["method"], row["thresholds"]): row for row in rows if "thresholds" in row}
    found["trials"] = _trials(trees, played)
    for name in SETTINGS:
        found[title_of(name)] = _play([played[method, name] for method in SHOWN if (method, name) in played])
    found["leaves of demonstration seeds 1 to 8"] = _bands([row for row in rows if "band" in row])
    return found


def title_of(thresholds: str) -> str:
    """The title of a table of play with thresholds."""
    if thresholds not in PRESETS:
        return f"{thresholds} thresholds"
    return f"{thresholds} thresholds ({PRESETS[thresholds].wall_m:g} m, {PRESETS[thresholds].approach_rad:g} rad)"


def _shown(trees: dict[tuple[str, str], Row], behavior: str) -> list[tuple[str, str]]:
    return [(method, behavior) for method in SHOWN if (method, behavior) in trees]


def _trees(rows: Sequence[Row]) -> Table:
    return tabulate(
        rows,
        {
            "method": lambda row: row["method"],
            "leaves": lambda row: between(row, "leaves", "leaves_low", "leaves_high", ".0f"),
            "held-out error [levels]": lambda row: between(row, "rmse_levels", "rmse_low", "rmse_high", ".2f"),
            "[rad/s]": lambda row: f"{row['rmse_rad_s']:.1f}",
            "value / optimum": lambda row: number(row["value_to_dp"], ".2f"),
            "time [ms]": lambda row: f"{1000.0 * row['seconds']:.0f}",
        },
    )


def _equal_leaves(rows: Sequence[Row]) -> Table:
    limit = 1.0 + TOLERANCE
    head = ["behavior", "CART by squared error", "CART by entropy", f"at most {limit:.2f}"]
    body = [
        [
            spoken(row["behavior"]),
            number(row["rmse_to_cart"], ".3f"),
            number(row["rmse_to_cart_by_entropy"], ".3f"),
            "yes" if max(row["rmse_to_cart"] or 0.0, row["rmse_to_cart_by_entropy"] or 0.0) <= limit else "no",
        ]
        for row in rows
    ]
    return Table(head, body)


def _costs(rows: Sequence[Row]) -> Table:
    of = {(row["behavior"], row["sized_by"], row["limit"]): row for row in rows}
    columns = [(behavior, objective) for behavior in RECIPES for objective in OBJECTIVES]
    head = ["cost [nat]", *(f"{spoken(behavior)}, {objective}" for behavior, objective in columns)]
    costs = [cost for cost in COSTS if cost in {row["limit"] for row in rows}]
    body = [[f"{cost:g}", *(_size(of[behavior, name, cost]) for behavior, name in columns)] for cost in costs]
    return Table(head, body)


def _size(row: Row) -> str:
    return f"{row['median_leaves']:.0f}, {row['median_rmse_levels']:.2f}"


def _trials(trees: dict[tuple[str, str], Row], played: dict[tuple[str, str], Row]) -> Table:
    head = ["method", *(f"{spoken(each)}: leaves, error, value" for each in RECIPES), "success [%]", "steps / goal"]
    methods = [f"{name} rl {n}{ending}" for name in OBJECTIVES for ending in ENDINGS for n in TRIALS]
    body: list[list[str]] = []
    for method in methods:
        of = [trees[method, behavior] for behavior in RECIPES if (method, behavior) in trees]
        if of:
            play = played[method, SETTINGS[0]]
            body.append(
                [
                    method,
                    *(f"{r['leaves']:.0f}, {r['rmse_levels']:.2f}, {number(r['value_to_dp'], '.2f')}" for r in of),
                    number(play["success_rate"], ".1f", 100.0),
                    number(play["cost_per_goal"], ".0f"),
                ]
            )
    return Table(head, body)


def _play(rows: Sequence[Row]) -> Table:
    return tabulate(
        rows,
        {
            "method": lambda row: row["method"],
            "success [%]": lambda row: between(row, "success_rate", "success_low", "success_high", ".1f", 100.0),
            "steps / goal": lambda row: between(row, "cost_per_goal", "cost_low", "cost_high", ".0f"),
            "against shipped": lambda row: between(row, "cost_to_shipped", "ratio_low", "ratio_high", ".2f"),
            "p": lambda row: number(row["p"], ".2g"),
            "own goals [%]": lambda row: f"{100.0 * row['own_goals']:.1f}",
            "timeouts [%]": lambda row: f"{100.0 * row['timeouts']:.1f}",
            "collisions": lambda row: f"{row['collisions_begun']:.1f}",
            "contact steps": lambda row: f"{row['collision_steps']:.1f}",
        },
    )


def _bands(rows: Sequence[Row]) -> Table:
    by_name = {(row["objective"], row["behavior"]): row for row in rows}
    chosen = [by_name[key] for name in OBJECTIVES for behavior in RECIPES if (key := (name, behavior)) in by_name]
    return tabulate(
        chosen,
        {
            "objective": lambda row: row["objective"],
            "behavior": lambda row: spoken(row["behavior"]),
            "leaves": lambda row: row["leaves_of_seeds_1_to_8"].replace(" ", ", "),
            "band": lambda row: row["band"].replace("-", " to "),
            "inside": lambda row: f"{row['inside']} of {row['n']}",
        },
    )


def settings_of(method: str) -> tuple[str, ...]:
    """The thresholds that a method's trees are played with; trees that hardly score are not worth tuning for."""
    if method.endswith("Q from 0"):
        return FIXED_ONLY
    return PRESETS_ONLY if method.endswith((" rl 5", " rl 20", "one leaf")) else SETTINGS


def table(results: Mapping[str, Result]) -> list[Row]:
    """Four tables: each method's trees, their play, leaves and error against size, leaves of known seeds."""
    by_method = methods_of(results)
    rows = [_tree_summary(method, behavior, by_method) for method in by_method for behavior in RECIPES]
    rows += [
        _play_summary(method, name, by_method)
        for name in SETTINGS
        for method in by_method
        if name in settings_of(method)
    ]
    rows += _size_summaries([row for result in results.values() for row in result.get("sizes", [])])
    for result in results.values():
        for objective, counts in result.get("leaves", {}).items():
            rows += [_band(objective, behavior, leaves) for behavior, leaves in counts.items()]
    return rows


def _size_summaries(sizes: Iterable[Row]) -> Iterator[Row]:
    """Medians over the seeds for each cost of a split, and for each number of leaves that CART may have."""
    groups: dict[tuple[str, str, float], list[Row]] = {}
    for row in sizes:
        limit = row["leaves"] if row["split_cost"] is None else row["split_cost"]
        groups.setdefault((row["behavior"], row["method"], limit), []).append(row)
    for (behavior, method, limit), rows in groups.items():
        yield {
            "behavior": behavior,
            "sized_by": method,
            "limit": limit,
            "n": len(rows),
            "median_leaves": median(row["leaves"] for row in rows),
            "median_rmse_levels": median(row["rmse_levels"] for row in rows),
        }


def _tree_summary(method: str, behavior: str, by_method: Mapping[str, Mapping[int, Any]]) -> Row:
    """Medians over the seeds, and the error's range."""
    by_seed = by_method[method]

    def of(name: str) -> list[float]:
        values = (each["trees"][behavior][name] for each in by_seed.values())
        return [value for value in values if value is not None]

    errors = of("rmse_levels")
    return {
        "method": method,
        "behavior": behavior,
        "n": len(by_seed),
        "leaves": median(of("leaves")),
        "leaves_low": min(of("leaves")),
        "leaves_high": max(of("leaves")),
        "rmse_levels": median(errors),
        "rmse_low": min(errors),
        "rmse_high": max(errors),
        "rmse_rad_s": rad_s_of(median(errors)),
        "rmse_training": median(of("rmse_training")),
        **{f"rmse_to_{name.replace(' ', '_')}": _error_to(name, method, behavior, by_method) for name in CARTS},
        "value_to_dp": median(of("value")) if of("value") else None,
        "belief_to_dp": median(of("belief")) if of("belief") else None,
        "seconds": median(each["seconds"][behavior] for each in by_seed.values()),
    }


def _error_to(other: str, method: str, behavior: str, by_method: Mapping[str, Mapping[int, Any]]) -> float | None:
    """The held-out error over that of another method with the same seed, the median over the seeds."""
    theirs = by_method.get(other, {})
    ratios = [
        each["trees"][behavior]["rmse_levels"] / theirs[seed]["trees"][behavior]["rmse_levels"]
        for seed, each in by_method[method].items()
        if seed in theirs
    ]
    return median(ratios) if ratios else None


def _play_summary(method: str, name: str, by_method: Mapping[str, Mapping[int, Any]]) -> Row:
    """Sums over the seeds, with bootstrap intervals over them, and a paired test against the shipped trees."""
    by_seed = by_method[method]
    scores = {seed: _score(each, name) for seed, each in by_seed.items()}
    success = _interval(scores.values(), "goals", "episodes")
    cost = _interval(scores.values(), "steps", "goals")
    shipped = {seed: _score(each, name) for seed, each in by_method.get(SHIPPED, {}).items() if seed in scores}
    paired = [(scores[seed], other) for seed, other in shipped.items()]
    row: Row = {
        "method": method,
        "thresholds": name,
        "n": len(scores),
        "episodes": sum(each.episodes for each in scores.values()),
        "success_rate": success.estimate,
        "success_low": success.low,
        "success_high": success.high,
        "cost_per_goal": cost.estimate,
        "cost_low": cost.low,
        "cost_high": cost.high,
        "own_goals": _interval(scores.values(), "own_goals", "episodes").estimate,
        "timeouts": _interval(scores.values(), "timeouts", "episodes").estimate,
        "collisions_begun": _interval(scores.values(), "collisions_begun", "episodes").estimate,
        "collision_steps": _interval(scores.values(), "collision_steps", "episodes").estimate,
        **_compared(paired if method != SHIPPED else []),
    }
    return finite(row)


def _compared(paired: Sequence[tuple[Score, Score]]) -> Row:
    """cost/goal relative to the shipped trees, on the same seeds: the ratio, its interval, and p."""
    ratio, p = Interval(nan, nan, nan), None
    if paired and all(ours.goals and theirs.goals for ours, theirs in paired):
        costs = [(ours.steps / ours.goals, theirs.steps / theirs.goals) for ours, theirs in paired]
        ratio = ratio_of_sums(*map(list, zip(*costs, strict=True)))
        p = paired_p_value(*map(list, zip(*costs, strict=True)))
    return {"cost_to_shipped": ratio.estimate, "ratio_low": ratio.low, "ratio_high": ratio.high, "p": p}


def _score(each: Mapping[str, Any], name: str) -> Score:
    return Score.of(each["play"][name])


def _interval(scores: Iterable[Score], numerator: str, denominator: str) -> Interval:
    counted = list(scores)
    if not any(getattr(each, denominator) for each in counted):
        return Interval(nan, nan, nan)
    return ratio_of_sums([getattr(s, numerator) for s in counted], [getattr(s, denominator) for s in counted])


def _band(objective: str, behavior: str, leaves: Sequence[int]) -> Row:
    low, high = BANDS[behavior]
    inside = sum(low <= count <= high for count in leaves)
    return {
        "objective": objective,
        "behavior": behavior,
        "leaves_of_seeds_1_to_8": " ".join(map(str, leaves)),
        "band": f"{low}-{high}",
        "inside": inside,
        "n": len(leaves),
    }
