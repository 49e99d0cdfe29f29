"""What the critic sees of the world state: tiles of it, the same in the mirror, and nothing of it in any weight."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.types import World
from fbql_fusion.core.learners.tilings import critic_tilings, splitmix64
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.core.tasks.soccer.critic import WIDTHS, critic_inputs
from held_learners import arrays_of, frozen, learned
from hypothesis import given
from hypothesis import strategies as st
from two_sides import Answers, TwoSides, goals, parameters, play, world_state

ACROSS = ("robot_y_m", "ball_y_m", "ball_vy_m_s")
NAMES = ("robot_x_m", "robot_y_m", "ball_x_m", "ball_y_m", "ball_vx_m_s", "ball_vy_m_s")
places = st.floats(-0.8, 0.8)


@st.composite
def worlds(draw: st.DrawFn) -> World:
    return world_state(0, 0)._replace(**{name: draw(places) for name in NAMES})


def in_the_mirror(world: World) -> World:
    return world._replace(**{name: -getattr(world, name) for name in ACROSS})


@given(worlds())
def test_the_critic_sees_the_positions_of_ball_and_robot_and_the_balls_velocity(world: World) -> None:
    x, y, rx, ry = world.ball_x_m, world.ball_y_m, world.robot_x_m, world.robot_y_m
    assert critic_inputs(world, mirror=False) == (x, y, rx, ry, rx - x, ry - y, world.ball_vx_m_s, world.ball_vy_m_s)
    assert len(WIDTHS[0]) == 8


def test_the_tiles_have_these_widths() -> None:
    """A policy's table of V is by these tiles: another width makes another learner."""
    ball = (0.16, 0.16, 0, 0, 0, 0, 0, 0)
    ball_and_robot = (0.35, 0.35, 0.35, 0.35, 0, 0, 0, 0)
    robot_from_ball = (0.3, 0, 0, 0, 0.2, 0.2, 0, 0)
    ball_and_velocity = (0.3, 0.3, 0, 0, 0, 0, 0.3, 0.3)
    assert (ball, ball_and_robot, robot_from_ball, ball_and_velocity) == WIDTHS


@given(worlds())
def test_mirrored_worlds_have_the_same_critic_inputs(world: World) -> None:
    other = in_the_mirror(world)
    inputs = critic_inputs(world, mirror=True)
    assert inputs[1] >= 0.0
    if world.ball_y_m:
        assert inputs == critic_inputs(other, mirror=True)
        assert critic_inputs(world, mirror=False) != critic_inputs(other, mirror=False)


def test_a_world_with_the_ball_on_the_middle_line_is_told_as_it_is() -> None:
    middle = world_state(0, 0)._replace(ball_y_m=0.0, robot_y_m=0.3, ball_vy_m_s=-0.2)
    assert critic_inputs(middle, mirror=True) == critic_inputs(middle, mirror=False)


@given(worlds(), st.lists(st.floats(-0.05, 0.05), min_size=6, max_size=6))
def test_a_key_is_that_of_a_tile(one: World, moved: list[float]) -> None:
    """Equal keys where floor(x / width + shift) is equal in every component that the group has, and only there."""
    tilings = 4
    two = one._replace(**{name: getattr(one, name) + by for name, by in zip(NAMES, moved, strict=True)})

    def literal(world: World) -> list[tuple[int, ...]]:
        inputs = critic_inputs(world, mirror=True)
        found: list[tuple[int, ...]] = []
        for group in WIDTHS:
            for t in range(tilings):
                shifts = [t * (2 * c + 1) / tilings % 1.0 for c in range(len(group))]
                found.append(
                    tuple(
                        int(np.floor(x * (1.0 / width) + shift))
                        for x, width, shift in zip(inputs, group, shifts, strict=True)
                        if width
                    )
                )
        return found

    tiles = critic_tilings(WIDTHS, tilings)
    first, second = (tiles.keys(critic_inputs(world, mirror=True)) for world in (one, two))
    assert len(set(first)) == len(first) == len(WIDTHS) * tilings
    same = [a == b for a, b in zip(first, second, strict=True)]
    assert same == [a == b for a, b in zip(literal(one), literal(two), strict=True)]


def test_zero_tilings_give_no_keys() -> None:
    assert critic_tilings(WIDTHS, 0).keys(critic_inputs(world_state(0, 0), mirror=True)) == []


def test_factors_are_splitmix64s_and_those_of_the_world_others_than_of_what_is_sensed() -> None:
    """The first outputs of SplitMix64 from the seed 0, one bit dropped, as published with the generator."""
    assert splitmix64(3) == [x >> 1 for x in (0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F)]
    assert splitmix64(2, 2) == splitmix64(3)[1:]
    assert not set(critic_tilings(WIDTHS, 32).families.tolist()) & set(splitmix64(10_000))


