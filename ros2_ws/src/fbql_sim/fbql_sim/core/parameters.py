"""Every adjustable constant of the simulator: default, unit, bounds and meaning."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import parameter


@dataclass(frozen=True)
class SimulationParameters:
    """Parameters of the physics and the task; the field's dimensions are in fbql_common.core.field.

    "Logs" below are the 12 FIRA 2019 match logs; their cycle is taken as 1/40 s, the rate of the paper's era.
    """

    dt_s: float = parameter(1 / 60, "duration of a step", unit="s", low=0.001, high=0.05)
    physics_step_s: float = parameter(
        1 / 240, "a step is divided into equal physics steps no longer than this", unit="s", low=0.0001, high=1 / 120
    )
    max_steps: int = parameter(4000, "steps after which an episode is truncated", low=1, high=10_000_000)

    robot_mass_kg: float = parameter(0.6, "mass of the robot", unit="kg", low=0.05, high=5.0)
    # Logs: full speed builds up over 10-16 cycles; from 0 to 1.76 m/s this takes 11.7.
    wheel_acceleration_m_s2: float = parameter(
        6.0, "limit of a wheel's acceleration along the ground", unit="m/s^2", low=0.1, high=100.0
    )
    # No source: holds every turn at 1 m/s up to 15 rad/s, slides in faster ones.
    lateral_grip_m_s2: float = parameter(
        15.0, "deceleration by which the wheels stop sideways sliding", unit="m/s^2", low=0.0, high=1000.0
    )

    ball_mass_kg: float = parameter(0.046, "mass of the ball", unit="kg", low=0.001, high=1.0)
    # Logs: a rolling ball keeps a median 0.9916 of its speed per cycle, and exp(-0.3374 / 40) = 0.9916.
    ball_roll_loss_1_s: float = parameter(
        0.3374, "rate at which the rolling ball loses speed", unit="1/s", low=0.0, high=100.0
    )
    ball_rest_speed_m_s: float = parameter(
        0.01, "speed below which the ball comes to rest", unit="m/s", low=0.0, high=0.1
    )

    # Logs: 0.450 (quartiles 0.446, 0.458), from speeds a moment before and after the bounce. Rolling loses 0.56 % of
    # the speed in a step of 1/60 s, so the bounce itself keeps a little more: 0.4525 measures as 0.4500.
    ball_wall_restitution: float = parameter(
        0.4525, "share of its speed that the ball keeps when it bounces off a wall", low=0.0, high=1.0
    )
    # The other coefficients have no source. Friction of ball and robot makes the game harder. The robot and the walls
    # have the products of their coefficients towards the ball: they hardly bounce, and do not stick to each other.
    ball_robot_restitution: float = parameter(
        0.2, "share of the relative speed that the ball keeps when it bounces off the robot", low=0.0, high=1.0
    )
    ball_wall_friction: float = parameter(0.2, "friction coefficient of ball and wall", low=0.0, high=2.0)
    ball_robot_friction: float = parameter(0.05, "friction coefficient of ball and robot", low=0.0, high=2.0)

    start_distance_low_m: float = parameter(
        0.05, "robot's least distance to its goal line", unit="m", low=0.04, high=0.5
    )
    start_distance_high_m: float = parameter(
        0.15, "robot's largest distance to its goal line", unit="m", low=0.04, high=2.15
    )
    start_robot_y_jitter_m: float = parameter(
        0.05, "largest |y| of the robot at the start", unit="m", low=0.0, high=0.85
    )
    start_yaw_jitter_rad: float = parameter(
        0.2, "largest |yaw| of the robot at the start", unit="rad", low=0.0, high=3.2
    )
    start_ball_jitter_m: float = parameter(
        0.05, "ball's largest distance to its spot along x and along y", unit="m", low=0.0, high=0.28
    )
    wheel_gain_deviation: float = parameter(
        0.02, "standard deviation of each wheel's gain, constant in an episode", low=0.0, high=0.2
    )
    wheel_noise_deviation: float = parameter(
        0.02, "standard deviation of each wheel's gain from step to step", low=0.0, high=0.2
    )
    collision_gap_s: float = parameter(
        0.1, "a contact that resumes after a shorter gap is not a new collision", unit="s", low=0.0, high=5.0
    )

    command_delay_s: float = parameter(
        0.0, "time until the wheels follow a command, rounded to whole steps; they stand still before", unit="s",
        low=0.0, high=1.0,
    )  # fmt: skip
    position_noise_m: float = parameter(
        0.0, "standard deviation of the error in each coordinate of robot and ball that the world state has", unit="m",
        low=0.0, high=0.1,
    )  # fmt: skip
    yaw_noise_rad: float = parameter(0.0, "the same of the robot's yaw", unit="rad", low=0.0, high=1.0)
    speed_noise_m_s: float = parameter(
        0.0, "the same of the robot's speed and of each component of the ball's velocity", unit="m/s", low=0.0, high=1.0
    )
    yaw_rate_noise_rad_s: float = parameter(0.0, "the same of the robot's yaw rate", unit="rad/s", low=0.0, high=10.0)
