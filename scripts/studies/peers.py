"""Peers on the same work: other methods in the same simulator, with the same budget of simulated steps.

A learner trains with a training seed (below FIRST_RUN_SEED) and then plays frozen on the episodes of another seed, the same
ones for every method of a tree set and seed. What is tuned for a tree set is tuned on training episodes. Stable-Baselines3
and torch are an optional extra (requirements-peers.txt): without them its rows say so.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from math import isfinite, nan
from pathlib import Path
from typing import Any

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.errors import BadInput
from launcher.make_trees import make_tree

from studies.inference import Interval, paired_p_value, ratio_of_sums
from studies.paper import BEHAVIORS, FIRST_RUN_SEED, FIRST_TREE_SEED
from studies.study import MEASURED, Parameters, Result, Row, Task
from studies.tree_play import Score

DESCRIPTION = (
    "other methods on the same work, simulator and budget: Q-learning, PPO, constant weights, single behaviors"
)
FIRST_TRAINING_SEED = 100
SEEDS_OF_A_TREE_SET = 100
MOST_TREE_SETS = (FIRST_RUN_SEED - FIRST_TRAINING_SEED) // SEEDS_OF_A_TREE_SET
CONTROLS = "controls"
EXTRA = "stable_baselines3"
NOT_INSTALLED = "not installed: pip install -r requirements-peers.txt"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    parser.add_argument("--seeds", type=int, default=4, metavar="N", help="training seeds of each tree set (4)")
    parser.add_argument("--trees", type=int, default=5, metavar="N", help="tree sets, each of other demonstrations (5)")
    parser.add_argument(
        "--steps", type=int, default=1_500_000, metavar="N", help="simulated steps of each training (1500000)"
    )
    parser.add_argument(
        "--episodes", type=int, default=100, metavar="N", help="episodes that each frozen policy is played on (100)"
    )


def tasks(options: argparse.Namespace) -> list[Task]:
    """One for the controls of each tree set, one for each learner, tree set and seed; those that can't run are left out."""
    limits = {"seeds": SEEDS_OF_A_TREE_SET, "trees": MOST_TREE_SETS, "steps": 2**62, "episodes": 2**31}
    for name, most in limits.items():
        if not 1 <= getattr(options, name) <= most:
            raise BadInput(f"--{name} is {getattr(options, name)}; it must be 1 to {most}")
    if find_spec("gymnasium") is None:
        raise BadInput("the study of peers needs Gymnasium: pip install -r requirements-study.txt")
    from peers.learners import LEARNERS, NEED_PPO

    learners = LEARNERS
    if find_spec(EXTRA) is None:
        learners = tuple(method for method in LEARNERS if method not in NEED_PPO)
        print(f"left out: {'; '.join(NEED_PPO)} ({NOT_INSTALLED})", file=sys.stderr)
    sets = range(options.trees)
    given = {"steps": options.steps, "episodes": options.episodes}
    found = [
        Task(f"{CONTROLS}-trees{FIRST_TREE_SEED + k}", {"part": CONTROLS, "set": k, "seeds": options.seeds, **given})
        for k in sets
    ]
    for method in learners:  # a study that is cut short has whole methods
        for seed in range(options.seeds):
            for k in sets:
                key = f"{method.replace(', ', '-').replace(' ', '_')}-trees{FIRST_TREE_SEED + k}-seed{seed}"
                found.append(Task(key, {"part": method, "set": k, "seed": seed, **given}))
    return found


def run(parameters: Parameters) -> Result:
    """Trains and plays one learner, or plays all controls of a tree set."""
    tree_set, episodes = parameters["set"], parameters["episodes"]
    behaviors = [Behavior(name, make_tree(name, FIRST_TREE_SEED + tree_set).tree) for name in BEHAVIORS]
    if parameters["part"] == CONTROLS:
        return _controls(parameters, behaviors)
    from peers.learners import Lesson, learn

    seed = parameters["seed"]
    training_seed = training_seed_of(tree_set, seed)
    lesson = Lesson(behaviors, parameters["steps"], training_seed, evaluation_seed_of(tree_set, seed), episodes)
    learned = learn(parameters["part"], lesson)
    row = _run_row(parameters["part"], tree_set, seed, learned.score, learned.course.steps)
    row |= {"played": learned.played, "curve": learned.course.slices()}
    return {"runs": [row], MEASURED: {"training_s": learned.training_s}}


def _controls(parameters: Parameters, behaviors: Sequence[Behavior]) -> Result:
    from peers.controls import CONSTANT, Controls

    controls = Controls(behaviors, parameters["steps"])
    tree_set = parameters["set"]
    rows = [
        _run_row(method, tree_set, seed, score, controls.weights_steps if method == CONSTANT else 0)
        for seed in range(parameters["seeds"])
        for method, score in controls.play(evaluation_seed_of(tree_set, seed), parameters["episodes"]).items()
    ]
    return {"runs": rows, "thresholds": list(controls.thresholds), "weights": list(controls.weights)}


