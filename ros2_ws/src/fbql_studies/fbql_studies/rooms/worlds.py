"""The two worlds that a room can be driven in: IR-SIM and its twin."""

from __future__ import annotations

import tempfile
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from math import cos, sin
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import yaml
from fbql_common.checkout import how_to_install
from fbql_common.core.errors import BadInput

from fbql_studies.rooms.maps import Room
from fbql_studies.rooms.robot import BEAMS, PERIOD_S, RADIUS_M, RANGE_M, SPACE, Reading, reading_of
from fbql_studies.rooms.scan import collides, distances, edges_of, moved, scan


class World(Protocol):
    """A robot in a room."""

    def reset(self, room: Room) -> Reading:
        """Puts the robot at the start of a room."""
        ...

    def step(self, v: float, w: float) -> Reading:
        """Drives for one period (m/s, rad/s)."""
        ...


class TwinWorld:
    """The twin.

    Args:
        noise_m: standard deviation of each range that hits something.
    """

    def __init__(self, noise_m: float = 0.0) -> None:
        self._noise_m = noise_m

    def reset(self, room: Room) -> Reading:
        """Puts the robot at the start of a room."""
        self._generator = np.random.default_rng(room.seed)
        self._goal = room.goal
        self._edges = edges_of(room.obstacles)
        self._pose = room.start
        self._step = 0
        return self._read()

    def step(self, v: float, w: float) -> Reading:
        """Drives for one period (m/s, rad/s)."""
        self._pose = moved(*self._pose, v, w, PERIOD_S)
        self._step += 1
        return self._read()

    def _read(self) -> Reading:
        x, y, yaw = self._pose
        near = distances(self._edges, x, y)
        ranges = scan(self._edges, near, x, y, cos(yaw), sin(yaw))
        if self._noise_m:
            hits = ranges < RANGE_M
            count = int(hits.sum())
            drawn = self._generator.normal(0.0, self._noise_m, count + int(hits[0]))  # IR-SIM's beam 73 is the first
            ranges[hits] += drawn[:count]
            ranges = np.minimum(np.maximum(ranges, 0.0), RANGE_M)
        return reading_of(self._step, self._pose, ranges, self._goal, bool(collides(self._edges, near, x, y, yaw)))


class IrSimWorld:
    """IR-SIM, in which a room becomes an environment of its own.

    Args:
        noise_m: as for the twin, from a generator with the same seed.

    Raises:
        BadInput: IR-SIM is not installed.
    """

    def __init__(self, noise_m: float = 0.0) -> None:
        self._noise_m = noise_m
        try:
            with redirect_stdout(StringIO()), redirect_stderr(StringIO()):  # it prints about keyboards that it lacks
                import irsim
        except ModuleNotFoundError as error:
            if error.name != "irsim":
                raise
            raise BadInput(f"this needs IR-SIM, which is not installed: {how_to_install('rooms')}") from None
        self._irsim: Any = irsim

    def reset(self, room: Room) -> Reading:
        """Puts the robot at the start of a room."""
        self._goal = room.goal
        self._step = 0
        with tempfile.TemporaryDirectory() as directory:
            path = Path(directory, "room.yaml")
            path.write_text(yaml.safe_dump(as_irsim(room, self._noise_m)))
            self._world = self._irsim.make(str(path), headless=True, log_level="CRITICAL", seed=room.seed)
        return self._read()

    def step(self, v: float, w: float) -> Reading:
        """Drives for one period (m/s, rad/s)."""
        self._world.step(np.array([[v], [w]]))
        self._step += 1
        return self._read()

    def _read(self) -> Reading:
        robot = self._world.robot
        x, y, yaw = robot.state[:3, 0].tolist()
        ranges = robot.get_lidar_scan()["ranges"][:BEAMS].copy()
        return reading_of(self._step, (x, y, yaw), ranges, self._goal, bool(robot.collision_flag))


def as_irsim(room: Room, noise_m: float) -> dict[str, Any]:
    """A room as IR-SIM's YAML describes it."""
    limits = [(axis.low, axis.high) for axis in SPACE.axes]
    lidar = {
        "name": "lidar2d",
        "range_min": 0.0,
        "range_max": RANGE_M,
        "angle_range": 2.0 * np.pi,
        "number": BEAMS + 1,  # the last beam is the first one again
        "noise": noise_m > 0.0,
        "std": noise_m,
    }
    robot = {
        "kinematics": {"name": "diff"},
        "shape": {"name": "circle", "radius": RADIUS_M},
        "state": list(room.start),
        "goal": [*room.goal, 0.0],
        "vel_min": [low for low, _ in limits],
        "vel_max": [high for _, high in limits],
        "sensors": [lidar],
    }
    obstacles = [
        {"shape": {"name": "polygon", "vertices": [list(corner) for corner in polygon]}, "state": [0.0, 0.0, 0.0]}
        for polygon in room.obstacles
    ]
    world = {"height": 14, "width": 14, "offset": [-2, -2], "step_time": PERIOD_S, "sample_time": PERIOD_S}
    return {"world": world, "robot": [robot], "obstacle": obstacles}
