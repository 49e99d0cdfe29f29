"""What is kept of a sitting, and what undo drops."""

from __future__ import annotations

from itertools import count

import pytest
from fbql.keyboard.sitting import Sitting
from fbql_common.core.types import World
from fbql_sim.core.world_loop import WorldLoop

EVERY, WANTED = 6, 20


class Play:
    """A sitting, and the world it drives."""

    def __init__(self) -> None:
        self.sitting = Sitting(count(100), EVERY, WANTED)
        self._loop = WorldLoop()
        self.world = self._loop.reset(0, 100)

    def drive(self, steps: int, left: float = 10.0, right: float = 12.0) -> World:
        """Drives for so many steps; a new episode begins first, where one is asked for."""
        sitting = self.sitting
        if self.world.episode != sitting.episode:
            self.world = self._loop.reset(sitting.episode, sitting.seed)
        sitting.begun = True
        for _ in range(steps):
            assert sitting.awaits(self.world)
            sitting.drive(self.world, left, right)
            self.world = self._loop.step(left, right)
        return self.world


@pytest.fixture
def play() -> Play:
    return Play()


def test_nothing_is_answered_before_the_first_key(play: Play) -> None:
    assert not play.sitting.awaits(play.world)
    play.sitting.begun = True
    assert play.sitting.awaits(play.world)


def test_a_command_answers_its_world_state(play: Play) -> None:
    play.sitting.begun = True
    command = play.sitting.drive(play.world, 1.0, 2.0)
    assert command == (play.world.stamp_ns, 0, 0, 1.0, 2.0)


def test_what_was_driven_is_kept_with_the_seed_of_its_start(play: Play) -> None:
    play.drive(5)
    play.sitting.next()
    play.drive(7)
    play.sitting.next()
    assert [(kept.seed, len(kept.demonstration.worlds)) for kept in play.sitting.kept] == [(100, 5), (101, 7)]
    assert [world.step for world in play.sitting.kept[1].demonstration.worlds] == list(range(7))


def test_a_start_where_nothing_was_driven_is_skipped(play: Play) -> None:
    assert play.sitting.next() is None
    play.drive(3)
    play.sitting.next()
    assert [kept.seed for kept in play.sitting.kept] == [101]


def test_standing_about_at_the_end_is_no_part_of_it(play: Play) -> None:
    play.drive(4)
    play.drive(3, 0.0, 0.0)
    play.drive(2)
    play.drive(50, 0.0, 0.0)
    demonstration = play.sitting.next()
    assert demonstration is not None
    assert [command.left_rad_s for command in demonstration.commands] == [10.0] * 4 + [0.0] * 3 + [10.0] * 2


def test_where_no_wheel_ever_moved_nothing_is_kept(play: Play) -> None:
    play.drive(9, 0.0, 0.0)
    assert play.sitting.next() is None
    assert play.sitting.kept == []


def test_undo_drops_what_is_under_way_and_begins_again_from_the_same_start(play: Play) -> None:
    play.drive(5)
    episode = play.sitting.episode
    assert play.sitting.undo() is False
    assert (play.sitting.seed, play.sitting.steps, play.sitting.begun) == (100, 0, False)
    assert play.sitting.episode > episode, "a late message of the dropped one must not be taken for the new"
    play.drive(6)
    play.sitting.next()
    assert [(kept.seed, len(kept.demonstration.worlds)) for kept in play.sitting.kept] == [(100, 6)]


def test_undo_drops_the_kept_ones_from_the_last_to_the_first(play: Play) -> None:
    for steps in (3, 4):
        play.drive(steps)
        play.sitting.next()
    start = play.sitting.seed
    assert play.sitting.undo() is True
    assert [len(kept.demonstration.worlds) for kept in play.sitting.kept] == [3]
    assert play.sitting.undo() is True
    assert play.sitting.undo() is None
    assert play.sitting.kept == []
    assert play.sitting.seed == start, "the start that is shown stays"


def test_patterns_are_counted_as_they_are_taken(play: Play) -> None:
    play.drive(EVERY + 1)
    assert play.sitting.patterns == 2
    play.sitting.next()
    play.drive(1)
    assert play.sitting.patterns == 3
    play.drive(500)
    assert play.sitting.patterns == WANTED


def test_a_world_state_that_comes_again_gets_the_answer_it_got(play: Play) -> None:
    first = play.world
    play.drive(3)
    assert not play.sitting.awaits(first)
    answer = play.sitting.answered(first)
    assert answer is not None
    assert (answer.step, answer.left_rad_s) == (0, 10.0)
    assert play.sitting.answered(play.world) is None


def test_a_world_state_of_another_episode_is_none_of_its(play: Play) -> None:
    play.drive(3)
    late = play.world
    play.sitting.undo()
    play.sitting.begun = True
    assert not play.sitting.awaits(late)
    assert play.sitting.answered(late) is None


def test_an_ended_episode_is_not_driven_on(play: Play) -> None:
    play.sitting.begun = True
    assert not play.sitting.awaits(play.world._replace(terminated=True, goal=True))
    assert not play.sitting.awaits(play.world._replace(truncated=True))
