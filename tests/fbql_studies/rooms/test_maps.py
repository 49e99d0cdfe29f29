"""The rooms: repeatable, solvable, and of the kinds that they say."""

from __future__ import annotations

import itertools
from math import hypot

import numpy as np
import pytest
from fbql_studies.rooms.maps import (
    CLEARANCE_M,
    FAMILIES,
    SIZE_M,
    WALL_M,
    is_solvable,
    rectangle,
    room_of,
    wall_with_gap,
)
from fbql_studies.rooms.scan import distances, edges_of

SEEDS = range(25)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_room_is_the_same_for_the_same_seed_and_no_other(family: str) -> None:
    rooms = [room_of(family, seed) for seed in SEEDS]
    assert rooms[7] == room_of(family, 7)
    assert len({room.obstacles for room in rooms}) == len({room.start for room in rooms}) == len(SEEDS)


@pytest.mark.parametrize("family", FAMILIES)
def test_start_and_goal_are_clear_and_far_from_each_other(family: str) -> None:
    for seed in SEEDS:
        room = room_of(family, seed)
        edges = edges_of(room.obstacles)
        for x, y in (room.start[:2], room.goal):
            assert 0.0 < x < SIZE_M
            assert 0.0 < y < SIZE_M
            assert distances(edges, x, y).min() >= CLEARANCE_M - 0.1
        assert hypot(room.goal[0] - room.start[0], room.goal[1] - room.start[1]) >= 4.0


@pytest.mark.parametrize("family", FAMILIES)
def test_obstacles_are_convex_and_counterclockwise(family: str) -> None:
    for seed in SEEDS:
        for polygon in room_of(family, seed).obstacles:
            corners = np.array(polygon)
            edges = np.roll(corners, -1, axis=0) - corners
            following = np.roll(edges, -1, axis=0)
            assert (edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0] > 0.0).all()


@pytest.mark.parametrize(("gap_m", "solvable"), [(0.7, True), (0.45, False), (0.0, False)])
def test_a_room_is_solvable_if_the_robot_fits_through(gap_m: float, solvable: bool) -> None:
    half = (SIZE_M - gap_m) / 2
    wall = [rectangle(SIZE_M / 2, y, WALL_M, half, 0.0) for y in (half / 2, SIZE_M - half / 2)]
    assert is_solvable(tuple(wall), (2.0, 2.0), (8.0, 8.0)) is solvable
    assert is_solvable(tuple(wall), (2.0, 2.0), (2.0, 8.0))


def test_the_traps_are_a_u_in_six_of_ten_and_a_wall_with_a_gap_in_three_and_a_half() -> None:
    lengths = [[max(hypot(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(p)) for p in room_of("traps", seed).obstacles[4:]] for seed in range(200)]  # fmt: skip
    walls = sum(each[0] + each[1] > 8.0 for each in lengths if len(each) > 1)
    us = sum(len(each) > 2 and each[1] == pytest.approx(each[2]) for each in lengths)
    assert 40 <= walls <= 100
    assert 90 <= us <= 150


def test_a_gap_is_as_wide_as_it_says_and_inside_of_the_room() -> None:
    generator = np.random.default_rng(1)
    for _ in range(50):
        parts = wall_with_gap(*generator.uniform(3.5, 6.5, 2), float(generator.uniform(-3.0, 3.0)), generator)
        ends = [np.array([part[0], part[1], part[2], part[3]]) for part in parts]
        if len(ends) == 2:
            nearest = min(np.hypot(*(a - b)) for a in ends[0] for b in ends[1])
            assert 0.75 - 1e-9 <= nearest <= 1.0 + 1e-9
