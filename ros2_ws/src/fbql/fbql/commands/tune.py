"""Tunes the leaves of a behavior's tree by Q-learning, and measures the tree before and after from the same starts."""

from __future__ import annotations

import argparse
from contextlib import closing
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import Any

from fbql_behaviors.core.exercises import EXERCISES, exercise_of, mean_cost
from fbql_behaviors.core.leaf_tuning import TuningParameters, tune, tuning_of
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree, save_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import check, types_of
from fbql_common.core.text import as_lines
from fbql_common.files import output_directory, write_atomically

from fbql.cli.exit_codes import DONE
from fbql.cli.interrupts import Interrupts
from fbql.cli.output import LiveLine, json_text, print_result, writing
from fbql.cli.parser import Parser, add_json_option, add_parameter_options, output_path
from fbql.cli.places import new_path
from fbql.cli.words import counted
from fbql.demonstrations.practice import PracticeGround, measure, measuring_seeds
from fbql.statistics.inference import mean_interval
from fbql.statistics.tables import finite

STARTS = 400
"""Number of starts that the tree is measured from, before and after."""


def run(arguments: argparse.Namespace, _interrupts: Interrupts) -> int:
    """Tunes and measures. Returns 0."""
    behavior = arguments.behavior
    exercise, parameters = exercise_of(behavior), _parameters(arguments)
    # Matplotlib is an extra: refused before anything is tuned.
    pictures = import_module("fbql.pictures.tuning") if arguments.figure is not None else None
    tree = _tree(behavior, arguments.trees)
    path = arguments.out or new_path(f"tuned-{behavior}") / f"{behavior}.json"
    ground = PracticeGround(behavior)
    begun_s = monotonic()
    with closing(LiveLine()) as line:

        def progress(done: int) -> None:
            line.show(f"{done} of {parameters.episodes} episodes")

        tuned = tune(tree, exercise, ground, ground.dt_s, parameters, arguments.seed, progress)
    seconds = monotonic() - begun_s
    seeds = measuring_seeds(arguments.seed, arguments.starts)
    before, after = (measure(each, exercise, ground, seeds) for each in (tree, tuned.tree))
    gained = mean_interval([exercise.cost(new) - exercise.cost(old) for old, new in zip(before, after, strict=True)])
    with writing(path), output_directory(path.parent):
        save_tree(path, tuned.tree)
    if pictures is not None:
        costs = [[exercise.cost(each) for each in attempts] for attempts in (before, after)]
        with writing(arguments.figure), output_directory(arguments.figure.parent):
            write_atomically(arguments.figure, pictures.tuning_svg(behavior, exercise.measure, *costs))
    result = finite(
        {
            "behavior": behavior,
            "leaves": tree.leaf_count,
            "leaves_changed": tuned.leaves_changed,
            "measure": exercise.measure,
            "before": mean_cost(before, exercise),
            "after": mean_cost(after, exercise),
            "difference_low": gained.low,
            "difference_high": gained.high,
            "starts": len(seeds),
            "steps": tuned.steps,
            "seconds": seconds,
            "path": str(path),
            "sha256": tuned.tree.hash,
            "tuned_from": tree.hash,
        }
    )
    print_result(json_text(result) if arguments.json else _words(result))
    return DONE


def _tree(behavior: str, directory: Path | None) -> Tree:
    path = (directory or shipped_trees()) / f"{behavior}.json"
    tree = load_tree(path)
    if tree.behavior != behavior:
        raise BadInput(f"{path}: a tree of behavior '{tree.behavior}', not of '{behavior}'; use the right file")
    return tree


def _parameters(arguments: argparse.Namespace) -> TuningParameters:
    """The behavior's settings, replaced by the command line's values where given."""
    given = {name: value for name in types_of(TuningParameters) if (value := getattr(arguments, name)) is not None}
    parameters = replace(tuning_of(arguments.behavior), **given)
    check(parameters, "leaf tuning")
    for name, low in (("seed", 0), ("starts", 1)):
        if getattr(arguments, name) < low:
            raise BadInput(f"--{name} is {getattr(arguments, name)}; it must be at least {low}")
    return parameters


def _words(result: dict[str, Any]) -> str:
    change = result["after"] - result["before"]
    low, high = result["difference_low"], result["difference_high"]
    interval = "" if low is None else f" (95 %: {low:+.1f} to {high:+.1f})"
    return as_lines(
        (
            f"{result['leaves_changed']} of {counted(result['leaves'], 'leaf', 'leaves')} changed, "
            f"after {result['steps']} steps in {result['seconds']:.1f} s",
            f"  {result['measure']}, over {counted(result['starts'], 'start')} not used in tuning",
            f"    before   {result['before']:.1f}",
            f"    after    {result['after']:.1f}, a difference of {change:+.1f}{interval}",
            f"  tree     {result['path']}",
        )
    )


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(
        prog=program,
        description="Tunes the leaves of a behavior's tree by Q-learning: small changes of the wheels' levels, kept where "
        "they pay off in practice.",
    )
    command.add_argument("behavior", metavar="BEHAVIOR", help=f"one of: {', '.join(EXERCISES)}")
    command.add_argument("--trees", type=Path, metavar="DIR", help="directory with BEHAVIOR.json (the shipped trees)")
    command.add_argument("--seed", type=int, default=1, metavar="S", help="seed of the practice (%(default)s)")
    command.add_argument(
        "--starts", type=int, default=STARTS, metavar="N", help="starts to measure from, before and after (%(default)s)"
    )
    command.add_argument(
        "--out", type=output_path, metavar="FILE", help="tree file (runs/TIME-tuned-BEHAVIOR/BEHAVIOR.json)"
    )
    command.add_argument("--figure", type=output_path, metavar="FILE", help="draw every start before and after, as SVG")
    add_json_option(command)
    add_parameter_options(command, TuningParameters, "tuning", "defaults are those set for the behavior")
    return command
