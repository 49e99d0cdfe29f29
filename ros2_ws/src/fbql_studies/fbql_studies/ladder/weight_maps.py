"""The weights that were learned, over the field: the ball lies still, the robot stands at every place in a few headings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from typing import Any

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.field import FIELD
from fbql_common.core.types import World
from fbql_common.core.walls import closest_wall_point
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession

from fbql_studies.common.methods import FBQL

BALL_M = (0.4, 0.3)
HEADINGS_RAD = (0.0, pi / 2, pi)
SPACING_M = 0.075


def weight_maps(fusion: FusionParameters, policy: Policy, behaviors: Sequence[Behavior]) -> dict[str, Any]:
    """The weights [%] of each behavior at every place.

    Returns:
        behaviors: names; ball_m: x, y; x_m, y_m: the places; headings_rad;
        weights: [heading][y][x][behavior], integers that sum to about 100.
    """
    play = {"play": "blended", "play_s": 0.0, "patience": 0}
    # what a learner does not have of its own it shares with fbql
    own = {name: f"{fusion.controller}_{name}" for name in play}
    changes = {own[name] if hasattr(fusion, own[name]) else f"{FBQL}_{name}": value for name, value in play.items()}
    blended = replace(fusion, learn=False, guided=0, episodes=1, goals=0, **changes)
    session = SoccerSession(blended, policy)
    begun = session.next_episode()
    assert begun is not None
    x_m, y_m = (_places(half) for half in (FIELD.half_length_m, FIELD.half_width_m))
    step = 0
    maps: list[list[list[list[int]]]] = []
    for heading in HEADINGS_RAD:
        rows: list[list[list[int]]] = []
        for y in y_m:
            row: list[list[int]] = []
            for x in x_m:
                world = _standing(begun[0], step, x, y, heading)
                _, decision = session.decide(world, [behavior.answer(world) for behavior in behaviors])
                row.append([round(100 * weight) for weight in decision.weights])
                step += 1
            rows.append(row)
        maps.append(rows)
    return {
        "behaviors": list(fusion.behaviors),
        "ball_m": list(BALL_M),
        "x_m": x_m,
        "y_m": y_m,
        "headings_rad": [round(heading, 4) for heading in HEADINGS_RAD],
        "weights": maps,
    }


def _places(half: float) -> list[float]:
    """Places across the field, SPACING_M apart, symmetric and none at a wall."""
    count = int(2 * half / SPACING_M)
    return [round((i - (count - 1) / 2) * SPACING_M, 4) for i in range(count)]


def _standing(episode: int, step: int, x_m: float, y_m: float, yaw_rad: float) -> World:
    """The world state in which everything stands still."""
    return World(
        step, episode, step, x_m, y_m, yaw_rad, 0.0, 0.0, *BALL_M, 0.0, 0.0, *closest_wall_point(x_m, y_m),
        False, False, False, False, False, False,
    )  # fmt: skip
