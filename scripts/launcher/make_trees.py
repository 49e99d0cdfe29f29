"""Makes the trees that ship, from their committed seeds: demonstrations, then induction, by each behavior's recipe.

`demonstrate.py BEHAVIOR` followed by `induce.py BEHAVIOR` with the same seeds makes the same trees.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from fbql_behaviors.core.induction import Induced, induce
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import patterns_of
from fbql_behaviors.core.recipes import RECIPES
from fbql_behaviors.storage import save_tree
from fbql_common.core.errors import BadInput

from launcher.instruct import instruct
from launcher.options import ROOT, Parser
from launcher.panel import print_result

PROGRAM = "make_trees.py"
DEMONSTRATION_SEED = 1
INDUCTION_SEED = 1
SHIPPED = ROOT / "ros2_ws" / "src" / "fbql_behaviors" / "trees"


def make_tree(behavior: str, demonstration_seed: int = DEMONSTRATION_SEED) -> Induced:
    """A behavior's tree by its recipe; with the default seed the one that ships."""
    recipe = RECIPES[behavior]
    demonstrations = instruct(behavior, demonstration_seed, recipe.demonstrations, recipe.steps)
    patterns = patterns_of(demonstrations, OBSERVATIONS[behavior], recipe.every, recipe.patterns)
    return induce(behavior, patterns, recipe.induction, INDUCTION_SEED)


def main(argv: Sequence[str]) -> int:
    """Runs the command. Gives the exit code."""
    parser = Parser(prog=PROGRAM, description="Makes the trees that ship again, from their committed seeds.")
    parser.add_argument("--out", type=Path, default=SHIPPED, metavar="DIR", help="where the trees go (%(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout and nothing else there")
    arguments = parser.parse_args(list(argv))
    made: dict[str, dict[str, object]] = {}
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
        for behavior in RECIPES:
            tree = make_tree(behavior).tree
            path = arguments.out / f"{behavior}.json"
            save_tree(path, tree)
            made[behavior] = {"leaves": tree.leaf_count, "sha256": tree.hash, "path": str(path)}
            print(f"{behavior}: {tree.leaf_count} leaves, {path}", file=sys.stderr)
    except (BadInput, OSError) as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 2
    if arguments.json:
        print_result(json.dumps(made))
    return 0
