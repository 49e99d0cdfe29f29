"""A robot that takes velocity commands: the learner chooses among sources, and only among those that may drive."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.types import DRIVER_BLEND
from fbql_fusion.core.guides.priorities import Priorities
from fbql_fusion.core.mux_session import MuxSession
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.tasks.twist.answers import SourceLeaves
from fbql_fusion.core.tasks.twist.moment import MuxMoment
from fbql_fusion.core.tasks.twist.task import MuxTask
from rail import PERIOD_S, SPACE, learning, play, session_of, success_rate

LEARNERS = ("fbql", "fbql_value")
DOWN, UP = 0, 1


def policy_of(session: MuxSession) -> Policy:
    """What it has learned."""
    policy = session.policy()
    assert policy is not None
    return policy


@pytest.fixture(scope="module", params=LEARNERS)
def learned(request: pytest.FixtureRequest) -> Policy:
    """A policy of the task."""
    session = session_of(controller=request.param)
    play(session, 250)
    return policy_of(session)


def test_whom_to_follow_is_learned_from_reward_alone(learned: Policy) -> None:
    frozen = session_of(learned, controller=learned.kind, learn=False)
    play(frozen, 40)
    assert success_rate(frozen) >= 0.95
    by_priority = session_of(controller="priorities", learn=False)
    play(by_priority, 40)
    assert success_rate(by_priority) < 0.8


def alternately(k: int) -> tuple[bool, bool]:
    """Down is silent in every third moment, up in every fifth; so nobody may drive in every fifteenth."""
    return k % 3 != 0, k % 5 != 0


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_source_that_may_not_drive_never_does_and_the_probability_that_counts_is_the_masked_one(learner: str) -> None:
    session = session_of(controller=learner)
    decided = play(session, 60, alternately)
    nobody = 0
    for k, (decision, command) in enumerate(decided):
        mask = alternately(k)
        assert not decision.degraded
        assert [leaf == 25 for leaf in decision.joint_state] == [not may_drive for may_drive in mask]
        if not any(mask):
            nobody += 1
            assert (decision.driver, command) == (DRIVER_BLEND, (0.0, 0.0))
        elif decision.driver >= 0:
            assert mask[decision.driver]
    assert nobody > 20
    assert session.is_learning
    arrays = policy_of(session).arrays
    assert int(arrays["counts"][0]) == 60, "no episode is lost because sources fall silent"
    assert int(arrays["counts"][1]) >= 5


def test_masks_of_decisions_that_wait_are_kept_in_the_policy_and_the_training_resumes_exactly() -> None:
    session = session_of(fbql_batch_episodes=7)
    play(session, 46, alternately)
    policy = policy_of(session)
    masks, drivers, chances = (policy.arrays[f"waiting_{name}"] for name in ("mask", "driver", "chance"))
    lengths = policy.arrays["waiting_lengths"]
    decisions = np.delete(masks, np.cumsum(lengths + 1) - 1, axis=0)
    assert len(decisions) == len(drivers) > 0
    assert decisions[np.arange(len(drivers)), drivers].all()
    alone = decisions.sum(axis=1) == 1
    assert alone.any()
    assert (chances[alone] == 1.0).all(), "who is the only one that may drive is drawn with certainty"
    again = session_of(policy, fbql_batch_episodes=7)
    assert policy_of(again).arrays.keys() == policy.arrays.keys()
    for name, array in policy_of(again).arrays.items():
        assert np.array_equal(array, policy.arrays[name]), name
    nobody = masks.copy()
    nobody[lengths[0]] = False  # where the first episode ended
    for wrong in (~masks, nobody):
        broken = policy._replace(arrays={**policy.arrays, "waiting_mask": wrong})
        with pytest.raises(BadInput, match="'waiting_mask' excludes a behavior that drove"):
            session_of(broken, fbql_batch_episodes=7)


def test_without_masks_a_policy_has_none() -> None:
    session = session_of()
    play(session, 30)
    assert "waiting_mask" not in policy_of(session).arrays


def test_a_moment_of_which_nothing_more_is_told_has_no_reward_and_no_end() -> None:
    moment = MuxMoment(0, 0, 0, ())
    assert (moment.reward, moment.ended, moment.outcome, moment.critic_inputs) == (0.0, False, "", ())


def step(session: MuxSession, number: int, active: tuple[bool, bool], reward: float = 0.0, **ends: Any) -> Any:
    """A moment of the first episode."""
    moment = MuxMoment(number, 0, number, ((0.1,), (1.0,)), reward, **ends)
    leaves = SourceLeaves(SPACE)
    return session.decide(moment, [leaves.answer((0.5, 0.0), may) for may in active])[1]


def test_what_happens_while_nobody_may_drive_is_due_to_the_decision_before() -> None:
    session = session_of(fbql_batch_episodes=1000, fbql_discount=0.5)
    play(session, 28)
    before = len(policy_of(session).arrays["waiting_driver"])
    begun = session.next_episode()
    assert begun is not None
    masks = [(True, True), (False, False), (False, False), (True, True)]
    leaves = SourceLeaves(SPACE)
    for number, mask in enumerate([*masks, (True, True)]):
        moment = MuxMoment(number, begun[0], number, ((0.1,), (1.0,)), 8.0 if number else 0.0, number == 4)
        session.decide(moment, [leaves.answer((0.5, 0.0), may) for may in mask])
    arrays = policy_of(session).arrays
    assert len(arrays["waiting_driver"]) == before + 2
    assert arrays["waiting_reward"].tolist()[-2:] == [8.0 + 4.0 + 2.0, 8.0]
    assert arrays["waiting_discount"].tolist()[-2:] == [0.125, 0.5]


def test_a_source_that_falls_silent_loses_its_hold_at_once_and_one_that_returns_is_not_blended() -> None:
    session = session_of(hold_s=100.0, play_s=100.0, learn=False)
    assert session.next_episode() is not None
    assert step(session, 0, (True, True)).driver == DOWN
    assert step(session, 1, (False, True)).driver == UP
    assert step(session, 2, (True, True)).driver == UP, "held"
    assert step(session, 3, (False, False)).driver == DRIVER_BLEND
    assert step(session, 4, (True, False)).driver == DOWN
    assert step(session, 5, (True, True)).driver == DOWN


# The guide as a prior


@pytest.mark.parametrize("priorities", [(1, 2), (2, 1)])
def test_an_untrained_policy_with_a_prior_plays_its_guide(priorities: tuple[int, int]) -> None:
    guided = play(session_of(controller="priorities", priorities=priorities, learn=False), 10, alternately)
    prior = play(
        session_of(priorities=priorities, fbql_prior=3.0, learn=False, play_s=0.0, fbql_patience=0), 10, alternately
    )
    assert [command for _, command in prior] == [command for _, command in guided]
    assert any(decision.driver == UP for decision, _ in guided)


def test_the_prior_is_a_preference_of_kappa_from_which_the_features_start() -> None:
    session = session_of(fbql_prior=2.0)
    (decision, _), *_ = play(session, 1)
    assert decision.learned_weights == pytest.approx((1 / (1 + np.e**2), np.e**2 / (1 + np.e**2)))
    session = session_of(fbql_prior=2.0, fbql_rate=0.0)
    play(session, 30)
    arrays = policy_of(session).arrays
    assert arrays["theta"][:3].tolist() == [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]], "none, down, up"
    assert not arrays["theta"][3:].any()
    (decision, _), *_ = play(session_of(policy_of(session), fbql_prior=0.0, learn=False), 1)
    assert decision.learned_weights == pytest.approx((1 / (1 + np.e**2), np.e**2 / (1 + np.e**2))), "the policy's own"


def test_without_a_prior_the_guide_is_no_feature() -> None:
    session, other = session_of(), session_of(priorities=(2, 1))
    assert [d for d, _ in play(session, 30)] == [d for d, _ in play(other, 30)]


# Groups of observations


@pytest.mark.parametrize("groups", [(), (2,), (1, 1), (1, 2, 1, 3)])
def test_there_may_be_any_number_of_groups_of_observations_beside_the_sources(groups: tuple[int, ...]) -> None:
    session = MuxSession(learning(), MuxTask(SPACE, PERIOD_S, groups), Priorities((1, 2)))
    rng = np.random.default_rng(5)
    leaves = SourceLeaves(SPACE)
    for _ in range(30):
        begun = session.next_episode()
        assert begun is not None
        for number in range(8):
            observed = tuple(tuple(rng.random(length).tolist()) for length in groups)
            moment = MuxMoment(number, begun[0], number, observed, float(number), number == 7)
            session.decide(moment, [leaves.answer((x, 0.0)) for x in rng.uniform(-1, 1, 2)])
    arrays = policy_of(session).arrays
    assert arrays["lengths"].tolist() == list(groups)
    assert arrays["counts"].tolist()[0] == 30
    pairs, n = len(groups) * (len(groups) - 1) // 2, 2
    assert arrays["waiting_active"].shape[1] in (n + 1 + 4 * pairs + 4 * bool(groups), 0)


def test_a_policy_of_other_groups_is_refused_in_one_line() -> None:
    session = session_of()
    play(session, 30)
    with pytest.raises(BadInput, match="learned with groups of 1, 1 observations; here they are of 1, 2"):
        MuxSession(learning(), MuxTask(SPACE, PERIOD_S, (1, 2)), Priorities((1, 2)), policy_of(session))


def test_an_observation_that_is_not_known_ends_learning_in_its_episode_and_not_playing() -> None:
    session = session_of()
    play(session, 25)
    counted = policy_of(session).arrays["counts"][0]
    begun = session.next_episode()
    assert begun is not None
    leaves = SourceLeaves(SPACE)
    for number in range(12):
        known = ((0.1,), (1.0,) if number < 5 else ())
        moment = MuxMoment(number, begun[0], number, known, terminated=number == 11)
        _, decision = session.decide(moment, [leaves.answer((0.5, 0.0))] * 2)
        assert decision.driver >= 0
    assert policy_of(session).arrays["counts"][0] == counted


# Durations in seconds


@pytest.mark.parametrize(
    ("period_s", "hold_s", "steps"), [(0.1, 0.8, 8), (0.1, 0.0, 1), (0.05, 0.8, 16), (0.3, 0.8, 3), (1.0, 0.4, 1)]
)
def test_a_decision_is_held_for_the_nearest_number_of_whole_periods(period_s: float, hold_s: float, steps: int) -> None:
    parameters = learning(learn=False, play_s=hold_s, decision_period_s=period_s, fbql_play="drawn")
    session = MuxSession(parameters, MuxTask(SPACE, period_s, (1, 1)), Priorities((1, 2)))
    assert session.next_episode() is not None
    drivers = [step(session, number, (True, True)).driver for number in range(400)]
    for begin in range(0, 400 - steps, steps):
        assert len({*drivers[begin : begin + steps]}) == 1
    assert len({*drivers}) == 2
    changes = sum(a != b for a, b in pairwise(drivers))
    assert changes > 400 / steps / 4


def test_the_discount_is_of_time_and_not_of_steps() -> None:
    waited: list[float] = []
    for period_s in (0.1, 0.05):
        parameters = learning(decision_period_s=period_s, hold_s=0.2, fbql_batch_episodes=1000, fbql_discount=0.81)
        session = MuxSession(parameters, MuxTask(SPACE, period_s, (1, 1)), Priorities((1, 2)))
        leaves = SourceLeaves(SPACE)
        for _ in range(25):
            begun = session.next_episode()
            assert begun is not None
            last = round(0.4 / period_s)
            for number in range(last + 1):
                moment = MuxMoment(number, begun[0], number, ((0.1,), (1.0,)), terminated=number == last)
                session.decide(moment, [leaves.answer((0.5, 0.0))] * 2)
        waited.append(policy_of(session).arrays["waiting_discount"][-1])
    assert waited == pytest.approx([0.81**2, 0.81**2])


# Outcomes


@pytest.mark.parametrize(
    ("ends", "outcome", "counts"),
    [
        ({"terminated": True, "outcome": "success"}, "success", (1, 0, 0, 0)),
        ({"terminated": True, "outcome": "collision"}, "collision", (0, 1, 0, 1)),
        ({"terminated": True, "outcome": "fell"}, "fell", (0, 1, 0, 0)),
        ({"terminated": True}, "failure", (0, 1, 0, 0)),
        ({"truncated": True, "outcome": "success"}, "timeout", (0, 0, 1, 0)),
        ({"truncated": True}, "timeout", (0, 0, 1, 0)),
    ],
)
def test_only_a_terminated_success_is_a_success(ends: dict[str, Any], outcome: str, counts: tuple[int, ...]) -> None:
    session = session_of()
    assert session.next_episode() is not None
    step(session, 0, (True, True))
    assert step(session, 1, (True, True), 3.5, **ends).reward == 3.5
    (record,) = session.records
    assert (record.outcome, record.return_, record.steps) == (outcome, 3.5, 1)
    assert (record.collision_steps, record.degraded) == (0, False), "contacts are not told"
    summary = session.summary()
    found = summary.successes, summary.failures, summary.timeouts, summary.collisions_begun
    assert found == counts
    assert summary.cost_per_success == (1.0 if counts[0] else None)
