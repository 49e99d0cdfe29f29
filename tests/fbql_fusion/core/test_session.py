"""The session: schedule, seeds, transitions, guided episodes, and what it refuses."""

from collections.abc import Callable, Sequence
from hashlib import sha256
from math import inf, nan

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_common.core.types import DRIVER_BLEND, NO_LEAF, BehaviorOutput, Decision, Phase, WheelCommand
from fbql_fusion.core import soccer_session as session_module
from fbql_fusion.core.controllers.interface import Selection
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.session import Rejections, episode_seed
from fbql_fusion.core.soccer_session import SoccerSession
from two_sides import world_state

Answers = list[BehaviorOutput | None]
LEAF_COUNTS = (120, 11, 37)
THIRD = 1 / 3


def answers(*leaves: int, **changes: object) -> Answers:
    """Three answers in the given leaves; behavior i refers (10 (i + 1), i)."""
    made: Answers = []
    for i, leaf in enumerate(leaves or (1, 2, 3)):
        made.append(BehaviorOutput(1, 0, 0, "b", 10.0 * (i + 1), float(i), leaf, LEAF_COUNTS[i], f"hash{i}", False, ()))
        made[-1] = made[-1]._replace(**changes)
    return made


GOAL = {"goal": True, "terminated": True}
OWN_GOAL = {"own_goal": True, "terminated": True}
TIMEOUT = {"truncated": True}


def play(
    session: SoccerSession,
    steps: int = 3,
    end: dict[str, bool] | None = None,
    outputs: Callable[[int], Answers] = lambda step: answers(),
) -> list[tuple[WheelCommand, Decision]]:
    """Plays one whole episode that ends after some steps."""
    begun = session.next_episode()
    assert begun is not None
    return [
        session.decide(world_state(begun[0], step, **((end or GOAL) if step == steps else {})), outputs(step))
        for step in range(steps + 1)
    ]


def learned(session: SoccerSession) -> dict[tuple[int, ...], tuple[list[float], list[float]]]:
    """The rows of what fbql_literal has learned."""
    policy = session.policy()
    assert policy is not None
    arrays = policy.arrays
    return {
        tuple(state): (q, weights)
        for state, q, weights in zip(
            arrays["joint_states"].tolist(), arrays["q"].tolist(), arrays["weights"].tolist(), strict=True
        )
    }


# The schedule


def test_guided_episodes_come_first_and_do_not_count():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=2, episodes=3))
    for _ in range(5):
        play(session)
    assert [record.phase for record in session.records] == [Phase.GUIDED] * 2 + [Phase.LEARNING] * 3
    assert session.next_episode() is None
    assert session.summary().episodes == 3


def test_a_run_is_done_at_its_goals_however_many_episodes_that_takes():
    session = SoccerSession(FusionParameters(goals=2))
    for end in (GOAL, OWN_GOAL, TIMEOUT, GOAL):
        play(session, end=end)
    assert session.next_episode() is None
    assert [record.outcome for record in session.records] == ["goal", "own_goal", "timeout", "goal"]


def test_a_run_is_done_at_whichever_limit_comes_first():
    session = SoccerSession(FusionParameters(goals=5, episodes=2))
    play(session)
    play(session)
    assert session.next_episode() is None


def test_a_goal_of_a_guided_episode_is_no_goal_of_the_run():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=2, goals=1))
    play(session)
    play(session)
    assert session.next_episode() is not None


@pytest.mark.parametrize(
    ("changes", "guided"),
    [
        ({"controller": "fbql_literal"}, 20),
        ({"controller": "fbql"}, 20),
        ({"controller": "fbql_literal", "learn": False}, 0),
        ({"controller": "fbql_literal", "guided": 3}, 3),
        ({"controller": "subsumption"}, 0),
        ({"controller": "uniform", "guided": 4}, 4),
    ],
)
def test_guided_episodes_unless_said_are_twenty_for_a_controller_that_learns(changes, guided):
    assert SoccerSession(FusionParameters(**changes)).guided == guided


