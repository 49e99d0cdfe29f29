"""Tree files: versioned JSON, fully validated when read, written atomically.

    {"format": "fbql_tree", "version": 1, "sha256": ...,
     "behavior": "ball_seeking",
     "features": [{"name": "ball_distance", "unit": "m", "low": 0.0, "high": 3.2}, ...],
     "nodes": [[0, 1.6, 1, 4], 0, ...],      a split [feature, threshold, left node, right node], or a leaf_id
     "leaves": [{"left_rad_s": 12.5, "right_rad_s": 50.0, "patterns": 8}, ...],
     "origin": {"method": "rl", ...}}        how it was made, with the SHA-256 of the training patterns

A tree that commands something else than a soccer robot's wheels names the axes, and its leaves have a value for each; one
from a bag also says how its features are read from messages (docs/bags.md):

     "commands": [{"name": "linear.x", "unit": "m/s", "low": -0.5, "high": 0.5, "levels": 11}, ...],
     "leaves": [{"command": [0.25, -0.6], "patterns": 8}, ...],
     "recipe": {"readings": ...}

Node 0 is the root. `sha256` covers everything but format, version and itself, in canonical form (`Tree.hash`).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from fbql_common.core.command_space import Axis, CommandSpace
from fbql_common.core.errors import BadInput
from fbql_common.core.field import WHEELS
from fbql_common.core.plain_json import json_from
from fbql_common.files import read_file, write_atomically

from fbql_behaviors.core.bag_spec import check_recipe
from fbql_behaviors.core.behavior import check_features
from fbql_behaviors.core.observation import OBSERVATIONS, Feature
from fbql_behaviors.core.tree import AnyLeaf, CommandLeaf, Leaf, Node, Split, Tree, canonical

FORMAT = "fbql_tree"
SUPPORTED_VERSIONS = (1,)
MAX_BYTES = 8 * 2**20
"""Largest tree file that is read."""
MAX_DEPTH = 32
"""Deepest nesting in a tree's origin."""


def load_tree(path: Path) -> Tree:
    """The tree in a file. Raises BadInput, with file and reason in one line, for anything but a valid tree."""
    data = read_file(path, MAX_BYTES)
    try:
        return tree_from_bytes(data)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None


def save_tree(path: Path, tree: Tree) -> None:
    """Writes a tree atomically; an existing file is replaced only by a complete one. Raises OSError."""
    write_atomically(path, tree_to_bytes(tree))


def tree_to_bytes(tree: Tree) -> bytes:
    """The file of a tree: one node or leaf per line, easy to read and to compare."""
    parts = [f'"format": "{FORMAT}"', f'"version": {SUPPORTED_VERSIONS[-1]}', f'"sha256": "{tree.hash}"']
    for key, value in tree.content().items():
        if isinstance(value, list):
            lines = ",\n".join(f"  {canonical(item)}" for item in value)  # pyright: ignore[reportUnknownVariableType]
            parts.append(f'"{key}": [\n{lines}\n ]')
        else:
            parts.append(f'"{key}": {canonical(value)}')
    return ("{\n " + ",\n ".join(parts) + "\n}\n").encode()


def tree_from_bytes(data: bytes) -> Tree:
    """The tree in a file's bytes. Raises BadInput with the reason."""
    content = json_from_bytes(data)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise BadInput(f'not a tree file: it lacks "format": "{FORMAT}"')
    version = content.get("version")
    if type(version) is not int or version not in SUPPORTED_VERSIONS:
        supported = ", ".join(map(str, SUPPORTED_VERSIONS))
        raise BadInput(f"version is {version!r}; supported: {supported}; make the tree again with this release")
    tree = Tree(
        _name(content, "behavior"),
        tuple(_each(content, "features", _feature)),
        tuple(_each(content, "nodes", _node)),
        tuple(_each(content, "leaves", _command_leaf if "commands" in content else _leaf)),
        _flat_enough("origin", _value(content, "origin", dict)),
        CommandSpace(tuple(_each(content, "commands", _axis))) if "commands" in content else WHEELS,
        _flat_enough("recipe", _value(content, "recipe", dict)) if "recipe" in content else {},
    )
    if tree.recipe:
        check_recipe(tree)
    elif tree.behavior in OBSERVATIONS:
        check_features(tree, OBSERVATIONS[tree.behavior])
    if content.get("sha256") != tree.hash:
        raise BadInput(f"sha256 does not match the content, which has {tree.hash}; the file was changed or damaged")
    return tree


