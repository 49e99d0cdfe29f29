"""What limits play: selection or the behaviors? An oracle selects among the trees of two teams, and fbql learns to.

The teams differ in how their instructors steer. A task is a training, the oracle on a tree set, or the controls of a tree
set. All play the same episodes, the oracle only those of the first training.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from fbql.statistics.runs import method_row, runs_by_method
from fbql.statistics.tables import Row, Table, number, tabulate
from fbql_behaviors.core.instructors import AGILE, approach, seek_ball
from fbql_behaviors.core.observation import Law
from fbql_common.core.errors import BadInput
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common import training
from fbql_studies.common.controls import bounds_of, least_steps_by_ball
from fbql_studies.common.fusion_tables import METHOD_COLUMNS, control_columns, methods_table, robust_table
from fbql_studies.common.methods import FBQL, TUNED_LAW
from fbql_studies.common.play import driven, frozen, laws_played
from fbql_studies.common.training import (
    Played,
    Seeds,
    add_training_options,
    check_training_options,
    judge,
    train,
    training_of,
)
from fbql_studies.common.tuning import retuned, subsumption
from fbql_studies.limits.oracle import SelectingOracle
from fbql_studies.runner.study import Parameters, Result, StudyTask

DESCRIPTION = (
    "what limits play: an oracle that selects who drives, and fbql, among the trees of two teams of instructors"
)
CAPTIONS = {
    "fusion_limits": "What a goal costs, relative to the tuned law on the same episodes, with 95 % intervals",
}
COLUMNS = {
    **METHOD_COLUMNS,
    **control_columns("tuned_law", "the scripted law with tuned constants"),
    **control_columns("shipped", "the same method with trees from the instructors as shipped"),
    "leaves": "leaves of the three trees, mean over tree sets; null for methods without trees",
    "bound": "what a kinematic bound assumes of the ball",
    "steps_per_episode": "the least steps that it allows, mean over the same episodes",
}
SEEDS = Seeds(1801, 17_000)
"""Used by no other study."""
SHIPPED, AGILE_TEAM = "instructors as shipped", "agile instructors"
TEAMS: Mapping[str, Mapping[str, Law]] = {
    SHIPPED: {},
    AGILE_TEAM: {
        "ball_seeking": partial(seek_ball, steering=AGILE),
        "approaching": partial(approach, steering=AGILE),
    },
}
"""Team -> behavior -> its instructor, where that is not the shipped one."""
EARLY_SHARE = 3
"""fbql is also played as it was after this part of its training."""


def oracle(team: str) -> str:
    """The oracle that selects among a team's trees."""
    return f"oracle, {team}"


def learned(team: str, episodes: int) -> str:
    """fbql after so many training episodes with a team's trees."""
    return f"{FBQL}, {team}, {episodes} episodes"


def retuned_for(team: str) -> str:
    """Subsumption with thresholds tuned for a team's trees."""
    return f"subsumption, re-tuned, {team}"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=5, seeds=2, episodes=9000, evaluate=60)


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """The controls of each tree set, a training for each seed, tree set and team, then the oracles."""
    check_training_options(options)
    if options.episodes % EARLY_SHARE:
        raise BadInput(
            f"--episodes is {options.episodes}; it must be a multiple of {EARLY_SHARE}, since fbql is also played as it was "
            f"after 1/{EARLY_SHARE} of them"
        )
    given: Parameters = {"evaluate": options.evaluate, "max_steps": options.max_steps}
    controls = [
        StudyTask(
            f"controls-trees{SEEDS.tree(k)}-seeds{options.seeds}",
            {"part": "controls", "set": k, "seeds": options.seeds, **given},
        )
        for k in range(options.trees)
    ]
    oracles = [
        StudyTask(
            f"oracle-{_key(team)}-trees{SEEDS.tree(k)}", {"part": "oracle", "team": team, "set": k, "seed": 0, **given}
        )
        for k in range(options.trees)
        for team in TEAMS
    ]
    trainings = [
        StudyTask(
            f"fbql-{_key(team)}-trees{SEEDS.tree(k)}-seed{seed}",
            {"part": FBQL, "team": team, "set": k, "seed": seed, "episodes": options.episodes, **given},
        )
        for seed in range(options.seeds)
        for k in range(options.trees)
        for team in TEAMS
    ]
    return [*controls, *trainings, *oracles]


def _key(team: str) -> str:
    return team.replace(" ", "_")