@pytest.mark.parametrize(
    ("changes", "phase"),
    [
        ({"controller": "fbql_literal", "guided": 0}, Phase.LEARNING),
        ({"controller": "fbql_literal", "learn": False}, Phase.EVALUATION),
        ({"controller": "subsumption"}, Phase.EVALUATION),
    ],
)
def test_phase_says_whether_the_controller_learns(changes, phase):
    session = SoccerSession(FusionParameters(**changes))
    assert {decision.phase for _, decision in play(session)} == {int(phase)}
    assert session.records[0].phase is phase


def test_episode_seeds_differ_repeat_and_fit_an_int64():
    session = SoccerSession(FusionParameters(seed=7))
    seeds = []
    for _ in range(50):
        begun = session.next_episode()
        assert begun is not None
        seeds.append(begun[1])
        session.decide(world_state(begun[0], 0, **TIMEOUT), answers())
    assert seeds == [episode_seed(7, episode) for episode in range(50)]
    assert len(set(seeds)) == 50
    assert all(0 <= seed < 2**63 for seed in seeds)
    assert not set(seeds) & {episode_seed(8, episode) for episode in range(50)}


def test_an_episode_seed_never_changes_between_versions():
    assert episode_seed(7, 0) == 8460147692890830636
    assert episode_seed(2**63 - 1, 3) == 5883105733459131166


# What is refused


def test_the_next_episode_waits_for_the_end_of_the_one_before():
    session = SoccerSession(FusionParameters())
    session.next_episode()
    with pytest.raises(ValueError, match="episode 0 has not ended"):
        session.next_episode()


@pytest.mark.parametrize(
    ("episode", "step", "reason"),
    [(0, 1, "after step 1"), (0, 0, "after step 1"), (1, 2, "while episode 0"), (-1, 2, "while episode 0")],
)
def test_a_world_state_out_of_order_is_refused_and_changes_nothing(episode, step, reason):
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0))
    session.next_episode()
    session.decide(world_state(0, 0), answers())
    session.decide(world_state(0, 1, collision_begun=True), answers())
    before, rows = session.digest, learned(session)
    with pytest.raises(ValueError, match=reason):
        session.decide(world_state(episode, step, collision_begun=True), answers())
    assert session.digest == before
    assert learned(session) == rows


@pytest.mark.parametrize("episode", [0, 1, -1])
def test_a_world_state_outside_of_any_episode_is_refused(episode):
    session = SoccerSession(FusionParameters())
    with pytest.raises(ValueError, match="no episode has begun"):
        session.decide(world_state(episode, 0), answers())
    play(session)
    with pytest.raises(ValueError, match="no episode has begun"):
        session.decide(world_state(episode, 4), answers())


@pytest.mark.parametrize("outputs", [[], answers()[:2], [*answers(), None]])
def test_a_wrong_number_of_outputs_is_refused(outputs: Answers):
    session = SoccerSession(FusionParameters())
    session.next_episode()
    with pytest.raises(ValueError):
        session.decide(world_state(0, 0), outputs)


# The decision


def test_subsumption_lets_one_behavior_drive_and_says_which():
    session = SoccerSession(FusionParameters())
    session.next_episode()
    command, decision = session.decide(world_state(0, 0), answers(4, 5, 6))
    assert command == (1, 0, 0, 10.0, 0.0)
    assert decision == (
        1, 0, 0, "subsumption", Phase.EVALUATION, ("ball_seeking", "wall_avoiding", "approaching"),
        (4, 5, 6), (), (1.0, 0.0, 0.0), 0, 0.0, False, (),
    )  # fmt: skip


def test_uniform_and_untaught_fbql_blend_all_behaviors_alike():
    for controller in ("uniform", "fbql_literal"):
        session = SoccerSession(FusionParameters(controller=controller, guided=0))
        session.next_episode()
        command, decision = session.decide(world_state(0, 0), answers())
        assert (command.left_rad_s, command.right_rad_s) == pytest.approx((20.0, 1.0))
        assert decision.weights == pytest.approx((THIRD,) * 3)
        assert decision.driver == DRIVER_BLEND


@pytest.mark.parametrize("end", [GOAL, OWN_GOAL, TIMEOUT])
def test_an_ended_world_stops_the_wheels(end):
    command, decision = play(SoccerSession(FusionParameters()), end=end)[-1]
    assert (command.left_rad_s, command.right_rad_s) == (0.0, 0.0)
    assert decision.weights == (1.0, 0.0, 0.0)


