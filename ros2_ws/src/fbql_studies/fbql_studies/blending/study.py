"""Does blending help? fbql selects one behavior; here it also gets mixtures to choose from, blends by its weights, or has its
commands smoothed, in play alone or in training as well."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fbql.match.in_process import play
from fbql.statistics.runs import method_row, runs_by_method
from fbql.statistics.tables import Row, Table, tabulate
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.blending.mixing import SmoothedLoop, is_mixture, with_copies, with_mixtures
from fbql_studies.common import methods
from fbql_studies.common.controls import controls_played
from fbql_studies.common.fusion_tables import METHOD_COLUMNS, methods_table, robust_table, share
from fbql_studies.common.methods import FBQL, RETUNED
from fbql_studies.common.play import counts_of
from fbql_studies.common.training import Seeds, add_training_options, train, training_of
from fbql_studies.common.variants import costs_of, tasks_of
from fbql_studies.runner.study import Parameters, Result, StudyTask

DESCRIPTION = (
    "whether blending helps: fbql with mixtures as further choices, with blended play, and with smoothed commands"
)
CAPTIONS = {
    "fusion_blending": "What a goal costs with blended commands, relative to fbql that selects on the same episodes, with 95 % "
    "intervals",
}
COLUMNS = {
    **METHOD_COLUMNS,
    "mixed_share": "share of the steps of frozen play whose command was a mixture, in which no behavior weighed .99 or more, mean over "
    "runs; smoothing is not counted; null for the controls",
}
SEEDS = Seeds(1701, 15_000)
"""Used by no other study."""
MIXED_STEPS = "mixed_steps"
ALONE = 0.99
"""Weight from which on a behavior as good as drives alone."""


class Way(NamedTuple):
    """A way to blend."""

    team: Callable[[Sequence[Behavior]], list[Behavior]] = list
    """What there is to choose from."""
    smoothing: float = 1.0
    """Steps over which commands are smoothed; 1: not at all."""
    changes: Mapping[str, Any] = {}
    """Parameters that differ from fbql's defaults."""


TRAINED: dict[str, Way] = {
    FBQL: Way(),
    "mixtures as further choices": Way(with_mixtures),
    "copies as further choices": Way(with_copies),
    "smoothed over 2 steps": Way(smoothing=2.0),
    "smoothed over 4 steps": Way(smoothing=4.0),
}
"""Method -> how it is trained and played. Copies are what mixtures are to be compared with: as many choices, nothing new."""
PLAYED: dict[str, Way] = {
    "blended play": Way(changes={"fbql_play": "blended"}),
    "play smoothed over 2 steps": Way(smoothing=2.0),
    "play smoothed over 4 steps": Way(smoothing=4.0),
}
"""Method -> how that which the default learned is played."""
CONTROLS = {"default": FBQL, "retuned": RETUNED}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=5, seeds=2, episodes=3000, evaluate=200)


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """A training for each seed, tree set and way, the default first; then the controls."""
    return tasks_of(SEEDS, tuple(TRAINED), options)


def run(parameters: Parameters) -> Result:
    """Trains one way and plays it frozen, the default in all ways of play; or plays the controls of a tree set."""
    method, tree_set = parameters["part"], parameters["set"]
    behaviors = SEEDS.behaviors(tree_set)
    simulation = SimulationParameters(max_steps=parameters["max_steps"])
    if method not in TRAINED:
        return controls_played(SEEDS, parameters, behaviors, WorldLoop(simulation))
    way, seed, episodes = TRAINED[method], parameters["seed"], parameters["episodes"]
    team = way.team(behaviors)
    fusion = training_of(SEEDS.training(seed), episodes, behaviors=[each.name for each in team])
    trained = train(fusion, team, _loop(way, simulation))
    run_seed = SEEDS.judging(tree_set, seed)
    runs: list[Row] = []
    for name, played in {method: way, **(PLAYED if method == FBQL else {})}.items():
        asked = training_of(
            run_seed, parameters["evaluate"], behaviors=fusion.behaviors, learn=False, guided=0, **played.changes
        )
        counts = _played(SoccerSession(asked, trained.policy), team, _loop(played, simulation))
        runs.append(SEEDS.row(name, tree_set, seed, counts))
    return {"runs": runs, "curve": trained.curve, "size": trained.size}


def _loop(way: Way, simulation: SimulationParameters) -> WorldLoop:
    return WorldLoop(simulation) if way.smoothing == 1.0 else SmoothedLoop(simulation, way.smoothing)


def _played(session: SoccerSession, team: Sequence[Behavior], loop: WorldLoop) -> Result:
    """Counts of frozen play, and of the steps whose command was a mixture."""
    mixed = 0

    def see(world: World, _outputs: Sequence[BehaviorOutput], _command: WheelCommand, decision: Decision) -> None:
        nonlocal mixed
        if not world.ended:
            alone = decision.driver
            mixed += is_mixture(team[alone]) if alone >= 0 else max(decision.weights) < ALONE

    play(session, loop, team, lambda: True, see)
    return {**counts_of(session.records), MIXED_STEPS: mixed}


def table(results: Mapping[str, Result]) -> list[Row]:
    """The frozen play of each method, compared with fbql that selects and with the re-tuned Subsumption."""
    found = (run for result in results.values() for run in result["runs"])
    by_method = runs_by_method(found, (*methods.CONTROLS, *TRAINED, *PLAYED))
    rows: list[Row] = []
    for method, runs in by_method.items():
        counted = [run[MIXED_STEPS] / run["steps"] for run in runs.values() if MIXED_STEPS in run]
        mixed = sum(counted) / len(counted) if counted else None
        rows.append({**method_row(method, by_method, CONTROLS), "mixed_share": mixed})
    return rows


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    controls = {"default": "fbql", "retuned": "re-tuned"}
    mixed = [row for row in rows if row["mixed_share"] is not None]
    return {
        "ways to blend": methods_table(rows, controls),
        "how often commands are mixtures": tabulate(
            mixed, {"method": lambda row: row["method"], "share of the steps": lambda row: share(row["mixed_share"])}
        ),
        **robust_table(rows, controls),
    }


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """The cost of each way, and the numbers it is drawn from (curves.json)."""
    from fbql_studies.blending.figures import FIGURES
    from fbql_studies.common.drawing import keep_and_draw

    costs = costs_of(table(results))
    return keep_and_draw(FIGURES, {"blending": costs} if costs else {}, directory)
