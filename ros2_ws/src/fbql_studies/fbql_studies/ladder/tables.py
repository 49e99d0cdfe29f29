"""The tables of the ladder: methods, tree sets, rungs b and c, and the size of what was learned."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from fbql.statistics.runs import Runs, cost_of, cost_ratio, cost_ratios_by_trees, ratio
from fbql.statistics.tables import Row, Table, between, finite, number, tabulate

from fbql_studies.common.fusion_tables import (
    METHOD_COLUMNS,
    SIZE_COLUMNS,
    byte_text,
    control_columns,
    methods_table,
    robust_table,
    share,
)
from fbql_studies.common.rungs import RUNG_COLUMNS, rung_row, rungs_table

COST_TO_RETUNED = 0.65
COST_TO_RETUNED_ON_ANY_TREES = 1.0
SUCCESS_RATE = 0.98
OWN_GOALS = 0.005
STEPS_TO_LAW = 2.0
STEPS_TO_TUNED_LAW = 1.6
COLUMNS = {
    **METHOD_COLUMNS,
    **control_columns("tuned_law", "the scripted law with tuned constants"),
    **control_columns(
        "imagined", "the frozen twin of fbql_model that imagined after the guided episodes, and then stopped"
    ),
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
    "trainings_played": "trainings that were played at the checkpoint",
    "yardstick": "what a method is set against: a law, or the kinematic bound, with what it assumes of the ball",
    "steps": "its steps of a success on the same episodes; of a bound, the steps that they take at least",
    "checkpoint": "training episodes after which the learner was played frozen, guided ones not counted",
    "minutes": "minutes that the robot had driven by then, guided episodes included, mean over trainings; it stands still while "
    "a model is fitted, which does not count",
    "ratios": "control -> cost_per_goal over its, with the ends of the 95 % interval",
    "target": "the control that is to be reached",
    "reached_after": "the first checkpoint at which, and at all later ones, cost_per_goal is at most the target's; null: none",
    "reached_minutes": "minutes that the robot had driven by then",
    "trainings_there": "trainings whose own cost_per_goal was at most the target's at that checkpoint; at the last one if it was "
    "not reached",
    "times": "learner -> its own steps of a success over those",
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


def checkpoint_rows(learner: str, checkpoints: Mapping[int, Sequence[Row]], targets: Mapping[str, Runs]) -> list[Row]:
    """A row for each checkpoint of a learner's trainings, and one for each control that they may have reached.

    Args:
        checkpoints: training episodes, ascending -> the frozen play after them, of each training.
    """
    curve: list[Row] = []
    below: dict[str, dict[int, tuple[bool, int]]] = {name: {} for name in targets}
    for episodes, played in checkpoints.items():
        runs: Runs = {(each["tree_seed"], each["seed"]): each for each in played}
        cost = ratio(runs, "steps", "goals")
        ratios = {name: cost_ratio(runs, control) for name, control in targets.items()}
        for name, control in targets.items():
            there = sum(key in control and cost_of(run) <= cost_of(control[key]) for key, run in runs.items())
            below[name][episodes] = ratios[name].estimate <= 1.0, there
        curve.append(
            {
                "learner": learner,
                "checkpoint": episodes,
                "trainings_played": len(runs),
                "minutes": sum(each["trained_s"] for each in played) / len(played) / 60.0,
                **finite({"cost_per_goal": cost.estimate, "cost_low": cost.low, "cost_high": cost.high}),
                "ratios": {name: list(finite(each._asdict()).values()) for name, each in ratios.items()},
            }
        )
    rows = list(curve)
    for name, found in below.items():
        reached: int | None = None
        for episodes in reversed(found):
            if not found[episodes][0]:
                break
            reached = episodes
        minutes = next((row["minutes"] for row in curve if row["checkpoint"] == reached), None)
        last = reached or max(found)
        rows.append(
            {
                "learner": learner,
                "target": name,
                "reached_after": reached,
                "reached_minutes": minutes,
                "trainings_there": found[last][1],
                "trainings_played": curve[-1]["trainings_played"],
            }
        )
    return rows


def yardstick_rows(learners: Mapping[str, Runs], yardsticks: Mapping[str, float]) -> list[Row]:
    """A row for each yardstick, with the steps of a success of each learner as a multiple of it.

    Args:
        yardsticks: name -> its steps of a success.
    """
    steps = {name: steps_of_a_success(runs) for name, runs in learners.items()}
    return [
        finite({"yardstick": name, "steps": least})
        | {"times": finite({learner: each / least for learner, each in steps.items()})}
        for name, least in yardsticks.items()
    ]


def steps_of_a_success(runs: Runs) -> float:
    """Steps of the episodes that ended in a goal, over the goals."""
    return ratio(runs, "steps_to_goals", "goals").estimate


def rung_rows(method: str, ours: Runs, retuned: Runs, law: Runs, tuned_law: Runs | None = None) -> list[Row]:
    """Rungs b and c of a method: frozen play after the training."""
    steps = steps_of_a_success(ours)
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
    rows.append(
        rung_row("c", "steps of a success to the scripted law's", steps / steps_of_a_success(law), STEPS_TO_LAW)
    )
    if tuned_law is not None:
        times = steps / steps_of_a_success(tuned_law)
        rows.append(rung_row("c", "steps of a success to the tuned law's", times, STEPS_TO_TUNED_LAW))
    return [finite({**row, "rung": f"{row['rung']}, {method}"}) for row in rows]


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    controls = {"retuned": "re-tuned", "paper": "paper", "untrained": "never learned", "guided": "only guided"}
    later = {"imagined": "imagined once", "tuned_law": "tuned law"}
    # data from before there were these controls lack their columns
    controls |= {name: label for name, label in later.items() if any(f"ratio_{name}" in row for row in rows)}
    return {
        "frozen play": methods_table(rows, controls),
        **robust_table(rows, controls),
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
        **_yardsticks(rows),
        **_checkpoints(rows),
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


def _yardsticks(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table of the yardsticks; none where the data lack them."""
    own = [row for row in rows if "yardstick" in row]
    if not own:
        return {}
    learners = list(own[0]["times"])
    head = ["yardstick", "steps of a success", *(f"{learner}, times it" for learner in learners)]
    body = [
        [row["yardstick"], number(row["steps"], ".1f"), *(number(row["times"][each], ".2f") for each in learners)]
        for row in own
    ]
    return {"yardsticks": Table(head, body)}