def test_digest_is_of_every_decision_in_order_little_endian():
    session = SoccerSession(FusionParameters())
    expected = sha256()
    for step, (command, _) in enumerate(play(session, steps=2)):
        state = world_state(0, step)
        expected.update(np.array([0, step], "<i8").tobytes())
        places = (state.robot_x_m, state.robot_y_m, state.robot_yaw_rad, state.ball_x_m, state.ball_y_m)
        expected.update(np.array([*places, command.left_rad_s, command.right_rad_s], "<f8").tobytes())
    assert session.digest == expected.hexdigest()


def test_the_same_run_has_the_same_digest_and_another_seed_another_one():
    def digest(**changes: int) -> str:
        session = SoccerSession(FusionParameters(controller="fbql_literal", guided=1, tie_rule="random", **changes))
        rng = np.random.default_rng(session.parameters.seed)
        for _ in range(3):
            leaves = rng.integers(0, 4, size=(21, 3)).tolist()
            play(session, 20, outputs=lambda step, leaves=leaves: answers(*leaves[step]))
        return session.digest

    assert digest(seed=1) == digest(seed=1)
    assert digest(seed=1) != digest(seed=2)


# Learning


def test_each_transition_updates_the_row_of_the_state_it_left():
    parameters = FusionParameters(controller="fbql_literal", guided=0, learning_rate=0.5, discount=0.8)
    session = SoccerSession(parameters)
    path = [(1, 1, 1), (2, 2, 2), (1, 1, 1)]
    play(session, steps=2, outputs=lambda step: answers(*path[step]))
    rows = learned(session)
    # (1,1,1) -> (2,2,2) without a reward leaves Q 0; (2,2,2) -> goal: 0.5 (10 / 3).
    assert rows[1, 1, 1][0] == [0.0, 0.0, 0.0]
    assert rows[2, 2, 2][0] == pytest.approx([5 / 3] * 3)
    play(session, steps=1, outputs=lambda step: answers(*path[step]))
    # (1,1,1) -> goal, which was terminal: nothing of (2,2,2) comes back.
    assert learned(session)[1, 1, 1][0] == pytest.approx([5 / 3] * 3)


@pytest.mark.parametrize(("end", "follows"), [(TIMEOUT, 0.5 * 0.8 * 5 / 3), (OWN_GOAL, 0.5 * -10 / 3)])
def test_termination_is_worth_nothing_and_truncation_what_its_state_is_worth(end, follows):
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0, learning_rate=0.5, discount=0.8))
    play(session, steps=1, outputs=lambda step: answers(2, 2, 2))
    assert learned(session)[2, 2, 2][0] == pytest.approx([5 / 3] * 3)
    play(session, steps=1, end=end, outputs=lambda step: answers(*((1, 1, 1), (2, 2, 2))[step]))
    assert learned(session)[1, 1, 1][0] == pytest.approx([follows] * 3)


def test_decision_carries_q_after_the_update_by_the_last_transition():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0, learning_rate=0.5, discount=0.0))
    decisions = [decision for _, decision in play(session, steps=2, outputs=lambda step: answers(2, 2, 2))]
    assert [decision.reward for decision in decisions] == [0.0, 0.0, 10.0]
    assert decisions[1].q == (0.0, 0.0, 0.0)
    assert decisions[2].q == pytest.approx((5 / 3,) * 3)


def test_a_collision_costs_once_when_it_begins():
    session = SoccerSession(FusionParameters(reward_collision=-0.5))
    session.next_episode()
    flags = [{}, {"collision": True, "collision_begun": True}, {"collision": True}, {"collision": True}, GOAL]
    rewards = [session.decide(world_state(0, k, **flag), answers())[1].reward for k, flag in enumerate(flags)]
    assert rewards == [0.0, -0.5, 0.0, 0.0, 10.0]
    record = session.records[0]
    assert (record.collisions_begun, record.collision_steps, record.return_) == (1, 3, 9.5)


def test_a_goal_in_a_collision_is_both():
    session = SoccerSession(FusionParameters())
    session.next_episode()
    session.decide(world_state(0, 0), answers())
    _, decision = session.decide(world_state(0, 1, collision=True, collision_begun=True, **GOAL), answers())
    assert decision.reward == 5.0


