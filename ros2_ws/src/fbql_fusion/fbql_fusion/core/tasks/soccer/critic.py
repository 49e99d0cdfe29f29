"""The inputs that only soccer's critic sees: the world state. They make the critic asymmetric.

Asymmetric actor-critic (Pinto et al. 2018, arXiv 1710.06542): V is needed only while learning, so it may see inputs on
which the weights must not depend: where ball and robot are, and how the ball rolls. `fbql_world_tilings` 0 leaves them
out.
"""

from __future__ import annotations

from fbql_common.core.types import World

WIDTHS: tuple[tuple[float, ...], ...] = (
    (0.16, 0.16, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.35, 0.35, 0.35, 0.35, 0.0, 0.0, 0.0, 0.0),
    (0.30, 0.0, 0.0, 0.0, 0.20, 0.20, 0.0, 0.0),
    (0.30, 0.30, 0.0, 0.0, 0.0, 0.0, 0.30, 0.30),
)
"""Widths of the tiles along each component of `critic_inputs` [m, m/s], 0 where a tiling leaves it out: the ball; ball and robot;
the ball along the field, and the robot from it; the ball and its velocity."""
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