def run(parameters: Parameters) -> Result:
    """Plays the controls or the oracle of a tree set, or trains on it and plays what was learned."""
    simulation = SimulationParameters(max_steps=parameters["max_steps"])
    loop = WorldLoop(simulation)
    if parameters["part"] == "controls":
        return _controls(parameters, loop)
    tree_set, seed, team = parameters["set"], parameters["seed"], parameters["team"]
    behaviors = training.behaviors_of(SEEDS.tree(tree_set), TEAMS[team])
    if parameters["part"] == "oracle":
        selecting = SelectingOracle(behaviors, simulation)
        counts = driven(selecting.drive, loop, SEEDS.judging(tree_set, seed), parameters["evaluate"])
        return {"runs": [SEEDS.row(oracle(team), tree_set, seed, counts)]}
    episodes = parameters["episodes"]
    early = episodes // EARLY_SHARE
    fusion = training_of(SEEDS.training(seed), episodes)
    trained = train(fusion, behaviors, loop, [early])
    played: Played = {
        learned(team, early): (fusion, trained.checkpoints[early].policy),
        learned(team, episodes): (fusion, trained.policy),
    }
    return {"runs": judge(SEEDS, parameters, played, behaviors, loop), "curve": trained.curve, "size": trained.size}


def _controls(parameters: Parameters, loop: WorldLoop) -> Result:
    """The laws, the kinematic bounds, and Subsumption re-tuned for the trees of each team."""
    tree_set, episodes = parameters["set"], parameters["evaluate"]
    teams = {team: training.behaviors_of(SEEDS.tree(tree_set), instructors) for team, instructors in TEAMS.items()}
    tuned = {team: subsumption(retuned(behaviors, loop), 0, episodes) for team, behaviors in teams.items()}
    runs: list[Row] = []
    bounds: list[Row] = []
    for seed in range(parameters["seeds"]):
        judging = SEEDS.judging(tree_set, seed)
        counts = laws_played(loop, judging, episodes)
        for team, behaviors in teams.items():
            counts[retuned_for(team)] = frozen(tuned[team], behaviors, loop, judging, episodes)
        runs += [SEEDS.row(method, tree_set, seed, each) for method, each in counts.items()]
        bounds += bounds_of(SEEDS, tree_set, seed, episodes)
    leaves = {team: [behavior.tree.leaf_count for behavior in behaviors] for team, behaviors in teams.items()}
    return {"runs": runs, "bounds": bounds, "leaves": leaves}


def table(results: Mapping[str, Result]) -> list[Row]:
    """The play of each method, compared with the tuned law and with the same method of the shipped team; then the bounds."""
    found = [run for result in results.values() for run in result["runs"]]
    methods = sorted(dict.fromkeys(run["method"] for run in found), key=lambda method: AGILE_TEAM in method)
    by_method = runs_by_method(found, methods)
    rows: list[Row] = []
    for method in by_method:
        controls = {"tuned_law": TUNED_LAW}
        if AGILE_TEAM in method:
            controls["shipped"] = method.replace(AGILE_TEAM, SHIPPED)
        rows.append({**method_row(method, by_method, controls), "leaves": _leaves(results, method)})
    return rows + [{"bound": ball, "steps_per_episode": steps} for ball, steps in least_steps_by_ball(results).items()]


def _leaves(results: Mapping[str, Result], method: str) -> list[float] | None:
    """Leaves of each tree of the team that a method plays with, mean over tree sets."""
    for team in TEAMS:
        if team in method:
            counted = [result["leaves"][team] for result in results.values() if "leaves" in result]
            return [sum(each) / len(counted) for each in zip(*counted, strict=True)] or None
    return None


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    controls = {"tuned_law": "tuned law", "shipped": "the shipped instructors"}
    played = [row for row in rows if "method" in row]
    bounds = [row for row in rows if "bound" in row]
    found = {"frozen play": methods_table(played, controls)}
    if bounds:
        columns: dict[str, Callable[[Row], str]] = {
            "the ball is": lambda row: row["bound"],
            "least steps": lambda row: number(row["steps_per_episode"], ".0f"),
        }
        found["kinematic bounds"] = tabulate(bounds, columns)
    return {**found, **robust_table(played, controls)}


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """The cost of each method, and the numbers it is drawn from (curves.json)."""
    from fbql_studies.common.drawing import keep_and_draw
    from fbql_studies.limits.figures import FIGURES

    names = ("method", "ratio_tuned_law", "ratio_tuned_law_low", "ratio_tuned_law_high")
    costs = [
        {name: row[name] for name in names}
        for row in table(results)
        if row.get("ratio_tuned_law") is not None and row["method"] != TUNED_LAW
    ]
    return keep_and_draw(FIGURES, {"limits": costs} if costs else {}, directory)
