"""What each part of FBQL is worth: one change each, trained and played like the default, on trees and seeds of its own."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from studies import fusion_controls, fusion_words
from studies.comparison import Runs, mean_of, method_row, runs_by_method
from studies.fusion_controls import PAPER, RETUNED, TUNED, control_tasks, controls_played
from studies.paper import LEARNERS, after_guidance, guided, untrained
from studies.study import Parameters, Result, Row, Task
from studies.training import SENSED_CRITIC, Seeds, check_options, frozen, train, training_of
from studies.training import add_options as add_training_options

DESCRIPTION = (
    "one change of fbql at a time (but for one of four at once), each trained and played frozen like the default"
)
COLUMNS = fusion_words.COLUMNS
words = fusion_words.ablation_tables
SEEDS = Seeds(1101, 3000)
"""Others than the ladder's, so that a default chosen here is judged there by what it has not seen."""
DEFAULT = LEARNERS[0]
UNTRAINED, GUIDED = untrained(DEFAULT), guided(DEFAULT)
CONTROLS = {
    "default": DEFAULT, "retuned": RETUNED, "tuned": TUNED, "paper": PAPER, "untrained": UNTRAINED, "guided": GUIDED,
}  # fmt: skip
FOREVER = 10_000_000

Changes = Mapping[str, Any]


def trained_variants() -> dict[str, Changes]:
    """Name -> what is changed in training and play. Values that are the default make no variant."""
    default = FusionParameters()
    found: dict[str, Changes] = {
        "no leaves, no pairs of leaves": {"fbql_leaf_pairs": False},
        "no tilings of pairs": {"fbql_pair_tilings": 0},
        "no tilings of all": {"fbql_joint_tilings": 0},
        "leaves and pairs of leaves only": {"fbql_pair_tilings": 0, "fbql_joint_tilings": 0},
        "no mirror": {"fbql_mirror": False},
        "sensed critic": SENSED_CRITIC,
        "no guided episodes": {"guided": 0},
        "paper's guide": {"preset": "paper"},
        "paper's guide, failures imitated": {"preset": "paper", "fbql_imitate_failures": True},
        "guided, but not followed": {"fbql_guide_passes": 0},
        "no critic": {"fbql_value_rate": 0.0, "fbql_trace": 1.0},
        "sensed critic, with rates and trace chosen for it": {
            **SENSED_CRITIC,
            "fbql_value_rate": 0.1,
            "fbql_trace": 0.975,
            "fbql_rate": 0.1,
        },
        "no averaging, constant rate": {"fbql_horizon": FOREVER},
    }
    series: dict[str, tuple[str, tuple[float, ...]]] = {
        "held for {} steps": ("fbql_hold_steps", (1, 2, 4, 8, 16)),
        "trace {}": ("fbql_trace", (0.9, 0.95, 0.975)),
        "rate {}": ("fbql_rate", (0.075, 0.15, 0.3)),
        "critic's rate {}": ("fbql_value_rate", (0.01, 0.03, 0.1)),
        "clip {}": ("fbql_clip", (0.2, 0.4, 1.0)),
        "collision {}": ("fbql_reward_collision", (0.0, -0.2, -5.0)),
        "entropy {}": ("fbql_entropy", (0.0, 0.0005, 0.003)),
        "discount {}": ("fbql_discount", (0.99, 0.998, 1.0)),
    }
    for name, (parameter, values) in series.items():
        found |= {name.format(f"{x:g}"): {parameter: x} for x in values if x != getattr(default, parameter)}
    return {
        name: changes
        for name, changes in found.items()
        if any(getattr(default, parameter) != value for parameter, value in changes.items())
    }


def played_variants() -> dict[str, Changes]:
    """Name -> what is changed in the frozen play of what the default learned."""
    default = FusionParameters()
    found: dict[str, Changes] = {"no patience": {"fbql_patience": 0}}
    found |= {f"{play} play": {"fbql_play": play} for play in ("held", "drawn", "blended")}
    found |= {f"play that decides every {steps} steps": {"fbql_play_steps": steps} for steps in (1, 2, 4, 8)}
    return {
        name: changes
        for name, changes in found.items()
        if any(getattr(default, parameter) != value for parameter, value in changes.items())
    }


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=2, seeds=2, episodes=1500, evaluate=200)