def test_in_guided_episodes_subsumption_drives_and_fbql_learns():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=1, learning_rate=0.5))
    decisions = play(session, steps=1, outputs=lambda step: answers(2, 2, 2))
    command, decision = decisions[0]
    assert (command.left_rad_s, decision.driver, decision.weights) == (10.0, 0, (1.0, 0.0, 0.0))
    assert decision.phase == Phase.GUIDED
    # The reward is shared by FBQL's own weights, 1/3 each, not by who drove.
    assert learned(session)[2, 2, 2][0] == pytest.approx([5 / 3] * 3)


def test_without_learning_nothing_changes_in_guided_episodes_or_later():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=1, learn=False))
    play(session)
    play(session)
    assert learned(session) == {}


def test_memory_grows_with_joint_states_visited_while_learning():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0))
    play(session, steps=30, outputs=lambda step: answers(step % 5, 0, 0))
    assert len(learned(session)) == 5


@pytest.mark.parametrize("tie_rule", ["none", "all"])
def test_tied_weights_stay_uniform_where_no_single_behavior_is_the_argmax(tie_rule):
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0, tie_rule=tie_rule))
    for _ in range(5):
        play(session, steps=10)
    assert learned(session)[1, 2, 3][1] == pytest.approx([THIRD] * 3)


def test_first_of_the_tied_takes_the_weight_from_the_others():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0, tie_rule="first"))
    for _ in range(5):
        play(session, steps=10)
    weights = learned(session)[1, 2, 3][1]
    assert weights[0] > 0.9
    assert min(weights) >= 0.009


def test_random_tie_rule_gives_every_behavior_its_turn():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0, tie_rule="random", episodes=1))
    play(session, steps=200, outputs=lambda step: answers(step % 100, 0, 0))
    winners = {max(range(3), key=weights.__getitem__) for _, weights in learned(session).values()}
    assert winners == {0, 1, 2}


def test_weights_stay_where_the_printed_update_leaves_nothing_to_divide_by():
    """With gains of -1 everybody's weight 1/2 becomes 0: possible only without the bounds."""
    session = SoccerSession(
        FusionParameters(
            controller="fbql_literal", guided=0, behaviors=["ball_seeking", "approaching"], tie_rule="all",
            weight_gain=1.0, weight_offset=-1.0, gain_low=-1e9, weight_floor=-1e9,
        )
    )  # fmt: skip
    session.next_episode()
    session.decide(world_state(0, 0), answers(1, 2))
    _, decision = session.decide(world_state(0, 1), answers(1, 2))
    assert decision.weights == (0.5, 0.5)
    assert learned(session) == {(1, 2): ([0.0, 0.0], [0.5, 0.5])}


# What is missing or wrong


def test_a_missing_behavior_leaves_its_weight_to_the_others_and_its_leaf_open():
    session = SoccerSession(FusionParameters(controller="uniform"))
    session.next_episode()
    outputs = answers()
    outputs[1] = None
    command, decision = session.decide(world_state(0, 0), outputs)
    assert command.left_rad_s == pytest.approx(20.0)
    assert decision.weights == (0.5, 0.0, 0.5)
    assert decision.joint_state == (1, NO_LEAF, 3)
    assert decision.degraded


def test_a_joint_state_with_a_leaf_missing_has_no_q_and_its_weights_are_equal():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0, tie_rule="first"))
    play(session)
    session.next_episode()
    outputs = answers()
    outputs[0] = None
    _, decision = session.decide(world_state(1, 0), outputs)
    assert decision.q == ()
    assert decision.weights == (0.0, 0.5, 0.5)


def test_with_no_behavior_left_the_wheels_stop():
    for controller in ("subsumption", "uniform", "fbql_literal"):
        session = SoccerSession(FusionParameters(controller=controller, guided=0))
        session.next_episode()
        session.decide(world_state(0, 0), answers())
        command, decision = session.decide(world_state(0, 1), [None, None, None])
        assert (command.left_rad_s, command.right_rad_s) == (0.0, 0.0)
        assert decision.weights == (0.0, 0.0, 0.0)


