"""Trees in C: the same answers as the tree, on random points and on every threshold."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from fbql_behaviors.core.c_source import c_name, to_c
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.tree import CommandLeaf, Leaf, Node, Split, Tree
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.command_space import Axis, CommandSpace
from hypothesis import HealthCheck, given, settings
from patience import PATIENCE_S
from tree_strategies import NASTY, edge_points, trees

NAMES = ("ball_seeking", "wall_avoiding", "approaching")
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-shared", "-fPIC")


class Compiled:
    """A tree's C function, compiled and loaded."""

    def __init__(self, tree: Tree, place: Path) -> None:
        compiler = shutil.which("gcc")
        if compiler is None:
            pytest.skip("there is no gcc here")
        source, library = place / "tree.c", place / "tree.so"
        source.write_text(to_c(tree))
        done = subprocess.run(
            [compiler, *STRICT, str(source), "-o", str(library)],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        self._loaded = ctypes.CDLL(str(library))
        self._answer = getattr(self._loaded, f"{c_name(tree.behavior)}_answer")
        self._observation = ctypes.c_double * len(tree.features)

    def answer(self, observation: tuple[float, ...]) -> tuple[int, float, float]:
        left, right = ctypes.c_double(nan), ctypes.c_double(nan)
        leaf_id = self._answer(self._observation(*observation), ctypes.byref(left), ctypes.byref(right))
        return leaf_id, left.value, right.value


@pytest.mark.parametrize("name", NAMES)
def test_c_answers_like_the_tree_on_random_points_and_on_every_threshold(name: str, tmp_path: Path) -> None:
    tree = load_tree(shipped_trees() / f"{name}.json")
    compiled = Compiled(tree, tmp_path)
    rng = np.random.default_rng(0)
    columns = [rng.uniform(feature.low - 0.5, feature.high + 0.5, 5000) for feature in tree.features]
    points = [tuple(row) for row in np.stack(columns, axis=1).tolist()]
    points += edge_points(tree)
    points += [(inf, -inf), (-inf, inf), (nan, 0.0), (0.0, -0.0)]
    assert len(points) > 5020
    for point in points:
        assert compiled.answer(point) == tree.answer(point)


def test_c_of_any_random_tree_answers_like_it(tmp_path_factory: pytest.TempPathFactory) -> None:
    @settings(max_examples=8, suppress_health_check=[HealthCheck.too_slow])
    @given(trees())
    def hold(tree: Tree) -> None:
        compiled = Compiled(tree, tmp_path_factory.mktemp("c"))
        for point in edge_points(tree):
            assert compiled.answer(point) == tree.answer(point)

    hold()


def test_c_takes_a_tree_as_deep_as_a_chain(tmp_path: Path) -> None:
    depth = 2000
    nodes: list[Node] = []
    for k in range(depth - 1):
        nodes += [Split(0, float(k + 1), 2 * k + 1, 2 * k + 2), k]
    nodes.append(depth - 1)
    leaves = tuple(Leaf(k / 100, -k / 100, 1) for k in range(depth))
    tree = Tree("chain", (Feature("x", "m", 0.0, float(depth)),), tuple(nodes), leaves)
    assert Compiled(tree, tmp_path).answer((1500.5,)) == (1500, 15.0, -15.0)


def test_a_behavior_name_cannot_end_the_comment_it_stands_in(tmp_path: Path) -> None:
    tree = Tree(NASTY, (Feature(NASTY, NASTY, 0.0, 1.0),), (Split(0, 0.5, 1, 2), 0, 1), (Leaf(1, 2, 3), Leaf(4, 5, 6)))
    assert Compiled(tree, tmp_path).answer((0.7,)) == (1, 4.0, 5.0)


def test_c_gives_every_axis_of_another_command_and_names_them() -> None:
    space = CommandSpace((Axis("linear.x", "m/s", -0.5, 1.0, 4), Axis("a*/b", "", 0.0, 9.0, 4)))
    nodes, leaves = (Split(0, 0.5, 1, 2), 0, 1), (CommandLeaf((0.25, 0.0), 1), CommandLeaf((-0.5, 9.0), 1))
    text = to_c(Tree("t", (Feature("x", "m", 0.0, 1.0),), nodes, leaves, commands=space))
    assert "int t_answer(const double observation[1], double command[2])" in text
    assert " *   [0] linear.x [m/s], -0.5 to 1.0\n *   [1] a?|b [], 0.0 to 9.0\n" in text
    assert "/* linear.x, a?|b */\nstatic const double leaves[][2] = {" in text
    assert f"{{{(0.25).hex()}, {(0.0).hex()}}},\n    {{{(-0.5).hex()}, {(9.0).hex()}}},\n" in text
    assert "for (int k = 0; k < 2; k++)\n        command[k] = leaves[leaf_id][k];" in text


@pytest.mark.parametrize(
    ("behavior", "name"), [("a b", "a_b"), ("9", "tree_9"), ("", "tree_"), ("_x", "tree__x"), ("é", "tree__")]
)
def test_any_behavior_gets_a_name_that_c_accepts(behavior: str, name: str) -> None:
    assert c_name(behavior) == name
