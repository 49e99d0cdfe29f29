"""Eqs. 5 and 6 as printed, in a task that FBQL learns: where weights begin equal, no reward ever parts them."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from fbql_common.core.types import DRIVER_BLEND, World
from fbql_fusion.core.controllers.interface import Transition
from fbql_fusion.core.learners.literal.equations import count_ties
from fbql_fusion.core.learners.literal.learner import FbqlLiteral
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from hypothesis import given
from hypothesis import strategies as st
from two_sides import Answers, parameters, play


@given(
    n=st.integers(2, 5),
    path=st.lists(st.integers(0, 3), min_size=2, max_size=40),
    rewards=st.lists(st.floats(-100, 100), min_size=40, max_size=40),
    ends=st.lists(st.booleans(), min_size=40, max_size=40),
)
def test_where_a_tie_changes_nothing_no_reward_ever_parts_equal_weights(
    n: int, path: list[int], rewards: list[float], ends: list[bool]
) -> None:
    """Equal weights share every reward alike, so that the Q of a state stay equal and eq. 6 finds no argmax."""
    literal = FbqlLiteral(FusionParameters(behaviors=[f"b{i}" for i in range(n)]), np.random.default_rng(0))
    for (state, following), reward, terminated in zip(pairwise(path), rewards, ends, strict=False):
        literal.learn(Transition((state,) * n, (1 / n,) * n, DRIVER_BLEND, reward, (following,) * n, terminated, False))
    arrays = literal.to_arrays()
    assert (arrays["weights"] == 1 / n).all()
    assert count_ties(arrays["q"]) == len(arrays["q"]) > 0


def three_times_as_fast_up(_: World, answers: Answers) -> Answers:
    """So that equal weights do not stand still: together they drive upwards."""
    up, down = answers
    assert up is not None
    return [up._replace(left_rad_s=3.0, right_rad_s=3.0), down]


@pytest.mark.parametrize("guided", [0, 5])
def test_literal_fbql_in_which_a_tie_changes_nothing_is_its_frozen_twin_and_equal_weights(guided: int) -> None:
    """To the last bit of the digest, over episodes of which half end in a goal and half in an own goal."""

    def played(**changes: object) -> SoccerSession:
        session = SoccerSession(parameters(seed=3, guided=guided, **changes))
        play(session, 60, three_times_as_fast_up)
        return session

    literal = played(controller="fbql_literal", tie_rule="none")
    assert played(controller="fbql_literal", learn=False).digest == literal.digest
    assert played(controller="uniform").digest == literal.digest
    outcomes = Counter(record.outcome for record in literal.records)
    assert min(outcomes["goal"], outcomes["own_goal"]) > 15
    policy = literal.policy()
    assert policy is not None
    q = policy.arrays["q"]
    assert count_ties(q) == len(q) > 10
    assert np.abs(q).max() > 0.5, "rewards did come"
    assert played(controller="fbql_literal", tie_rule="first").digest != literal.digest
