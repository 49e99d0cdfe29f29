"""Induces a behavior's tree from demonstrations and writes the tree file."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from time import monotonic
from typing import Any

from fbql_behaviors.core.evaluation import held_out_rmse
from fbql_behaviors.core.induction import InductionParameters, induce
from fbql_behaviors.core.observation import OBSERVATIONS, observation_of
from fbql_behaviors.core.patterns import Demonstration, patterns_of
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_behaviors.core.recipes import Recipe, recipe_of
from fbql_behaviors.demonstration_storage import load_demonstrations
from fbql_behaviors.storage import save_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import check, limits_of, types_of

from launcher.instruct import instruct
from launcher.make_trees import DEMONSTRATION_SEED, INDUCTION_SEED
from launcher.options import Parser
from launcher.places import new_path

PROGRAM = "induce.py"
_DONE, _FAILED, _BAD_INPUT, _INTERRUPTED = 0, 1, 2, 130


def main(argv: Sequence[str]) -> int:
    """Runs the command. Gives the exit code."""
    arguments = _parser().parse_args(list(argv))
    try:
        return _induce(arguments)
    except BadInput as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return _BAD_INPUT
    except KeyboardInterrupt:
        print(f"{PROGRAM}: interrupted; no tree was written", file=sys.stderr)
        return _INTERRUPTED


def _induce(arguments: argparse.Namespace) -> int:
    behavior = arguments.behavior
    recipe = _recipe(arguments)
    patterns = patterns_of(_demonstrations(arguments, recipe), observation_of(behavior), recipe.every, recipe.patterns)
    for warning in patterns.warnings():
        print(f"{PROGRAM}: WARNING: {warning}", file=sys.stderr)
    begun_s = monotonic()
    induced = induce(behavior, patterns, recipe.induction, arguments.seed)
    seconds = monotonic() - begun_s
    tree = induced.tree
    rmse = held_out_rmse(behavior, patterns, recipe.induction, arguments.seed)
    path = arguments.out or new_path(f"tree-{behavior}") / f"{behavior}.json"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_tree(path, tree)
    except OSError as error:
        print(f"{PROGRAM}: {path}: cannot be written ({error.strerror})", file=sys.stderr)
        return _FAILED
    result = {
        "leaves": tree.leaf_count,
        "rmse_levels": rmse,
        "rmse_rad_s": None if rmse is None else rad_s_of(rmse),
        "root_value": induced.value if isfinite(induced.value) else None,
        "seconds": seconds,
        "path": str(path),
        "patterns": len(patterns),
        "sha256": tree.hash,
    }
    print(json.dumps(result) if arguments.json else _worded(result))
    return _DONE


def _worded(result: dict[str, Any]) -> str:
    error = "n/a (it takes two demonstrations)"
    if result["rmse_levels"] is not None:
        error = f"{result['rmse_levels']:.2f} levels, {result['rmse_rad_s']:.1f} rad/s"
    value = "not finite: it diverged" if result["root_value"] is None else f"{result['root_value']:.4f} nat"
    return "\n".join(
        (
            f"{result['leaves']} leaves from {result['patterns']} patterns in {result['seconds']:.3f} s",
            f"  held-out error of the wheel velocities   {error}",
            f"  value of the root                        {value}",
            f"  tree                                     {result['path']}",
        )
    )


def _demonstrations(arguments: argparse.Namespace, recipe: Recipe) -> list[Demonstration]:
    if not arguments.demos:
        print(f"no --demos: the scripted instructor demonstrates (seed {DEMONSTRATION_SEED})", file=sys.stderr)
        return instruct(arguments.behavior, DEMONSTRATION_SEED, recipe.demonstrations, recipe.steps)
    return [found for path in arguments.demos for found in load_demonstrations(path, arguments.behavior)]


def _recipe(arguments: argparse.Namespace) -> Recipe:
    """The behavior's recipe with what the command line says instead."""
    recipe = recipe_of(arguments.behavior)
    given = {name: value for name in types_of(InductionParameters) if (value := getattr(arguments, name)) is not None}
    usual = recipe.printed if arguments.objective == "printed" else recipe.induction
    recipe = replace(recipe, induction=replace(usual, **given))
    check(recipe.induction, "induction")
    for name in ("every", "patterns"):
        value = getattr(arguments, name)
        if value is not None:
            if value < 1:
                raise BadInput(f"--{name} is {value}; it must be at least 1")
            recipe = replace(recipe, **{name: value})
    if arguments.seed < 0:
        raise BadInput(f"--seed is {arguments.seed}; it must be at least 0")
    return recipe


def _parser() -> Parser:
    parser = Parser(prog=PROGRAM, description="Induces a behavior's decision tree from demonstrations.")
    parser.add_argument("behavior", metavar="BEHAVIOR", help=f"such as: {', '.join(OBSERVATIONS)}")
    parser.add_argument(
        "--demos",
        type=Path,
        action="append",
        metavar="DIR",
        help="recording of demonstrations, or a directory of such; may be repeated (the scripted instructor, seed 1)",
    )
    parser.add_argument("--every", type=int, metavar="N", help="take every N-th step of a demonstration as a pattern")
    parser.add_argument("--patterns", type=int, metavar="N", help="take N patterns at most")
    parser.add_argument(
        "--seed", type=int, default=INDUCTION_SEED, metavar="S", help="seed of the trials (%(default)s)"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="tree file (runs/TIME-tree-BEHAVIOR/BEHAVIOR.json)")
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout and nothing else there")
    group = parser.add_argument_group("induction", "without an option the behavior's recipe holds")
    kinds = types_of(InductionParameters)
    for name, limits in limits_of(InductionParameters).items():
        unit = f" [{limits.unit}]" if limits.unit else ""
        group.add_argument(
            f"--{name.replace('_', '-')}",
            type=kinds[name],
            choices=limits.choices,
            metavar=None if limits.choices else "N",
            help=limits.description.replace("%", "%%") + unit,
        )
    return parser