def _flat_enough(key: str, part: dict[str, Any]) -> dict[str, Any]:
    """A part of the content, if whatever handles it can nest as deep."""
    level: list[Any] = [part]
    for _ in range(MAX_DEPTH):
        level = [each for value in level for each in (value.values() if isinstance(value, dict) else value)]
        level = [value for value in level if isinstance(value, dict | list)]
    if level:
        raise BadInput(f"'{key}' is nested more than {MAX_DEPTH} deep")
    return part


def json_from_bytes(data: bytes) -> Any:
    """The value in a JSON text. Raises BadInput with the reason, for numbers that are not finite too."""
    if not data:
        raise BadInput("the file is empty")
    if len(data) > MAX_BYTES:
        raise BadInput(f"more than {MAX_BYTES} bytes, the limit for a tree")
    return json_from(data)


def _feature(item: Any) -> Feature:
    unit = _value(item, "unit", str)
    return Feature(_name(item, "name"), unit and _name(item, "unit"), _number(item, "low"), _number(item, "high"))


def _axis(item: Any) -> Axis:
    unit, levels = _value(item, "unit", str), _value(item, "levels", int)
    return Axis(_name(item, "name"), unit and _name(item, "unit"), _number(item, "low"), _number(item, "high"), levels)


def _leaf(item: Any) -> AnyLeaf:
    return Leaf(_number(item, "left_rad_s"), _number(item, "right_rad_s"), _patterns(item))


def _command_leaf(item: Any) -> AnyLeaf:
    values = _value(item, "command", list)
    return CommandLeaf(tuple(_number({"command": value}, "command") for value in values), _patterns(item))  # pyright: ignore


def _patterns(item: Any) -> int:
    patterns = _value(item, "patterns", int)
    if patterns >= 2**63:
        raise BadInput("'patterns' is too large")
    return patterns


def _node(item: Any) -> Node:
    if type(item) is int:
        return item
    if not isinstance(item, list) or len(item) != 4 or any(type(item[place]) is not int for place in (0, 2, 3)):  # pyright: ignore
        raise BadInput("expected a leaf_id or [feature, threshold, left, right]")
    feature, threshold, left, right = item  # pyright: ignore[reportUnknownVariableType]
    return Split(feature, _number({"threshold": threshold}, "threshold"), left, right)


def _each[T](content: dict[str, Any], key: str, read: Callable[[Any], T]) -> list[T]:
    values: list[T] = []
    for index, item in enumerate(_value(content, key, list)):
        try:
            values.append(read(item))
        except BadInput as error:
            raise BadInput(f"{key}[{index}]: {error}") from None
    return values


def _get(content: Any, key: str) -> Any:
    if not isinstance(content, dict):
        raise BadInput(f"expected an object with '{key}'")
    return content.get(key)


def _value[T](content: Any, key: str, kind: type[T]) -> T:
    value = _get(content, key)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise BadInput(f"'{key}' is missing, or of the wrong type")
    return value


def _name(content: Any, key: str) -> str:
    """A printable text of one line."""
    text = _value(content, key, str)
    if not text or not text.isprintable():
        raise BadInput(f"'{key}' is {text!r}; it must be a name in one line")
    return text


def _number(content: Any, key: str) -> float:
    value = _get(content, key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadInput(f"'{key}' is missing, or not a number")
    try:
        return float(value)
    except OverflowError:
        raise BadInput(f"'{key}' is too large") from None
