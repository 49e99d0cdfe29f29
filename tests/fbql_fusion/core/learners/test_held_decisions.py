"""The learners that hold their decisions: each learns, resumes exactly, and learns only from episodes that it saw whole."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fbql_common.core.types import DRIVER_BLEND, NO_LEAF, BehaviorOutput, Phase, World
from fbql_fusion.core.learners.ppo.learner import Fbql, batch_of
from fbql_fusion.core.learners.trajectories import Trajectory, minibatches
from fbql_fusion.core.learners.value.learner import FbqlValue
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.policy_storage import load_policy, save_policy
from held_learners import (
    GOAL,
    LEARNERS,
    TABLE,
    TIMEOUT,
    Arrays,
    anywhere,
    arrays_of,
    equal,
    frozen,
    learned,
    learner_of,
    live,
    stay,
    trained,
)
from two_sides import BEHAVIORS, DOWN, UP, Answers, TwoSides, answer, goals, parameters, play, world_state

SEEDS = pytest.mark.parametrize("seed", [1, 2, 3])
EACH = pytest.mark.parametrize("learner", LEARNERS)


def learned_after_guidance(session: SoccerSession) -> Policy:
    """The guided episodes are learned from when the first free one begins."""
    session.next_episode()
    return learned(session)


# It learns


WAYS_TO_LEARN: dict[str, tuple[str, dict[str, Any]]] = {
    "alone": ("fbql", {}),
    "by value": ("fbql_value", {}),
    "guided": ("fbql", {"guided": 5}),
    "of leaves": ("fbql", {"fbql_pair_tilings": 0, "fbql_joint_tilings": 0}),
    "of pairs' tiles": ("fbql", {"fbql_leaf_pairs": False, "fbql_joint_tilings": 0}),
    "of joint tiles": ("fbql", {"fbql_leaf_pairs": False, "fbql_pair_tilings": 0}),
    "guided by value": ("fbql_value", {"guided": 5}),
    "by value of leaves": ("fbql_value", {"fbql_pair_tilings": 0, "fbql_joint_tilings": 0}),
}
THREE_SEEDS = ("alone", "by value")
"""The others are played daily with one seed."""


@pytest.mark.parametrize(
    ("way", "seed"),
    [
        pytest.param(way, seed, marks=[] if seed == 1 or way in THREE_SEEDS else [pytest.mark.long])
        for way in WAYS_TO_LEARN
        for seed in (1, 2, 3)
    ],
)
def test_from_goals_alone_it_learns_which_behavior_is_right_where(way: str, seed: int) -> None:
    """The guide drives up on either side, which scores in half of its episodes: no help."""
    learner, changes = WAYS_TO_LEARN[way]
    session = SoccerSession(parameters(learner, seed=seed, **changes))
    play(session, 160)
    assert goals(session, 50) >= 0.9

    def reached(policy: Policy | None, play_: str) -> float:
        evaluation = SoccerSession(
            parameters(learner, seed=seed + 100, learn=False, own_play=play_, **(changes | {"guided": 0})), policy
        )
        play(evaluation, 60)
        return goals(evaluation, 60)

    assert reached(None, "drawn") <= 0.7, "its frozen twin"
    for play_ in ("held", "drawn", "blended"):
        assert reached(learned(session), play_) >= 0.9


@EACH
def test_the_same_seed_learns_the_same_and_another_seed_another(learner: str) -> None:
    def run(seed: int) -> tuple[str, Arrays]:
        session = SoccerSession(parameters(learner, seed=seed, guided=3))
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
    session = SoccerSession(parameters(seed=seed, guided=12, fbql_value_rate=0.0))
    play(session, 12)
    assert {record.outcome for record in session.records} == {"goal", "own_goal"}
    policy = learned_after_guidance(session)
    blended = SoccerSession(
        parameters(seed=seed + 100, learn=False, guided=0, fbql_play="blended", fbql_patience=0), policy
    )
    decisions = play(blended, 20)
    wanted = [decision.weights[UP] for decision in decisions if decision.joint_state[0] >= 2]
    other = [decision.weights[UP] for decision in decisions if decision.joint_state[0] < 2]
    assert min(len(wanted), len(other)) > 20
    assert np.mean(wanted) > np.mean(other) + 0.1


@SEEDS
def test_the_critic_learns_from_guided_episodes_and_from_the_guides_failures_too(seed: int) -> None:
    """Goals make V larger than 0 where they are near, own goals smaller, though only the goals are imitated."""
    session = SoccerSession(parameters(seed=seed, guided=12))
    play(session, 12)
    assert {record.outcome for record in session.records} == {"goal", "own_goal"}
    value = learned_after_guidance(session).arrays["value"]
    assert value.max() > 0.1
    assert value.min() < -0.1


@SEEDS
def test_following_a_good_guide_needs_no_reward(seed: int) -> None:
    """The guide takes who is not clamped: the right one. Then is played without learning anything more."""

    def right(_: World, answers: Answers) -> Answers:
        up, down = answers
        assert up is not None
        return [up._replace(clamped=up.observation[0] >= 0.5), down]

    session = SoccerSession(parameters(seed=seed, guided=8, reward_goal=0.0, reward_own_goal=0.0))
    play(session, 8, right)
    assert [record.outcome for record in session.records] == ["goal"] * 8
    play(session, 1)
    evaluation = SoccerSession(parameters(seed=seed + 100, learn=False), learned(session))
    play(evaluation, 40)
    assert goals(evaluation, 40) >= 0.9


# Without learning nothing changes


@EACH
@pytest.mark.parametrize("guided", [0, 3])
@pytest.mark.parametrize(("play_", "draws"), [("held", False), ("blended", False), ("drawn", True)])
def test_without_learning_nothing_changes_but_the_generator_where_is_drawn(
    learner: str, play_: str, draws: bool, guided: int
) -> None:
    session = SoccerSession(parameters(learner, seed=1))
    play(session, 40)
    before = arrays_of(session)
    given = parameters(learner, seed=2, learn=False, guided=guided, own_play=play_, own_patience=0)
    unlearning = SoccerSession(given, learned(session))
    play(unlearning, 12, anywhere(0))
    after = arrays_of(unlearning)
    drawn = draws or guided > 0
    assert np.array_equal(before.pop("generator"), after.pop("generator")) != drawn
    assert equal(before, after)


@EACH
def test_without_learning_and_without_a_policy_nothing_is_learned(learner: str) -> None:
    session = SoccerSession(parameters(learner, learn=False, guided=2, own_patience=0))
    play(session, 6)
    assert set(arrays_of(session)) == {"counts", "generator"}
    assert arrays_of(session)["counts"].tolist() == [0, 0]


# It goes on where it was left


@EACH
@pytest.mark.parametrize("guided", [0, 4])
@pytest.mark.parametrize("saved_after", [31, 40])
def test_a_training_that_is_saved_and_loaded_goes_on_bit_for_bit(
    learner: str, guided: int, saved_after: int, tmp_path: Path
) -> None:
    """With episodes that wait."""
    given = parameters(learner, seed=4)

    def lived(episodes: int) -> Fbql | FbqlValue:
        made = learner_of(given)
        live(made, range(guided), Phase.GUIDED)
        live(made, range(guided, episodes), Phase.LEARNING)
        return made

    whole, half = lived(60), lived(saved_after)
    saved = half.to_arrays()
    policy = Policy(learner, tuple(BEHAVIORS), ("a", "b"), (4, 4), saved)
    save_policy(tmp_path / "policy.npz", policy)
    rest = learner_of(replace(given, seed=77))
    rest.load_arrays(load_policy(tmp_path / "policy.npz").arrays)
    assert equal(rest.to_arrays(), saved)
    live(rest, range(saved_after, 60), Phase.LEARNING)
    assert equal(rest.to_arrays(), whole.to_arrays())
    assert whole.to_arrays()["counts"].tolist()[0] == 60 - guided
    assert whole.to_arrays()["counts"].tolist()[1] > 3
    assert not equal(saved, whole.to_arrays())
    live(rest, range(60, 65), Phase.EVALUATION)
    live(whole, range(60, 65), Phase.EVALUATION)
    assert equal(rest.to_arrays(), whole.to_arrays())


@EACH
def test_some_episodes_wait_when_a_training_is_saved(learner: str) -> None:
    """So that the test above is about them."""
    made = learner_of(parameters(learner, seed=4))
    live(made, range(31), Phase.LEARNING)
    assert len(made.to_arrays()["waiting_lengths"]) > 0


@EACH
def test_before_there_are_features_a_policy_is_a_beginning(learner: str) -> None:
    session = SoccerSession(parameters(learner, seed=1, guided=5))
    play(session, 4)
    policy = learned(session)
    assert set(policy.arrays) == {"counts", "generator"}
    again = SoccerSession(parameters(learner, seed=2), policy)
    play(again, 30)
    assert np.abs(arrays_of(again)[TABLE[learner]]).max() > 0.0


@EACH
def test_more_features_than_a_table_has_rows_make_it_longer(learner: str) -> None:
    """Ten tiles along each component and random situations: every one of them is new."""
    session = SoccerSession(
        parameters(
            learner, own_hold_s=1 / 60, own_passes=1, fbql_pair_tilings=32, fbql_pair_tiles=64,
            fbql_joint_tilings=32, fbql_joint_tiles=64,
        )
    )  # fmt: skip
    play(session, 24, anywhere(0))
    arrays = arrays_of(session)
    rows = {len(arrays[name]) for name in ("keys", "theta", "value", "values") if name in arrays}
    assert rows == {len(arrays["keys"])}
    assert np.abs(arrays[TABLE[learner]][2**14 :]).max() > 0.0


# What it plays


@EACH
def test_a_decision_is_held_for_its_steps_and_one_behavior_drives_alone(learner: str) -> None:
    for session in (
        SoccerSession(parameters(learner, seed=1, own_hold_s=7 / 60)),
        frozen(trained(learner), own_play_s=7 / 60, own_play="drawn", own_patience=2),
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


@EACH
def test_held_is_whose_weight_is_the_largest_and_blended_are_all_of_them(learner: str) -> None:
    policy = trained(learner)
    blended = play(frozen(policy, own_play="blended", own_patience=0), 8)
    assert {decision.driver for decision in blended} == {DRIVER_BLEND}
    assert all(sum(decision.weights) == pytest.approx(1.0) for decision in blended)
    assert len({decision.weights for decision in blended}) > 20
    for leaves in [(0, 0), (2, 3), (3, 1)]:
        ((_, weights), *_) = stay(frozen(policy, own_play="blended"), 4, lambda _, x=leaves: x)
        ((driver, alone), *_) = stay(frozen(policy, own_play="held"), 4, lambda _, x=leaves: x)
        assert driver == weights.index(max(weights))
        assert alone[driver] == 1.0


@EACH
def test_a_decision_tells_the_learned_weights_by_which_its_driver_was_chosen(learner: str) -> None:
    policy = trained(learner)
    held = play(frozen(policy, own_play="held", own_play_s=1 / 60, own_patience=0), 8)
    blended = play(frozen(policy, own_play="blended", own_patience=0), 8)
    assert len(held) > 20
    assert len(blended) > 20
    for decision in held[:-1]:
        assert sum(decision.learned_weights) == pytest.approx(1.0)
        if decision.driver != DRIVER_BLEND:
            assert decision.driver == decision.learned_weights.index(max(decision.learned_weights))
    assert len({decision.learned_weights for decision in held}) > 20
    assert all(decision.learned_weights == decision.weights for decision in blended)


def test_drawn_is_by_the_weights() -> None:
    policy = trained()
    ((_, weights), *_) = stay(frozen(policy, fbql_play="blended"), 1)
    drivers = Counter(
        driver for driver, _ in stay(frozen(policy, fbql_play="drawn", fbql_play_s=1 / 60, fbql_patience=0), 4000)
    )
    assert 0.1 < weights[UP] < 0.9
    assert drivers[UP] / 4000 == pytest.approx(weights[UP], abs=0.03)


def test_the_longer_a_deadlock_lasts_the_more_alike_are_the_weights_that_are_drawn_by() -> None:
    policy = trained()
    policy = policy._replace(arrays={**policy.arrays, "theta": 40.0 * policy.arrays["theta"]})
    ((_, weights), *_) = stay(frozen(policy, fbql_play="blended"), 1)
    drivers = [driver for driver, _ in stay(frozen(policy, fbql_play_s=1 / 60, fbql_patience=1), 4000)]
    assert min(weights) < 0.05
    assert drivers[1000:].count(UP) / 3000 == pytest.approx(0.5, abs=0.03)


@EACH
@pytest.mark.parametrize("patience", [1, 4])
def test_who_decides_the_same_joint_state_too_often_begins_to_draw_there(learner: str, patience: int) -> None:
    session = frozen(trained(learner), own_patience=patience, own_play_s=2 / 60)
    for _ in range(2):
        drivers = [driver for driver, _ in stay(session, 400)]
        assert len({*drivers[: 2 * patience]}) == 1
        assert {*drivers[2 * patience :]} == {UP, DOWN}


def test_patience_counts_each_joint_state_by_itself_and_0_is_without_end() -> None:
    policy = trained()
    moving = stay(frozen(policy, fbql_patience=25, fbql_play_s=1 / 60), 400, lambda step: (step % 4, step // 4 % 4))
    assert len({(k % 16, driver) for k, (driver, _) in enumerate(moving)}) == 16
    assert len({*stay(frozen(policy, fbql_patience=0, fbql_play_s=1 / 60), 400)}) == 1


@EACH
def test_an_untrained_learner_draws_every_behavior_alike(learner: str) -> None:
    drivers = Counter(driver for driver, _ in stay(SoccerSession(parameters(learner, own_hold_s=1 / 60)), 2000))
    assert drivers[UP] == pytest.approx(1000, abs=100)


@EACH
def test_a_step_that_is_held_is_the_same_as_one_that_is_decided(learner: str) -> None:
    """Bit for bit: commands, digest, records and what is learned."""
    for given, policy in (
        (parameters(learner, seed=3, guided=2), None),
        (parameters(learner, learn=False), trained(learner)),
    ):
        decided, held = SoccerSession(given, policy), SoccerSession(given, policy)
        task, count = TwoSides(), 0
        for _ in range(8):
            begun = decided.next_episode()
            assert held.next_episode() == begun
            assert held.held_driver == DRIVER_BLEND, "an episode's first step is decided"
            world = task.reset(*begun)  # pyright: ignore[reportOptionalMemberAccess, reportGeneralTypeIssues]
            while True:
                outputs, driver = task.answers(), held.held_driver
                command, decision = decided.decide(world, outputs)
                ours = outputs[driver] if driver >= 0 else None
                done = held.hold(world, ours) if ours is not None else None
                if done is None:
                    assert held.decide(world, outputs)[0] == command
                else:
                    count += 1
                    assert (decision.driver, done) == (driver, (command.left_rad_s, command.right_rad_s))
                if world.ended:
                    break
                world = task.step(world, command.left_rad_s)
        assert count > 0.4 * decided.steps, "two of three steps are held, except in guided episodes"
        assert (held.digest, held.steps, held.records) == (decided.digest, decided.steps, decided.records)
        assert equal(arrays_of(held), arrays_of(decided))


@pytest.mark.parametrize("draw", [UP, DOWN])
def test_a_draw_that_is_given_is_taken_where_that_behavior_may_drive(draw: int) -> None:
    session = frozen(trained(), fbql_play="drawn", fbql_play_s=1 / 60, fbql_patience=0)
    drawing = session.drawing
    assert drawing is not None
    drawing.known_draw = draw
    assert {driver for driver, _ in stay(session, 40)} == {draw}
    assert drawing.draws_taken == 40
    for unknown in (-1, 2, None):
        drawing.known_draw = unknown
        assert {driver for driver, _ in stay(session, 60)} == {UP, DOWN}
    assert drawing.draws_taken == 40
    assert SoccerSession(replace(parameters(), controller="uniform")).drawing is None, "it draws nothing"


# What it learns from


@EACH
def test_a_decisions_reward_and_discount_are_those_of_the_steps_it_was_held_for(learner: str) -> None:
    session = SoccerSession(
        parameters(learner, seed=1, own_batch_episodes=1000, own_discount=0.5, own_hold_s=3 / 60, reward_goal=8.0)
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
    trajectory = Trajectory(
        False, [], [[0, 1], [1, 2], [2, 3]], [1, 0], [0.5, 0.25], [4.0, 6.0], [0.5, 0.5], terminated,
        masks=[(True, True), (True, False), (False, True)],
    )  # fmt: skip
    value = np.array([0.75, 0.25, 1.75, 1.25])
    batch = batch_of([trajectory, trajectory], value, 1.0, active_features=1)
    returns = [4.0 + 0.5 * (6.0 + 0.5 * last), 6.0 + 0.5 * last]
    assert batch.lambda_returns.tolist() == returns * 2
    assert batch.advantages.tolist() == [returns[0] - 1.0, returns[1] - 2.0] * 2
    assert batch.critic_inputs.tolist() == [[0, 1], [1, 2]] * 2, "what only V sees comes after the active features"
    assert batch.active.tolist() == [[0], [1]] * 2
    assert batch.masks.tolist() == [[True, True], [True, False]] * 2
    assert (batch.drivers.tolist(), batch.old_probs.tolist()) == ([1, 0] * 2, [0.5, 0.25] * 2)


def test_every_decision_is_in_one_minibatch_of_a_pass() -> None:
    found = [some.tolist() for some in minibatches(10, 4, np.random.default_rng(0))]
    assert [len(some) for some in found] == [4, 4, 2]
    order = np.concatenate(found).tolist()
    assert order != sorted(order) == list(range(10))


@pytest.mark.parametrize("discount", [0.0, 0.9, 1.0])
def test_a_guided_decision_is_of_whom_the_guide_took_first(discount: float) -> None:
    trajectory = Trajectory(guided=True)
    for _ in range(2):
        trajectory.begin_decision(((1, 2), ((), ())), None, (True, True, True), 0, 0.7)  # pyright: ignore[reportArgumentType]
        assert trajectory.add_step(2, 0.0, discount)
        assert trajectory.add_step(1, 0.0, discount)
    assert trajectory.drivers == [2, 2]


def test_guided_episodes_of_a_learner_that_knows_much_already_pull_towards_the_guide() -> None:
    """With a policy given. The guide always takes up; no reward, and nothing of it waits for eq. 14."""
    policy = trained()
    session = SoccerSession(parameters(seed=3, guided=8, reward_goal=0.0, reward_own_goal=0.0), policy)
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
    session = SoccerSession(parameters(seed=1, guided=3, fbql_hold_s=1 / 60))
    for episode in range(40):
        stay(session, 400, **(GOAL if episode % 5 == 4 else TIMEOUT))
    arrays = arrays_of(session)
    reached = [arrays["value"][row].sum() for row in arrays["waiting_active"]]
    assert np.abs(reached).max() <= 10.0
    assert np.abs(arrays["value"]).max() <= 10.0
    assert np.isfinite(arrays["theta"]).all()


# What it did not see whole is not learned from


@cache
def _taught(learner: str) -> Policy:
    session = SoccerSession(parameters(learner, seed=1, own_batch_episodes=1000))
    play(session, 30)
    return learned(session)


def taught(learner: str) -> SoccerSession:
    """A session that has learned something, between two batches."""
    return SoccerSession(parameters(learner, seed=2, own_batch_episodes=1000), _taught(learner))


def assert_not_learned_from(session: SoccerSession, spoilt: Callable[[], None]) -> None:
    """What `spoilt` does counts nothing; a whole episode after it does."""
    before = arrays_of(session)
    spoilt()
    after = arrays_of(session)
    assert session.records[-1].degraded or not session.records[-1].steps
    m = len(before["keys"])
    for name in ("counts", "waiting_lengths", "waiting_active", "waiting_reward"):
        assert np.array_equal(after[name], before[name])
    for name in {"theta", "value", "values"} & before.keys():
        assert np.array_equal(after[name][:m], before[name])
        assert not after[name][m:].any()
    play(session, 1)
    assert arrays_of(session)["counts"][0] == before["counts"][0] + 1


@EACH
@pytest.mark.parametrize("gone", [[0], [5], [5, 6, 7, 8, 9, 10], [19], [20]])
@pytest.mark.parametrize("who", [[UP], [DOWN], [UP, DOWN]])
def test_an_episode_with_a_missing_answer_is_played_and_not_learned_from(
    learner: str, gone: list[int], who: list[int]
) -> None:
    """Fault 23: a behavior hangs. Whoever is there drives; where nobody is, the wheels stop."""
    session = taught(learner)

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


@EACH
@pytest.mark.parametrize("steps", [[0, 1, 3, 4, 5], [1, 2, 3], [0, 1, 2, 3, 90], [4]])
def test_across_a_gap_nothing_is_learned(learner: str, steps: list[int]) -> None:
    """Fault 12."""
    session = taught(learner)

    def spoilt() -> None:
        begun = session.next_episode()
        assert begun is not None
        for step in steps:
            outputs: Answers = [answer("up", 1.0, 1, [0.3]), answer("down", -1.0, 2, [0.5, 0.5])]
            session.decide(world_state(begun[0], step, **(GOAL if step == steps[-1] else {})), outputs)

    assert_not_learned_from(session, spoilt)


@EACH
def test_across_a_clock_that_went_back_nothing_is_learned(learner: str) -> None:
    """Fault 11: the simulator was started again, so the episode begins again."""
    session = taught(learner)

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


@EACH
def test_an_episode_that_is_asked_for_again_before_it_began_is_learned_from(learner: str) -> None:
    session = taught(learner)
    before = arrays_of(session)["counts"][0]
    begun = session.next_episode()
    assert session.restart_episode() == begun
    for step in range(6):
        outputs: Answers = [answer("up", 1.0, 1, [0.3]), answer("down", -1.0, 2, [0.5, 0.5])]
        session.decide(world_state(0, step, **(GOAL if step == 5 else {})), outputs)
    assert arrays_of(session)["counts"][0] == before + 1


@EACH
@pytest.mark.parametrize("change", [{"tree_hash": "other"}, {"leaf_count": 5}])
def test_a_behavior_that_comes_back_with_another_tree_is_not_learned_from(learner: str, change: dict[str, Any]) -> None:
    """Fault 22."""
    session = taught(learner)

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


@EACH
@pytest.mark.parametrize("begun_with", [0, 25])
@pytest.mark.parametrize("observation", [(), (0.5,), (0.5, 0.5, 0.5), (nan, 0.5), (0.5, float("inf"))])
def test_what_is_no_observation_is_not_learned_from(
    learner: str, observation: tuple[float, ...], begun_with: int
) -> None:
    """Before there are features, which would be made of it, and afterwards. The policy can be saved all the same."""
    session = SoccerSession(parameters(learner, seed=1, own_passes=1))
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


@EACH
def test_an_episode_that_ends_at_once_is_no_experience(learner: str) -> None:
    session = taught(learner)

    def spoilt() -> None:
        stay(session, 0)

    assert_not_learned_from(session, spoilt)
    assert SoccerSession(parameters(learner), learned(session)).policy() is not None


@EACH
def test_behaviors_that_tell_nothing_of_what_they_sense_are_told_apart_by_their_leaves(learner: str) -> None:
    def silent(_: World, answers: Answers) -> Answers:
        return [x and x._replace(observation=()) for x in answers]

    session = SoccerSession(parameters(learner, seed=1))
    play(session, 120, silent)
    assert goals(session, 40) >= 0.9


@EACH
@pytest.mark.parametrize("told", [0, 4])
def test_who_is_told_nothing_at_all_goes_on_drawing_alike(learner: str, told: int) -> None:
    """Whatever its critic is told."""
    nothing = {"fbql_leaf_pairs": False, "fbql_pair_tilings": 0, "fbql_joint_tilings": 0, "fbql_world_tilings": told}
    session = SoccerSession(parameters(learner, seed=1, **nothing))
    drivers = Counter(decision.driver for decision in play(session, 40))
    assert 0.4 < drivers[UP] / (drivers[UP] + drivers[DOWN]) < 0.6
    assert not arrays_of(session)[TABLE[learner]].any()
    assert SoccerSession(parameters(learner, **nothing), learned(session)).policy() is not None


def test_drivers_change_only_when_a_decision_is_over_or_a_behavior_is_gone() -> None:
    session = SoccerSession(parameters(seed=2, fbql_hold_s=50 / 60))

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


def test_fbql_that_does_not_explore_plays_by_the_largest_weight_while_it_learns() -> None:
    session = SoccerSession(parameters("fbql", seed=1, guided=5, fbql_explore=False, fbql_play_s=0.0, fbql_patience=0))
    play(session, 6)
    before = learned(session).arrays["theta"].copy()
    decisions = play(session, 20)
    for decision in decisions:
        assert decision.phase == Phase.LEARNING
        assert decision.driver == int(np.argmax(decision.learned_weights))
    after = learned(session).arrays["theta"]
    assert not np.array_equal(after[: len(before)], before), "it goes on learning"


def test_fbql_that_does_not_explore_draws_until_it_has_features() -> None:
    session = SoccerSession(parameters("fbql", seed=1, guided=0, fbql_explore=False))
    assert {decision.driver for decision in play(session, 10)} == {0, 1}
