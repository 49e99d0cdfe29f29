"""What changes of fbql are worth: one each, trained and played like the default, on the same trees and seeds."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from fbql.match.options import set_text
from fbql.statistics.runs import Runs, method_row, runs_by_method
from fbql.statistics.tables import Row, mean_of
from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies import fusion_controls
from fbql_studies.fusion_controls import PAPER, RETUNED, TUNED, control_tasks, controls_played
from fbql_studies.methods import LEARNERS, guided, untrained
from fbql_studies.paper import after_guidance
from fbql_studies.runner.study import Parameters, Result, Task
from fbql_studies.training import Seeds, check_options, frozen, train, training_of

DEFAULT = LEARNERS[0]
UNTRAINED, GUIDED = untrained(DEFAULT), guided(DEFAULT)
CONTROLS = {
    "default": DEFAULT, "retuned": RETUNED, "tuned": TUNED, "paper": PAPER, "untrained": UNTRAINED, "guided": GUIDED,
}  # fmt: skip

Changes = Mapping[str, Any]
"""Parameter -> value."""


class Variants(NamedTuple):
    """A study of changes."""

    figure: str
    """Name of its figure."""
    seeds: Seeds
    trained: Mapping[str, Changes]
    """Name -> what is changed in training and play."""
    played: Mapping[str, Changes]
    """Name -> what is changed in the frozen play of what the default learned."""

    def tasks(self, options: argparse.Namespace) -> list[Task]:
        """A training for each seed, tree set and variant, the default first, so that all rows grow alike; the controls."""
        check_options(options)
        given = {"evaluate": options.evaluate, "max_steps": options.max_steps}
        trainings = [
            Task(
                f"{re.sub(r'[^a-z0-9.-]+', '_', name)}-trees{self.seeds.tree(k)}-seed{seed}",
                {"part": name, "set": k, "seed": seed, "episodes": options.episodes, **given},
            )
            for seed in range(options.seeds)
            for k in range(options.trees)
            for name in (DEFAULT, *self.trained)
        ]
        return [*trainings, *control_tasks(self.seeds, options.trees, options.seeds, given)]

    def run(self, parameters: Parameters) -> Result:
        """Trains one variant and plays it; the default also as it is played otherwise, and its frozen twins."""
        behaviors = self.seeds.behaviors(parameters["set"])
        loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
        if parameters["part"] == "controls":
            return controls_played(self.seeds, parameters, behaviors, loop)
        return self._trained(parameters, behaviors, loop)

    def _trained(self, parameters: Parameters, behaviors: list[Behavior], loop: WorldLoop) -> Result:
        tree_set, seed, name = parameters["set"], parameters["seed"], parameters["part"]
        run_seed, episodes = self.seeds.training(seed), parameters["episodes"]
        fusion = training_of(run_seed, episodes, **({} if name == DEFAULT else self.trained[name]))
        trained = train(fusion, behaviors, loop)
        played = {name: (fusion, trained.policy)}
        if name == DEFAULT:
            played[UNTRAINED] = (fusion, None)
            played[GUIDED] = (fusion, after_guidance(fusion, behaviors, loop))
            for variant, changed in self.played.items():
                played[variant] = (training_of(run_seed, episodes, **changed), trained.policy)
        judge = self.seeds.judging(tree_set, seed)
        runs = [
            self.seeds.row(method, tree_set, seed, frozen(each, behaviors, loop, judge, parameters["evaluate"], policy))
            for method, (each, policy) in played.items()
        ]
        return {"runs": runs, "curve": trained.curve, "size": trained.size}

    def table(self, results: Mapping[str, Result]) -> list[Row]:
        """Method x what it reached frozen, paired with the default as well."""
        by_method = self._runs(results)
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

    def _runs(self, results: Mapping[str, Result]) -> dict[str, Runs]:
        methods = (*fusion_controls.METHODS, UNTRAINED, GUIDED, DEFAULT, *self.played, *self.trained)
        return runs_by_method((run for result in results.values() for run in result["runs"]), methods)

    def figures(self, results: Mapping[str, Result], directory: Path) -> list[Path]:
        """The cost of each variant relative to the default's, and the numbers it is drawn from (curves.json)."""
        rows = [row for row in self.table(results) if row["ratio_default"] is not None and row["method"] != DEFAULT]
        if not rows:
            return []
        from fbql_studies.fusion_figures import draw, write_curves

        names = ("method", "ratio_default", "ratio_default_low", "ratio_default_high")
        curves = {self.figure: [{name: row[name] for name in names} for row in rows]}
        return [write_curves(curves, directory), *draw(curves, directory)]


def changing(variants: Mapping[str, Changes]) -> dict[str, Changes]:
    """The variants that differ from the default."""
    default = FusionParameters()
    return {
        name: changes
        for name, changes in variants.items()
        if any(getattr(default, parameter) != value for parameter, value in changes.items())
    }


def as_set(changes: Changes) -> str:
    """Changes as the options of a command."""
    return " ".join(f"--set {name}={set_text(value)}" for name, value in changes.items())
