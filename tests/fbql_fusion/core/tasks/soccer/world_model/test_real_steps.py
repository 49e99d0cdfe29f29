"""The real steps: whole episodes alone, the latest ones, and the same after reading."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.types import World
from fbql_fusion.core.tasks.soccer.world_model.real_steps import RealSteps, state_of

WORLD = World(1, 0, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 0.0, 0.0, *[False] * 6)


def played(steps: RealSteps, length: int, mark: float = 0.0) -> None:
    """An episode; the ball's x tells which step it is."""
    steps.begin(WORLD._replace(ball_x_m=mark))
    for step in range(1, length + 1):
        ended = step == length
        steps.add(step, -step, WORLD._replace(ball_x_m=mark + step, truncated=ended, collision=step == 2))


def test_a_transition_has_its_command_between_the_two_states() -> None:
    steps = RealSteps(100)
    played(steps, 3)
    real = steps.transitions()
    assert real.before[:, 5].tolist() == [0.0, 1.0, 2.0]
    assert real.after[:, 5].tolist() == [1.0, 2.0, 3.0]
    assert real.commands.tolist() == [[1.0, -1.0], [2.0, -2.0], [3.0, -3.0]]
    assert real.touched.tolist() == [0.0, 1.0, 0.0]
    assert real.before[0] == pytest.approx(state_of(WORLD._replace(ball_x_m=0.0)), abs=1e-7)


def test_the_marks_of_a_stored_step_tell_begin_contact_and_collision_by_a_bit_each() -> None:
    """Stored policies depend on them."""
    steps = RealSteps(100)
    steps.begin(WORLD)
    for touches, begins, ends in ((True, True, False), (True, False, False), (False, False, True)):
        steps.add(1.0, 2.0, WORLD._replace(collision=touches, collision_begun=begins, terminated=ends))
    assert steps.to_arrays()["real_marks"].tolist() == [1, 2 + 4, 2, 0]
    real = steps.transitions()
    assert (real.touched.tolist(), real.collides.tolist()) == ([1.0, 1.0, 0.0], [True, False, False])


def test_no_transition_leads_from_one_episode_to_the_next() -> None:
    steps = RealSteps(100)
    played(steps, 3)
    played(steps, 2, mark=50.0)
    real = steps.transitions()
    assert len(steps) == len(real.before) == 5
    assert real.episode.tolist() == [0, 0, 0, 1, 1]
    assert real.before[:, 5].tolist() == [0.0, 1.0, 2.0, 50.0, 51.0]
    assert steps.starts()[:, 5].tolist() == [0.0, 50.0]


def test_an_unfinished_episode_does_not_count() -> None:
    steps = RealSteps(100)
    played(steps, 3)
    steps.begin(WORLD)
    steps.add(1.0, 1.0, WORLD)
    assert len(steps) == 3
    played(steps, 2, mark=50.0)
    assert len(steps) == 5
    assert steps.starts()[:, 5].tolist() == [0.0, 50.0]


def test_a_step_counts_only_between_the_beginning_and_the_end_of_an_episode() -> None:
    steps = RealSteps(100)
    steps.add(1.0, 1.0, WORLD._replace(truncated=True))
    assert len(steps) == 0
    played(steps, 3)
    steps.add(1.0, 1.0, WORLD._replace(truncated=True))
    assert len(steps) == 3
    assert steps.transitions().commands.tolist() == [[1.0, -1.0], [2.0, -2.0], [3.0, -3.0]]


def test_an_episode_with_a_missing_step_is_dropped() -> None:
    steps = RealSteps(100)
    steps.begin(WORLD)
    steps.forget_episode()
    steps.add(1.0, 1.0, WORLD._replace(truncated=True))
    assert len(steps) == 0


def test_the_oldest_episodes_make_room() -> None:
    steps = RealSteps(7)
    for episode in range(5):
        played(steps, 3, mark=10.0 * episode)
    assert len(steps) == 6
    assert steps.starts()[:, 5].tolist() == [30.0, 40.0]


def test_as_many_steps_as_the_capacity_are_kept() -> None:
    steps = RealSteps(6)
    played(steps, 3)
    played(steps, 3)
    assert len(steps) == 6


def test_the_latest_episode_stays_even_if_it_is_longer_than_the_capacity() -> None:
    steps = RealSteps(7)
    played(steps, 3)
    played(steps, 3)
    played(steps, 20, mark=50.0)
    assert len(steps) == 20
    assert steps.starts()[:, 5].tolist() == [50.0]


def test_memory_grows_with_the_steps() -> None:
    steps = RealSteps(100_000)
    for episode in range(4):
        played(steps, 700, mark=1000.0 * episode)
    assert steps.transitions().before[-1, 5] == 3699.0


def test_what_is_stored_reads_back() -> None:
    steps = RealSteps(100)
    played(steps, 3)
    played(steps, 4)
    again = RealSteps.from_arrays(steps.to_arrays(), 100)
    for mine, its in zip(steps.transitions(), again.transitions(), strict=True):
        assert np.array_equal(mine, its)
    played(steps, 5)
    played(again, 5)
    assert all(
        np.array_equal(a, b) for a, b in zip(steps.to_arrays().values(), again.to_arrays().values(), strict=True)
    )


def test_no_steps_read_back_as_none() -> None:
    again = RealSteps.from_arrays(RealSteps(100).to_arrays(), 100)
    played(again, 3)
    assert len(again) == 3


def broken(change: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    steps = RealSteps(100)
    played(steps, 3)
    arrays = steps.to_arrays()
    change(arrays)
    return arrays


@pytest.mark.parametrize(
    "change",
    [
        lambda arrays: arrays.pop("real_states"),
        lambda arrays: arrays.update(real_commands=arrays["real_commands"][:-1]),
        lambda arrays: arrays["real_states"].__setitem__((1, 1), np.nan),
        lambda arrays: arrays["real_marks"].__setitem__(0, 0),
        lambda arrays: arrays["real_marks"].__setitem__(1, 1),
        lambda arrays: arrays["real_marks"].__setitem__(-1, 1),
        lambda arrays: arrays["real_marks"].__setitem__(2, 99),
    ],
)
def test_arrays_that_can_not_come_from_steps_are_bad_input(change: Callable[[dict[str, Any]], object]) -> None:
    with pytest.raises(BadInput, match="policy"):
        RealSteps.from_arrays(broken(change), 100)
