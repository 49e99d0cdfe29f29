"""The inputs that only soccer's critic sees: the world state. They make the critic asymmetric.

Asymmetric actor-critic (Pinto et al. 2018, arXiv 1710.06542): V is needed only while learning, so it may see inputs on
which the weights must not depend: where ball and robot are, and how the ball rolls. `fbql_world_tilings` 0 leaves them
out.
"""

from __future__ import annotations

from fbql_common.core.kernels import kernel
from fbql_common.core.types import World

WIDTHS: tuple[tuple[float, ...], ...] = (
    (0.16, 0.16, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.35, 0.35, 0.35, 0.35, 0.0, 0.0, 0.0, 0.0),
    (0.30, 0.0, 0.0, 0.0, 0.20, 0.20, 0.0, 0.0),
    (0.30, 0.30, 0.0, 0.0, 0.0, 0.0, 0.30, 0.30),
)
"""Widths of the tiles along each component of `critic_inputs` [m, m/s], 0 where a tiling leaves it out: the ball; ball and robot;
the ball along the field, and the robot from it; the ball and its velocity."""
CRITIC_INPUTS = len(WIDTHS[0])


@kernel
def critic_numbers(
    ball_x: float, ball_y: float, robot_x: float, robot_y: float, ball_vx: float, ball_vy: float, mirror: bool
) -> tuple[float, float, float, float, float, float, float, float]:
    """Ball x, y, robot x, y, robot from ball x, y [m], the ball's velocity x, y [m/s], in the frame `field`.

    With `mirror`, situations that mirror each other (left and right) become equal: both as if the ball's y were above
    0.
    """
    from_x, from_y = robot_x - ball_x, robot_y - ball_y
    if mirror and ball_y < 0.0:
        return ball_x, -ball_y, robot_x, -robot_y, from_x, -from_y, ball_vx, -ball_vy
    return ball_x, ball_y, robot_x, robot_y, from_x, from_y, ball_vx, ball_vy


_numbers = critic_numbers.function
"""The plain function: real steps never run compiled."""


def critic_inputs(world: World, mirror: bool) -> tuple[float, ...]:
    """`critic_numbers` of a world state."""
    return _numbers(
        world.ball_x_m,
        world.ball_y_m,
        world.robot_x_m,
        world.robot_y_m,
        world.ball_vx_m_s,
        world.ball_vy_m_s,
        mirror,
    )
