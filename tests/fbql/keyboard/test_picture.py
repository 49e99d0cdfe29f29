"""The field as characters, and the page around it."""

from __future__ import annotations

from math import cos, pi, sin

import pytest
from fbql.keyboard.page import LEAST_COLUMNS, LEAST_ROWS, driving_side, page, replay_side, senses
from fbql.keyboard.picture import field_picture
from fbql.keyboard.sitting import Sitting
from fbql.keyboard.steering import Steering
from fbql_behaviors.core.observation import OBSERVATIONS, observation_of
from fbql_common.core.types import WheelCommand, World
from fbql_common.terminal.keys import Key
from fbql_common.terminal.screen import Line, text_of
from fbql_sim.core.arena import HALF_LENGTH, HALF_WIDTH, closest_wall_point
from hypothesis import given
from hypothesis import strategies as st

SIZES = [(49, 23), (89, 39), (30, 12), (200, 20), (30, 60)]


def world_with(x: float = 0.0, y: float = 0.0, yaw: float = 0.0, ball: tuple[float, float] = (0.55, 0.6)) -> World:
    wall = closest_wall_point(x, y)
    return World(1, 0, 0, x, y, yaw, 0.0, 0.0, *ball, 0.0, 0.0, *wall, False, False, False, False, False, False)


def plain(lines: list[Line]) -> list[str]:
    return [text_of(line, colour=False) for line in lines]


def place_of(style: str, world: World, columns: int, rows: int) -> tuple[float, float]:
    """Middle of the characters of one style, as shares of the picture's width and height."""
    lines = field_picture(world, columns, rows)
    width = len(plain(lines)[0])
    found: list[tuple[int, int]] = []
    for row, line in enumerate(lines):
        column = 0
        for text, used in line:
            found += [(column + k, row) for k in range(len(text)) if used == style]
            column += len(text)
    middle = [sum(place[axis] + 0.5 for place in found) / len(found) for axis in (0, 1)]
    return middle[0] / width, middle[1] / len(lines)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("ascii_only", [False, True])
def test_the_picture_fits_and_keeps_the_shape_of_the_field(size: tuple[int, int], ascii_only: bool) -> None:
    lines = plain(field_picture(world_with(), *size, ascii_only))
    columns, rows = len(lines[0]), len(lines)
    assert columns <= size[0]
    assert rows <= size[1]
    assert {len(line) for line in lines} == {columns}
    assert columns / 2 / rows == pytest.approx(2.4 / 1.8, rel=0.2), "a character is twice as high as wide"
    assert columns >= size[0] - 2 or rows >= size[1] - 1, "as large as fits"


@pytest.mark.parametrize(("style", "is_ball"), [("1;36", False), ("1;33", True)])
@pytest.mark.parametrize("x", [-0.9, 0.0, 0.9])
@pytest.mark.parametrize("y", [-0.7, 0.0, 0.7])
def test_robot_and_ball_are_where_they_are(style: str, is_ball: bool, x: float, y: float) -> None:
    world = world_with(-x / 2, -y / 2 - 0.1, ball=(x, y)) if is_ball else world_with(x, y, ball=(-x / 2, -y / 2 - 0.1))
    across, down = place_of(style, world, 89, 39)
    assert across == pytest.approx((x + 1.2) / 2.4, abs=0.03)
    assert down == pytest.approx((0.9 - y) / 1.8, abs=0.04)


@pytest.mark.parametrize("eighth", range(8))
def test_the_line_ahead_of_the_robot_shows_where_it_is_heading(eighth: int) -> None:
    yaw = eighth * pi / 4
    world = world_with(yaw=yaw)
    across, down = place_of("36", world, 200, 90)
    ahead = (2.4 * (across - 0.5) * cos(yaw), 1.8 * (0.5 - down) * sin(yaw))
    assert sum(ahead) > 0.05
    assert ">/^\\</v\\"[eighth] in "".join(plain(field_picture(world, 49, 23, True)))


def test_in_ascii_everything_has_a_shape_of_its_own() -> None:
    text = "\n".join(plain(field_picture(world_with(), 49, 23, True)))
    assert text.isascii()
    assert text.count("o") == 1
    assert text.count(">") == 1
    assert {"#", "[", "]", "*"} <= set(text)


@given(
    st.floats(-HALF_LENGTH, HALF_LENGTH),
    st.floats(-HALF_WIDTH, HALF_WIDTH),
    st.floats(-4.0, 4.0),
    st.integers(8, 130),
    st.integers(4, 60),
    st.booleans(),
)
def test_no_world_and_no_size_breaks_the_picture(
    x: float, y: float, yaw: float, columns: int, rows: int, ascii_only: bool
) -> None:
    lines = plain(field_picture(world_with(x, y, yaw, ball=(-x, -y)), columns, rows, ascii_only))
    assert len(lines) <= rows
    assert max(map(len, lines)) <= columns


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
    told = [behavior, "demonstration 1, 0 kept", "0 of 1000 patterns", "begins with your first key", "left 1"]
    keys = ["faster", "slower", "turn left", "turn right", "stop", "next start", "undo", "finish"]
    assert [word for word in [*told, *keys, "kept demonstration 3"] if word not in text] == []
    for whole in plain(side):
        assert whole.rstrip() in text, "nothing beside the field is cut off"


def test_a_page_of_a_replay_shows_the_command() -> None:
    world = world_with()

    side = replay_side("ball_seeking", observation_of("ball_seeking"), 2, 5, world, WheelCommand(1, 0, 0, 12.57, -6.29))
    text = "\n".join(plain(page(world, side, "", 80, 24, False)))
    assert [word for word in ("demonstration 2 of 5", "+12.6 rad/s", "-6.3 rad/s", "quit") if word not in text] == []


def test_a_terminal_that_is_too_small_is_told_so() -> None:
    assert "at least" in plain(page(world_with(), [], "", 60, 20, False))[0]
    assert plain(page(world_with(), [], "", 10, 2, False)) == ["This termi"]


def test_before_the_first_world_there_is_a_page_too() -> None:
    sitting = Sitting(iter(range(9)), 6, 1000)
    side = driving_side("ball_seeking", observation_of("ball_seeking"), sitting, Steering(), None, 0.0, 1 / 60, False)
    assert "begins with" not in "\n".join(plain(page(None, side, "", 80, 24, False)))


def test_colour_changes_no_character() -> None:
    line: Line = [("ab", "1;36"), ("c", "")]
    assert text_of(line, colour=True) == "\x1b[1;36mab\x1b[mc"
    assert text_of(line, colour=False) == "abc"
