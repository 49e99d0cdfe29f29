"""Makes the trees that ship, from their committed seeds: demonstrations, then induction, by each behavior's recipe.

`demonstrate.py BEHAVIOR` followed by `induce.py BEHAVIOR` with the same seeds makes the same trees.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from fbql_behaviors.core.recipes import RECIPES
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import save_tree

from fbql.cli.exit_codes import DONE
from fbql.cli.interrupts import Interrupts
from fbql.cli.panel import print_result, say
from fbql.cli.parser import Parser
from fbql.cli.unwritable import Unwritable
from fbql.demonstrations.make_tree import make_tree


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(prog=program, description="Makes the trees that ship again, from their committed seeds.")
    command.add_argument(
        "--out", type=Path, default=shipped_trees(), metavar="DIR", help="where the trees go (%(default)s)"
    )
    command.add_argument("--json", action="store_true", help="print one JSON object on stdout and nothing else there")
    return command


def run(arguments: argparse.Namespace, _interrupts: Interrupts) -> int:
    """Makes the trees. Gives 0."""
    made: dict[str, dict[str, object]] = {}
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
        for behavior in RECIPES:
            tree = make_tree(behavior).tree
            path = arguments.out / f"{behavior}.json"
            save_tree(path, tree)
            made[behavior] = {"leaves": tree.leaf_count, "sha256": tree.hash, "path": str(path)}
            say(f"{behavior}: {tree.leaf_count} leaves, {path}")
    except OSError as error:
        raise Unwritable(arguments.out, error) from None
    if arguments.json:
        print_result(json.dumps(made))
    return DONE
