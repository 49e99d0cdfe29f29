"""The rungs of the ladder, each a row: what was wanted, what was found, and whether that is enough."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Any

from fbql.statistics.runs import Runs, cost_ratio, cost_ratios_by_trees, p_of, ratio
from fbql.statistics.tables import Row, finite

COST_TO_RETUNED = 0.65
COST_TO_RETUNED_ON_ANY_TREES = 1.0
SUCCESS_RATE = 0.98
OWN_GOALS = 0.005
STEPS_TO_LAW = 2.0
EARLY_OWN_GOALS = 0.35
EARLY_COST = 0.85
EARLY_P = 0.01
TWIN_COST = 1.0


def tree_rows(method: str, ours: Runs, retuned: Runs, results: Mapping[str, Mapping[str, Any]]) -> list[Row]:
    """A row for each tree set: what a method and the re-tuned Subsumption cost on it."""
    sets = {result["runs"][0]["tree_seed"]: result for result in results.values() if "thresholds" in result}
    rows: list[Row] = []
    for tree_seed, found in cost_ratios_by_trees(ours, retuned).items():
        own, theirs = ({key: run for key, run in runs.items() if key[0] == tree_seed} for runs in (ours, retuned))
        if not theirs:
            continue
        wall_m, approach_rad = sets[tree_seed]["thresholds"]
        worst = max(cost_ratio({key: own[key]}, theirs).estimate for key in own)
        rows.append(
            finite(
                {
                    "learner": method,
                    "trees": tree_seed,
                    "leaves": " x ".join(map(str, sets[tree_seed]["leaves"])),
                    "wall_m": wall_m,
                    "approach_rad": approach_rad,
                    "retuned_cost": ratio(theirs, "steps", "goals").estimate,
                    "learner_cost": ratio(own, "steps", "goals").estimate,
                    "ratio": found,
                    "worst_run": worst,
                    "success_rate": ratio(own, "goals", "episodes").estimate,
                    "own_goal_rate": ratio(own, "own_goals", "episodes").estimate,
                }
            )
        )
    return rows


def rung_rows(method: str, ours: Runs, retuned: Runs, law: Runs) -> list[Row]:
    """Rungs b and c of a method: frozen, after the training."""
    steps, floor = (ratio(runs, "steps_to_goals", "goals").estimate for runs in (ours, law))
    rows = [
        _rung("b", "cost/goal to re-tuned", cost_ratio(ours, retuned).estimate, COST_TO_RETUNED),
        _rung(
            "b",
            "cost/goal to re-tuned, worst tree set",
            max(cost_ratios_by_trees(ours, retuned).values()),
            COST_TO_RETUNED_ON_ANY_TREES,
        ),
        _rung("b", "success rate", ratio(ours, "goals", "episodes").estimate, SUCCESS_RATE, at_least=True),
        _rung("b", "own goals / episodes", ratio(ours, "own_goals", "episodes").estimate, OWN_GOALS),
    ]
    for name in ("collisions_begun", "collision_steps"):
        found, most = (ratio(runs, name, "goals").estimate for runs in (ours, retuned))
        rows.append(_rung("b", f"{name.replace('_', ' ')} / goals, at most re-tuned's", found, most))
    rows.append(_rung("c", "steps of a success to the scripted law's", steps / floor, STEPS_TO_LAW))
    return [finite({**row, "rung": f"{row['rung']}, {method}"}) for row in rows]


def early_rung_rows(method: str, by_method: Mapping[str, Runs], paper: str, *twins: str) -> list[Row]:
    """Rung a: in the paper's 50 goals, while it learns, against the paper-like Subsumption and its frozen twins."""
    ours, theirs = by_method[method], by_method[paper]
    own_goals = [sum(run["own_goals"] for run in runs.values()) for runs in (ours, theirs)]
    p = p_of(ours, theirs)
    rows = [
        _rung(
            method, "own goals to Subsumption's", own_goals[0] / own_goals[1] if own_goals[1] else nan, EARLY_OWN_GOALS
        ),
        _rung(method, "cost/goal to Subsumption's", cost_ratio(ours, theirs).estimate, EARLY_COST),
        _rung(method, "p of the cost", nan if p is None else p, EARLY_P),
    ]
    rows += [
        _rung(method, f"cost/goal to '{twin}'", cost_ratio(ours, by_method[twin]).estimate, TWIN_COST) for twin in twins
    ]
    return [finite({**row, "rung": f"a, {method}"}) for row in rows]


def _rung(rung: str, measure: str, found: float, wanted: float, at_least: bool = False) -> Row:
    reached = found >= wanted if at_least else found <= wanted
    return {"rung": rung, "measure": measure, "bound": "at least" if at_least else "at most", "wanted": wanted,
            "found": found, "reached": reached}  # fmt: skip
