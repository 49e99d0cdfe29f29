"""Shooting: at full speed, with ball and goal ahead. A behavior in twenty lines; README.md shows how to use it."""

from math import radians

from fbql_behaviors.core.observation import Feature, Observation
from fbql_common.core.field import FIELD
from fbql_common.core.geometry import ball_distance_and_bearing, distance_and_bearing


def sense(world):
    """Bearing of the ball and of the goal's center [rad]."""
    return ball_distance_and_bearing(world)[1], distance_and_bearing(world, FIELD.half_length_m, 0.0)[1]


def shoot(observation):
    """Drives where the ball is pushed at the goal: past the ball's far side by twice the angle between the two."""
    ball, goal = observation
    turn = 60.0 * min(max(ball + 2.0 * (ball - goal), -0.5), 0.5)
    forward = 88.0 - abs(turn)
    return forward - turn, forward + turn


AHEAD = (-radians(20.0), radians(20.0))
shooting = Observation((Feature("ball_bearing", "rad", *AHEAD), Feature("goal_bearing", "rad", *AHEAD)), sense, shoot)
