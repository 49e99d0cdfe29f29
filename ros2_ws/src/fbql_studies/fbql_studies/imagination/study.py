"""Is it learning or knowledge? fbql_model in the paper's budget, without the parts that were built in, and in other worlds.

A task is a training (20 guided episodes, then until 50 goals) and the frozen play of its policy, or the control of a tree
set in a world: the Subsumption that is tuned for both. Each training is compared with its own twin, the policy before
anything was learned from an episode that the guide did not drive; for fbql_model that is after the first imagination.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

from fbql.match.in_process import play
from fbql.match.trees import playing_trees
from fbql.statistics.runs import RunCounts, Runs, method_row, runs_by_method
from fbql.statistics.tables import Row, mean_of, with_all_columns
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import Phase
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.methods import FBQL, FBQL_MODEL, RETUNED, TUNED, guided
from fbql_studies.common.play import counts_of, frozen
from fbql_studies.common.training import (
    MOST_TREE_SETS,
    SEEDS_OF_A_TREE_SET,
    Played,
    Seeds,
    add_max_steps,
    judge,
    training_of,
)
from fbql_studies.common.tuning import retuned, subsumption
from fbql_studies.common.variants import Changes, as_set
from fbql_studies.imagination import tables
from fbql_studies.runner.study import MEASURED, MOST_PLAYED, Parameters, Result, StudyTask, add_count, check_counts

DESCRIPTION = (
    "fbql_model in the paper's budget without the parts that are built in, and in worlds that it was not built on"
)
CAPTIONS = {
    "fusion_imagination": "What a goal costs frozen after the training, relative to the Subsumption that is re-tuned for the same trees and world, with 95 % intervals",
}
COLUMNS, words = tables.COLUMNS, tables.words
SEEDS = Seeds(1501, 11000)
"""Used for nothing else: neither by the prototype nor to choose a parameter."""
MOST_EPISODES = 400
"""A training ends after this many episodes, regardless of its goals."""

_NOTHING_FITTED_BY_HAND: Changes = {"model_known_sizes": False, "model_mirror": False, "model_gain_deviation": 0.0}
_EVERYWHERE: Changes = {"model_robot_wall_m": 10.0, "model_ball_robot_m": 10.0, "model_ball_wall_m": 10.0}
"""The forests predict wherever robot and ball are: no body is ever free, and walls are nothing special."""
VARIANTS: Mapping[str, Changes] = {
    "sizes not known": {"model_known_sizes": False},
    "distances fitted": {"model_robot_wall_m": -1.0, "model_ball_robot_m": -1.0, "model_ball_wall_m": -1.0},
    "free and near not told apart": _EVERYWHERE,
    "steps not mirrored": {"model_mirror": False},
    "nothing mirrored": {"model_mirror": False, "fbql_mirror": False},
    "wheel gains fitted": {"model_gain_deviation": -1.0},
    "wheel gains exact": {"model_gain_deviation": 0.0},
    "none of these": {**_NOTHING_FITTED_BY_HAND, **_EVERYWHERE},
    "generic, extra-trees": {**_NOTHING_FITTED_BY_HAND, "model_family": "forest"},
    "generic, nearest neighbours": {**_NOTHING_FITTED_BY_HAND, "model_family": "neighbours"},
    "generic, linear": {**_NOTHING_FITTED_BY_HAND, "model_family": "linear"},
    "guided steps only": {"fbql_model_data": "guided"},
}
"""What is changed in fbql_model. The last one imagines as much as ever, but never learns from a step of its own."""
WORLDS: Mapping[str, Changes] = {
    "ball and robot have friction 0.1": {"ball_robot_friction": 0.1},
    "ball and robot have friction 0.2": {"ball_robot_friction": 0.2},
    "the robot has half its mass": {"robot_mass_kg": 0.3},
    "the robot has twice its mass": {"robot_mass_kg": 1.2},
    "the ball has twice its mass": {"ball_mass_kg": 0.092},
    "wheels have a third of their grip": {"lateral_grip_m_s2": 5.0},
    "wheels have twice their grip": {"lateral_grip_m_s2": 30.0},
    "a step takes 1/30 s": {"dt_s": 1 / 30},
    "a step takes 1/120 s": {"dt_s": 1 / 120},
    "nothing bounces": {"ball_wall_restitution": 0.1, "ball_robot_restitution": 0.0},
    "everything bounces": {"ball_wall_restitution": 0.8, "ball_robot_restitution": 0.6},
    "sensors are noisy": {
        "position_noise_m": 0.001, "yaw_noise_rad": 0.01, "speed_noise_m_s": 0.02, "yaw_rate_noise_rad_s": 0.2,
    },
    "sensors are three times as noisy": {
        "position_noise_m": 0.003, "yaw_noise_rad": 0.03, "speed_noise_m_s": 0.06, "yaw_rate_noise_rad_s": 0.6,
    },
    "commands are 50 ms late": {"command_delay_s": 0.05},
    "commands are 100 ms late": {"command_delay_s": 0.1},
}  # fmt: skip
"""What is changed in the world, in training and in play alike, for the controls as well. The trees are always those of the
default world."""


class Trial(NamedTuple):
    """What is trained, and in which world."""

    learner: str
    changes: Changes
    """To the learner's parameters."""
    world: str
    """Name in WORLDS; "" is the default."""