def tasks(options: argparse.Namespace) -> list[Task]:
    """The default first, then the controls, then a training for each variant, tree set and seed."""
    check_options(options)
    given = {"evaluate": options.evaluate, "max_steps": options.max_steps}
    each = [(k, seed) for seed in range(options.seeds) for k in range(options.trees)]

    def trainings(name: str) -> list[Task]:
        return [
            Task(
                f"{re.sub(r'[^a-z0-9.-]+', '_', name)}-trees{SEEDS.tree(k)}-seed{seed}",
                {"part": name, "set": k, "seed": seed, "episodes": options.episodes, **given},
            )
            for k, seed in each
        ]

    found = [*trainings(DEFAULT), *control_tasks(SEEDS, options.trees, options.seeds, given)]
    for name in trained_variants():
        found += trainings(name)
    return found


def run(parameters: Parameters) -> Result:
    """Trains one variant and plays it; the default also as it is played otherwise, and its frozen twins."""
    tree_set, part = parameters["set"], parameters["part"]
    behaviors = SEEDS.behaviors(tree_set)
    loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
    if part == "controls":
        return controls_played(SEEDS, parameters, behaviors, loop)
    return _trained(parameters, behaviors, loop, {} if part == DEFAULT else trained_variants()[part])


def _trained(parameters: Parameters, behaviors: list[Behavior], loop: WorldLoop, changes: Changes) -> Result:
    tree_set, seed, name = parameters["set"], parameters["seed"], parameters["part"]
    run_seed, episodes = SEEDS.training(seed), parameters["episodes"]
    fusion = training_of(run_seed, episodes, **changes)
    trained = train(fusion, behaviors, loop)
    played = {name: (fusion, trained.policy)}
    if name == DEFAULT:
        played[UNTRAINED] = (fusion, None)
        played[GUIDED] = (fusion, after_guidance(fusion, behaviors, loop))
        for variant, changed in played_variants().items():
            played[variant] = (training_of(run_seed, episodes, **changed), trained.policy)
    judge = SEEDS.judging(tree_set, seed)
    runs = [
        SEEDS.row(method, tree_set, seed, frozen(each, behaviors, loop, judge, parameters["evaluate"], policy))
        for method, (each, policy) in played.items()
    ]
    return {"runs": runs, "curve": trained.curve, "size": trained.size}


def table(results: Mapping[str, Result]) -> list[Row]:
    """Method x what it reached frozen, paired with the default as well."""
    by_method = _runs(results)
    features: dict[str, list[float]] = {}
    for result in results.values():
        if "size" in result:
            features.setdefault(result["runs"][0]["method"], []).append(result["size"]["features"])
    changed = played_variants() | trained_variants()
    return [
        {
            **method_row(method, by_method, CONTROLS),
            "features": mean_of(features.get(method, [])),
            "changes": as_set(changed.get(method, {})),
        }
        for method in by_method
    ]


def as_set(changes: Changes) -> str:
    """Changes as the options of a command."""
    return " ".join(f"--set {name}={str(value).lower()}" for name, value in changes.items())


def _runs(results: Mapping[str, Result]) -> dict[str, Runs]:
    methods = (*fusion_controls.METHODS, UNTRAINED, GUIDED, DEFAULT, *played_variants(), *trained_variants())
    return runs_by_method((run for result in results.values() for run in result["runs"]), methods)


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """The cost of each variant relative to the default's, and the numbers it is drawn from (curves.json)."""
    rows = [row for row in table(results) if row["ratio_default"] is not None and row["method"] != DEFAULT]
    if not rows:
        return []
    from studies.fusion_figures import draw, write_curves

    names = ("method", "ratio_default", "ratio_default_low", "ratio_default_high")
    curves = {"ablation": [{name: row[name] for name in names} for row in rows]}
    return [write_curves(curves, directory), *draw(curves, directory)]
