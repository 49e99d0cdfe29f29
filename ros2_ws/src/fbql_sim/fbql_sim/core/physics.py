"""The bodies and their motion: robot, ball and walls in a pymunk space.

Velocities are set before each step and the solved ones are read back, so a robot that a wall has stopped starts again
from standstill. Only this module reads and sets bodies through pymunk's C functions: its attributes build a vector object
per access, which would take several times as long as the physics.
"""

from __future__ import annotations

from importlib import import_module
from math import ceil, cos, exp, sin
from typing import Any, NamedTuple

import pymunk
from fbql_common.core.field import AXLE_M, BALL_RADIUS_M, MAX_WHEEL_RAD_S, ROBOT_SIDE_M, WHEEL_RADIUS_M
from fbql_common.core.geometry import wrap_angle

from fbql_sim.core.arena import wall_blocks
from fbql_sim.core.parameters import SimulationParameters

C: Any = import_module("pymunk._chipmunk_cffi").lib
"""pymunk's C functions; they have no type declarations."""
get_position, get_velocity, get_angle, get_spin = (
    C.cpBodyGetPosition,
    C.cpBodyGetVelocity,
    C.cpBodyGetAngle,
    C.cpBodyGetAngularVelocity,
)
set_velocity, set_spin, advance = C.cpBodySetVelocity, C.cpBodySetAngularVelocity, C.cpSpaceStep

ROBOT, BALL, WALL = 1, 2, 3
"""Collision types."""

SLOP_M = 0.0001
"""Overlap the solver leaves between bodies in contact, so that contacts persist [m]."""
OVERLAP_LOSS_1_S = 160.0
"""Rate at which a deeper overlap is undone [1/s]: half of it in 1/240 s (pymunk's default takes 0.11 s)."""


class Start(NamedTuple):
    """Where robot and ball stand at the start of an episode [m, rad], and how they move there, if at all [m/s, rad/s]."""

    robot_x_m: float
    robot_y_m: float
    robot_yaw_rad: float
    ball_x_m: float
    ball_y_m: float
    ball_vx_m_s: float = 0.0
    ball_vy_m_s: float = 0.0
    robot_speed_m_s: float = 0.0
    """Along the heading."""
    robot_yaw_rate_rad_s: float = 0.0