TRIALS: Mapping[str, Trial] = {
    FBQL_MODEL: Trial(FBQL_MODEL, {}, ""),
    FBQL: Trial(FBQL, {}, ""),
    **{f"{FBQL_MODEL}, {name}": Trial(FBQL_MODEL, changes, "") for name, changes in VARIANTS.items()},
    **{f"{FBQL_MODEL} where {name}": Trial(FBQL_MODEL, {}, name) for name in WORLDS},
}
"""Method -> how it is trained."""


def retuned_where(world: str) -> str:
    """The Subsumption that is tuned for the trees and a world."""
    return f"{RETUNED} where {world}" if world else RETUNED


CONTROLS = (TUNED, *map(retuned_where, ("", *WORLDS)))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--trees", 5, "tree sets, each from other demonstrations")
    add_count(parser, "--seeds", 4, "trainings on each tree set")
    most = f"a training that takes more than {MOST_EPISODES} episodes ends there"
    add_count(parser, "--goals", 50, f"goals of a training after its guided episodes; {most}")
    add_count(parser, "--evaluate", 200, "episodes of frozen play")
    add_max_steps(parser)


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """For each seed and tree set a task for each training, all methods before the next set; then the controls."""
    check_counts(
        options,
        trees=MOST_TREE_SETS,
        seeds=SEEDS_OF_A_TREE_SET,
        goals=MOST_EPISODES,
        evaluate=MOST_PLAYED,
        max_steps=MOST_PLAYED,
    )
    given = {"evaluate": options.evaluate, "max_steps": options.max_steps}
    sets = range(options.trees)
    trainings = [
        StudyTask(
            f"{_file_name(method)}-trees{SEEDS.tree(k)}-seed{seed}",
            {"method": method, "set": k, "seed": seed, "goals": options.goals, **given},
        )
        for seed in range(options.seeds)
        for k in sets
        for method in TRIALS
    ]
    controls = [
        StudyTask(
            f"{_file_name(retuned_where(world))}-trees{SEEDS.tree(k)}-seeds{options.seeds}",
            {"world": world, "set": k, "seeds": options.seeds, **given},
        )
        for k in sets
        for world in ("", *WORLDS)
    ]
    return [*trainings, *controls]


def _file_name(method: str) -> str:
    return re.sub(r"[^a-z0-9.-]+", "_", method)


def run(parameters: Parameters) -> Result:
    """Trains a method and plays it and its twin frozen, or tunes and plays the control of a world."""
    begun_s = process_time()
    behaviors = SEEDS.behaviors(parameters["set"])
    result = (_trained if "method" in parameters else _control)(parameters, behaviors)
    return {**result, MEASURED: {"processor_s": process_time() - begun_s}}


def world_loop(world: str, max_steps: int) -> WorldLoop:
    """A world, whose episodes last as long as `max_steps` of the default world."""
    changed = SimulationParameters(**WORLDS[world]) if world else SimulationParameters()
    steps = round(max_steps * SimulationParameters().dt_s / changed.dt_s)
    return WorldLoop(SimulationParameters(**(WORLDS[world] if world else {}), max_steps=max(steps, 1)))


