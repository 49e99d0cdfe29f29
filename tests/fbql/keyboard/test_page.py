"""What is beside the field while a person drives, or sees demonstrations."""

from __future__ import annotations

import pytest
from drawn_field import plain, world_with
from fbql.keyboard.page import driving_side, replay_side, senses
from fbql.keyboard.sitting import Sitting
from fbql.keyboard.steering import Steering
from fbql.watch.page import LEAST_COLUMNS, LEAST_ROWS, page
from fbql_behaviors.core.observation import OBSERVATIONS, observation_of
from fbql_common.core.types import WheelCommand
from fbql_common.terminal.keys import Key


def test_what_is_sensed_is_shown_with_its_unit() -> None:
    world = world_with(ball=(0.3, 0.3))
    assert [" ".join(text.split()) for text in plain(senses(observation_of("ball_seeking"), world))] == [
        "ball distance 0.42 m",
        "ball bearing +0.79 rad +45 deg",
    ]
    for observation in OBSERVATIONS.values():
        texts = plain(senses(observation, world))
        assert all(feature.unit in text for feature, text in zip(observation.features, texts, strict=True))


@pytest.mark.parametrize("behavior", sorted(OBSERVATIONS))
@pytest.mark.parametrize("size", [(80, 24), (120, 40), (LEAST_COLUMNS, LEAST_ROWS)])
@pytest.mark.parametrize("ascii_only", [False, True])
def test_the_whole_page_fits_and_shows_state_and_keys(behavior: str, size: tuple[int, int], ascii_only: bool) -> None:
    sitting, driving = Sitting(iter(range(9)), 6, 1000), Steering()
    driving.press(Key.LEFT, 0.0)
    observation, world = observation_of(behavior), world_with()
    side = driving_side(behavior, observation, sitting, driving, world, 0.0, 1 / 60, ascii_only)
    lines = plain(page(world, side, "kept demonstration 3", *size, ascii_only))
    assert len(lines) == size[1]
    assert max(map(len, lines)) <= size[0]
    text = "\n".join(lines)
    assert text.isascii() or not ascii_only
    told = [behavior, "demonstration 1, 0 kept", "0 patterns, at most 1000", "begins with your first key", "left 1"]
    keys = ["faster", "slower", "turn left", "turn right", "stop", "next start", "undo", "finish"]
    assert [word for word in [*told, *keys, "kept demonstration 3"] if word not in text] == []
    for whole in plain(side):
        assert whole.rstrip() in text, "nothing beside the field is cut off"


def test_a_page_of_a_replay_shows_the_command() -> None:
    world = world_with()

    side = replay_side(
        "ball_seeking",
        observation_of("ball_seeking"),
        2,
        5,
        world,
        WheelCommand(1, 0, 0, 12.57, -6.29),
        "2 x real time",
    )
    text = "\n".join(plain(page(world, side, "", 80, 24, False)))
    assert [
        word
        for word in ("demonstration 2 of 5", "+12.6 rad/s", "-6.3 rad/s", "2 x real time", "quit")
        if word not in text
    ] == []


def test_before_the_first_world_there_is_a_page_too() -> None:
    sitting = Sitting(iter(range(9)), 6, 1000)
    side = driving_side("ball_seeking", observation_of("ball_seeking"), sitting, Steering(), None, 0.0, 1 / 60, False)
    assert "begins with" not in "\n".join(plain(page(None, side, "", 80, 24, False)))