def drivers_of(policy: Policy, **said: float) -> list[int]:
    """Who drives in frozen play of some episodes, where this is said of the world state."""
    session, task, drivers = frozen(policy), TwoSides(), list[int]()
    for _ in range(10):
        begun = session.next_episode()
        assert begun is not None
        world = task.reset(*begun)
        while not world.ended:
            command, decision = session.decide(world._replace(**said), task.answers())
            drivers.append(decision.driver)
            world = task.step(world, command.left_rad_s)
        session.decide(world, task.answers())
    return drivers


def test_no_weight_depends_on_the_world_state() -> None:
    """Rows of theta that belong to what only V sees stay 0, and frozen play is the same wherever the ball is said to be."""
    session = SoccerSession(parameters(seed=1))
    play(session, 59)
    arrays = arrays_of(session)
    rows = arrays["waiting_active"]
    inputs = np.unique(rows[:, -len(WIDTHS) * 4 :])
    assert len(inputs) >= len(WIDTHS) * 4
    assert not arrays["theta"][inputs].any()
    assert arrays["value"][inputs].any()
    assert not set(inputs.tolist()) & set(rows[:, : -len(WIDTHS) * 4].ravel().tolist())
    assert arrays["theta"][np.unique(rows[:, : -len(WIDTHS) * 4])].any()
    policy = learned(session)
    found = drivers_of(policy)
    assert len(set(found)) == 2
    assert found == drivers_of(policy, ball_x_m=-0.6, ball_y_m=0.3, robot_x_m=0.2, ball_vx_m_s=0.5)
    assert found == drivers_of(policy, ball_x_m=nan, ball_vy_m_s=inf, robot_y_m=1e30), "played without a look at it"


@pytest.mark.parametrize("mirror", [False, True])
def test_a_decision_keeps_the_critic_inputs_of_its_own_moment(mirror: bool) -> None:
    """The keys of waiting episodes' last columns are those of the world states that were decided in, in the mirror's
    way where there is one."""
    session = SoccerSession(parameters(seed=1, fbql_mirror=mirror))
    play(session, 60)
    heard: list[World] = []

    def listening(world: World, answers: Answers) -> Answers:
        heard.append(world)
        return answers

    play(session, 4, listening)
    arrays = arrays_of(session)
    assert len(arrays["waiting_lengths"]) == 4
    held = round(session.parameters.fbql_hold_s * 60)
    decided = [world for world in heard if world.ended or world.step % held == 0]
    assert len({world.ball_y_m < 0.0 for world in decided}) == 2, "on both sides"
    tiles = critic_tilings(WIDTHS, 4)
    rows = arrays["waiting_active"]
    assert arrays["keys"][rows[:, -len(WIDTHS) * 4 :]].tolist() == [
        tiles.keys(critic_inputs(w, mirror)) for w in decided
    ]


@pytest.mark.parametrize("said", [nan, inf, -1e20])
@pytest.mark.parametrize("when", ["always", "once", "at the end"])
def test_an_episode_with_a_world_state_out_of_this_world_is_not_learned_from(said: float, when: str) -> None:
    """Fault 11: a ball that is nowhere, or beyond all tiles, spoils nothing: its episode is left out."""
    session = SoccerSession(parameters(seed=1))
    play(session, 47)
    before = len(arrays_of(session)["waiting_lengths"])
    begun = session.next_episode()
    assert begun is not None
    task = TwoSides()
    world = task.reset(*begun)
    while True:
        spoilt = when == "always" or (when == "once" and world.step == 6) or (when == "at the end" and world.ended)
        heard = world._replace(ball_vx_m_s=said) if spoilt else world
        command, _ = session.decide(heard, task.answers())
        if world.ended:
            break
        world = task.step(world, command.left_rad_s)
    assert world.step > 6
    assert len(arrays_of(session)["waiting_lengths"]) == before > 0
    play(session, 1)
    assert len(arrays_of(session)["waiting_lengths"]) == before + 1, "one that is whole is"


@pytest.mark.parametrize("tilings", [0, 4])
def test_it_learns_with_and_without_critic_inputs_and_a_policy_records_which(tilings: int) -> None:
    changes = {"seed": 2, "fbql_world_tilings": tilings}
    session = SoccerSession(parameters(**changes))
    play(session, 160)
    policy = learned(session)
    assert policy.arrays["resolution"].tolist()[-2:] == [tilings, 0]
    with pytest.raises(
        BadInput, match=f"learned with fbql_world_tilings {tilings}, but the parameter is {4 - tilings}"
    ):
        SoccerSession(parameters(**(changes | {"fbql_world_tilings": 4 - tilings})), policy)
    assert goals(session, 50) >= 0.9
    again = SoccerSession(replace(parameters(**changes), learn=False, seed=9), policy)
    play(again, 40)
    assert goals(again, 40) >= 0.9
