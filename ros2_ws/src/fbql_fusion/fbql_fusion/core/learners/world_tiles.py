"""The critic's inputs in addition to what the behaviors sense: tilings of the world state. It makes the critic
asymmetric.

Asymmetric actor-critic (Pinto et al. 2018, arXiv 1710.06542): V is needed only while learning, so it may see inputs on
which the weights must not depend: where ball and robot are, and how the ball rolls. `fbql_world_tilings` 0 leaves them
out.
"""

from __future__ import annotations

import numpy as np
from fbql_common.core.types import World

from fbql_fusion.core.learners.tilings import Tilings

_FIRST = 1_000_001
"""Keeps the keys different from those of the sensed values."""
GROUPS: tuple[tuple[float, ...], ...] = (
    (0.16, 0.16, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.35, 0.35, 0.35, 0.35, 0.0, 0.0, 0.0, 0.0),
    (0.30, 0.0, 0.0, 0.0, 0.20, 0.20, 0.0, 0.0),
    (0.30, 0.30, 0.0, 0.0, 0.0, 0.0, 0.30, 0.30),
)
"""Widths of the tiles along each component of `critic_inputs` [m, m/s], 0 where a tiling leaves it out: the ball; ball and robot;
the ball along the field, and the robot from it; the ball and its velocity."""
FAR = 1e6
"""Larger numbers [m, m/s] can't belong to a world state, and their tiles could not be counted."""
_ACROSS = (1, 3, 5, 7)
"""The components that change their sign in the mirror."""


def critic_inputs(world: World, mirror: bool) -> tuple[float, ...]:
    """Ball x, y, robot x, y, robot from ball x, y [m], the ball's velocity x, y [m/s], in the frame `field`.

    With `mirror`, situations that mirror each other (left and right) become equal: both as if the ball's y were above
    0.
    """
    x, y = world.ball_x_m, world.ball_y_m
    values = [
        x,
        y,
        world.robot_x_m,
        world.robot_y_m,
        world.robot_x_m - x,
        world.robot_y_m - y,
        world.ball_vx_m_s,
        world.ball_vy_m_s,
    ]
    if mirror and y < 0.0:
        for i in _ACROSS:
            values[i] = -values[i]
    return tuple(values)


def world_tiles(tilings: int) -> Tilings:
    """That many tilings for each of GROUPS: tiling t is shifted by t (2 c + 1) / tilings of a tile along component c. 1 and
    odd numbers to 15 leave some component unshifted.
    """
    d = len(GROUPS[0])
    odd = 2.0 * np.arange(d) + 1.0
    widths = [np.array(group) for group in GROUPS for _ in range(tilings)]
    sizes = [np.divide(1.0, each, out=np.zeros(d), where=each > 0.0) for each in widths]
    shifts = [np.mod(odd * t / tilings, 1.0) for _ in GROUPS for t in range(tilings)]
    return Tilings.of(sizes, shifts, d, _FIRST)
