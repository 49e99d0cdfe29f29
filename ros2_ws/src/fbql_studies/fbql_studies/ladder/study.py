"""The ladder: FBQL trained on fresh tree sets, then played frozen against its controls on the same unseen episodes.

A task is the training of one learner on one tree set with one seed, or the controls of one tree set. Training, tuning
and evaluation use separate run seeds.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from fbql.statistics.runs import Runs, method_row, runs_by_method
from fbql.statistics.tables import Row, with_all_columns
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.errors import BadInput
from fbql_common.own_code import content_hash
from fbql_fusion.controller_loading import KnownController, resolve_controller
from fbql_fusion.core.registry import source_file
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common import methods
from fbql_studies.common.controls import control_tasks, controls_played, least_steps_by_ball
from fbql_studies.common.learning_curves import Trainings, growth, learning, mean_sizes, trainings_by
from fbql_studies.common.methods import (
    FBQL,
    FBQL_MODEL,
    FBQL_VALUE,
    LAW,
    LEARNERS,
    PAPER,
    RETUNED,
    SENSED,
    SENSED_CRITIC,
    TUNED,
    TUNED_LAW,
    drawn,
    guided,
    imagined_once,
    untrained,
)
from fbql_studies.common.training import (
    FIRST_RUN_SEED,
    FIRST_TREE_SEED,
    Played,
    Seeds,
    add_first_seeds,
    add_training_options,
    after_guidance,
    as_it_learns,
    check_first_seeds,
    check_training_options,
    judge,
    train,
    training_of,
)
from fbql_studies.ladder import tables
from fbql_studies.ladder.weight_maps import weight_maps
from fbql_studies.runner.study import MEASURED, Parameters, Result, StudyTask

DESCRIPTION = "the learners trained on fresh trees, then compared frozen with Subsumption, constant weights, their twins and the law"
CAPTIONS = {
    "fusion_ladder": "What a goal costs, relative to the re-tuned Subsumption on the same episodes, with 95 % intervals",
    "fusion_learning": "Learning curves over blocks of 100 training episodes, exploration included; dashed: frozen controls",
    "fusion_coverage": "Joint states met in the course of the training",
    "fusion_maps": "The behavior with the largest weight at each place of the robot, for each learner after its training on tree set 1001 with seed 0; the ball lies at the white dot, the attacked goal is on the right; the paler, the nearer to equal weights",
}
COLUMNS, words = tables.COLUMNS, tables.words
SEEDS = Seeds(FIRST_TREE_SEED, FIRST_RUN_SEED)
"""Those of the tables in docs/results, unless other ones are asked for."""

TRAINED: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    FBQL: (FBQL, {}),
    SENSED: (FBQL, SENSED_CRITIC),
    FBQL_VALUE: (FBQL_VALUE, {}),
    FBQL_MODEL: (FBQL_MODEL, {}),
}
"""Learner -> its controller, and the parameters that differ from its defaults."""
ASKED = {"fbql": FBQL, "fbql_sensed": SENSED, "fbql_value": FBQL_VALUE, "fbql_model": FBQL_MODEL}
ALL = "all"


def _methods_of(learner: str) -> tuple[str, ...]:
    """The method that a learner trained, and its frozen twins."""
    return untrained(learner), drawn(untrained(learner)), guided(learner), learner


METHODS = (
    *methods.CONTROLS,
    *_methods_of(FBQL),
    SENSED,
    *_methods_of(FBQL_VALUE),
    imagined_once(FBQL_MODEL),
    FBQL_MODEL,
)
CONTROLS = {"retuned": RETUNED, "tuned": TUNED, "paper": PAPER, "tuned_law": TUNED_LAW}
TWINS = {
    method: {"untrained": untrained(learner), "guided": guided(learner)}
    for learner in LEARNERS
    for method in _methods_of(learner)
} | {
    SENSED: {"untrained": untrained(FBQL), "guided": guided(FBQL)},
    FBQL_MODEL: {"untrained": untrained(FBQL), "guided": guided(FBQL), "imagined": imagined_once(FBQL_MODEL)},
}
"""Method -> the frozen twins of its learner, with which it is compared in addition to CONTROLS."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=5, seeds=5, episodes=3000, evaluate=200)
    parser.add_argument(
        "--learners",
        choices=[*ASKED, ALL],
        default=ALL,
        help=f"which learner is trained: {', '.join(ASKED)} or {ALL} ({ALL}); fbql_sensed is fbql whose critic knows no more "
        "than the behaviors sense",
    )
    add_first_seeds(parser)
    parser.add_argument(
        "--checkpoints",
        nargs="+",
        type=int,
        default=argparse.SUPPRESS,
        metavar="N",
        help="training episodes after which each learner is also played frozen: how long it takes to reach the controls",
    )
    parser.add_argument(
        "--controllers",
        nargs="+",
        default=argparse.SUPPRESS,  # where it is not given, a study's directory has no such option
        metavar="SOURCE",
        help="your own controllers that take part: the name of one that an installed package declares, or FILE.py:NAME",
    )


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """A training for each learner, tree set and seed, seed by seed, so that every tree set has a training early.

    The controls come after the first learner's trainings: the rungs need just these two.
    """
    check_training_options(options)
    check_first_seeds(options)
    seeds = Seeds(options.first_trees, options.first_seed)
    given: Parameters = {"evaluate": options.evaluate, "max_steps": options.max_steps, "seeds_from": list(seeds)}
    checkpoints = sorted(set(getattr(options, "checkpoints", [])))
    for each in checkpoints:
        if not 1 <= each <= options.episodes:
            raise BadInput(f"--checkpoints has {each}; it must be 1 to the training's {options.episodes} episodes")
    kept = {"checkpoints": checkpoints} if checkpoints else {}
    alone = {"twins": True} if ASKED.get(options.learners) == SENSED else {}
    controls = control_tasks(seeds, options.trees, options.seeds, given)
    found: list[StudyTask] = []
    for asked in ASKED if options.learners == ALL else [options.learners]:
        learner = ASKED[asked]
        found += [
            StudyTask(
                f"{asked}-trees{seeds.tree(k)}-seed{seed}",
                {"part": learner, "set": k, "seed": seed, "episodes": options.episodes, **given, **alone, **kept},
            )
            for seed in range(options.seeds)
            for k in range(options.trees)
        ]
        found, controls = found + controls, []
    for key, own in _own_controllers(getattr(options, "controllers", [])).items():
        found += [
            StudyTask(
                f"{key}-trees{seeds.tree(k)}-seed{seed}",
                {**own, "set": k, "seed": seed, "episodes": options.episodes, **given, **kept},
            )
            for seed in range(options.seeds)
            for k in range(options.trees)
        ]
    return found