def _trained(parameters: Parameters, behaviors: list[Behavior]) -> Result:
    method = parameters["method"]
    learner, changes, world = TRIALS[method]
    loop = world_loop(world, parameters["max_steps"])
    run_seed = SEEDS.training(parameters["seed"])
    fusion = training_of(run_seed, MOST_EPISODES, learner, **{"goals": parameters["goals"], **changes})
    policy, twin, course = _train(fusion, behaviors, loop)
    played: Played = {method: (fusion, policy), guided(method): (fusion, twin)}
    return {"runs": judge(SEEDS, parameters, played, behaviors, loop), "trained": method, "course": course}


def _train(
    fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop
) -> tuple[Policy | None, Policy | None, Result]:
    """The policy of a training, what it was before anything was learned from an episode that was not guided, and the counts of
    these."""
    session = SoccerSession(fusion, trees=playing_trees(behavior.tree for behavior in behaviors))
    twin: Policy | None = None

    def episode_ended() -> bool:
        nonlocal twin
        if twin is None and session.phase is Phase.LEARNING:
            twin = session.policy()  # no learner updates after a single episode
        return True

    play(session, loop, behaviors, episode_ended)
    return session.policy(), twin, counts_of([each for each in session.records if each.phase is not Phase.GUIDED])


def _control(parameters: Parameters, behaviors: list[Behavior]) -> Result:
    tree_set, episodes, world = parameters["set"], parameters["evaluate"], parameters["world"]
    loop = world_loop(world, parameters["max_steps"])
    thresholds = retuned(behaviors, loop)
    played = {retuned_where(world): subsumption(thresholds, 0, episodes)}
    if not world:
        played[TUNED] = FusionParameters(controller="subsumption", preset="tuned")
    runs: list[Row] = [
        SEEDS.row(method, tree_set, seed, frozen(fusion, behaviors, loop, SEEDS.judging(tree_set, seed), episodes))
        for seed in range(parameters["seeds"])
        for method, fusion in played.items()
    ]
    return {"runs": runs, "thresholds": list(thresholds)}


def table(results: Mapping[str, Result]) -> list[Row]:
    """The frozen play of every method, paired with the re-tuned Subsumption of its world and with its own twin."""
    by_method = _runs(results)
    return with_all_columns({**_row(method, by_method), **_course(method, results)} for method in by_method)


def _runs(results: Mapping[str, Result]) -> dict[str, Runs]:
    found: list[RunCounts] = [run for result in results.values() for run in result["runs"]]
    methods = [each for method in TRIALS for each in (method, guided(method))]
    return runs_by_method(found, (*CONTROLS, *methods))


def _row(method: str, by_method: Mapping[str, Runs]) -> Row:
    trial = TRIALS.get(method.removesuffix(guided("")), TRIALS[FBQL_MODEL])
    world = trial.world or next((each for each in WORLDS if method == retuned_where(each)), "")
    controls = {"retuned": retuned_where(world)}
    if method in TRIALS:
        controls["guided"] = guided(method)
    if not world:
        controls["default"] = FBQL_MODEL
    return {
        **method_row(method, by_method, controls),
        "is_twin": method.endswith(guided("")),
        "part": tables.BUILT_IN if not world else tables.WORLDS,
        "changes": as_set({**trial.changes, **WORLDS.get(world, {})}),
    }


def _course(method: str, results: Mapping[str, Result]) -> Row:
    """What a goal cost while it was learned, and what the task took."""
    own = [result for result in results.values() if result.get("trained") == method]
    goals = sum(result["course"]["goals"] for result in own)
    steps = sum(result["course"]["steps"] for result in own)
    return {
        "learning_cost": steps / goals if goals else None,
        "processor_s": mean_of([result[MEASURED]["processor_s"] for result in own]),
    }


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """The cost of each method, and the numbers it is drawn from (curves.json)."""
    from fbql_studies.common.drawing import keep_and_draw
    from fbql_studies.imagination.figures import FIGURES

    names = ("method", "ratio_retuned", "ratio_retuned_low", "ratio_retuned_high")
    costs: list[dict[str, Any]] = [
        {name: row[name] for name in names}
        for row in table(results)
        if row["method"] in TRIALS and row["ratio_retuned"] is not None
    ]
    return keep_and_draw(FIGURES, {"imagination": costs} if costs else {}, directory)