def one_missing(step: int) -> Answers:
    outputs = answers(step, 0, 0)
    if step == 3:
        outputs[2] = None
    return outputs


def test_from_a_missing_answer_on_nothing_of_the_episode_is_learned():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0))
    decisions = play(session, steps=6, outputs=one_missing)
    assert sorted(learned(session)) == [(0, 0, 0), (1, 0, 0)]
    assert [decision.degraded for _, decision in decisions] == [False] * 3 + [True] * 4
    assert session.records[0].degraded
    play(session, steps=3, outputs=lambda step: answers(step, 1, 1))
    assert not session.records[1].degraded
    assert (2, 1, 1) in learned(session)


def test_steps_that_others_played_are_counted_and_nothing_of_the_episode_is_learned_from_then_on():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0))
    session.next_episode()
    decided = [session.decide(world_state(0, step), answers(step, 0, 0))[1] for step in (2, 3, 7)]
    assert (session.unseen, session.steps) == (2 + 3, 7)
    assert all(decision.degraded for decision in decided)
    session.decide(world_state(0, 8, **GOAL), answers(8, 0, 0))
    play(session, steps=3, outputs=lambda step: answers(step, 1, 1))
    assert session.unseen == 5
    assert {row[0] for row in learned(session)} == {0, 1, 2}
    assert all(row[1:] == (1, 1) for row in learned(session))


def test_an_episode_begun_again_keeps_its_number_and_seed_and_is_degraded():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0))
    begun = session.next_episode()
    assert session.restart_episode() == begun
    for step in range(3):
        session.decide(world_state(0, step, collision_begun=True), answers(step, 0, 0))
    rows = learned(session)
    assert len(rows) == 2
    assert session.restart_episode() == begun
    for step in range(2):
        session.decide(world_state(0, step, **(GOAL if step == 1 else {})), answers(step, 1, 1))
    assert learned(session) == rows
    record = session.records[0]
    assert (record.degraded, record.steps, record.collisions_begun, record.return_) == (True, 1, 0, 10.0)
    assert session.steps == 3


def test_an_episode_begun_again_counts_its_collisions_from_the_new_start():
    session = SoccerSession(FusionParameters())
    session.next_episode()
    for step in range(3):
        session.decide(world_state(0, step, collision=True, collision_begun=step == 1), answers())
    session.restart_episode()
    session.decide(world_state(0, 0, collision=True), answers())
    session.decide(world_state(0, 1, **TIMEOUT), answers())
    record = session.records[0]
    assert (record.collisions_begun, record.collision_steps, record.return_) == (0, 1, 0.0)


def test_a_session_that_skips_to_an_episode_begins_it_next_and_knows_none_before():
    session = SoccerSession(FusionParameters(seed=7))
    session.next_episode()
    session.decide(world_state(0, 0), answers())
    session.skip_to_episode(5)
    with pytest.raises(ValueError, match="no episode has begun"):
        session.decide(world_state(0, 1), answers())
    assert session.next_episode() == (5, episode_seed(7, 5))
    session.decide(world_state(5, 0, **TIMEOUT), answers())
    assert session.records[0].index == 5
    assert session.next_episode() == (6, episode_seed(7, 6))


def test_what_was_rejected_is_counted_and_told_by_its_reason():
    assert (Rejections().total, str(Rejections())) == (0, "")
    rejections = Rejections(leaf_ids=1, references=20, trees=300, weights=4000)
    assert rejections.total == 4321
    assert str(rejections) == (
        "1 answers with a leaf that the tree does not have, 20 answers with a reference that is not finite, "
        "300 answers from another tree than the behavior's first, 4000 sets of weights that can't be used"
    )
    assert str(Rejections(trees=2)) == "2 answers from another tree than the behavior's first"


def test_only_an_episode_under_way_is_begun_again():
    session = SoccerSession(FusionParameters())
    with pytest.raises(ValueError, match="no episode is under way"):
        session.restart_episode()
    play(session)
    with pytest.raises(ValueError, match="no episode is under way"):
        session.restart_episode()