def training_seed_of(tree_set: int, seed: int) -> int:
    """The run seed of a training, below FIRST_RUN_SEED: another one for each tree set and seed."""
    return FIRST_TRAINING_SEED + tree_set * SEEDS_OF_A_TREE_SET + seed


def evaluation_seed_of(tree_set: int, seed: int) -> int:
    """The run seed of the frozen play, from FIRST_RUN_SEED on: another one for each tree set and seed."""
    return FIRST_RUN_SEED + training_seed_of(tree_set, seed)


def _run_row(method: str, tree_set: int, seed: int, score: Score, training_steps: int) -> dict[str, Any]:
    return {
        "method": method,
        "tree_seed": FIRST_TREE_SEED + tree_set,
        "seed": seed,
        "training_steps": training_steps,
        **score._asdict(),
    }


def table(results: Mapping[str, Result]) -> list[Row]:
    """Method x what it reached frozen, with intervals over runs, and paired with Subsumption on the same episodes."""
    from peers.controls import PAPER, RETUNED
    from peers.learners import NEED_PPO

    runs = runs_of(results)
    controls = {"retuned": runs.get(RETUNED, {}), "paper": runs.get(PAPER, {})}
    seconds: dict[str, list[float]] = {}
    for result in results.values():
        if MEASURED in result:
            seconds.setdefault(result["runs"][0]["method"], []).append(result[MEASURED]["training_s"])
    rows = [_row(method, by_run, controls, seconds.get(method, [])) for method, by_run in runs.items()]
    if results and find_spec(EXTRA) is None:
        missing = [method for method in NEED_PPO if method not in runs]
        rows += [{**dict.fromkeys(rows[0]), "method": each, "runs": 0, "note": NOT_INSTALLED} for each in missing]
    return rows


def runs_of(results: Mapping[str, Result]) -> dict[str, dict[tuple[int, int], dict[str, Any]]]:
    """Method -> (tree seed, seed) -> run, controls first."""
    from peers.controls import METHODS
    from peers.learners import LEARNERS

    found: dict[str, dict[tuple[int, int], dict[str, Any]]] = {method: {} for method in (*METHODS, *LEARNERS)}
    for result in results.values():
        for each in result["runs"]:
            found[each["method"]][each["tree_seed"], each["seed"]] = each
    return {method: by_run for method, by_run in found.items() if by_run}


def _row(
    method: str,
    by_run: Mapping[tuple[int, int], Mapping[str, Any]],
    controls: Mapping[str, Mapping[tuple[int, int], Mapping[str, Any]]],
    seconds: Sequence[float],
) -> Row:
    own = list(by_run.values())
    goals = sum(each["goals"] for each in own)
    success = _ratio(own, "goals", "episodes")
    cost = _ratio(own, "steps", "goals")
    compared: Row = {}
    for name, control in controls.items():
        paired = [(each, control[run]) for run, each in by_run.items() if run in control]
        ratio, p = nan, None
        if paired and by_run is not control:
            if len(paired) > 1:
                ours, theirs = ([_cost(each) for each in side] for side in zip(*paired, strict=True))
                p = paired_p_value(ours, theirs)
            ratio = cost.estimate / _ratio([each for _, each in paired], "steps", "goals").estimate
        compared |= {f"ratio_{name}": ratio, f"p_{name}": p}
    row: Row = {
        "method": method,
        "runs": len(own),
        "episodes": sum(each["episodes"] for each in own),
        "goals": goals,
        "own_goals": sum(each["own_goals"] for each in own),
        "timeouts": sum(each["timeouts"] for each in own),
        "success_rate": success.estimate,
        "cost_per_goal": cost.estimate,
        "cost_low": cost.low,
        "cost_high": cost.high,
        "collisions_begun_per_goal": sum(each["collisions_begun"] for each in own) / goals if goals else nan,
        "collision_steps_per_goal": sum(each["collision_steps"] for each in own) / goals if goals else nan,
        **compared,
        "training_steps": sum(each["training_steps"] for each in own) / len(own),
        "training_seconds": sum(seconds) / len(seconds) if seconds else nan,
        "note": ", ".join(sorted({each["played"] for each in own if "played" in each})),
    }
    return {name: None if isinstance(value, float) and not isfinite(value) else value for name, value in row.items()}


def _ratio(runs: Sequence[Mapping[str, Any]], numerator: str, denominator: str) -> Interval:
    return ratio_of_sums([each[numerator] for each in runs], [each[denominator] for each in runs])


def _cost(run: Mapping[str, Any]) -> float:
    """cost/goal of a run; one without a goal costs what it took."""
    return run["steps"] / max(run["goals"], 1)


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """What each method costs, and the course of the trainings."""
    if not results:
        return []
    from studies.peer_figures import draw

    return draw(runs_of(results), directory)
