"""FBQL that learns: it does, goes on exactly where it was left, and learns of nothing that it did not see whole."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fbql_common.core.types import DRIVER_BLEND, NO_LEAF, BehaviorOutput, Phase, World
from fbql_fusion.core.controllers import Transition
from fbql_fusion.core.experience import Batch, Episode
from fbql_fusion.core.fbql import Fbql
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.session import Session, episode_seed
from fbql_fusion.policy_storage import load_policy, save_policy
from numpy.typing import NDArray
from two_sides import BEHAVIORS, DOWN, UP, Answers, Heard, TwoSides, answer, goals, parameters, play, world_state

Arrays = dict[str, NDArray[Any]]
SEEDS = pytest.mark.parametrize("seed", [1, 2, 3])
GOAL = {"goal": True, "terminated": True}
TIMEOUT = {"truncated": True}


def learned(session: Session) -> Policy:
    policy = session.policy()
    assert policy is not None
    return policy


def learned_after_guidance(session: Session) -> Policy:
    """The guided episodes are learned from when the first free one begins."""
    session.next_episode()
    return learned(session)


def equal(one: Arrays, other: Arrays) -> bool:
    return one.keys() == other.keys() and all(np.array_equal(array, other[name]) for name, array in one.items())


def arrays_of(session: Session) -> Arrays:
    return dict(learned(session).arrays)


def anywhere(seed: int) -> Heard:
    """Lets the behaviors sense something else at every step: nothing that was ever met."""
    rng = np.random.default_rng(seed)
    return lambda _, answers: [
        x and x._replace(observation=tuple(rng.random(len(x.observation)).tolist())) for x in answers
    ]


# It learns


@SEEDS
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"guided": 5},
        {"fbql_pair_tilings": 0, "fbql_joint_tilings": 0},
        {"fbql_leaf_pairs": False, "fbql_joint_tilings": 0},
        {"fbql_leaf_pairs": False, "fbql_pair_tilings": 0},
    ],
    ids=["alone", "guided", "of leaves", "of pairs' tiles", "of joint tiles"],
)
def test_from_goals_alone_it_learns_which_behavior_is_right_where(seed: int, changes: dict[str, Any]) -> None:
    """The guide drives up on either side, which scores in half of its episodes: no help."""
    session = Session(parameters(seed=seed, **changes))
    play(session, 160)
    assert goals(session, 50) >= 0.9

    def frozen(policy: Policy | None, play_: str) -> float:
        evaluation = Session(
            parameters(seed=seed + 100, learn=False, fbql_play=play_, **(changes | {"guided": 0})), policy
        )
        play(evaluation, 60)
        return goals(evaluation, 60)

    assert frozen(None, "drawn") <= 0.7, "its frozen twin"
    for play_ in ("held", "drawn", "blended"):
        assert frozen(learned(session), play_) >= 0.9


def test_the_same_seed_learns_the_same_and_another_seed_another() -> None:
    def run(seed: int) -> tuple[str, Arrays]:
        session = Session(parameters(seed=seed, guided=3))
        play(session, 40)
        return session.digest, arrays_of(session)

    digest, arrays = run(1)
    again = run(1)
    assert again[0] == digest
    assert equal(again[1], arrays)
    assert run(2)[0] != digest


@SEEDS
def test_the_guides_failures_are_not_imitated(seed: int) -> None:
    """A guide that always takes up scores where up is right, and only these episodes are examples."""
    session = Session(parameters(seed=seed, guided=12, fbql_value_rate=0.0))
    play(session, 12)
    assert {record.outcome for record in session.records} == {"goal", "own_goal"}
    policy = learned_after_guidance(session)
    blended = Session(parameters(seed=seed + 100, learn=False, guided=0, fbql_play="blended", fbql_patience=0), policy)
    decisions = play(blended, 20)
    wanted = [decision.weights[UP] for decision in decisions if decision.joint_state[0] >= 2]
    other = [decision.weights[UP] for decision in decisions if decision.joint_state[0] < 2]
    assert min(len(wanted), len(other)) > 20
    assert np.mean(wanted) > np.mean(other) + 0.1


@SEEDS
def test_following_a_good_guide_needs_no_reward(seed: int) -> None:
    """The guide takes who is not clamped: the right one. Then is played without learning anything more."""

    def right(_: World, answers: Answers) -> Answers:
        up, down = answers
        assert up is not None
        return [up._replace(clamped=up.observation[0] >= 0.5), down]

    session = Session(parameters(seed=seed, guided=8, reward_goal=0.0, reward_own_goal=0.0))
    play(session, 8, right)
    assert [record.outcome for record in session.records] == ["goal"] * 8
    play(session, 1)
    evaluation = Session(parameters(seed=seed + 100, learn=False), learned(session))
    play(evaluation, 40)
    assert goals(evaluation, 40) >= 0.9


# Without learning nothing changes


@pytest.mark.parametrize("guided", [0, 3])
@pytest.mark.parametrize(("play_", "draws"), [("held", False), ("blended", False), ("drawn", True)])
def test_without_learning_nothing_changes_but_the_generator_where_is_drawn(
    play_: str, draws: bool, guided: int
) -> None:
    session = Session(parameters(seed=1))
    play(session, 40)
    before = arrays_of(session)
    frozen = Session(parameters(seed=2, learn=False, guided=guided, fbql_play=play_, fbql_patience=0), learned(session))
    play(frozen, 12, anywhere(0))
    after = arrays_of(frozen)
    drawn = draws or guided > 0
    assert np.array_equal(before.pop("generator"), after.pop("generator")) != drawn
    assert equal(before, after)


def test_without_learning_and_without_a_policy_nothing_is_learned() -> None:
    session = Session(parameters(learn=False, guided=2, fbql_patience=0))
    play(session, 6)
    assert set(arrays_of(session)) == {"counts", "generator"}
    assert arrays_of(session)["counts"].tolist() == [0, 0, 0]


# It goes on where it was left


def live(learner: Fbql, numbers: range, phase: Phase) -> None:
    """Lives through the episodes of these numbers, as a session lets a learner do."""
    task, up_always = TwoSides(), ((1.0, 0.0), UP)
    for number in numbers:
        learner.begin_episode(phase)
        world = task.reset(number, episode_seed(9, number))
        before: tuple[tuple[int, ...], tuple[float, ...], int] | None = None
        while True:
            outputs = task.answers()
            joint_state = tuple(NO_LEAF if x is None else x.leaf_id for x in outputs)
            if before is not None:
                reward = 10.0 * world.goal - 10.0 * world.own_goal
                learner.learn(Transition(*before, reward, joint_state, world.terminated, world.truncated))
            weights, driver, _ = learner.select(world, joint_state, outputs)
            if phase is Phase.GUIDED:
                weights, driver = up_always
            before = joint_state, weights, driver
            if world.ended:
                break
            command = (1.0, -1.0)[driver] if driver >= 0 else weights[0] - weights[1]
            world = task.step(world, command)


def learner_of(given: FusionParameters) -> Fbql:
    return Fbql(given, np.random.default_rng(given.seed))


@pytest.mark.parametrize("guided", [0, 4])
@pytest.mark.parametrize("saved_after", [31, 40])
def test_a_training_that_is_saved_and_loaded_goes_on_bit_for_bit(guided: int, saved_after: int, tmp_path: Path) -> None:
    """With episodes that wait, a mean that is under way, and a rate that falls."""
    given = parameters(seed=4, fbql_horizon=45)

    def trained(episodes: int) -> Fbql:
        learner = learner_of(given)
        live(learner, range(guided), Phase.GUIDED)
        live(learner, range(guided, episodes), Phase.LEARNING)
        return learner

    whole, half = trained(60), trained(saved_after)
    saved = half.to_arrays()
    policy = Policy("fbql", tuple(BEHAVIORS), ("a", "b"), (4, 4), saved)
    save_policy(tmp_path / "policy.npz", policy)
    rest = learner_of(replace(given, seed=77))
    rest.load_arrays(load_policy(tmp_path / "policy.npz").arrays)
    assert equal(rest.to_arrays(), saved)
    live(rest, range(saved_after, 60), Phase.LEARNING)
    assert equal(rest.to_arrays(), whole.to_arrays())
    assert whole.to_arrays()["counts"].tolist()[0] == 60 - guided
    assert whole.to_arrays()["counts"].tolist()[2] > 3
    assert not equal(saved, whole.to_arrays())
    live(rest, range(60, 65), Phase.EVALUATION)
    live(whole, range(60, 65), Phase.EVALUATION)
    assert equal(rest.to_arrays(), whole.to_arrays())


def test_some_episodes_wait_when_a_training_is_saved() -> None:
    """So that the test above is about them."""
    learner = learner_of(parameters(seed=4, fbql_horizon=45))
    live(learner, range(31), Phase.LEARNING)
    assert len(learner.to_arrays()["waiting_lengths"]) > 0


def test_before_there_are_features_a_policy_is_a_beginning() -> None:
    session = Session(parameters(seed=1, guided=5))
    play(session, 4)
    policy = learned(session)
    assert set(policy.arrays) == {"counts", "generator"}
    again = Session(parameters(seed=2), policy)
    play(again, 30)
    assert "theta" in arrays_of(again)


def test_more_features_than_a_table_has_rows_make_it_longer() -> None:
    """Ten tiles along each component and random situations: every one of them is new."""
    session = Session(
        parameters(
            fbql_hold_steps=1, fbql_pair_tilings=32, fbql_pair_tiles=64, fbql_joint_tilings=32, fbql_joint_tiles=64
        )
    )
    play(session, 40, anywhere(0))
    arrays = arrays_of(session)
    assert len(arrays["keys"]) == len(arrays["theta"]) == len(arrays["value"]) == len(arrays["mean"]) > 2**14
    assert np.abs(arrays["theta"][2**14 :]).max() > 0.0


@pytest.mark.parametrize(("horizon", "share"), [(10**6, 1.0), (40, 1.0), (27, 14 / 27), (20, 0.1), (1, 0.1)])
def test_the_rate_falls_after_half_of_the_horizon_to_a_tenth(horizon: int, share: float) -> None:
    """The first batch is of 20 episodes: it is learned from as at the rate that the horizon leaves by then."""

    def theta(**changes: Any) -> NDArray[Any]:
        session = Session(parameters(seed=1, **changes))
        play(session, 21)
        return arrays_of(session)["theta"]

    expected = theta(fbql_rate=0.1 * share, fbql_horizon=10**6)
    assert np.abs(expected).max() > 0.01
    assert theta(fbql_rate=0.1, fbql_horizon=horizon) == pytest.approx(expected, abs=1e-9)


# What it plays


def stay(
    session: Session, steps: int, leaves: Callable[[int], tuple[int, int]] = lambda _: (1, 2), **end: bool
) -> list[tuple[int, tuple[float, ...]]]:
    """An episode in which everything stays as it is: who drove, and the weights, of each step."""
    begun = session.next_episode()
    assert begun is not None
    found: list[tuple[int, tuple[float, ...]]] = []
    for step in range(steps + 1):
        up, down = leaves(step)
        outputs: Answers = [answer("up", 1.0, up, [0.3]), answer("down", -1.0, down, [0.5, 0.5])]
        world = world_state(begun[0], step, **((end or TIMEOUT) if step == steps else {}))
        _, decision = session.decide(world, outputs)
        found.append((decision.driver, decision.weights))
    return found[:-1]


def trained(**changes: Any) -> Policy:
    session = Session(parameters(seed=1, **changes))
    play(session, 30)
    return learned(session)


def frozen(policy: Policy, **changes: Any) -> Session:
    return Session(parameters(seed=5, learn=False, **changes), policy)


def test_a_decision_is_held_for_its_steps_and_one_behavior_drives_alone() -> None:
    for session in (
        Session(parameters(seed=1, fbql_hold_steps=7)),
        frozen(trained(), fbql_play_steps=7, fbql_play="drawn"),
    ):
        drivers: list[int] = []
        for _ in range(5):
            decided = stay(session, 35)
            for begin in range(0, 35, 7):
                assert len(set(decided[begin : begin + 7])) == 1
            drivers += [driver for driver, _ in decided]
            assert {weights for _, weights in decided} <= {(1.0, 0.0), (0.0, 1.0)}
            assert all(weights[driver] == 1.0 for driver, weights in decided)
        assert {*drivers} == {UP, DOWN}


def test_held_is_whose_weight_is_the_largest_and_blended_are_all_of_them() -> None:
    policy = trained()
    blended = play(frozen(policy, fbql_play="blended", fbql_patience=0), 8)
    assert {decision.driver for decision in blended} == {DRIVER_BLEND}
    assert all(sum(decision.weights) == pytest.approx(1.0) for decision in blended)
    assert len({decision.weights for decision in blended}) > 20
    for leaves in [(0, 0), (2, 3), (3, 1)]:
        ((_, weights), *_) = stay(frozen(policy, fbql_play="blended"), 4, lambda _, x=leaves: x)
        ((driver, alone), *_) = stay(frozen(policy, fbql_play="held"), 4, lambda _, x=leaves: x)
        assert driver == weights.index(max(weights))
        assert alone[driver] == 1.0


@pytest.mark.parametrize("averaged", [0, 1])
def test_what_is_frozen_plays_by_the_mean_as_soon_as_there_is_one(averaged: int) -> None:
    policy = trained()
    opposite = {"mean": -policy.arrays["theta"], "counts": np.array([*policy.arrays["counts"][:2], averaged])}
    other = policy._replace(arrays={**policy.arrays, **opposite})
    ((_, weights), *_) = stay(frozen(policy, fbql_play="blended"), 1)
    ((_, found), *_) = stay(frozen(other, fbql_play="blended"), 1)
    assert abs(weights[UP] - weights[DOWN]) > 0.01
    assert found == pytest.approx(weights[::-1] if averaged else weights)


def test_the_mean_is_of_thetas_after_two_thirds_of_the_horizon() -> None:
    """Played up to there, and one batch further each time."""
    thetas: list[NDArray[Any]] = []
    session = Session(parameters(seed=1, fbql_horizon=60, fbql_batch_episodes=4))
    while len(session.records) < 52:
        play(session, 4)
        if len(session.records) >= 40:
            thetas.append(arrays_of(session)["theta"])
    arrays = arrays_of(session)
    assert arrays["counts"].tolist()[2] == len(thetas) == 4
    expected = np.zeros_like(arrays["theta"])
    for theta in thetas:
        expected[: len(theta)] += theta / 4
    assert arrays["mean"] == pytest.approx(expected, abs=1e-12)


def test_drawn_is_by_the_weights() -> None:
    policy = trained()
    ((_, weights), *_) = stay(frozen(policy, fbql_play="blended"), 1)
    drivers = Counter(
        driver for driver, _ in stay(frozen(policy, fbql_play="drawn", fbql_hold_steps=1, fbql_patience=0), 4000)
    )
    assert 0.1 < weights[UP] < 0.9
    assert drivers[UP] / 4000 == pytest.approx(weights[UP], abs=0.03)


def test_the_longer_a_deadlock_lasts_the_more_alike_are_the_weights_that_are_drawn_by() -> None:
    policy = trained()
    sure = {name: 40.0 * policy.arrays[name] for name in ("theta", "mean")}
    policy = policy._replace(arrays={**policy.arrays, **sure})
    ((_, weights), *_) = stay(frozen(policy, fbql_play="blended"), 1)
    drivers = [driver for driver, _ in stay(frozen(policy, fbql_hold_steps=1, fbql_patience=1), 4000)]
    assert min(weights) < 0.05
    assert drivers[1000:].count(UP) / 3000 == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("patience", [1, 4])
def test_who_decides_the_same_joint_state_too_often_begins_to_draw_there(patience: int) -> None:
    session = frozen(trained(), fbql_patience=patience, fbql_hold_steps=2)
    for _ in range(2):
        drivers = [driver for driver, _ in stay(session, 400)]
        assert len({*drivers[: 2 * patience]}) == 1
        assert {*drivers[2 * patience :]} == {UP, DOWN}


def test_patience_counts_each_joint_state_by_itself_and_0_is_without_end() -> None:
    policy = trained()
    moving = stay(frozen(policy, fbql_patience=25, fbql_hold_steps=1), 400, lambda step: (step % 4, step // 4 % 4))
    assert len({(k % 16, driver) for k, (driver, _) in enumerate(moving)}) == 16
    assert len({*stay(frozen(policy, fbql_patience=0, fbql_hold_steps=1), 400)}) == 1


def test_an_untrained_learner_draws_every_behavior_alike() -> None:
    drivers = Counter(driver for driver, _ in stay(Session(parameters(fbql_hold_steps=1)), 2000))
    assert drivers[UP] == pytest.approx(1000, abs=100)


# What it learns from


def test_a_decisions_reward_and_discount_are_those_of_the_steps_it_was_held_for() -> None:
    session = Session(
        parameters(seed=1, fbql_batch_episodes=1000, fbql_discount=0.5, fbql_hold_steps=3, reward_goal=8.0)
    )
    play(session, 28)
    assert not len(arrays_of(session)["waiting_lengths"]), "a batch was just learned from"
    stay(session, 7, **GOAL)
    arrays = arrays_of(session)
    assert arrays["waiting_lengths"].tolist() == [3]
    assert arrays["waiting_discount"].tolist()[-3:] == [0.125, 0.125, 0.5]
    assert arrays["waiting_reward"].tolist()[-3:] == [0.0, 0.0, 8.0]
    stay(session, 6, **GOAL)
    arrays = arrays_of(session)
    assert arrays["waiting_reward"].tolist()[-2:] == [0.0, 0.25 * 8.0]
    assert arrays["waiting_terminated"].tolist()[-2:] == [True, True]
    stay(session, 6, **TIMEOUT)
    assert arrays_of(session)["waiting_terminated"].tolist()[-1:] == [False]


@pytest.mark.parametrize(("terminated", "last"), [(True, 0.0), (False, 3.0)])
def test_truncation_is_worth_what_its_state_is_and_termination_nothing(terminated: bool, last: float) -> None:
    """V is 1, 2 and 3 in the three situations, gamma^k 0.5, lambda 1: what comes is R + 0.5 (R' + 0.5 V'')."""
    episode = Episode(False, [], [[0, 1], [1, 2], [2, 3]], [1, 0], [0.5, 0.25], [4.0, 6.0], [0.5, 0.5], terminated)
    value = np.array([0.75, 0.25, 1.75, 1.25])
    batch = Batch.of([episode, episode], value, 1.0)
    returns = [4.0 + 0.5 * (6.0 + 0.5 * last), 6.0 + 0.5 * last]
    assert batch.returns.tolist() == returns * 2
    assert batch.advantages.tolist() == [returns[0] - 1.0, returns[1] - 2.0] * 2
    assert batch.active.tolist() == [[0, 1], [1, 2]] * 2
    assert (batch.driver.tolist(), batch.chance.tolist()) == ([1, 0] * 2, [0.5, 0.25] * 2)


def test_every_decision_is_in_one_minibatch_of_a_pass() -> None:
    episode = Episode(False, [], [[k] for k in range(11)], [0] * 10, [1.0] * 10, [0.0] * 10, [1.0] * 10)
    batch = Batch.of([episode], np.zeros(11), 1.0)
    minibatches = [some.tolist() for some in batch.minibatches(4, np.random.default_rng(0))]
    assert [len(some) for some in minibatches] == [4, 4, 2]
    order = np.concatenate(minibatches).tolist()
    assert order != sorted(order) == list(range(10))


@pytest.mark.parametrize("discount", [0.0, 0.9, 1.0])
def test_a_guided_decision_is_of_whom_the_guide_took_first(discount: float) -> None:
    episode = Episode(guided=True)
    for _ in range(2):
        episode.begin_decision(((1, 2), ((), ())), None, 0, 0.7)  # pyright: ignore[reportArgumentType]
        assert episode.add_step(2, 0.0, discount)
        assert episode.add_step(1, 0.0, discount)
    assert episode.drivers == [2, 2]


def test_guided_episodes_of_a_learner_that_knows_much_already_pull_towards_the_guide() -> None:
    """With a policy given. The guide always takes up; no reward, and nothing of it waits for eq. 14."""
    policy = trained()
    session = Session(parameters(seed=3, guided=8, reward_goal=0.0, reward_own_goal=0.0), policy)
    play(session, 8)
    arrays = arrays_of(session)
    assert arrays["waiting_lengths"].tolist() == policy.arrays["waiting_lengths"].tolist()
    assert arrays["counts"].tolist() == policy.arrays["counts"].tolist()

    def mean_weight_of_up(of: Policy) -> float:
        decisions = play(frozen(of, fbql_play="blended", fbql_patience=0), 10)
        return float(np.mean([decision.weights[UP] for decision in decisions]))

    assert mean_weight_of_up(learned(session)) > mean_weight_of_up(policy) + 0.03


def test_a_robot_that_stands_still_for_many_episodes_leaves_v_within_the_rewards() -> None:
    """A deadlock, the most frequent failure: all of its decisions have the same features."""
    session = Session(parameters(seed=1, guided=3, fbql_hold_steps=1))
    for episode in range(40):
        stay(session, 400, **(GOAL if episode % 5 == 4 else TIMEOUT))
    arrays = arrays_of(session)
    reached = [arrays["value"][row].sum() for row in arrays["waiting_active"]]
    assert np.abs(reached).max() <= 10.0
    assert np.abs(arrays["value"]).max() <= 10.0
    assert np.isfinite(arrays["theta"]).all()


# What it did not see whole is not learned from


def taught() -> Session:
    """A session that has learned something, between two batches."""
    session = Session(parameters(seed=1, fbql_batch_episodes=1000))
    play(session, 30)
    return session


def assert_not_learned_from(session: Session, spoilt: Callable[[], None]) -> None:
    """What `spoilt` does counts nothing; a whole episode after it does."""
    before = arrays_of(session)
    spoilt()
    after = arrays_of(session)
    assert session.records[-1].degraded or not session.records[-1].steps
    m = len(before["theta"])
    for name in ("counts", "waiting_lengths", "waiting_active", "waiting_reward"):
        assert np.array_equal(after[name], before[name])
    assert np.array_equal(after["theta"][:m], before["theta"])
    assert not after["theta"][m:].any()
    assert np.array_equal(after["value"][:m], before["value"])
    play(session, 1)
    assert arrays_of(session)["counts"][0] == before["counts"][0] + 1


@pytest.mark.parametrize("gone", [[0], [5], [5, 6, 7, 8, 9, 10], [19], [20]])
@pytest.mark.parametrize("who", [[UP], [DOWN], [UP, DOWN]])
def test_an_episode_with_a_missing_answer_is_played_and_not_learned_from(gone: list[int], who: list[int]) -> None:
    """Fault 23: a behavior hangs. Whoever is there drives; where nobody is, the wheels stop."""
    session = taught()

    def spoilt() -> None:
        begun = session.next_episode()
        assert begun is not None
        for step in range(21):
            outputs: Answers = [answer("up", 1.0, 1, [0.3]), answer("down", -1.0, 2, [0.5, 0.5])]
            if step in gone:
                outputs = [None if i in who else x for i, x in enumerate(outputs)]
            world = world_state(begun[0], step, **(GOAL if step == 20 else {}))
            command, decision = session.decide(world, outputs)
            assert decision.degraded == (step >= gone[0])
            assert all(not decision.weights[i] for i in who if step in gone)
            assert (command.left_rad_s == 0.0) == (step == 20 or (step in gone and len(who) == 2))

    assert_not_learned_from(session, spoilt)


@pytest.mark.parametrize("steps", [[0, 1, 3, 4, 5], [1, 2, 3], [0, 1, 2, 3, 90], [4]])
def test_across_a_gap_nothing_is_learned(steps: list[int]) -> None:
    """Fault 12."""
    session = taught()

    def spoilt() -> None:
        begun = session.next_episode()
        assert begun is not None
        for step in steps:
            outputs: Answers = [answer("up", 1.0, 1, [0.3]), answer("down", -1.0, 2, [0.5, 0.5])]
            session.decide(world_state(begun[0], step, **(GOAL if step == steps[-1] else {})), outputs)

    assert_not_learned_from(session, spoilt)


def test_across_a_clock_that_went_back_nothing_is_learned() -> None:
    """Fault 11: the simulator was started again, so the episode begins again."""
    session = taught()

    def spoilt() -> None:
        assert session.next_episode() is not None
        number = len(session.records)
        outputs: Answers = [answer("up", 1.0, 1, [0.3]), answer("down", -1.0, 2, [0.5, 0.5])]
        for step in range(9):
            session.decide(world_state(number, step), outputs)
        with pytest.raises(ValueError, match="after step 8"):
            session.decide(world_state(number, 3), outputs)
        session.restart_episode()
        for step in range(6):
            session.decide(world_state(number, step, **(GOAL if step == 5 else {})), outputs)

    assert_not_learned_from(session, spoilt)


def test_an_episode_that_is_asked_for_again_before_it_began_is_learned_from() -> None:
    session = taught()
    before = arrays_of(session)["counts"][0]
    begun = session.next_episode()
    assert session.restart_episode() == begun
    for step in range(6):
        outputs: Answers = [answer("up", 1.0, 1, [0.3]), answer("down", -1.0, 2, [0.5, 0.5])]
        session.decide(world_state(30, step, **(GOAL if step == 5 else {})), outputs)
    assert arrays_of(session)["counts"][0] == before + 1


@pytest.mark.parametrize("change", [{"tree_hash": "other"}, {"leaf_count": 5}])
def test_a_behavior_that_comes_back_with_another_tree_is_not_learned_from(change: dict[str, Any]) -> None:
    """Fault 22."""
    session = taught()

    def spoilt() -> None:
        begun = session.next_episode()
        assert begun is not None
        for step in range(12):
            outputs: Answers = [answer("up", 1.0, 1, [0.3]), answer("down", -1.0, 2, [0.5, 0.5])]
            if step >= 4:
                outputs[DOWN] = None if step < 6 else answer("down", -1.0, 2, [0.5, 0.5], **change)
            world = world_state(begun[0], step, **(GOAL if step == 11 else {}))
            _, decision = session.decide(world, outputs)
            assert decision.joint_state == (1, 2 if step < 4 else NO_LEAF)
            assert decision.driver == UP or step < 4

    assert_not_learned_from(session, spoilt)
    assert session.rejections.trees == 6


@pytest.mark.parametrize("begun_with", [0, 25])
@pytest.mark.parametrize("observation", [(), (0.5,), (0.5, 0.5, 0.5), (nan, 0.5), (0.5, float("inf"))])
def test_what_is_no_observation_is_not_learned_from(observation: tuple[float, ...], begun_with: int) -> None:
    """Before there are features, which would be made of it, and afterwards. The policy can be saved all the same."""
    session = Session(parameters(seed=1))
    play(session, begun_with)

    def spoilt(world: World, answers: Answers) -> Answers:
        down = answers[DOWN]
        assert down is not None
        spoils = world.episode % 2 == 1 and world.step == 6
        return [answers[UP], down._replace(observation=observation) if spoils else down]

    play(session, 50, spoilt)
    arrays = arrays_of(session)
    assert arrays["counts"][0] == begun_with + 25
    assert arrays["counts"][1] > 0
    assert all(np.isfinite(array).all() for array in arrays.values())


def test_an_episode_that_ends_at_once_is_no_experience() -> None:
    session = taught()

    def spoilt() -> None:
        stay(session, 0)

    assert_not_learned_from(session, spoilt)
    assert Session(parameters(), learned(session)).policy() is not None


def test_behaviors_that_tell_nothing_of_what_they_sense_are_told_apart_by_their_leaves() -> None:
    def silent(_: World, answers: Answers) -> Answers:
        return [x and x._replace(observation=()) for x in answers]

    session = Session(parameters(seed=1))
    play(session, 120, silent)
    assert goals(session, 40) >= 0.9


def test_who_is_told_nothing_at_all_goes_on_drawing_alike() -> None:
    nothing = {"fbql_leaf_pairs": False, "fbql_pair_tilings": 0, "fbql_joint_tilings": 0}
    session = Session(parameters(seed=1, **nothing))
    drivers = Counter(decision.driver for decision in play(session, 40))
    assert 0.4 < drivers[UP] / (drivers[UP] + drivers[DOWN]) < 0.6
    assert arrays_of(session)["theta"].shape == (0, 2)
    assert Session(parameters(**nothing), learned(session)).policy() is not None


def test_drivers_change_only_when_a_decision_is_over_or_a_behavior_is_gone() -> None:
    session = Session(parameters(seed=2, fbql_hold_steps=50))

    def gone_at_10(world: World, answers: Answers) -> Answers:
        return [None, answers[DOWN]] if world.step == 10 else answers

    decisions = play(session, 12, gone_at_10)
    assert all(decision.driver == DOWN for decision in decisions if decision.step == 10)
    changes = {
        after.step
        for before, after in pairwise(decisions)
        if before.episode == after.episode and before.driver != after.driver
    }
    assert changes <= {10, 11, 50, 61, 100, 111}
    assert changes & {10, 11}


def test_an_answer_is_a_behavior_output() -> None:
    """The helper's answers are what a real behavior sends."""
    assert all(isinstance(x, BehaviorOutput) for x in TwoSides().answers())
