"""The value of any tree, against the equations by the letter, and against the optimum that dynamic programming finds."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fbql_behaviors.core.induction import InductionParameters, induce
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.tree import Split, Tree
from fbql_behaviors.core.tree_value import tree_value
from hypothesis import given
from hypothesis import strategies as st
from induction_oracle import gain_of
from tree_strategies import PLANE, Row, patterns_of_rows, rows, trees

OBJECTIVES = st.sampled_from(["weighted", "printed"])


def value_of(tree: Tree, node: int, patterns: Patterns, inside: list[int], parameters: InductionParameters) -> float:
    """Eqs. 1 to 4 down a tree; every node looks at its patterns again."""
    split = tree.nodes[node]
    if not isinstance(split, Split):
        return 0.0
    left = [row for row in inside if patterns.x[row, split.feature] < split.threshold]
    right = [row for row in inside if patterns.x[row, split.feature] >= split.threshold]
    gain = 0.0
    if left and right:
        gain = gain_of(*(patterns.wheel_class[part].tolist() for part in (inside, left, right)))
    if parameters.objective == "weighted":
        gain *= len(inside) / len(patterns)
    below = value_of(tree, split.left, patterns, left, parameters)
    below += value_of(tree, split.right, patterns, right, parameters)
    if parameters.objective == "printed":
        below /= 2
    return parameters.split_cost + gain + parameters.discount * below


@given(trees(PLANE), rows([1, 2, 3], 30), OBJECTIVES, st.sampled_from([-0.3, -0.01]), st.sampled_from([1.0, 0.7]))
def test_the_value_is_that_of_the_equations_at_every_split(
    tree: Tree, given_rows: list[Row], objective: str, split_cost: float, discount: float
) -> None:
    patterns = patterns_of_rows(given_rows)
    parameters = InductionParameters(objective=objective, split_cost=split_cost, discount=discount)
    expected = value_of(tree, 0, patterns, list(range(len(patterns))), parameters)
    assert tree_value(tree, patterns, parameters) == pytest.approx(expected, abs=1e-12)


@given(rows([1, 2, 3], 30), OBJECTIVES)
def test_the_value_of_the_optimal_tree_is_what_induction_says(given_rows: list[Row], objective: str) -> None:
    patterns = patterns_of_rows(given_rows)
    parameters = replace(InductionParameters(), method="dp", objective=objective, split_cost=-0.02, min_range=1 / 8)
    induced = induce("t", patterns, parameters, 0)
    assert tree_value(induced.tree, patterns, parameters) == pytest.approx(induced.value, abs=1e-9)
