"""Tree files: what is written comes back, and whatever is wrong with a file is one line with its name."""

from __future__ import annotations

import io
import json
import os
import pickle
import zipfile
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fbql_behaviors.core.observation import OBSERVATIONS, Feature
from fbql_behaviors.core.tree import Leaf, Split, Tree, canonical
from fbql_behaviors.storage import load_tree, save_tree, tree_from_bytes, tree_to_bytes
from fbql_common.core.errors import BadInput

FEATURES = OBSERVATIONS["ball_seeking"].features
TREE = Tree(
    "ball_seeking",
    FEATURES,
    (Split(0, 0.4, 1, 2), 0, Split(1, 0.1, 3, 4), 1, 2),
    (Leaf(0.1 + 0.2, -2.0, 5), Leaf(1 / 3, 4.0, 6), Leaf(-88.0, 88.0, 0)),
    {"method": "rl", "seed": 1, "patterns_sha256": "ab" * 32},
)
Change = Callable[[dict[str, Any]], Any]


def changed(change: Change) -> bytes:
    """The file of TREE with a change, and with the sha256 that belongs to it."""
    content = json.loads(tree_to_bytes(TREE))
    change(content)
    hashed = {key: content[key] for key in ("behavior", "features", "nodes", "leaves", "origin") if key in content}
    with suppress(ValueError):  # NaN has no canonical form
        content["sha256"] = sha256(canonical(hashed).encode()).hexdigest()
    return json.dumps(content).encode()


def test_a_tree_comes_back_as_it_was(tmp_path: Path) -> None:
    save_tree(tmp_path / "tree.json", TREE)
    loaded = load_tree(tmp_path / "tree.json")
    assert loaded == TREE
    assert loaded.hash == TREE.hash == json.loads((tmp_path / "tree.json").read_text())["sha256"]


def test_the_file_tells_names_units_and_the_training_data(tmp_path: Path) -> None:
    content = json.loads(tree_to_bytes(TREE))
    assert (content["format"], content["version"]) == ("fbql_tree", 1)
    assert [(feature["name"], feature["unit"]) for feature in content["features"]] == [
        ("ball_distance", "m"),
        ("ball_bearing", "rad"),
    ]
    assert content["origin"]["patterns_sha256"] == "ab" * 32


def test_a_tree_of_a_behavior_that_is_not_known_here_is_read() -> None:
    other = Tree("keeper", (Feature("ball_x", "m", -2.0, 2.0),), (0,), (Leaf(0.0, 0.0, 1),))
    assert tree_from_bytes(tree_to_bytes(other)) == other


def test_a_file_is_replaced_whole_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "tree.json"
    path.write_text("older")
    save_tree(path, TREE)
    assert load_tree(path) == TREE
    assert [each.name for each in tmp_path.iterdir()] == ["tree.json"]


def test_a_write_that_fails_leaves_the_older_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "tree.json"
    path.write_text("older")

    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="No space left"):
        save_tree(path, TREE)
    assert path.read_text() == "older"
    assert [each.name for each in tmp_path.iterdir()] == ["tree.json"]


def set_at(*place: Any) -> Change:
    """A change: place[:-1] leads to a value, place[-1] replaces it."""

    def change(content: Any) -> None:
        for key in place[:-2]:
            content = content[key]
        content[place[-2]] = place[-1]

    return change


def a_pickle() -> bytes:
    return pickle.dumps(TREE.content())


def an_object_npz() -> bytes:
    file = io.BytesIO()
    np.savez(file, nodes=np.array([TREE.content()], dtype=object))
    return file.getvalue()