def _own_controllers(sources: Sequence[str]) -> dict[str, Parameters]:
    """How the keys of a controller's tasks begin, and what its tasks know of it.

    The content of the file that defines it is part of both, so that one that was edited does not resume the results of
    the other.
    """
    found: dict[str, Parameters] = {}
    for source in sources:
        known = resolve_controller(source)
        digest = _content(known)
        key = f"own-{known.name}-{digest}" if digest else f"own-{known.name}"
        found.setdefault(key, {"part": known.name, "controller": known.source or known.name, "sha256": digest})
    names = [own["part"] for own in found.values()]
    for own in found.values():
        if names.count(own["part"]) > 1:
            own["part"] += f" {own['sha256'] or 'installed'}"
    return found


def _content(known: KnownController) -> str:
    """A hash of the file that defines a controller; "" for one of this package."""
    file = known.source or source_file(known.name)
    return content_hash(file) if file else ""


def run(parameters: Parameters) -> Result:
    """Trains a learner once and plays its policy and its frozen twins, or plays the controls of a tree set."""
    seeds = Seeds(*parameters["seeds_from"])
    behaviors = seeds.behaviors(parameters["set"])
    loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
    if parameters["part"] not in TRAINED and "controller" not in parameters:
        return controls_played(seeds, parameters, behaviors, loop)
    return _trained(seeds, parameters, behaviors, loop)


def _trained(seeds: Seeds, parameters: Parameters, behaviors: list[Behavior], loop: WorldLoop) -> Result:
    learner, tree_set, seed = parameters["part"], parameters["set"], parameters["seed"]
    if own := parameters.get("controller"):
        known = resolve_controller(own)  # a worker is a separate process
        if parameters["sha256"] != _content(known):
            raise BadInput(f"{own}: it has changed since its tasks were made; start the study again")
        controller, changes = known.name, {}
    else:
        controller, changes = TRAINED[learner]
    fusion = training_of(seeds.training(seed), parameters["episodes"], controller, **changes)
    begun_s = perf_counter()
    trained = train(fusion, behaviors, loop, parameters.get("checkpoints", ()))
    training_s = perf_counter() - begun_s
    played: Played = {}
    if learner in LEARNERS or parameters.get("twins"):
        # The critic does not affect them: fbql's twins are those of the sensed critic as well.
        as_learning = training_of(fusion.seed, fusion.episodes, controller, **(changes | as_it_learns(controller)))
        played[untrained(controller)] = (fusion, None)
        played[drawn(untrained(controller))] = (as_learning, None)
        played[guided(controller)] = (fusion, after_guidance(fusion, behaviors, loop))
    elif learner == FBQL_MODEL:
        played[imagined_once(learner)] = (fusion, after_guidance(fusion, behaviors, loop))
    played[learner] = (fusion, trained.policy)
    begun_s = perf_counter()
    runs = judge(seeds, parameters, played, behaviors, loop)
    curve: list[Row] = []
    for episodes, (policy, steps) in trained.checkpoints.items():
        (counts,) = judge(seeds, parameters, {learner: (fusion, policy)}, behaviors, loop)
        curve.append({**counts, "trained": episodes, "trained_s": steps * loop.dt_s})
    seconds = {"training_s": training_s, "evaluation_s": perf_counter() - begun_s}
    result: Result = {
        "learner": learner, "runs": runs, "curve": trained.curve, "size": trained.size, MEASURED: seconds
    }  # fmt: skip
    if curve:
        result["checkpoints"] = curve
    if tree_set == seed == 0 and learner in TRAINED and trained.policy is not None:
        result["maps"] = weight_maps(fusion, trained.policy, behaviors)
    return result


