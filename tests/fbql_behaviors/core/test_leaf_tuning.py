"""DT-based Q-learning: each equation with numbers computed by hand, and small worlds in which the answer is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi
from pathlib import Path

import pytest
from fbql_behaviors.core.exercises import Exercise, exercise_of
from fbql_behaviors.core.leaf_tuning import (
    TuningParameters,
    changed,
    changes_up_to,
    chosen_changes,
    discounted_return,
    epsilon_of,
    greedy,
    smdp_target,
    step_size,
    tune,
    tuning_of,
    updated_q,
)
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.quantizer import LEVEL_RAD_S
from fbql_behaviors.core.tree import Leaf, Split, Tree
from fbql_behaviors.storage import load_tree, save_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S, WHEEL_RADIUS_M
from fbql_common.core.parameters import check, limits_of
from fbql_common.core.types import World
from hypothesis import given
from hypothesis import strategies as st

DT_S = 1 / 60
FEATURES = OBSERVATIONS["ball_seeking"].features
NEAR_AND_FAR = Tree(
    "ball_seeking", FEATURES, (Split(0, 0.5, 1, 2), 0, 1), (Leaf(30.0, 30.0, 5), Leaf(40.0, 40.0, 6)), {"method": "rl"}
)
ONE_LEAF = Tree("ball_seeking", FEATURES, (0,), (Leaf(30.0, 30.0, 5),))


class Rail:
    """The robot on a rail towards a ball a metre ahead: the mean of its wheels moves it, and nothing turns it."""

    def __init__(self) -> None:
        self._world = World(0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.9, -pi / 2, *[False] * 6)
        self.commands: list[tuple[float, float]] = []

    def reset(self, seed: int) -> World:
        self.commands.clear()
        self._world = self._world._replace(step=0, robot_x_m=0.001 * (seed % 100))
        return self._world

    def step(self, left_rad_s: float, right_rad_s: float) -> World:
        self.commands.append((left_rad_s, right_rad_s))
        way_m = (left_rad_s + right_rad_s) / 2 * WHEEL_RADIUS_M * DT_S
        self._world = self._world._replace(step=self._world.step + 1, robot_x_m=self._world.robot_x_m + way_m)
        return self._world


def nobody(_: World) -> None:
    return None


def exercise(
    arrived_at: int = -1,
    max_steps: int = 1000,
    other: Callable[[World], tuple[float, float] | None] = nobody,
    reward: Callable[[World, World, float], float] = lambda *_: 1.0,
) -> Exercise:
    """One that pays 1 for each step unless told otherwise, and arrives at a step."""
    return Exercise(reward, lambda world: world.step == arrived_at, max_steps, lambda _: 0.0, "nothing", other)


GREEDY = TuningParameters(
    episodes=1, discount=0.5, credit_steps=1, hold_steps=1, learning_rate=1.0, epsilon_start=0.0, epsilon_end=0.0
)
"""One episode without a random decision; every step is a decision of its own, and every update replaces Q."""


def learned(parameters: TuningParameters, practised: Exercise) -> float:
    """Q of no change in a tree of one leaf."""
    return tune(ONE_LEAF, practised, Rail(), DT_S, parameters, 0).q[0][0]


# Equations


def test_the_return_of_three_steps() -> None:
    assert discounted_return([1.0, 2.0, 4.0], 0.5) == 3.0  # 1 + 2/2 + 4/4


def test_the_target_adds_the_next_value_discounted_by_every_step() -> None:
    assert smdp_target([1.0, 2.0, 4.0], 0.5, 8.0) == 4.0  # 3 + 8/8
    assert smdp_target([1.0, 2.0, 4.0], 1.0, -2.0) == 5.0
    assert smdp_target([], 0.5, 8.0) == 8.0


@given(st.lists(st.floats(-100, 100), max_size=50), st.floats(0, 1))
def test_the_return_is_that_of_a_literal_loop(rewards: list[float], discount: float) -> None:
    literal = 0.0
    for j, reward in enumerate(rewards):
        literal += discount**j * reward
    assert discounted_return(rewards, discount) == pytest.approx(literal, abs=1e-9)


def test_an_update_goes_a_share_of_the_way_to_the_target() -> None:
    assert updated_q(2.0, 6.0, 0.25) == 3.0


def test_the_step_size_is_that_of_the_mean_until_the_rate_is_reached() -> None:
    assert [step_size(0.3, n) for n in (1, 2, 3, 4)] == [1.0, 0.5, pytest.approx(1 / 3), 0.3]


def test_epsilon_falls_in_a_line_from_the_first_episode_to_the_last() -> None:
    parameters = TuningParameters(episodes=5, epsilon_start=0.9, epsilon_end=0.1)
    assert [epsilon_of(parameters, k) for k in range(5)] == pytest.approx([0.9, 0.7, 0.5, 0.3, 0.1])
    assert epsilon_of(replace(parameters, episodes=1), 0) == 0.9
    assert epsilon_of(replace(parameters, episodes=2), 1) == pytest.approx(0.1)


# Actions


def test_the_actions_are_all_pairs_of_changes_and_the_first_is_no_change() -> None:
    assert changes_up_to(1)[0] == (0, 0)
    assert sorted(changes_up_to(1)) == [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    assert len(changes_up_to(2)) == 25


def test_a_change_adds_levels_to_a_leaf_and_stops_at_full_velocity() -> None:
    assert changed(Leaf(10.0, -10.0, 7), (1, -2)) == Leaf(
        pytest.approx(10.0 + LEVEL_RAD_S), pytest.approx(-10.0 - 2 * LEVEL_RAD_S), 7
    )
    assert changed(Leaf(87.0, -87.0, 7), (1, -1)) == Leaf(MAX_WHEEL_RAD_S, -MAX_WHEEL_RAD_S, 7)


def test_ties_are_won_by_no_change() -> None:
    assert greedy([0.5, 0.5, 0.1]) == 0
    assert greedy([0.5, 0.6, 0.6]) == 1


def test_a_change_that_was_tried_too_little_is_not_made() -> None:
    changes = ((0, 0), (0, 1), (1, 0))
    q = [[-3.0, -1.0, -2.0], [-3.0, -1.0, -2.0], [-3.0, -1.0, -2.0], [0.0, 0.0, 0.0]]
    updates = [[0, 9, 9], [0, 1, 9], [0, 1, 1], [9, 9, 9]]
    assert chosen_changes(q, updates, changes, 5) == ((0, 1), (1, 0), (0, 0), (0, 0))


# Transitions


def test_after_arriving_nothing_follows() -> None:
    # Steps 0, 1, 2: Q = 1 + 0/2, then 1 + 1/2; the last step has no next leaf: Q = 1.
    assert learned(GREEDY, exercise(arrived_at=3)) == 1.0


def test_a_truncated_episode_would_have_gone_on() -> None:
    # As above, but the last step goes on from Q = 1.5: 1 + 1.5/2.
    assert learned(GREEDY, exercise(max_steps=3)) == 1.75


def test_a_decision_holds_until_the_leaf_changes() -> None:
    environment = Rail()
    parameters = replace(GREEDY, hold_steps=1000, min_updates=0)
    tuned = tune(NEAR_AND_FAR, exercise(arrived_at=60), environment, DT_S, parameters, 0)
    # At 40 rad/s, 0.8 m/s, it comes within half a metre: one decision in each leaf, so one update of each.
    assert [counts[0] for counts in tuned.updates] == [1, 1]
    far = environment.commands.count((40.0, 40.0))
    near = environment.commands.count((30.0, 30.0))
    assert far + near == 60
    assert tuned.q[0][0] == pytest.approx(2.0 * (1.0 - 0.5**near))
    # The far leaf was left before the near one had been learned: its next value was 0.
    assert tuned.q[1][0] == pytest.approx(2.0 * (1.0 - 0.5**far))


def test_in_a_leaf_that_is_not_left_a_decision_is_made_again() -> None:
    tuned = tune(ONE_LEAF, exercise(max_steps=60), Rail(), DT_S, replace(GREEDY, hold_steps=20), 0)
    assert tuned.updates[0][0] == 3


def test_a_decision_is_credited_with_what_follows_in_so_many_steps_at_least() -> None:
    # Decisions at 0, 1, 2. The first learns at step 2: 1 + 1/2, and Q is still 0. The second at the end: 1 + 1/2; the third 1.
    assert learned(replace(GREEDY, credit_steps=2, learning_rate=0.0), exercise(arrived_at=3)) == pytest.approx(4 / 3)


def test_while_another_drives_its_steps_count_for_the_last_decision() -> None:
    def other(world: World) -> tuple[float, float] | None:
        return (7.0, 7.0) if world.step in (1, 2) else None

    def reward(world: World, *_: object) -> float:
        return float(10**world.step)

    environment = Rail()
    parameters = replace(GREEDY, discount=1.0, hold_steps=1000, learning_rate=0.0)
    tuned = tune(ONE_LEAF, exercise(arrived_at=4, other=other, reward=reward), environment, DT_S, parameters, 0)
    assert [left for left, _ in environment.commands] == [30.0, 7.0, 7.0, 30.0]
    assert tuned.updates[0][0] == 2
    # 1 + 10 + 100 for the decision at 0, its next value being 0; 1000 for that at 3.
    assert tuned.q[0][0] == pytest.approx((111.0 + 1000.0) / 2)


# Trees


def test_on_a_rail_every_leaf_learns_to_drive_faster() -> None:
    parameters = TuningParameters(episodes=150, discount=0.9, credit_steps=1, hold_steps=10, min_updates=5)
    tuned = tune(NEAR_AND_FAR, exercise_of("ball_seeking"), Rail(), DT_S, parameters, 1)
    assert tuned.leaves_changed == 2
    for leaf, before in zip(tuned.tree.leaves, NEAR_AND_FAR.leaves, strict=True):
        assert leaf == Leaf(
            pytest.approx(before.left_rad_s + LEVEL_RAD_S),
            pytest.approx(before.right_rad_s + LEVEL_RAD_S),
            before.patterns,
        )


def test_a_tuned_tree_is_a_tree_of_its_own_that_names_the_one_it_came_from(tmp_path: Path) -> None:
    parameters = TuningParameters(episodes=3, min_updates=100)
    tuned = tune(NEAR_AND_FAR, exercise_of("ball_seeking"), Rail(), DT_S, parameters, 8)
    tree = tuned.tree
    assert tuned.leaves_changed == 0
    assert (tree.nodes, tree.features, tree.leaves) == (NEAR_AND_FAR.nodes, NEAR_AND_FAR.features, NEAR_AND_FAR.leaves)
    assert tree.hash != NEAR_AND_FAR.hash
    assert tree.origin["tuned_from"] == NEAR_AND_FAR.hash
    assert tree.origin["tuned_from_origin"] == {"method": "rl"}
    assert (tree.origin["method"], tree.origin["seed"], tree.origin["episodes"]) == ("leaf_tuning", 8, 3)
    save_tree(tmp_path / "tuned.json", tree)
    assert load_tree(tmp_path / "tuned.json").hash == tree.hash


def test_the_same_seed_tunes_the_same_tree_and_another_one_another() -> None:
    def tuned(seed: int) -> tuple[str, tuple[tuple[float, ...], ...]]:
        found = tune(NEAR_AND_FAR, exercise_of("ball_seeking"), Rail(), DT_S, TuningParameters(episodes=10), seed)
        return found.tree.hash, found.q

    assert tuned(3) == tuned(3)
    assert tuned(3)[1] != tuned(4)[1]


@pytest.mark.parametrize(
    ("values", "what"),
    [
        ({"episodes": 0}, "'episodes' is 0"),
        ({"discount": 1.5}, "'discount' is 1.5"),
        ({"epsilon_start": float("nan")}, "'epsilon_start' is nan"),
        ({"max_change": 6}, "'max_change' is 6"),
    ],
)
def test_a_parameter_out_of_range_is_named(values: dict[str, float], what: str) -> None:
    with pytest.raises(BadInput, match=what):
        tune(ONE_LEAF, exercise(), Rail(), DT_S, TuningParameters(**values), 0)  # type: ignore[arg-type]


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(BadInput, match="seed is -1"):
        tune(ONE_LEAF, exercise(), Rail(), DT_S, GREEDY, -1)


def test_progress_is_told_after_each_episode_with_the_number_driven() -> None:
    told: list[int] = []
    tune(ONE_LEAF, exercise(max_steps=5), Rail(), DT_S, replace(GREEDY, episodes=3), 0, told.append)
    assert told == [1, 2, 3]


def test_every_behavior_is_tuned_by_the_same_setting_but_for_the_one_without_an_end() -> None:
    usual = TuningParameters(
        episodes=4000, max_change=1, discount=1.0, credit_steps=40, hold_steps=60, learning_rate=0.003,
        epsilon_start=0.2, epsilon_end=0.05, min_updates=20,
    )  # fmt: skip
    assert tuning_of("ball_seeking") == tuning_of("approaching") == tuning_of("dance") == usual
    assert tuning_of("wall_avoiding") == replace(usual, episodes=400, discount=0.99)


def test_each_setting_is_taken_up_to_its_bounds_and_not_beyond() -> None:
    """These settings are those of no node, so docs/parameters.md does not hold their bounds."""
    bounds = {
        "episodes": (1, 10_000_000), "max_change": (1, 5), "discount": (0.0, 1.0), "credit_steps": (1, None),
        "hold_steps": (1, None), "learning_rate": (0.0, 1.0), "epsilon_start": (0.0, 1.0), "epsilon_end": (0.0, 1.0),
        "min_updates": (0, None),
    }  # fmt: skip
    assert {name: (limits.low, limits.high) for name, limits in limits_of(TuningParameters).items()} == bounds
    for name, ends in bounds.items():
        for end, beyond in zip(ends, (-1, 1), strict=True):
            if end is not None:
                check(replace(TuningParameters(), **{name: end}), "here")
                with pytest.raises(BadInput, match=f"'{name}' is .*, outside of"):
                    check(replace(TuningParameters(), **{name: end + beyond}), "here")