class Trap:
    """What leaves a file behind when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Path]]:
        return Path.touch, (self.path,)


def a_zip_bomb() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("tree.json", b"0" * 10_000_000)
    return file.getvalue()


BAD_FILES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "the file is empty"),
    "truncated": (tree_to_bytes(TREE)[:-40], "not JSON, or truncated"),
    "not JSON": (b"trees are green", "not JSON, or truncated"),
    "not text": (b"\xff\xfe\xfd\x00\x80", "not a tree file|not JSON"),
    "pickle": (a_pickle(), "not a tree file|not JSON"),
    "object npz": (an_object_npz(), "not a tree file|not JSON"),
    "zip bomb": (a_zip_bomb(), "not a tree file|not JSON"),
    "deep": (b"[" * 100_000, "nested too deeply|not JSON"),
    "a list": (b"[]", "not a tree file"),
    "other JSON": (b'{"format": "poem"}', "not a tree file"),
    "wrong version": (changed(set_at("version", 2)), "version is 2; supported: 1"),
    "version as text": (changed(set_at("version", "1")), "version is '1'; supported: 1"),
    "version true": (changed(set_at("version", True)), "version is True; supported: 1"),
    "no features": (changed(set_at("features", [])), "at least one feature"),
    "one feature less": (
        changed(lambda c: (c["features"].pop(), c.update(nodes=[0], leaves=c["leaves"][:1]))),
        "senses",
    ),
    "feature order": (changed(lambda c: c["features"].reverse()), "features are|threshold"),
    "feature unit": (changed(set_at("features", 0, "unit", "cm")), r"ball_distance \[cm\].*senses ball_distance \[m\]"),
    "low above high": (changed(set_at("features", 0, "low", 4.0)), "must be below high"),
    "behavior without a name": (changed(set_at("behavior", "")), "'behavior' is ''; it must be a name in one line"),
    "behavior of two lines": (changed(set_at("behavior", "a\nb")), r"'behavior' is 'a\\nb'; it must be a name"),
    "behavior that no terminal shows": (changed(set_at("behavior", "\ud800")), r"'behavior' is '\\ud800'"),
    "feature of two lines": (changed(set_at("features", 0, "name", "a\nb")), r"features\[0\]: 'name' is 'a\\nb'"),
    "unit of two lines": (changed(set_at("features", 0, "unit", "m\n")), r"features\[0\]: 'unit' is 'm\\n'"),
    "feature twice": (
        changed(set_at("features", 1, "name", "ball_distance")),
        "feature 'ball_distance' occurs twice",
    ),
    "feature without a name": (changed(set_at("features", 1, "name", None)), r"features\[1\]: 'name' is missing"),
    "NaN threshold": (changed(set_at("nodes", 0, 1, float("nan"))), "NaN is not a number"),
    "infinite leaf": (changed(set_at("leaves", 0, "left_rad_s", float("inf"))), "Infinity is not a number"),
    "number too large": (tree_to_bytes(TREE).replace(b"0.4", b"1e999"), "1e999 is too large"),
    "threshold as text": (
        changed(set_at("nodes", 0, 1, "0.4")),
        r"nodes\[0\]: 'threshold' is missing, or not a number",
    ),
    "threshold true": (changed(set_at("nodes", 0, 1, True)), r"nodes\[0\]"),
    "threshold of a thousand digits": (changed(set_at("nodes", 0, 1, 10**400)), "too large"),
    "whole number of 5000 digits": (
        tree_to_bytes(TREE).replace(b'"version": 1', b'"version": ' + b"1" * 5000),
        "a number has too many digits",
    ),
    "node of three": (changed(set_at("nodes", 0, [0, 0.4, 1])), r"nodes\[0\]: expected a leaf_id or"),
    "node of nothing": (changed(set_at("nodes", 0, [])), r"nodes\[0\]: expected a leaf_id or"),
    "node of an object": (changed(set_at("nodes", 0, {})), r"nodes\[0\]: expected a leaf_id or"),
    "too many patterns": (changed(set_at("leaves", 0, "patterns", 2**63)), "'patterns' is too large"),
    "a feature as wide as floats go": (changed(set_at("features", 1, "high", 1e300)), "must be below high 1e"),
    "a deep origin": (changed(set_at("origin", {"x": json.loads("[" * 500 + "]" * 500)})), "nested more than 32 deep"),
    "many features": (
        changed(set_at("features", [{"name": f"f{n}", "unit": "", "low": 0, "high": 1} for n in range(65)])),
        "65 features; at most 64",
    ),
    "fractional child": (changed(set_at("nodes", 0, [0, 0.4, 1.0, 2])), r"nodes\[0\]: expected a leaf_id or"),
    "bad child": (changed(set_at("nodes", 2, [1, 0.1, 3, 9])), "child index 9 is outside"),
    "cycle": (changed(set_at("nodes", 2, [1, 0.1, 3, 0])), "node 0 is reached twice: a cycle"),
    "duplicate leaf": (changed(set_at("nodes", 4, 1)), "leaf_id 1 appears in two nodes"),
    "threshold outside": (changed(set_at("nodes", 0, [0, 9.0, 1, 2])), "threshold 9.0 is not inside"),
    "leaf faster than full": (changed(set_at("leaves", 1, "right_rad_s", 100.0)), "leaf 1: right_rad_s is 100.0"),
    "leaf without a wheel": (changed(lambda c: c["leaves"][1].pop("right_rad_s")), r"leaves\[1\]: 'right_rad_s'"),
    "leaf not an object": (changed(set_at("leaves", 1, 7)), r"leaves\[1\]: expected an object"),
    "no leaves": (changed(lambda c: c.pop("leaves")), "'leaves' is missing"),
    "no origin": (changed(lambda c: c.pop("origin")), "'origin' is missing"),
    "leaf changed": (tree_to_bytes(TREE).replace(b"-88.0", b"-87.0"), "sha256 does not match the content"),
    "no sha256": (
        json.dumps({k: v for k, v in json.loads(tree_to_bytes(TREE)).items() if k != "sha256"}).encode(),
        "sha256",
    ),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_bad_file_is_refused_in_one_line_with_its_name_and_the_reason(name: str, tmp_path: Path) -> None:
    """Faults 35, 36, 37, 38, 39."""
    data, reason = BAD_FILES[name]
    path = tmp_path / "bad tree.json"
    path.write_bytes(data)
    with pytest.raises(BadInput, match=reason) as refused:
        load_tree(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_nothing_is_ever_unpickled(protocol: int, tmp_path: Path) -> None:
    """Fault 39."""
    sprung, path = tmp_path / "sprung", tmp_path / "tree.json"
    path.write_bytes(pickle.dumps(Trap(sprung), protocol))
    with pytest.raises(BadInput):
        load_tree(path)
    assert not sprung.exists()
    pickle.loads(path.read_bytes())  # the trap is one
    assert sprung.exists()


def test_a_missing_file_and_a_directory_are_refused_with_the_reason(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none\.json: no such file"):
        load_tree(tmp_path / "none.json")
    with pytest.raises(BadInput, match="cannot be read"):
        load_tree(tmp_path)


def test_a_huge_file_is_refused_by_its_size_before_it_is_read(tmp_path: Path) -> None:
    """Fault 39."""
    path = tmp_path / "huge.json"
    with path.open("wb") as file:
        file.truncate(2**30)
    with pytest.raises(BadInput, match="more than 8388608 bytes, the limit for such a file"):
        load_tree(path)


@pytest.mark.parametrize("cut", range(0, 700, 7))
def test_wherever_a_file_is_cut_off_it_is_refused(cut: int) -> None:
    """Fault 35."""
    data = tree_to_bytes(TREE)
    assert cut < len(data.rstrip()) - 1
    with pytest.raises(BadInput):
        tree_from_bytes(data[:cut])