@pytest.mark.parametrize(("gap", "learned_leaves"), [([0, 1, 3, 4, 5], [0]), ([2, 3, 4], [])])
def test_across_a_gap_and_after_it_nothing_is_learned(gap: Sequence[int], learned_leaves):
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0))
    session.next_episode()
    for step in gap:
        session.decide(world_state(0, step, **(GOAL if step == gap[-1] else {})), answers(step, 0, 0))
    assert sorted(learned(session)) == [(leaf, 0, 0) for leaf in learned_leaves]
    assert session.records[0].degraded
    assert session.records[0].steps == session.steps == gap[-1]


BAD_ANSWERS = [
    ({"leaf_id": -1}, "leaf_ids"),
    ({"leaf_id": 37}, "leaf_ids"),
    ({"leaf_id": 2**31 - 1}, "leaf_ids"),
    ({"leaf_id": 0, "leaf_count": 0}, "leaf_ids"),
    ({"left_rad_s": nan}, "references"),
    ({"right_rad_s": inf}, "references"),
    ({"right_rad_s": -inf}, "references"),
]
OTHER_TREES = [({"tree_hash": "other"}, "trees"), ({"leaf_count": 36}, "trees")]


def hear_one_bad(session: SoccerSession, step: int, change: dict[str, object], counter: str) -> None:
    """Lets approaching give a bad answer: it must count as missing, once, under its reason."""
    outputs = answers()
    assert outputs[2] is not None
    outputs[2] = outputs[2]._replace(**change)
    command, decision = session.decide(world_state(0, step), outputs)
    assert decision.joint_state == (1, 2, NO_LEAF)
    assert (command.left_rad_s, command.right_rad_s) == pytest.approx((15.0, 0.5))
    assert decision.degraded
    counts = vars(session.rejections)
    assert counts[counter] == 1
    assert sum(counts.values()) == 1


@pytest.mark.parametrize(("change", "counter"), BAD_ANSWERS)
def test_a_first_answer_that_cannot_be_acted_on_counts_as_missing(change, counter):
    session = SoccerSession(FusionParameters(controller="uniform"))
    session.next_episode()
    hear_one_bad(session, 0, change, counter)
    command, _ = session.decide(world_state(0, 1), answers())
    assert command.left_rad_s == pytest.approx(20.0)


@pytest.mark.parametrize(("change", "counter"), BAD_ANSWERS + OTHER_TREES)
def test_a_later_answer_that_cannot_be_acted_on_counts_as_missing(change, counter):
    session = SoccerSession(FusionParameters(controller="uniform"))
    session.next_episode()
    session.decide(world_state(0, 0), answers())
    hear_one_bad(session, 1, change, counter)


@pytest.mark.parametrize("weights", [(nan, 0.5, 0.5), (0.5, 0.5), (inf, 0.0, 0.0)])
def test_weights_that_are_none_give_way_to_uniform_ones_and_are_counted(weights, monkeypatch):
    """Fault 20, of a controller that has one."""

    class Broken:
        def begin_episode(self, phase: Phase) -> None:
            pass

        def select(self, *_: object) -> Selection:
            return weights, DRIVER_BLEND, (), ()

    monkeypatch.setattr(session_module, "make_controller", lambda *_: Broken())
    session = SoccerSession(FusionParameters())
    session.next_episode()
    command, decision = session.decide(world_state(0, 0), answers())
    assert (command.left_rad_s, command.right_rad_s) == pytest.approx((20.0, 1.0))
    assert decision.weights == pytest.approx((THIRD,) * 3)
    assert session.rejections.weights == 1


def test_the_printed_equations_without_their_bounds_still_command_what_wheels_can_do():
    printed = {"gain_low": -1e9, "gain_high": 1e9, "weight_floor": -1e9, "weight_gain": 1e9, "tie_rule": "first"}
    session = SoccerSession(
        FusionParameters(controller="fbql_literal", guided=0, reward_goal=1e9, discount=1.0, **printed)
    )
    weights: list[float] = []
    for _ in range(20):
        for command, decision in play(session, steps=3):
            assert -MAX_WHEEL_RAD_S <= command.left_rad_s <= MAX_WHEEL_RAD_S
            weights += decision.weights
    assert min(weights) < 0.0


# Policies