def table(results: Mapping[str, Result]) -> list[Row]:
    """Methods; then each learner's tree sets and rungs b and c; then the size of what was learned."""
    by_method = _runs(results)
    rows = with_all_columns(method_row(method, by_method, CONTROLS | TWINS.get(method, {})) for method in by_method)
    controls = {*METHODS} - {*TRAINED}
    learners = [method for method in by_method if method not in controls and RETUNED in by_method]
    for learner in learners:
        rows += tables.tree_rows(learner, by_method[learner], by_method[RETUNED], results)
    for learner in learners:
        rows += tables.rung_rows(
            learner, by_method[learner], by_method[RETUNED], by_method[LAW], by_method.get(TUNED_LAW)
        )
    rows += tables.yardstick_rows(
        {learner: by_method[learner] for learner in learners}, _yardsticks(results, by_method)
    )
    rows += _reached(results, by_method)
    return rows + _sizes(results)


def _reached(results: Mapping[str, Result], by_method: Mapping[str, Runs]) -> list[Row]:
    """The learning curves of the frozen play at the checkpoints, and when each learner reached which control."""
    found: dict[str, dict[int, list[Row]]] = {}
    for result in results.values():
        for each in result.get("checkpoints", []):
            found.setdefault(each["method"], {}).setdefault(each["trained"], []).append(each)
    targets = {name: by_method[name] for name in (RETUNED, LAW, TUNED_LAW) if name in by_method}
    rows: list[Row] = []
    for learner in (each for each in by_method if each in found):
        rows += tables.checkpoint_rows(learner, dict(sorted(found[learner].items())), targets)
    return rows


def _yardsticks(results: Mapping[str, Result], by_method: Mapping[str, Runs]) -> dict[str, float]:
    """Yardstick -> its steps of a success: the laws, then the kinematic bounds of the same episodes."""
    found = {name: tables.steps_of_a_success(by_method[name]) for name in (LAW, TUNED_LAW) if name in by_method}
    return found | {f"kinematic bound, ball {ball}": steps for ball, steps in least_steps_by_ball(results).items()}


def _runs(results: Mapping[str, Result]) -> dict[str, Runs]:
    found = [run for result in results.values() for run in result["runs"]]
    return runs_by_method(found, dict.fromkeys((*METHODS, *(run["method"] for run in found))))


def _trainings(results: Mapping[str, Result]) -> dict[str, Trainings]:
    own = [result["learner"] for result in results.values() if "learner" in result]
    return trainings_by(results, lambda result: result.get("learner"), dict.fromkeys((*TRAINED, *own)))


def _sizes(results: Mapping[str, Result]) -> list[Row]:
    """Means over the trainings of each learner."""
    rows: list[Row] = []
    for learner, by_run in _trainings(results).items():
        trained = list(by_run.values())
        steps = sum(part["steps"] for each in trained for part in each["curve"]) / len(trained)
        mean = mean_sizes(trained)
        seconds = mean.pop("training_s")
        rows.append(
            {"learner": learner, "trainings": len(trained), **mean, "training_steps": steps, "training_s": seconds}
        )
    return rows


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """Learning curves, the methods, coverage and weight maps, and the numbers they are drawn from (curves.json)."""
    trained = _trainings(results)
    if not trained:
        return []
    from fbql_studies.common.drawing import keep_and_draw
    from fbql_studies.ladder.figures import FIGURES

    by_method = _runs(results)
    curves: dict[str, Any] = {
        "learning": learning(trained, {name: by_method[name] for name in (RETUNED, LAW) if name in by_method}),
        "coverage": growth(trained),
    }
    if RETUNED in by_method:
        curves["ladder"] = [
            {name: row[name] for name in ("method", "ratio_retuned", "ratio_retuned_low", "ratio_retuned_high")}
            for row in table(results)
            if "method" in row
        ]
    maps = {
        learner: result["maps"] for learner, found in trained.items() for result in found.values() if "maps" in result
    }
    if maps:
        curves["maps"] = maps
    return keep_and_draw(FIGURES, curves, directory)
