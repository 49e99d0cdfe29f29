"""Equations 1-4, each with numbers computed by hand."""

from __future__ import annotations

from math import log

import numpy as np
import pytest
from fbql_behaviors.core.equations import (
    children_value,
    entropy,
    information_gain,
    q_update,
    q_update_printed,
    split_reward,
)
from hypothesis import given
from hypothesis import strategies as st


def test_entropy_of_two_equal_classes_is_ln_2() -> None:
    assert entropy([5, 5]) == pytest.approx(0.6931471805599453)


def test_entropy_of_one_in_four_is_that_of_the_hand() -> None:
    # -(1/4 ln 1/4 + 3/4 ln 3/4) = 0.346574 + 0.215762
    assert entropy([1, 3]) == pytest.approx(0.5623351446188083)


def test_entropy_of_one_class_or_of_nothing_is_0() -> None:
    assert entropy([7]) == 0.0
    assert entropy([0, 7, 0]) == 0.0
    assert entropy([]) == 0.0


@given(st.lists(st.integers(0, 50), min_size=1, max_size=12))
def test_entropy_lies_between_0_and_ln_of_the_number_of_classes(counts: list[int]) -> None:
    assert -1e-12 <= entropy(counts) <= log(len(counts)) + 1e-12


def test_information_gain_of_a_split_into_pure_halves_is_the_whole_entropy() -> None:
    assert information_gain(log(2), 0.0, 0.0, 5.0, 5.0) == pytest.approx(log(2))


def test_information_gain_weights_the_children_by_their_patterns() -> None:
    # node (4, 4), left (3, 1), right (1, 3): ln 2 - 0.562335
    assert information_gain(log(2), 0.5623351446, 0.5623351446, 4.0, 4.0) == pytest.approx(0.1308120360)
    # node (2, 2), left (1, 0), right (1, 2): ln 2 - 3/4 * 0.636514
    assert information_gain(log(2), 0.0, 0.6365141683, 1.0, 3.0) == pytest.approx(0.2157615543)


def test_information_gain_of_arrays_is_that_of_each() -> None:
    left, right = np.array([0.0, 0.5]), np.array([0.2, 0.1])
    n_left, n_right = np.array([1.0, 3.0]), np.array([3.0, 1.0])
    gains = information_gain(np.array([0.6, 0.6]), left, right, n_left, n_right)
    assert gains.tolist() == pytest.approx([0.6 - 0.15, 0.6 - 0.4])


def test_reward_of_a_split_is_its_cost_plus_its_gain() -> None:
    assert split_reward(-0.25, 0.75) == 0.5


def test_successors_are_averaged_as_printed_or_added_when_the_share_is_1() -> None:
    assert children_value(0.5, 0.25, 0.5) == 0.375
    assert children_value(0.5, 0.25, 1.0) == 0.75


def test_q_update_moves_a_share_of_the_way_to_the_target() -> None:
    # 0.5 + 0.1 * (1.5 - 0.5)
    assert q_update(0.5, 1.5, 0.1) == pytest.approx(0.6)


def test_q_update_rests_at_its_target() -> None:
    assert q_update(1.5, 1.5, 0.3) == 1.5


def test_q_update_as_printed_grows_without_end() -> None:
    q = 0.0
    for _ in range(1000):
        q = q_update_printed(q, 1.0, 0.1)
    assert q == pytest.approx(100.0)