class Physics:
    """Robot and ball between the walls; knows nothing of goals, episodes or noise.

    After `reset` and each `step` the attributes hold the solved state: robot_x_m, robot_y_m, robot_yaw_rad in
    (-pi, pi], robot_speed_m_s (along the heading), robot_slip_m_s (to the left of it), robot_yaw_rate_rad_s,
    ball_x_m, ball_y_m, ball_vx_m_s, ball_vy_m_s, and robot_touched_wall: whether it did at any time in the step.
    """

    def __init__(self, parameters: SimulationParameters) -> None:
        self._parameters = parameters
        substeps = ceil(parameters.dt_s / parameters.physics_step_s - 1e-9)  # 1/60 by 1/240 is 4, not 4 and a bit
        self._substeps = range(substeps)
        self._substep_s = parameters.dt_s / substeps
        self._keep = exp(-parameters.ball_roll_loss_1_s * parameters.dt_s)
        self._rest_squared = parameters.ball_rest_speed_m_s**2
        self._speed_change = parameters.wheel_acceleration_m_s2 * parameters.dt_s
        self._slip_change = parameters.lateral_grip_m_s2 * parameters.dt_s
        self.reset(Start(0.0, 0.0, 0.0, 0.5, 0.0))

    def reset(self, start: Start) -> None:
        """Puts robot and ball at their start, in a new space.

        A space remembers contacts and the order of its shapes, but an episode must not depend on those before it.
        """
        parameters = self._parameters
        self._space = space = pymunk.Space()
        space.collision_slop = SLOP_M
        space.collision_bias = exp(-OVERLAP_LOSS_1_S)  # pymunk wants the share left after 1 s
        self._robot_body = robot = pymunk.Body(
            parameters.robot_mass_kg, pymunk.moment_for_box(parameters.robot_mass_kg, (ROBOT_SIDE_M, ROBOT_SIDE_M))
        )
        robot.position, robot.angle = (start.robot_x_m, start.robot_y_m), start.robot_yaw_rad
        if speed := start.robot_speed_m_s:
            robot.velocity = (speed * cos(start.robot_yaw_rad), speed * sin(start.robot_yaw_rad))
        robot.angular_velocity = start.robot_yaw_rate_rad_s
        ball_moment = 0.4 * parameters.ball_mass_kg * BALL_RADIUS_M**2
        self._ball_body = ball = pymunk.Body(parameters.ball_mass_kg, ball_moment)
        ball.position = (start.ball_x_m, start.ball_y_m)
        ball.velocity = (start.ball_vx_m_s, start.ball_vy_m_s)
        # pymunk multiplies the two shapes' coefficients: with 1 for the ball the others are the pairs' own
        robot_shape = pymunk.Poly.create_box(robot, (ROBOT_SIDE_M, ROBOT_SIDE_M))
        _set_material(robot_shape, ROBOT, parameters.ball_robot_restitution, parameters.ball_robot_friction)
        ball_shape = pymunk.Circle(ball, BALL_RADIUS_M)
        _set_material(ball_shape, BALL, 1.0, 1.0)
        walls = [pymunk.Poly(space.static_body, block) for block in wall_blocks()]
        for wall in walls:
            _set_material(wall, WALL, parameters.ball_wall_restitution, parameters.ball_wall_friction)
        space.add(robot, robot_shape, ball, ball_shape, *walls)
        self._contacts = contacts = _WallContacts()
        space.on_collision(ROBOT, WALL, begin=contacts.begin, separate=contacts.end)
        self._c_space, self._c_robot, self._c_ball = _pointers(space, robot, ball)
        self._read()

    def step(self, left_rad_s: float, right_rad_s: float) -> None:
        """Advances by dt under wheel velocities [rad/s], which are clipped to ±MAX_WHEEL_RAD_S."""
        left = WHEEL_RADIUS_M * _limited(left_rad_s, -MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S)
        right = WHEEL_RADIUS_M * _limited(right_rad_s, -MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S)
        # each wheel's ground speed changes from the solved one by no more than the acceleration allows
        limit = self._speed_change
        speed, turn = self.robot_speed_m_s, self.robot_yaw_rate_rad_s * (AXLE_M / 2)
        now_left, now_right = speed - turn, speed + turn
        left = _limited(left, now_left - limit, now_left + limit)
        right = _limited(right, now_right - limit, now_right + limit)
        speed = (left + right) / 2
        # the grip of the wheels reduces sideways speed, as far as it can
        slip, grip = self.robot_slip_m_s, self._slip_change
        slip = slip - grip if slip > grip else slip + grip if slip < -grip else 0.0
        cosine, sine = self._cosine, self._sine
        robot, ball, space = self._c_robot, self._c_ball, self._c_space
        set_velocity(robot, (speed * cosine - slip * sine, speed * sine + slip * cosine))
        set_spin(robot, (right - left) / AXLE_M)

        vx, vy = self.ball_vx_m_s, self.ball_vy_m_s
        if vx or vy:
            keep = self._keep if vx * vx + vy * vy >= self._rest_squared else 0.0
            set_velocity(ball, (vx * keep, vy * keep))
            set_spin(ball, get_spin(ball) * keep)

        contacts = self._contacts
        contacts.touched = contacts.count > 0
        substep_s = self._substep_s
        for _ in self._substeps:
            advance(space, substep_s)
        self._read()

    def _read(self) -> None:
        robot, ball = self._c_robot, self._c_ball
        position, velocity, angle = get_position(robot), get_velocity(robot), get_angle(robot)
        cosine, sine = cos(angle), sin(angle)
        vx, vy = velocity.x, velocity.y
        self._cosine, self._sine = cosine, sine
        self.robot_x_m, self.robot_y_m = position.x, position.y
        self.robot_yaw_rad = wrap_angle(angle)
        self.robot_speed_m_s = vx * cosine + vy * sine
        self.robot_slip_m_s = vy * cosine - vx * sine
        self.robot_yaw_rate_rad_s = get_spin(robot)
        position, velocity = get_position(ball), get_velocity(ball)
        self.ball_x_m, self.ball_y_m = position.x, position.y
        self.ball_vx_m_s, self.ball_vy_m_s = velocity.x, velocity.y
        self.robot_touched_wall = self._contacts.touched


class _WallContacts:
    """The robot's contacts with walls in one space.

    Each space has its own counter: a space ends its contacts when it is freed, possibly during a later episode.
    """

    def __init__(self) -> None:
        self.count = 0
        self.touched = False

    def begin(self, _arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: object) -> None:
        self.count += 1
        self.touched = True

    def end(self, _arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: object) -> None:
        self.count -= 1


def _limited(value: float, low: float, high: float) -> float:
    """Within [low, high]; several times as fast as min and max."""
    return low if value < low else high if value > high else value


def _set_material(shape: pymunk.Shape, collision_type: int, elasticity: float, friction: float) -> None:
    shape.collision_type, shape.elasticity, shape.friction = collision_type, elasticity, friction


def _pointers(space: pymunk.Space, robot: pymunk.Body, ball: pymunk.Body) -> tuple[Any, Any, Any]:
    """The C objects behind pymunk's; they live as long as those do."""
    typed: list[Any] = [space, robot, ball]
    return typed[0]._space, typed[1]._body, typed[2]._body
