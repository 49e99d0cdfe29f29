"""The tables of the study of trees for docs/trees.md; a test compares them with the committed data."""

from __future__ import annotations

from collections.abc import Sequence

from fbql.statistics.tables import Row, Table, between, number
from fbql_behaviors.core.recipes import RECIPES

from fbql_studies.tree_methods import OBJECTIVES, TRIALS
from fbql_studies.tree_play import PRESETS, SETTINGS

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
"""The methods that are told of one by one; the others differ in the number of trials."""
ENDINGS = ("", ", Q from 0")
COSTS = (0.0, 0.002, 0.006, 0.01, 0.025, 0.06, 0.1, 0.2, 0.3, 0.4)
"""The costs of a split that are told of [nat]; the recipes' are among them or near."""
TOLERANCE = 0.12
"""How far above CART's the held-out error of the exact tree of the weighted objective was to be at most."""

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
"""Column -> what it says."""


def tables(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table, in the order of docs/trees.md."""
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
    """How thresholds are spoken of."""
    if thresholds not in PRESETS:
        return f"{thresholds} thresholds"
    return f"{thresholds} thresholds ({PRESETS[thresholds].wall_m:g} m, {PRESETS[thresholds].approach_rad:g} rad)"


def _shown(trees: dict[tuple[str, str], Row], behavior: str) -> list[tuple[str, str]]:
    return [(method, behavior) for method in SHOWN if (method, behavior) in trees]


def _trees(rows: Sequence[Row]) -> Table:
    head = ["method", "leaves", "held-out error [levels]", "[rad/s]", "value / optimum", "time [ms]"]
    body = [
        [
            row["method"],
            _spread(row, "leaves", ".0f"),
            between(row, "rmse_levels", "rmse_low", "rmse_high", ".2f"),
            f"{row['rmse_rad_s']:.1f}",
            number(row["value_to_dp"], ".2f"),
            f"{1000.0 * row['seconds']:.0f}",
        ]
        for row in rows
    ]
    return Table(head, body)


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
    head = ["method", "success [%]", "steps / goal", "against shipped", "p", "own goals [%]", "timeouts [%]", "collisions", "contact steps"]  # fmt: skip
    body = [
        [
            row["method"],
            between(row, "success_rate", "success_low", "success_high", ".1f", 100.0),
            between(row, "cost_per_goal", "cost_low", "cost_high", ".0f"),
            between(row, "cost_to_shipped", "ratio_low", "ratio_high", ".2f"),
            number(row["p"], ".2g"),
            f"{100.0 * row['own_goals']:.1f}",
            f"{100.0 * row['timeouts']:.1f}",
            f"{row['collisions_begun']:.1f}",
            f"{row['collision_steps']:.1f}",
        ]
        for row in rows
    ]
    return Table(head, body)


def _bands(rows: Sequence[Row]) -> Table:
    by_name = {(row["objective"], row["behavior"]): row for row in rows}
    chosen = [by_name[key] for name in OBJECTIVES for behavior in RECIPES if (key := (name, behavior)) in by_name]
    head = ["objective", "behavior", "leaves", "band", "inside"]
    body = [
        [
            row["objective"],
            spoken(row["behavior"]),
            row["leaves_of_seeds_1_to_8"].replace(" ", ", "),
            row["band"].replace("-", " to "),
            f"{row['inside']} of {row['n']}",
        ]
        for row in chosen
    ]
    return Table(head, body)


def spoken(behavior: str) -> str:
    """The name of a behavior in a text."""
    return behavior.replace("_", " ")


def _spread(row: Row, name: str, form: str) -> str:
    """A median with the range."""
    return between(row, name, f"{name}_low", f"{name}_high", form)
