"""Studies of changes to fbql: one change each, trained and played like the default on the same trees and seeds."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fbql.match.options import set_text
from fbql.statistics.runs import method_row, runs_by_method
from fbql.statistics.tables import Row, Table, mean_of
from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common import methods
from fbql_studies.common.controls import control_tasks, controls_played
from fbql_studies.common.fusion_tables import METHOD_COLUMNS, SIZE_COLUMNS, methods_table, robust_table
from fbql_studies.common.methods import FBQL, PAPER, RETUNED, TUNED, guided, untrained
from fbql_studies.common.training import (
    Played,
    Seeds,
    after_guidance,
    check_training_options,
    judge,
    train,
    training_of,
)
from fbql_studies.runner.study import Parameters, Result, StudyTask

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = {
    **METHOD_COLUMNS,
    "features": SIZE_COLUMNS["features"],
    "changes": "the changes to fbql's defaults, as options of a command",
}
DEFAULT = FBQL
UNTRAINED, GUIDED = untrained(DEFAULT), guided(DEFAULT)
CONTROLS = {
    "default": DEFAULT, "retuned": RETUNED, "tuned": TUNED, "paper": PAPER, "untrained": UNTRAINED, "guided": GUIDED,
}  # fmt: skip

Changes = Mapping[str, Any]
"""Parameter -> value."""


def tasks_of(seeds: Seeds, names: Sequence[str], options: argparse.Namespace) -> list[StudyTask]:
    """A training for each seed, tree set and method, the default first, so that all rows grow at the same rate; then the
    controls.

    Raises:
        BadInput: an option out of range.
    """
    check_training_options(options)
    given = {"evaluate": options.evaluate, "max_steps": options.max_steps}
    trainings = [
        StudyTask(
            f"{re.sub(r'[^a-z0-9.-]+', '_', name)}-trees{seeds.tree(k)}-seed{seed}",
            {"part": name, "set": k, "seed": seed, "episodes": options.episodes, **given},
        )
        for seed in range(options.seeds)
        for k in range(options.trees)
        for name in names
    ]
    return [*trainings, *control_tasks(seeds, options.trees, options.seeds, given)]


def costs_of(rows: Sequence[Row]) -> list[Row]:
    """The numbers of the figure: what a goal costs with each method, relative to the default."""
    names = ("method", "ratio_default", "ratio_default_low", "ratio_default_high")
    return [
        {name: row[name] for name in names}
        for row in rows
        if row["ratio_default"] is not None and row["method"] != DEFAULT
    ]


class Variants(NamedTuple):
    """The changes of a study, and how they are tested."""

    seeds: Seeds
    trained: Mapping[str, Changes]
    """Name -> changes to training and play."""
    played: Mapping[str, Changes]
    """Name -> changes to the frozen play of what the default learned."""

    def tasks(self, options: argparse.Namespace) -> list[StudyTask]:
        """A training for each seed, tree set and variant, and the controls."""
        return tasks_of(self.seeds, (DEFAULT, *self.trained), options)

    def run(self, parameters: Parameters) -> Result:
        """Trains one variant and plays it frozen; for the default also its variants of play and its frozen twins."""
        behaviors = self.seeds.behaviors(parameters["set"])
        loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
        if parameters["part"] == "controls":
            return controls_played(self.seeds, parameters, behaviors, loop)
        return self._trained(parameters, behaviors, loop)

    def _trained(self, parameters: Parameters, behaviors: list[Behavior], loop: WorldLoop) -> Result:
        name, episodes = parameters["part"], parameters["episodes"]
        run_seed = self.seeds.training(parameters["seed"])
        fusion = training_of(run_seed, episodes, **({} if name == DEFAULT else self.trained[name]))
        trained = train(fusion, behaviors, loop)
        played: Played = {name: (fusion, trained.policy)}
        if name == DEFAULT:
            played[UNTRAINED] = (fusion, None)
            played[GUIDED] = (fusion, after_guidance(fusion, behaviors, loop))
            for variant, changed in self.played.items():
                played[variant] = (training_of(run_seed, episodes, **changed), trained.policy)
        runs = judge(self.seeds, parameters, played, behaviors, loop)
        return {"runs": runs, "curve": trained.curve, "size": trained.size}

    def table(self, results: Mapping[str, Result]) -> list[Row]:
        """The frozen play of each method, compared with the default as well as with the controls."""
        order = (*methods.CONTROLS, UNTRAINED, GUIDED, DEFAULT, *self.played, *self.trained)
        by_method = runs_by_method((run for result in results.values() for run in result["runs"]), order)
        features: dict[str, list[float]] = {}
        for result in results.values():
            if "size" in result:
                features.setdefault(result["runs"][0]["method"], []).append(result["size"]["features"])
        changed = {**self.played, **self.trained}
        return [
            {
                **method_row(method, by_method, CONTROLS),
                "features": mean_of(features.get(method, [])),
                "changes": as_set(changed.get(method, {})),
            }
            for method in by_method
        ]

    def costs(self, results: Mapping[str, Result]) -> list[Row]:
        """The numbers of the figure: the cost of each variant relative to the default's."""
        return costs_of(self.table(results))

    def figures(
        self, drawings: Mapping[str, Callable[[Any], Figure]], results: Mapping[str, Result], directory: Path
    ) -> list[Path]:
        """The cost of each variant, and the numbers it is drawn from (curves.json)."""
        from fbql_studies.common.drawing import keep_and_draw

        costs = self.costs(results)
        return keep_and_draw(drawings, dict.fromkeys(drawings, costs) if costs else {}, directory)


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    controls = {"default": "default", "retuned": "re-tuned", "paper": "paper", "untrained": "never learned",
                "guided": "only guided"}  # fmt: skip
    return {"one change each": methods_table(rows, controls), **robust_table(rows, controls), **changes_table(rows)}


def changes_table(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table of the rows' changes; none if the data lack them."""
    changed = [[row["method"], f"`{row['changes']}`"] for row in rows if row.get("changes")]
    return {"what is changed": Table(["method", "changes"], changed)} if changed else {}


def changing(variants: Mapping[str, Changes]) -> dict[str, Changes]:
    """The variants that differ from today's default."""
    default = FusionParameters()
    return {
        name: changes
        for name, changes in variants.items()
        if any(getattr(default, parameter) != value for parameter, value in changes.items())
    }


def as_set(changes: Changes) -> str:
    """Changes as the options of a command."""
    return " ".join(f"--set {name}={set_text(value)}" for name, value in changes.items())
