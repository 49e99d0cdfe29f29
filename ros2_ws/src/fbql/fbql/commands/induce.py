"""Induces a behavior's tree from demonstrations and writes the tree file."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

from fbql_behaviors.cart import grow_cart, scikit_learn
from fbql_behaviors.core.evaluation import cross_validated_rmse, wheel_rmse
from fbql_behaviors.core.induction import InductionParameters, induce
from fbql_behaviors.core.observation import OBSERVATIONS, observation_of
from fbql_behaviors.core.patterns import Demonstration, Patterns, patterns_of
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_behaviors.core.recipes import Recipe, recipe_of
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.core.tree_value import tree_value
from fbql_behaviors.demonstration_storage import load_demonstrations
from fbql_behaviors.storage import save_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import check, limits_of, types_of

from fbql.cli.exit_codes import DONE
from fbql.cli.interrupts import Interrupts
from fbql.cli.observations import add_observation_option, know_observations
from fbql.cli.panel import print_result, say
from fbql.cli.parser import Parser
from fbql.cli.places import new_path
from fbql.cli.unwritable import Unwritable
from fbql.cli.words import counted
from fbql.demonstrations.instruct import instruct
from fbql.demonstrations.make_tree import DEMONSTRATION_SEED, INDUCTION_SEED
from fbql.report.induction import Induction, induction_page

CART = "cart"
METHOD_HELP = "; cart: by scikit-learn, to be compared with (installs requirements-study.txt, once)"
BESIDE = Path()
"""The value of --report without a file."""
_ONE_LEAF = (
    "the tree is a single leaf: one command whatever is sensed; record more demonstrations, "
    "or bring --split-cost nearer to 0"
)


def run(arguments: argparse.Namespace, _interrupts: Interrupts) -> int:
    """Induces the tree. Gives 0."""
    know_observations(arguments.observation, [arguments.behavior])
    behavior = arguments.behavior
    recipe = _recipe(arguments)
    if arguments.method == CART:
        scikit_learn()  # before anything takes long, and before time is taken
    demonstrations = _demonstrations(arguments, recipe)
    patterns = patterns_of(demonstrations, observation_of(behavior), recipe.every, recipe.patterns)
    for warning in patterns.warnings():
        say(f"WARNING: {warning}")
    begun_s = monotonic()
    made = _made(arguments, patterns, recipe.induction)
    seconds = monotonic() - begun_s
    rmse = cross_validated_rmse(patterns, lambda part: _made(arguments, part, recipe.induction).tree)
    path = arguments.out or new_path(f"tree-{behavior}") / f"{behavior}.json"
    report = path.with_suffix(".html") if arguments.report is BESIDE else arguments.report
    result = {
        "leaves": made.tree.leaf_count,
        "rmse_levels": rmse,
        "rmse_rad_s": None if rmse is None else rad_s_of(rmse),
        "root_value": made.value if isfinite(made.value) else None,
        "seconds": seconds,
        "path": str(path),
        "patterns": len(patterns),
        "sha256": made.tree.hash,
        "report": None if report is None else str(report),
    }
    replaced, writing = path.exists(), path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_tree(path, made.tree)
        if report is not None:
            writing = report
            report.parent.mkdir(parents=True, exist_ok=True)
            report.write_text(_page(arguments, recipe.induction, demonstrations, patterns, made, rmse))
        if arguments.curve is not None:
            writing = arguments.curve
            writing.parent.mkdir(parents=True, exist_ok=True)
            writing.write_text(_curve(made.curve))
    except OSError as error:
        raise Unwritable(writing, error) from None
    if replaced:
        say(f"{path}: the tree that was there is replaced")
    if made.tree.leaf_count == 1:
        say(f"WARNING: {_ONE_LEAF}")
    print_result(json.dumps(result) if arguments.json else _worded(result))
    return DONE


class _Made(NamedTuple):
    """A tree by whatever method."""

    tree: Tree
    value: float
    """What it is worth by the objective, of whatever method it is."""
    curve: list[float]
    tried: dict[int, float]


def _made(arguments: argparse.Namespace, patterns: Patterns, parameters: InductionParameters) -> _Made:
    if arguments.method == CART:
        cart = grow_cart(arguments.behavior, patterns, arguments.seed, arguments.leaves)
        return _Made(cart.tree, tree_value(cart.tree, patterns, parameters), [], cart.tried)
    tree, value, curve = induce(arguments.behavior, patterns, parameters, arguments.seed)
    return _Made(tree, value, curve, {})


def _page(
    arguments: argparse.Namespace,
    parameters: InductionParameters,
    demonstrations: list[Demonstration],
    patterns: Patterns,
    made: _Made,
    rmse: float | None,
) -> str:
    optimum = induce(arguments.behavior, patterns, replace(parameters, method="dp"), arguments.seed).value
    source = f"Scripted instructor, seed {DEMONSTRATION_SEED}"
    if arguments.demos:
        source = "Recordings " + ", ".join(path.name for path in arguments.demos)
    return induction_page(
        Induction(
            tree=made.tree,
            patterns=patterns,
            demonstrations=len(demonstrations),
            source=source,
            method=arguments.method or parameters.method,
            objective=parameters.objective,
            value=made.value,
            worth=tree_value(made.tree, patterns, parameters),
            optimum=optimum,
            rmse=rmse,
            training_rmse=wheel_rmse(made.tree, patterns),
            curve=made.curve,
            tried=made.tried,
        )
    )


def _curve(values: Sequence[float]) -> str:
    """The learning curve as CSV; values that diverged are inf or nan."""
    lines = (f"{trial},{value!r}" for trial, value in enumerate(values, start=1))
    return "\n".join(("trial,root_value_nat", *lines, ""))


def _worded(result: dict[str, Any]) -> str:
    error = "n/a (it takes two demonstrations)"
    if result["rmse_levels"] is not None:
        error = f"{result['rmse_levels']:.2f} levels, {result['rmse_rad_s']:.1f} rad/s"
    value = "not finite: it diverged" if result["root_value"] is None else f"{result['root_value']:.4f} nat"
    return "\n".join(
        (
            f"{counted(result['leaves'], 'leaf', 'leaves')} from {counted(result['patterns'], 'pattern')} in {result['seconds']:.3f} s",
            f"  held-out error of the wheel velocities   {error}",
            f"  value of the root                        {value}",
            f"  tree                                     {result['path']}",
            *([f"  report                                   {result['report']}"] if result["report"] else []),
        )
    )


def _demonstrations(arguments: argparse.Namespace, recipe: Recipe) -> list[Demonstration]:
    if not arguments.demos:
        say(f"no --demos: the scripted instructor demonstrates (seed {DEMONSTRATION_SEED})")
        return instruct(arguments.behavior, DEMONSTRATION_SEED, recipe.demonstrations, recipe.steps)
    return [found for path in arguments.demos for found in load_demonstrations(path, arguments.behavior)]


def _recipe(arguments: argparse.Namespace) -> Recipe:
    """The behavior's recipe with what the command line says instead."""
    recipe = recipe_of(arguments.behavior)
    given = {name: value for name in types_of(InductionParameters) if (value := getattr(arguments, name)) is not None}
    if arguments.method == CART:
        del given["method"]
    elif arguments.leaves is not None:
        raise BadInput("--leaves is for --method cart; the other methods choose the number themselves (--split-cost)")
    if arguments.curve is not None and (arguments.method or recipe.induction.method) != "rl":
        raise BadInput("--curve is for --method rl; the other methods have no trials")
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


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(prog=program, description="Induces a behavior's decision tree from demonstrations.")
    command.add_argument("behavior", metavar="BEHAVIOR", help=f"such as: {', '.join(OBSERVATIONS)}")
    command.add_argument(
        "--demos",
        type=Path,
        action="append",
        metavar="DIR",
        help="recording of demonstrations, or a directory of such; may be repeated (the scripted instructor, seed 1)",
    )
    command.add_argument("--every", type=int, metavar="N", help="take every N-th step of a demonstration as a pattern")
    command.add_argument("--patterns", type=int, metavar="N", help="take N patterns at most")
    command.add_argument(
        "--seed", type=int, default=INDUCTION_SEED, metavar="S", help="seed of the trials (%(default)s)"
    )
    command.add_argument("--out", type=Path, metavar="FILE", help="tree file (runs/TIME-tree-BEHAVIOR/BEHAVIOR.json)")
    command.add_argument("--json", action="store_true", help="print one JSON object on stdout and nothing else there")
    command.add_argument(
        "--report",
        type=Path,
        nargs="?",
        const=BESIDE,
        metavar="FILE",
        help="write a page about the tree and how it was made (beside the tree file, as .html)",
    )
    command.add_argument(
        "--curve", type=Path, metavar="FILE", help="write the learning curve as CSV: the root's value after each trial"
    )
    command.add_argument(
        "--leaves", type=int, metavar="N", help="leaves of --method cart (as many as cross-validation chooses)"
    )
    add_observation_option(command)
    group = command.add_argument_group("induction", "without an option the behavior's recipe holds")
    kinds = types_of(InductionParameters)
    for name, limits in limits_of(InductionParameters).items():
        unit = f" [{limits.unit}]" if limits.unit else ""
        group.add_argument(
            f"--{name.replace('_', '-')}",
            type=kinds[name],
            choices=(*limits.choices, CART) if name == "method" and limits.choices else limits.choices,
            metavar=None if limits.choices else "N",
            help=limits.description.replace("%", "%%") + unit + (METHOD_HELP if name == "method" else ""),
        )
    return command
