"""Tree files: explained in words, exported, checked, changed in a leaf, and made from scikit-learn trees."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from math import degrees, isfinite, radians
from pathlib import Path
from typing import Any

from fbql_behaviors.core.c_source import to_c
from fbql_behaviors.core.explanation import describe_tree, rules
from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.tree import Leaf, Tree, changed_leaf
from fbql_behaviors.drawing.dot import to_dot
from fbql_behaviors.drawing.partition import partition_svg
from fbql_behaviors.sklearn_trees import from_arrays
from fbql_behaviors.storage import MAX_BYTES, json_from_bytes, load_tree, save_tree, tree_to_bytes
from fbql_common.core.errors import BadInput
from fbql_common.core.text import as_lines, one_line
from fbql_common.files import output_directory, read_file, write_atomically

from fbql.cli.exit_codes import DONE
from fbql.cli.interrupts import Interrupts
from fbql.cli.observations import add_observation_option, register_observations, unused_observations
from fbql.cli.output import complain, json_text, print_result, say, writing
from fbql.cli.parser import Parser, output_path
from fbql.cli.words import counted

FORMATS: Mapping[str, Callable[[Tree], str]] = {
    "c": to_c,
    "dot": to_dot,
    "svg": partition_svg,
    "json": lambda tree: tree_to_bytes(tree).decode(),
}
_SIGNED = re.compile(r"-[\d.]")


_NUMBERS = ("--at", "--command")
"""The options whose value may begin with a minus."""


class _TreeParser(Parser):
    """Takes `--at -5,3` as `--at=-5,3`: argparse mistakes a word that begins with a minus for an option."""

    def parse_args(self, args: Sequence[str], namespace: None = None) -> argparse.Namespace:  # type: ignore[override]
        words: list[str] = []
        for word in args:
            if words and words[-1] in _NUMBERS and _SIGNED.match(word):
                words[-1] += f"={word}"
            else:
                words.append(word)
        return super().parse_args(words, namespace)


def run(arguments: argparse.Namespace, _interrupts: Interrupts) -> int:
    """Runs the subcommand. Returns 0."""
    arguments.sources = register_observations(arguments.observation)
    return arguments.run(arguments)


def _load(arguments: argparse.Namespace) -> Tree:
    tree = load_tree(arguments.file)
    _report_unused(arguments, tree.behavior)
    return tree


def _report_unused(arguments: argparse.Namespace, behavior: str) -> None:
    for note in unused_observations(arguments.sources, [behavior]):
        complain(note)


def _explain(arguments: argparse.Namespace) -> int:
    tree = _load(arguments)
    chosen = range(tree.leaf_count)
    if arguments.at is not None:
        chosen = [tree.answer(_observation(arguments.at, tree))[0]]
    if arguments.json:
        every = rules(tree)
        leaves = [{"leaf_id": k, "rule": every[k].sentence, "motion": every[k].what, **_leaf(tree, k)} for k in chosen]
        print_result(json_text({"behavior": tree.behavior, "sha256": tree.hash, "leaves": leaves}))
    elif arguments.at is not None:
        print_result(f"leaf {chosen[0]}: {rules(tree)[chosen[0]].sentence}")
    else:
        print_result(f"{_summary(tree)}\n{describe_tree(tree)}")
    return DONE


def _leaf(tree: Tree, leaf_id: int) -> dict[str, Any]:
    """A leaf as JSON values; the command of another robot than the soccer robot by the names of its axes."""
    leaf = tree.leaves[leaf_id]
    if isinstance(leaf, Leaf):
        return leaf._asdict()
    names = (axis.name for axis in tree.commands.axes)
    return {"command": dict(zip(names, leaf.command, strict=True)), "patterns": leaf.patterns}


def _observation(text: str, tree: Tree) -> tuple[float, ...]:
    """The observation of --at, clamped to the root region; angles are given in degrees."""
    given = _numbers(f"--at {text}", text, [feature.name for feature in tree.features], "senses")
    values = [
        radians(value) if feature.unit == "rad" else value for value, feature in zip(given, tree.features, strict=True)
    ]
    inside = tree.clamp(values)
    for given, taken, feature in zip(values, inside, tree.features, strict=True):
        if given != taken:
            complain(f"--at {text}: {feature.name} lies outside the tree's range and is clamped")
    return inside


def _numbers(where: str, text: str, names: Sequence[str], does: str) -> list[float]:
    """The numbers in a text, one for each of these names. Raises BadInput."""
    words = text.split(",")
    if len(words) != len(names):
        raise BadInput(f"{where}: {len(words)} values; this tree {does} {','.join(names)}")
    values: list[float] = []
    for word, name in zip(words, names, strict=True):
        try:
            value = float(word)
        except ValueError:
            raise BadInput(f"{where}: '{word}' is not a number") from None
        if not isfinite(value):
            raise BadInput(f"{where}: {name} is {word}; it must be finite")
        values.append(value)
    return values


def _change(arguments: argparse.Namespace) -> int:
    tree = _load(arguments)
    k = arguments.leaf
    if not 0 <= k < tree.leaf_count:
        raise BadInput(f"--leaf {k}: the tree has the leaves 0 to {tree.leaf_count - 1}")
    names = [axis.name for axis in tree.commands.axes]
    command = tuple(_numbers(f"--command {arguments.command}", arguments.command, names, "commands"))
    try:
        new = changed_leaf(tree, k, command)
    except BadInput as error:
        raise BadInput(f"--command {arguments.command}: {error}") from None
    with writing(arguments.out), output_directory(arguments.out.parent):
        save_tree(arguments.out, new)
    lines = (f"leaf {k} was:  {rules(tree)[k].sentence}", f"leaf {k} is:   {rules(new)[k].sentence}")
    print_result(as_lines((*lines, f"tree {arguments.out}")))
    return DONE


def _check(arguments: argparse.Namespace) -> int:
    tree = _load(arguments)
    if arguments.json:
        print_result(json_text({"behavior": tree.behavior, "leaves": tree.leaf_count, "sha256": tree.hash}))
    else:
        print_result(one_line(f"{arguments.file}: sound. {_summary(tree)}"))
    return DONE


def _export(arguments: argparse.Namespace) -> int:
    text = FORMATS[arguments.to](_load(arguments))
    if arguments.out is None:
        print_result(text.removesuffix("\n"))
    else:
        with writing(arguments.out), output_directory(arguments.out.parent):
            write_atomically(arguments.out, text.encode())
        say(f"{arguments.out}: {len(text)} characters")
    return DONE


def _import(arguments: argparse.Namespace) -> int:
    _report_unused(arguments, arguments.behavior)
    register_observations([], [arguments.behavior])
    features = observation_of(arguments.behavior).features
    data = read_file(arguments.file, MAX_BYTES)
    try:
        arrays = json_from_bytes(data)
        if not isinstance(arrays, dict):
            raise BadInput("expected an object with the arrays of a scikit-learn tree")
        tree = from_arrays(arrays, arguments.behavior, features, {"method": "imported"})
    except BadInput as error:
        raise BadInput(f"{arguments.file}: {error}") from None
    with writing(arguments.out), output_directory(arguments.out.parent):
        save_tree(arguments.out, tree)
    print_result(one_line(f"{arguments.out}: {_summary(tree)}"))
    return DONE


def _summary(tree: Tree) -> str:
    senses = ", ".join(
        f"{feature.name} {degrees(feature.low):.0f} to {degrees(feature.high):.0f} degrees"
        if feature.unit == "rad"
        else f"{feature.name} {feature.low:g} to {feature.high:g} {feature.unit}".strip()
        for feature in tree.features
    )
    return f"{tree.behavior}: {counted(tree.leaf_count, 'leaf', 'leaves')}; senses {senses}; SHA-256 {tree.hash}"


def parser(program: str) -> Parser:
    """The command line."""
    result = _TreeParser(prog=program, description="Explains, exports, checks, changes and imports tree files.")
    commands = result.add_subparsers(required=True, metavar="COMMAND", parser_class=Parser)

    def command(name: str, run: Callable[[argparse.Namespace], int], text: str, file: str) -> argparse.ArgumentParser:
        own = commands.add_parser(name, help=text, description=text)
        own.set_defaults(run=run)
        own.add_argument("file", type=Path, metavar="FILE", help=file)
        add_observation_option(own)
        return own

    explain = command("explain", _explain, "describe what each leaf does and where, one rule per line", "tree file")
    explain.add_argument(
        "--at",
        metavar="A,B",
        help="the rule for this observation only; angles in degrees; clamped to the tree's range",
    )
    explain.add_argument("--json", action="store_true", help="print one JSON object")
    export = command("export", _export, "write a tree as C99, DOT, a picture of its partition, or JSON", "tree file")
    export.add_argument("--to", choices=tuple(FORMATS), required=True, help="what to write")
    export.add_argument("--out", type=output_path, metavar="F", help="file to write (stdout)")
    check = command("check", _check, "check whether a tree file is sound, and describe it", "tree file")
    check.add_argument("--json", action="store_true", help="print one JSON object")
    change = command("change", _change, "write a tree in which one leaf has another command", "tree file")
    change.add_argument("--leaf", type=int, required=True, metavar="N", help="leaf_id, as explain shows it")
    change.add_argument(
        "--command",
        required=True,
        metavar="A,B",
        help="what it commands instead: left,right [rad/s], or a value per axis",
    )
    change.add_argument("--out", type=output_path, required=True, metavar="F", help="tree file to write")
    imports = command(
        "import", _import, "make a tree file from the arrays of a scikit-learn tree", "JSON file with the arrays"
    )
    imports.add_argument("--behavior", required=True, metavar="NAME", help="behavior of the tree")
    imports.add_argument("--out", type=output_path, required=True, metavar="F", help="tree file to write")
    return result
