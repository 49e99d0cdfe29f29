"""The tables of the ladder: methods, tree sets, rungs b and c, and the size of what was learned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fbql.statistics.runs import Runs, cost_ratio, cost_ratios_by_trees, ratio
from fbql.statistics.tables import Row, Table, finite, number, tabulate

from fbql_studies.common.fusion_tables import METHOD_COLUMNS, SIZE_COLUMNS, byte_text, methods_table, share
from fbql_studies.common.rungs import RUNG_COLUMNS, rung_row, rungs_table

COST_TO_RETUNED = 0.65
COST_TO_RETUNED_ON_ANY_TREES = 1.0
SUCCESS_RATE = 0.98
OWN_GOALS = 0.005
STEPS_TO_LAW = 2.0
COLUMNS = {
    **METHOD_COLUMNS,
    **RUNG_COLUMNS,
    **SIZE_COLUMNS,
    "learner": "the method that was trained",
    "trees": "demonstration seed of the tree set",
    "leaves": "leaves of its trees",
    "wall_m": "re-tuned Subsumption's threshold of the wall's distance [m]",
    "approach_rad": "its threshold of the approach angle [rad]",
    "retuned_cost": "its cost_per_goal on these trees",
    "learner_cost": "the learner's",
    "ratio": "learner_cost / retuned_cost",
    "worst_run": "the same for the worst training on these trees",
    "own_goal_rate": "own goals / episodes",
    "trainings": "trainings that the means are over",
}


def tree_rows(method: str, ours: Runs, retuned: Runs, results: Mapping[str, Mapping[str, Any]]) -> list[Row]:
    """A row for each tree set: cost/goal of a method and of the re-tuned Subsumption on it."""
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
    """Rungs b and c of a method: frozen play after the training."""
    steps, floor = (ratio(runs, "steps_to_goals", "goals").estimate for runs in (ours, law))
    rows = [
        rung_row("b", "cost/goal to re-tuned", cost_ratio(ours, retuned).estimate, COST_TO_RETUNED),
        rung_row(
            "b",
            "cost/goal to re-tuned, worst tree set",
            max(cost_ratios_by_trees(ours, retuned).values()),
            COST_TO_RETUNED_ON_ANY_TREES,
        ),
        rung_row("b", "success rate", ratio(ours, "goals", "episodes").estimate, SUCCESS_RATE, at_least=True),
        rung_row("b", "own goals / episodes", ratio(ours, "own_goals", "episodes").estimate, OWN_GOALS),
    ]
    for name in ("collisions_begun", "collision_steps"):
        found, most = (ratio(runs, name, "goals").estimate for runs in (ours, retuned))
        rows.append(rung_row("b", f"{name.replace('_', ' ')} / goals, at most re-tuned's", found, most))
    rows.append(rung_row("c", "steps of a success to the scripted law's", steps / floor, STEPS_TO_LAW))
    return [finite({**row, "rung": f"{row['rung']}, {method}"}) for row in rows]


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    controls = {"retuned": "re-tuned", "paper": "paper", "untrained": "never learned", "guided": "only guided"}
    return {
        "frozen play": methods_table(rows, controls),
        "tree sets": tabulate(
            (row for row in rows if "trees" in row),
            {
                "learner": lambda row: row["learner"],
                "trees": lambda row: str(row["trees"]),
                "leaves": lambda row: row["leaves"],
                "thresholds": lambda row: f"{row['wall_m']:g} m, {row['approach_rad']:g} rad",
                "re-tuned": lambda row: number(row["retuned_cost"], ".0f"),
                "learned": lambda row: number(row["learner_cost"], ".0f"),
                "ratio": lambda row: number(row["ratio"], ".2f"),
                "worst run": lambda row: number(row["worst_run"], ".2f"),
                "success rate": lambda row: share(row["success_rate"]),
                "own goals": lambda row: f"{row['own_goal_rate']:.2%}",
            },
        ),
        "rungs b and c": rungs_table(rows),
        "size": tabulate(
            (row for row in rows if "trainings" in row),
            {
                "learner": lambda row: row["learner"],
                "trainings": lambda row: str(row["trainings"]),
                "features": lambda row: f"{row['features']:.0f}",
                "policy": lambda row: byte_text(row["bytes"]),
                "joint states met": lambda row: f"{row['joint_states']:.0f} of {row['leaf_product']:.0f}",
                "steps of a training": lambda row: f"{row['training_steps']:.3g}",
                "seconds": lambda row: f"{row['training_s']:.0f}",
            },
        ),
    }
