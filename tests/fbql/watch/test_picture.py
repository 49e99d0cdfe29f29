"""The field as characters, and the page around it."""

from __future__ import annotations

from math import cos, pi, sin

import pytest
from drawn_field import plain, world_with
from fbql.watch.page import page
from fbql.watch.picture import Trail, field_picture
from fbql_common.core.types import World
from fbql_common.core.walls import HALF_LENGTH, HALF_WIDTH
from fbql_common.terminal.screen import Line, text_of
from hypothesis import given
from hypothesis import strategies as st

SIZES = [(49, 23), (89, 39), (30, 12), (200, 20), (30, 60)]


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


def test_a_terminal_that_is_too_small_is_told_so() -> None:
    assert "at least" in plain(page(world_with(), [], "", 60, 20, False))[0]
    narrow = ["This terminal is 40 x 15; at least 66 x", "23 is needed."]
    assert plain(page(world_with(), [], "", 40, 15, False)) == narrow
    assert plain(page(world_with(), [], "", 10, 2, False)) == ["This", "terminal"]
    assert plain(page(world_with(), [], "", 0, 1, False)) == ["T"]


def test_colour_changes_no_character() -> None:
    line: Line = [("ab", "1;36"), ("c", "")]
    assert text_of(line, colour=True) == "\x1b[1;36mab\x1b[mc"
    assert text_of(line, colour=False) == "abc"


@pytest.mark.parametrize("ascii_only", [False, True])
def test_a_trail_shows_where_both_have_been_and_covers_nothing(ascii_only: bool) -> None:
    world = world_with()
    robot, ball = [(-0.8 + 0.05 * k, -0.5) for k in range(20)], [(0.2, -0.7 + 0.05 * k) for k in range(20)]
    before = plain(field_picture(world, 49, 23, ascii_only))
    after = plain(field_picture(world, 49, 23, ascii_only, Trail(robot, ball)))
    changed = [
        (old, new) for lines in zip(before, after, strict=True) for old, new in zip(*lines, strict=True) if old != new
    ]
    assert len(changed) > 15
    assert all(old == " " for old, _ in changed) or not ascii_only
    if ascii_only:
        assert {new for _, new in changed} == {".", ","}
