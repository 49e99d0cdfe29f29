"""Makes the shipped trees from their committed seeds: demonstrations, then induction, by each behavior's recipe.

`demonstrate BEHAVIOR` followed by `induce BEHAVIOR` with the same seeds makes the same trees.
"""

from __future__ import annotations

import argparse

from fbql_behaviors.core.recipes import RECIPES
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import save_tree
from fbql_common.files import output_directory

from fbql.cli.exit_codes import DONE
from fbql.cli.interrupts import Interrupts
from fbql.cli.output import json_text, print_result, say, writing
from fbql.cli.parser import Parser, add_json_option, output_path
from fbql.demonstrations.make_tree import make_tree


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(prog=program, description="Regenerates the shipped trees from their committed seeds.")
    command.add_argument(
        "--out",
        type=output_path,
        default=shipped_trees().resolve(),
        metavar="DIR",
        help="directory for the trees (%(default)s)",
    )
    add_json_option(command)
    return command


def run(arguments: argparse.Namespace, _interrupts: Interrupts) -> int:
    """Makes the trees. Returns 0."""
    made: dict[str, dict[str, object]] = {}
    with writing(arguments.out), output_directory(arguments.out):
        for behavior in RECIPES:
            tree = make_tree(behavior).tree
            path = arguments.out / f"{behavior}.json"
            save_tree(path, tree)
            made[behavior] = {"leaves": tree.leaf_count, "sha256": tree.hash, "path": str(path)}
            say(f"{behavior}: {tree.leaf_count} leaves, {path}")
    if arguments.json:
        print_result(json_text(made))
    return DONE
