"""Records demonstrations of a behavior: its scripted instructor drives in the simulator, in one process."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from fbql_behaviors.core.instructors import INSTRUCTORS, Habits
from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.patterns import Demonstration, patterns_of
from fbql_behaviors.core.recipes import recipe_of
from fbql_common.core.errors import BadInput

from launcher.demonstration_recording import save_demonstrations
from launcher.instruct import instruct
from launcher.options import Parser
from launcher.places import new_path

PROGRAM = "demonstrate.py"
_DONE, _FAILED, _BAD_INPUT, _INTERRUPTED = 0, 1, 2, 130


def main(argv: Sequence[str]) -> int:
    """Runs the command. Gives the exit code."""
    arguments = _parser().parse_args(list(argv))
    try:
        return _demonstrate(arguments)
    except BadInput as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return _BAD_INPUT
    except KeyboardInterrupt:
        print(f"{PROGRAM}: interrupted", file=sys.stderr)
        return _INTERRUPTED


def _demonstrate(arguments: argparse.Namespace) -> int:
    behavior, seed = arguments.behavior, arguments.seed
    recipe = recipe_of(behavior)
    count = recipe.demonstrations if arguments.demonstrations is None else arguments.demonstrations
    steps = recipe.steps if arguments.steps is None else arguments.steps
    out = arguments.out or new_path(f"demonstrations-{behavior}-s{seed}")
    demonstrations = instruct(behavior, seed, count, steps, _progress(count))
    about = {"seed": seed, "instructor": "scripted", "habits": asdict(Habits())}
    if not save_demonstrations(out, behavior, demonstrations, about):
        return _FAILED
    patterns = _patterns(behavior, demonstrations)
    print(f"{len(demonstrations)} demonstrations, {patterns} patterns: {out}", file=sys.stderr)
    if arguments.json:
        print(json.dumps({"demonstrations": len(demonstrations), "patterns": patterns, "path": str(out)}))
    else:
        print(f"Next: python3 scripts/induce.py {behavior} --demos {out}", file=sys.stderr)
    return _DONE


def _patterns(behavior: str, demonstrations: Sequence[Demonstration]) -> int:
    """Patterns that the behavior's recipe takes from the demonstrations."""
    recipe = recipe_of(behavior)
    return len(patterns_of(demonstrations, observation_of(behavior), recipe.every, recipe.patterns))


def _progress(count: int) -> Callable[[int], None]:
    def show(made: int) -> None:
        print(f"\r{made} of {count} demonstrations", end="\n" if made == count else "", file=sys.stderr, flush=True)

    return show if sys.stderr.isatty() else lambda _: None


def _parser() -> Parser:
    parser = Parser(
        prog=PROGRAM,
        description="Records demonstrations of a behavior by its scripted instructor, as an MCAP recording.",
    )
    parser.add_argument("behavior", metavar="BEHAVIOR", help=f"one of: {', '.join(INSTRUCTORS)}")
    parser.add_argument(
        "--seed", type=int, default=1, metavar="S", help="seed of the starts and of the instructor's hand (%(default)s)"
    )
    parser.add_argument("--demonstrations", type=int, metavar="N", help="how many (what the behavior's recipe says)")
    parser.add_argument("--steps", type=int, metavar="N", help="steps of each at most (what the recipe says)")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="directory to make; it must not exist (runs/TIME-demonstrations-BEHAVIOR-sSEED)",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout and nothing else there")
    return parser
