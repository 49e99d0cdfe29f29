"""The twin is IR-SIM: the same poses, scans and collisions, with and without noise, compiled or not."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import pairwise
from math import cos, pi, sin

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_studies.rooms.maps import FAMILIES, Room, rectangle, room_of
from fbql_studies.rooms.robot import ANGLES, MAX_STEPS, RADIUS_M, RANGE_M, SPACE, Reading
from fbql_studies.rooms.scan import collides, distances, edges_of, scan
from fbql_studies.rooms.worlds import IrSimWorld, TwinWorld, World

NEAR = 1e-9


def drive(world: World, room: Room, seed: int, steps: int) -> list[Reading]:
    """Readings of a random drive, mostly forwards, until it ends."""
    generator = np.random.default_rng(seed)
    readings = [world.reset(room)]
    while not readings[-1].terminated and len(readings) <= steps:
        readings.append(world.step(*SPACE.limited((generator.uniform(-0.2, 1.0), generator.uniform(-2.0, 2.0)))))
    return readings


@pytest.mark.parametrize("noise_m", [0.0, 0.05])
@pytest.mark.parametrize("family", FAMILIES)
def test_the_twin_drives_as_irsim_does(family: str, noise_m: float) -> None:
    irsim, twin = IrSimWorld(noise_m), TwinWorld(noise_m)
    collisions = 0
    for seed in range(4):
        room = room_of(family, seed)
        theirs, ours = drive(irsim, room, seed, 60), drive(twin, room, seed, 60)
        assert [each.collided for each in ours] == [each.collided for each in theirs]
        for a, b in zip(ours, theirs, strict=True):
            assert np.abs(a.ranges - b.ranges).max() < NEAR
            assert np.allclose(a[1:4] + a[5:7], b[1:4] + b[5:7], rtol=0.0, atol=NEAR)
        collisions += ours[-1].collided
    assert collisions


def test_noise_is_that_of_the_room_and_leaves_beams_that_hit_nothing() -> None:
    room = room_of("traps", 3)
    quiet, noisy, again = (world.reset(room).ranges for world in (TwinWorld(), TwinWorld(0.05), TwinWorld(0.05)))
    hits = quiet < RANGE_M
    assert 0 < hits.sum() < len(hits)
    assert (noisy == again).all()
    assert (noisy[~hits] == RANGE_M).all()
    assert 0.02 < np.std((noisy - quiet)[hits & (noisy < RANGE_M)]) < 0.08


def test_a_scan_is_what_a_slow_search_along_each_beam_finds() -> None:
    room = room_of("doors", 5)
    x, y, yaw = room.start
    edges = edges_of(room.obstacles)
    ranges = scan(edges, distances(edges, x, y), x, y, cos(yaw), sin(yaw))
    for angle, found in zip(ANGLES, ranges, strict=True):
        along = np.arange(0.0, RANGE_M, 0.002)
        points = np.array([x, y]) + along[:, None] * np.array([cos(yaw + angle), sin(yaw + angle)])
        inside = [along[k] for k in range(len(along)) if any(_holds(p, points[k]) for p in room.obstacles)][:1]
        assert found == pytest.approx(inside[0] if inside else RANGE_M, abs=0.005)


def _holds(polygon: tuple[tuple[float, float], ...], point: np.ndarray) -> bool:
    """Whether a point is inside of a convex polygon."""
    x, y = point
    return all(
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) >= 0 for a, b in pairwise((*polygon, polygon[0]))
    )


@pytest.mark.parametrize(("gap_m", "expected"), [(0.001, False), (-0.001, True), (-0.0001, False)])
def test_the_robot_is_a_polygon_of_64_corners(gap_m: float, expected: bool) -> None:
    """Between two corners it reaches .24 mm less far."""
    wall = edges_of([rectangle(1.0 + RADIUS_M + 0.5 + gap_m, 1.0, 1.0, 0.0001, 0.0)])
    between = pi / 64
    assert collides(wall, distances(wall, 1.0, 1.0), 1.0, 1.0, between) is expected


def test_an_episode_ends_at_the_limit() -> None:
    world = TwinWorld()
    reading = world.reset(room_of("traps", 1))
    while not (reading.terminated or reading.truncated):
        reading = world.step(0.0, 1.0)
    assert reading.step == MAX_STEPS
    assert reading.truncated
    assert not reading.terminated


def test_without_irsim_one_line_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "irsim", None)
    with pytest.raises(BadInput, match="IR-SIM, which is not installed: "):
        IrSimWorld()


def test_compiled_and_interpreted_the_same_bits_come_out() -> None:
    program = (
        "from fbql_common.core.kernels import prepare\n"
        "from fbql_studies.rooms.maps import room_of\n"
        "from fbql_studies.rooms.play import by_priorities\n"
        "from fbql_studies.rooms.priorities import settings\n"
        "from fbql_studies.rooms.scan import scan\n"
        "from fbql_studies.rooms.worlds import TwinWorld\n"
        "prepare()\n"
        "rooms = [room_of('traps', seed) for seed in range(3)]\n"
        "ends = [end for each in settings(3, 1) for end in by_priorities(each, TwinWorld(0.05), rooms)]\n"
        "readings = TwinWorld().reset(rooms[0])\n"
        "print(scan.is_compiled, ends, readings.ranges.tolist())\n"
    )
    printed = [
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "FBQL_COMPILE": value},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split(" ", 1)
        for value in ("0", "1")
    ]
    assert [first for first, _ in printed] == ["False", "True"]
    assert printed[0][1] == printed[1][1]
