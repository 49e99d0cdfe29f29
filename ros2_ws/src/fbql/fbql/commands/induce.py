"""Induces a behavior's tree from demonstrations and writes the tree file."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from fbql_behaviors.core.evaluation import wheel_rmse
from fbql_behaviors.core.induction import InductionParameters
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import Demonstration, Patterns
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_behaviors.core.tree_value import tree_value
from fbql_behaviors.demonstration_storage import load_demonstrations
from fbql_behaviors.storage import save_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import types_of
from fbql_common.core.text import as_lines
from fbql_common.files import output_directory, write_atomically

from fbql.cli.exit_codes import DONE
from fbql.cli.interrupts import Interrupts
from fbql.cli.observations import add_observation_option, register_observations, unused_observations
from fbql.cli.output import complain, print_result, say, warn, writing
from fbql.cli.parser import Parser, add_json_option, add_parameter_options, output_path, without_effect
from fbql.cli.places import new_path
from fbql.cli.words import counted
from fbql.demonstrations.make_tree import (
    CART,
    DEMONSTRATION_SEED,
    INDUCTION_SEED,
    InducedTree,
    InductionRequest,
    induced_tree,
    instructed,
    optimum_of,
    patterns_for,
    request_of,
    unused_parameters,
)
from fbql.report.induction import Induction, induction_page

BESIDE = Path()
"""The value of --report without a file."""


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(prog=program, description="Induces a behavior's decision tree from demonstrations.")
    command.add_argument("behavior", metavar="BEHAVIOR", help=f"such as: {', '.join(OBSERVATIONS)}")
    command.add_argument(
        "--demos",
        type=Path,
        action="append",
        metavar="DIR",
        help="recording of demonstrations, or a directory of them; may be repeated (the scripted instructor, seed 1)",
    )
    command.add_argument("--every", type=int, metavar="N", help="take every N-th step of a demonstration as a pattern")
    command.add_argument("--patterns", type=int, metavar="N", help="take at most N patterns")
    command.add_argument("--seed", type=int, metavar="S", help=f"seed of the trials ({INDUCTION_SEED})")
    command.add_argument(
        "--out", type=output_path, metavar="FILE", help="tree file (runs/TIME-tree-BEHAVIOR/BEHAVIOR.json)"
    )
    add_json_option(command)
    command.add_argument(
        "--report",
        type=output_path,
        nargs="?",
        const=BESIDE,
        metavar="FILE",
        help="write a page about the tree and how it was made (beside the tree file, as .html)",
    )
    command.add_argument(
        "--curve",
        type=output_path,
        metavar="FILE",
        help="write the learning curve as CSV: the root's value after each trial",
    )
    command.add_argument("--leaves", type=int, metavar="N", help="leaves of --method cart (chosen by cross-validation)")
    add_observation_option(command)
    more = "; cart: scikit-learn's, for comparison (needs the extra studies; in a clone it is installed once)"
    about = "defaults are those of the behavior's recipe"
    add_parameter_options(command, InductionParameters, "induction", about, {"method": (CART, more)})
    return command


def run(arguments: argparse.Namespace, _interrupts: Interrupts) -> int:
    """Induces the tree. Returns 0."""
    sources = register_observations(arguments.observation, [arguments.behavior])
    names = ("seed", "every", "patterns", "leaves", *types_of(InductionParameters))
    given = {name: value for name in names if (value := getattr(arguments, name)) is not None}
    request = request_of(arguments.behavior, **given)
    unused = unused_parameters(request.method)
    for note in (
        *unused_observations(sources, [arguments.behavior]),
        *without_effect(arguments, unused, f"with --method {request.method}"),
    ):
        complain(note)
    if arguments.curve is not None and request.method != "rl":
        raise BadInput("--curve needs --method rl; the other methods have no trials")
    demonstrations = _demonstrations(request, arguments.demos)
    patterns = patterns_for(request, demonstrations)
    warn(patterns.warnings())
    made = induced_tree(request, patterns)
    path = arguments.out or new_path(f"tree-{request.behavior}") / f"{request.behavior}.json"
    report = path.with_suffix(".html") if arguments.report is BESIDE else arguments.report
    replaced = path.exists()
    with writing(path), output_directory(path.parent):
        save_tree(path, made.tree)
    if report is not None:
        _write(report, _page(request, arguments.demos, demonstrations, patterns, made))
    if arguments.curve is not None:
        _write(arguments.curve, _curve(made.curve))
    if replaced:
        say(f"{path}: replaced the existing tree")
    if made.tree.leaf_count == 1:
        warn(["the tree is a single leaf, the same command for every observation; record more demonstrations, or move "
              "--split-cost closer to 0"])  # fmt: skip
    rmse = made.rmse_levels
    result = {
        "leaves": made.tree.leaf_count,
        "rmse_levels": rmse,
        "rmse_rad_s": None if rmse is None else rad_s_of(rmse),
        "root_value": made.value if isfinite(made.value) else None,
        "seconds": made.seconds,
        "path": str(path),
        "patterns": len(patterns),
        "sha256": made.tree.hash,
        "report": None if report is None else str(report),
    }
    print_result(json.dumps(result) if arguments.json else _words(result))
    return DONE


def _demonstrations(request: InductionRequest, paths: Sequence[Path] | None) -> list[Demonstration]:
    if not paths:
        say(f"no --demos: the scripted instructor demonstrates (seed {DEMONSTRATION_SEED})")
        return instructed(request)
    return [each for path in paths for each in load_demonstrations(path, request.behavior)]


def _write(path: Path, text: str) -> None:
    with writing(path), output_directory(path.parent):
        write_atomically(path, text.encode())


def _page(
    request: InductionRequest,
    paths: Sequence[Path] | None,
    demonstrations: Sequence[Demonstration],
    patterns: Patterns,
    made: InducedTree,
) -> str:
    source = f"Scripted instructor, seed {DEMONSTRATION_SEED}"
    if paths:
        source = "Recordings " + ", ".join(path.name for path in paths)
    return induction_page(
        Induction(
            tree=made.tree,
            patterns=patterns,
            demonstrations=len(demonstrations),
            source=source,
            method=request.method,
            objective=request.parameters.objective,
            value=made.value,
            worth=tree_value(made.tree, patterns, request.parameters),
            optimum=optimum_of(request, patterns),
            rmse=made.rmse_levels,
            training_rmse=wheel_rmse(made.tree, patterns),
            curve=made.curve,
            tried=made.tried,
        )
    )


def _curve(values: Sequence[float]) -> str:
    """The learning curve as CSV; values that diverged are inf or nan."""
    lines = (f"{trial},{value!r}" for trial, value in enumerate(values, start=1))
    return "\n".join(("trial,root_value_nat", *lines, ""))


def _words(result: dict[str, Any]) -> str:
    error = "n/a (needs two demonstrations)"
    if result["rmse_levels"] is not None:
        error = f"{result['rmse_levels']:.2f} levels, {result['rmse_rad_s']:.1f} rad/s"
    value = "not finite: it diverged" if result["root_value"] is None else f"{result['root_value']:.4f} nat"
    return as_lines(
        (
            f"{counted(result['leaves'], 'leaf', 'leaves')} from {counted(result['patterns'], 'pattern')} in {result['seconds']:.3f} s",
            f"  held-out error of the wheel velocities   {error}",
            f"  value of the root                        {value}",
            f"  tree                                     {result['path']}",
            *([f"  report                                   {result['report']}"] if result["report"] else []),
        )
    )
