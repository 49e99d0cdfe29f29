"""The closest wall point against a slow literal search, and the walls' blocks against their segments."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import pytest
from fbql_common.core.field import FIELD
from fbql_common.core.walls import HALF_GOAL, HALF_LENGTH, HALF_WIDTH, POCKET, closest_wall_point
from fbql_sim.core.arena import SEGMENTS, wall_blocks
from hypothesis import example, given
from hypothesis import strategies as st

Point = tuple[float, float]


def closest_on_segment(point: Point, ends: tuple[Point, Point]) -> Point:
    (x, y), ((ax, ay), (bx, by)) = point, ends
    t = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
    t = min(max(t, 0.0), 1.0)
    return ax + t * (bx - ax), ay + t * (by - ay)


def oracle_distance(point: Point) -> float:
    return min(hypot(px - point[0], py - point[1]) for px, py in (closest_on_segment(point, s) for s in SEGMENTS))


def is_inside(point: Point) -> bool:
    x, y = abs(point[0]), abs(point[1])
    in_field = x < HALF_LENGTH and y < HALF_WIDTH and (HALF_LENGTH - x) + (HALF_WIDTH - y) > FIELD.corner_m
    return in_field or (x < POCKET and y < HALF_GOAL)


def in_block(point: Point, block: list[Point]) -> bool:
    signs = set[bool]()
    for (ax, ay), (bx, by) in zip(block, block[1:] + block[:1], strict=True):
        signs.add((bx - ax) * (point[1] - ay) - (by - ay) * (point[0] - ax) > 0)
    return len(signs) == 1


inside_points = st.tuples(st.floats(-POCKET, POCKET), st.floats(-HALF_WIDTH, HALF_WIDTH)).filter(is_inside)


@given(inside_points)
@example((0.0, 0.0))
@example((1.09, 0.0))
@example((1.15, 0.01))
@example((1.05, 0.85))
def test_closest_wall_point_is_the_nearest_of_all_segments(point: Point) -> None:
    x, y, _ = closest_wall_point(*point)
    assert min(hypot(cx - x, cy - y) for cx, cy in (closest_on_segment((x, y), s) for s in SEGMENTS)) < 1e-12
    assert hypot(x - point[0], y - point[1]) == pytest.approx(oracle_distance(point), abs=1e-12)


@given(inside_points)
def test_wall_direction_points_from_the_wall_point_to_the_robot(point: Point) -> None:
    x, y, yaw = closest_wall_point(*point)
    distance = hypot(point[0] - x, point[1] - y)
    assert -pi < yaw <= pi
    assert x + distance * cos(yaw) == pytest.approx(point[0], abs=1e-9)
    assert y + distance * sin(yaw) == pytest.approx(point[1], abs=1e-9)


@pytest.mark.parametrize(
    ("point", "wall", "yaw"),
    [
        ((0.2, 0.5), (0.2, 0.9), -pi / 2),
        ((0.2, -0.5), (0.2, -0.9), pi / 2),
        ((0.9, 0.4), (1.1, 0.4), pi),
        ((0.9, -0.4), (1.1, -0.4), pi),
        ((-0.9, 0.4), (-1.1, 0.4), 0.0),
        ((-0.9, -0.4), (-1.1, -0.4), 0.0),
        ((1.015, 0.815), (1.065, 0.865), -3 * pi / 4),
        ((1.18, 0.05), (1.2, 0.05), pi),
        ((1.12, 0.17), (1.12, 0.2), -pi / 2),
        ((1.07, 0.16), (1.1, 0.2), -2.2142974355881810),
    ],
)
def test_closest_wall_point_at_places_computed_by_hand(point: Point, wall: Point, yaw: float) -> None:
    assert closest_wall_point(*point) == pytest.approx((*wall, yaw), abs=1e-12)


@given(st.sampled_from([-1, 1]), st.floats(-0.19, 0.19), st.floats(0.0, 0.3))
def test_a_goal_mouth_is_not_wall(side: int, y: float, before: float) -> None:
    x, wall_y, _ = closest_wall_point(side * (HALF_LENGTH - before), y)
    assert not (abs(x) == pytest.approx(HALF_LENGTH) and abs(wall_y) < HALF_GOAL - 1e-12)


def test_every_segment_is_a_face_of_a_block_and_no_block_reaches_inside() -> None:
    blocks = wall_blocks()
    for (ax, ay), (bx, by) in SEGMENTS:
        length = hypot(bx - ax, by - ay)
        for share in (0.01, 0.3, 0.7, 0.99):
            x, y = ax + share * (bx - ax), ay + share * (by - ay)
            normal = ((by - ay) / length * 1e-6, -(bx - ax) / length * 1e-6)
            sides = [(x + sign * normal[0], y + sign * normal[1]) for sign in (1, -1)]
            inner = [side for side in sides if is_inside(side)]
            outer = [side for side in sides if not is_inside(side)]
            assert len(inner) == len(outer) == 1
            assert not any(in_block(inner[0], block) for block in blocks)
            assert any(in_block(outer[0], block) for block in blocks)