def test_a_policy_goes_on_where_it_ended():
    once = SoccerSession(FusionParameters(controller="fbql_literal", guided=0, tie_rule="first"))
    play(once)
    policy = once.policy()
    assert policy is not None
    twice = SoccerSession(FusionParameters(controller="fbql_literal", tie_rule="first"), policy)
    assert twice.guided == 0
    assert learned(twice) == learned(once)
    play(once)
    play(twice)
    assert learned(twice) == learned(once)


def test_there_is_no_policy_where_nothing_is_learned():
    session = SoccerSession(FusionParameters())
    play(session)
    assert session.policy() is None
    assert SoccerSession(FusionParameters(controller="fbql_literal")).policy() is None


def taught() -> SoccerSession:
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0))
    play(session)
    return session


@pytest.mark.parametrize(
    ("changes", "parameters", "reason"),
    [
        ({}, {"controller": "subsumption"}, "takes no policy"),
        ({"kind": "other"}, {}, "to controller 'other'"),
        ({"behaviors": ("ball_seeking", "approaching", "wall_avoiding")}, {}, "in this order"),
        ({"arrays": {}}, {}, "no array 'joint_states'"),
    ],
)
def test_a_policy_of_something_else_is_refused(changes, parameters, reason):
    policy = taught().policy()
    assert policy is not None
    with pytest.raises(BadInput, match=reason):
        SoccerSession(FusionParameters(**({"controller": "fbql_literal"} | parameters)), policy._replace(**changes))


@pytest.mark.parametrize("change", [{"tree_hash": "other"}, {"leaf_count": 300}])
def test_a_policy_learned_with_other_trees_is_refused_at_the_first_answer(change):
    policy = taught().policy()
    session = SoccerSession(FusionParameters(controller="fbql_literal"), policy)
    session.next_episode()
    outputs = answers()
    assert outputs[1] is not None
    outputs[1] = outputs[1]._replace(**change)
    with pytest.raises(BadInput, match="another tree of wall_avoiding"):
        session.decide(world_state(0, 0), outputs)


# The result


def test_summary_counts_what_it_says():
    session = SoccerSession(FusionParameters(controller="fbql", guided=1, seed=3))
    play(session, steps=100)
    play(session, steps=10, end=GOAL)
    play(session, steps=20, end=OWN_GOAL)
    play(session, steps=40, end=TIMEOUT)
    play(session, steps=30, end=GOAL)
    session.next_episode()
    session.decide(world_state(5, 0), answers())
    session.decide(world_state(5, 1, collision=True, collision_begun=True), answers())
    assert session.summary(wall_s=2.01, messages_recorded=9, incomplete=True)._asdict() == {
        "controller": "fbql",
        "seed": 3,
        "episodes": 4,
        "goals": 2,
        "own_goals": 1,
        "timeouts": 1,
        "success_rate": 0.5,
        "cost_per_goal": 50.0,
        "mean_steps_per_goal": 20.0,
        "collisions_begun": 0,
        "collision_steps": 0,
        "steps": 201,
        "wall_s": 2.01,
        "steps_per_s": pytest.approx(100.0),
        "digest": session.digest,
        "messages_recorded": 9,
        "incomplete": True,
    }


def test_what_cannot_be_divided_is_none():
    summary = SoccerSession(FusionParameters()).summary()
    assert [summary.success_rate, summary.cost_per_goal, summary.mean_steps_per_goal] == [None] * 3
    assert (summary.wall_s, summary.steps_per_s) == (None, None)
    session = SoccerSession(FusionParameters())
    play(session, end=TIMEOUT)
    assert (session.summary().success_rate, session.summary().cost_per_goal) == (0.0, None)


def test_digest_of_nothing_is_that_of_no_bytes():
    assert SoccerSession(FusionParameters()).digest == sha256(b"").hexdigest()


def test_without_a_tie_the_best_gains_whatever_the_tie_rule():
    session = SoccerSession(FusionParameters(controller="fbql_literal", guided=0, tie_rule="first"))
    play(session, steps=10)
    policy = session.policy()
    assert policy is not None
    again = SoccerSession(FusionParameters(controller="fbql_literal", guided=0, tie_rule="none"), policy)
    before = learned(again)[1, 2, 3][1]
    for _ in range(3):
        play(again, steps=10)
    assert learned(again)[1, 2, 3][1] != before, "its values are not tied any more"