def _checkpoints(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table of the checkpoints; none where the data lack them."""
    curve = [row for row in rows if "checkpoint" in row]
    if not curve:
        return {}
    columns: dict[str, Callable[[Row], str]] = {
        "learner": lambda row: row["learner"],
        "episodes": lambda row: str(row["checkpoint"]),
        "minutes of robot time": lambda row: number(row["minutes"], ".1f"),
        "cost/goal (95 %)": lambda row: between(row, "cost_per_goal", "cost_low", "cost_high", ".0f"),
    }
    columns |= {f"to {name}": partial(_ratio_to, name=name) for name in curve[0]["ratios"]}
    return {
        "frozen in the course of the training": tabulate(curve, columns),
        "how long it takes to reach the controls": tabulate(
            (row for row in rows if "target" in row),
            {
                "learner": lambda row: row["learner"],
                "control": lambda row: row["target"],
                "episodes": lambda row: "not reached" if row["reached_after"] is None else str(row["reached_after"]),
                "minutes of robot time": lambda row: number(row["reached_minutes"], ".1f"),
                "trainings there": lambda row: f"{row['trainings_there']} of {row['trainings_played']}",
            },
        ),
    }


def _ratio_to(row: Row, name: str) -> str:
    estimate, low, high = row["ratios"][name]
    return between({"ratio": estimate, "low": low, "high": high}, "ratio", "low", "high", ".2f")
