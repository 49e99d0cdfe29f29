"""`fbql_value`: what it makes of equations 16 to 20. Rules that both learners keep: ../test_held_decisions.py."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fbql_common.core.types import DRIVER_BLEND, Decision
from fbql_fusion.core.learners.value.equations import decayed, soft_weights
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession
from held_learners import GOAL, TIMEOUT, Arrays, arrays_of, frozen, learned, stay, trained
from two_sides import DOWN, UP, goals, parameters, play

VALUE = "fbql_value"
OWN_GOAL = {"own_goal": True, "terminated": True}


def with_values(value: float, **changes: Any) -> SoccerSession:
    """A session that learns of each episode at once, by eq. 20 without a trace; all that it knows is worth `value`."""
    given: dict[str, Any] = {"own_batch_episodes": 1, "own_discount": 1.0, "own_trace": 0.0, "own_passes": 1, **changes}
    met = SoccerSession(parameters(VALUE, seed=3, **given), trained(VALUE))
    stay(met, 3)
    policy = learned(met)
    features = 1 + 1 + 1 + 4 + 4  # leaves, their pair, tilings of the pair and of all
    values = np.zeros_like(policy.arrays["values"])
    values[:, -1] = value / features
    return SoccerSession(
        parameters(VALUE, seed=3, **given), policy._replace(arrays={**policy.arrays, "values": values})
    )


def moved(session: SoccerSession, before: Arrays) -> np.ndarray:
    """How the features of where it stays moved: the rows of the table that did."""
    after = arrays_of(session)["values"]
    rows = (after[: len(before["values"])] - before["values"]).any(axis=1).nonzero()[0]
    return after[rows] - before["values"][rows]


@pytest.mark.parametrize(("end", "sign"), [(GOAL, 1.0), (OWN_GOAL, -1.0)])
def test_who_drove_gains_or_loses_what_came_and_the_others_the_opposite(end: dict[str, bool], sign: float) -> None:
    session = with_values(0.0, own_hold_s=30 / 60, own_exploration_first=1.0, own_exploration_last=1.0)
    drivers: set[int] = set()
    for _ in range(10):
        before = arrays_of(session)
        ((driver, _), *_) = stay(session, 30, **end)
        steps = sign * moved(session, before)
        assert len(steps) > 10
        assert (steps[:, driver] > 0.0).all()
        assert steps[:, 1 - driver] == pytest.approx(-steps[:, driver])
        drivers.add(driver)
    assert drivers == {UP, DOWN}


def test_truncation_is_worth_what_its_state_is_and_termination_nothing() -> None:
    """Without rewards, where everything is worth 6 and stays as it is."""
    session = with_values(6.0, own_hold_s=30 / 60, reward_goal=0.0)
    before = arrays_of(session)
    stay(session, 30, **TIMEOUT)
    assert np.abs(moved(session, before)).sum() == pytest.approx(0.0, abs=1e-9)
    stay(session, 30, **GOAL)
    steps = moved(session, before)[:, -1]
    rate = session.parameters.fbql_value_shared_rate
    assert steps.sum() == pytest.approx(-6.0 * rate, rel=0.01), "U of the state moves towards 0 by beta"


def test_of_guided_episodes_it_learns_what_came_of_them_and_of_no_reward_nothing() -> None:
    """It follows no guide: it learns what was worth what."""
    for reward, learns in ((10.0, True), (0.0, False)):
        session = SoccerSession(parameters(VALUE, seed=1, guided=8, reward_goal=reward, reward_own_goal=-reward))
        play(session, 9)
        arrays = arrays_of(session)
        assert arrays["counts"].tolist() == [1, 1]
        assert arrays["values"].any() == learns


def test_guided_episodes_of_a_learner_that_knows_something_are_learned_from_one_by_one() -> None:
    session = SoccerSession(parameters(VALUE, seed=3, guided=3), trained(VALUE))
    before = arrays_of(session)["counts"].tolist()
    play(session, 3)
    assert arrays_of(session)["counts"].tolist() == [before[0], before[1] + 3]


def decided(policy: Policy, **changes: Any) -> Decision:
    """The first decision of frozen, blended play."""
    return play(frozen(policy, own_play="blended", own_patience=0, **changes), 1)[0]


def test_a_decision_tells_q_and_the_weights_are_those_of_q_at_the_tau_and_eps_of_so_many_episodes() -> None:
    fall = {"temperature_first": 4.0, "temperature_last": 1.0, "exploration_first": 0.4, "exploration_last": 0.1}
    own = {f"own_{name}": value for name, value in fall.items()}
    policy = trained(VALUE)
    for halving in (10.0, 1000.0):
        decision = decided(policy, own_halving=halving, **own)
        episodes = int(policy.arrays["counts"][0])
        assert episodes == 30
        temperature = decayed(4.0, 1.0, halving, episodes)
        exploration = decayed(0.4, 0.1, halving, episodes)
        assert decision.driver == DRIVER_BLEND
        assert len(set(decision.q)) == 2
        assert decision.weights == pytest.approx(soft_weights(decision.q, temperature, exploration), abs=1e-12)


def test_a_held_decision_tells_q_of_all_behaviors() -> None:
    decisions = play(frozen(trained(VALUE), own_patience=0), 3)
    for decision in decisions:
        if decision.driver != DRIVER_BLEND:
            assert decision.q[decision.driver] == max(decision.q)
    assert len({decision.q for decision in decisions}) > 5


@pytest.mark.parametrize(("halving", "share"), [(1e9, 1.0), (20.0, 0.5), (5.0, 0.2)])
def test_alpha_decays_with_the_episodes(halving: float, share: float) -> None:
    """The first batch is of 20 episodes: it is learned from at the alpha that is left by then."""

    def theta(first: float, last: float, halving: float) -> np.ndarray:
        rates = {"own_rate_first": first, "own_rate_last": last, "own_halving": halving}
        session = SoccerSession(parameters(VALUE, seed=1, **rates))
        play(session, 21)
        return arrays_of(session)["values"]

    expected = theta(0.01 * share, 0.01 * share, 1e9)
    assert np.abs(expected[:, :-1]).max() > 0.001
    assert theta(0.01, 0.0, halving) == pytest.approx(expected, abs=1e-6)


def test_with_eps_1_it_goes_on_drawing_alike_whatever_it_learned() -> None:
    given = {"own_exploration_first": 1.0, "own_exploration_last": 1.0}
    session = SoccerSession(parameters(VALUE, seed=1, **given))
    play(session, 60)
    assert goals(session, 60) < 0.7
    assert np.abs(arrays_of(session)["values"][:, :-1]).max() > 0.0
    decision = play(SoccerSession(parameters(VALUE, learn=False, own_play="blended", **given), learned(session)), 1)[0]
    assert decision.weights == pytest.approx((0.5, 0.5))


def test_a_robot_that_stands_still_for_many_episodes_leaves_q_within_the_rewards() -> None:
    """A deadlock, the most frequent failure: all of its decisions have the same features."""
    session = SoccerSession(parameters(VALUE, seed=1, guided=3, own_hold_s=1 / 60))
    for episode in range(20):
        stay(session, 300, **(GOAL if episode % 5 == 4 else TIMEOUT))
    if not arrays_of(session)["waiting_active"].size:  # it was just learned from
        stay(session, 1)
    arrays = arrays_of(session)
    worth = np.array([arrays["values"][row].sum(axis=0) for row in arrays["waiting_active"]])
    assert 0.0 < np.abs(worth[:, -1]).max() <= 10.0
    assert np.abs(worth[:, 0] - worth[:, 1]).max() <= 10.0
