"""Fits the world model to the real steps so far."""

from __future__ import annotations

from math import cos, pi, sin, tau

import numpy as np
from fbql_common.core.field import AXLE_M, MAX_WHEEL_RAD_S, WHEEL_RADIUS_M
from fbql_common.core.kernels import kernel
from fbql_common.core.walls import closest_wall
from numpy.typing import NDArray

from fbql_fusion.core.learners.linear import Floats
from fbql_fusion.core.tasks.soccer.world_model.ball import Rolling, fit_rolling
from fbql_fusion.core.tasks.soccer.world_model.forest import fit_forest
from fbql_fusion.core.tasks.soccer.world_model.model import EMPTY, FOREST, NEIGHBOURS, REGIONS, WorldModel
from fbql_fusion.core.tasks.soccer.world_model.neighbours import fit_neighbours
from fbql_fusion.core.tasks.soccer.world_model.parameters import FAMILIES, WorldModelParameters
from fbql_fusion.core.tasks.soccer.world_model.real_steps import RealSteps, Transitions
from fbql_fusion.core.tasks.soccer.world_model.robot import Wheels, fit_wheels

LEAST_STEPS = 100
"""The fewest real steps that a model is fitted to."""
_FAR_QUANTILE = 0.995
_RIDGE = 1e-9
_EXCEEDS = 3.0
"""A body counts as free where its error stays below so many times this quantile of the errors of bodies that are certainly
free."""
_SETTLED_M_S, _FAST_M_S, _SETTLED_STEPS = 0.08, 0.3, 30
"""A wheel has settled if its speed is this close to the commanded one; from this speed on it is fast enough to measure; and an
episode counts if it has this many such steps."""


@kernel
def walls_near(places: Floats) -> Floats:
    """Distance of the closest wall [m] and its normal, for each of N places, [N, 2] -> [N, 3]."""
    found = np.empty((len(places), 3))
    for i in range(len(places)):
        x, y, normal_x, normal_y, _ = closest_wall(places[i, 0], places[i, 1])
        found[i, 0] = (places[i, 0] - x) * normal_x + (places[i, 1] - y) * normal_y
        found[i, 1] = normal_x
        found[i, 2] = normal_y
    return found


def can_fit(steps: RealSteps) -> bool:
    """Whether enough has been seen for a fit."""
    return len(steps) >= LEAST_STEPS


def fit(steps: RealSteps, parameters: WorldModelParameters, generator: np.random.Generator) -> WorldModel:
    """Fits a model to the real steps, at least LEAST_STEPS.

    Args:
        generator: of the trees' thresholds.
    """
    real = steps.transitions()
    gap_steps = fitted_gap(real)
    gain_deviation = parameters.model_gain_deviation
    if gain_deviation < 0.0:
        gain_deviation = fitted_gain_deviation(real)
    if parameters.model_mirror:
        real = with_mirror_image(real)
    family = FAMILIES.index(parameters.model_family)
    seen = _Seen(real)
    if family == REGIONS:
        model = _fit_regions(seen, parameters, generator)
    else:
        model = _fit_whole(seen, family, parameters, generator)
    return model._replace(gap_steps=gap_steps, gain_deviation=gain_deviation)


def mirrored(states: Floats) -> Floats:
    """The mirror image, left and right, of states [N, 9]."""
    return states * np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def with_mirror_image(real: Transitions) -> Transitions:
    """The steps, and after them their mirror image."""
    return Transitions(
        np.concatenate([real.before, mirrored(real.before)]),
        np.concatenate([real.commands, real.commands[:, ::-1]]),
        np.concatenate([real.after, mirrored(real.after)]),
        np.concatenate([real.touched, real.touched]),
        np.concatenate([real.collides, real.collides]),
        np.concatenate([real.episode, real.episode]),
    )


class _Seen:
    """N steps as the models see them: commanded ground speeds, distances, and frames."""

    def __init__(self, real: Transitions) -> None:
        before, after = real.before, real.after
        self.before, self.after, self.touched = before, after, real.touched
        self.commanded = WHEEL_RADIUS_M * np.clip(real.commands, -MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S)
        self.speeds = _wheels_of(before)
        self.changes = _wheels_of(after) - self.speeds
        self.cosine, self.sine = directions(before[:, 2])
        self.robot_wall = walls_near(before[:, 0:2].copy())
        self.ball_wall = walls_near(before[:, 5:7].copy())
        self.ball = before[:, 5:7] - before[:, 0:2]
        self.ball_robot_m = np.sqrt((self.ball**2).sum(axis=1))
        self.turn = np.remainder(after[:, 2] - before[:, 2] + pi, tau) - pi

    def in_robots_frame(self, vectors: Floats) -> Floats:
        """Vectors of the field, [N, 2], along the robot's heading and to its left."""
        return rotated(vectors, self.cosine, self.sine)


def directions(angles_rad: Floats) -> tuple[Floats, Floats]:
    """Cosine and sine of each angle, [N] each: not NumPy's own, which differ between processors."""
    angles = angles_rad.tolist()
    return np.array(list(map(cos, angles))), np.array(list(map(sin, angles)))


def rotated(vectors: Floats, axis_x: Floats, axis_y: Floats) -> Floats:
    """Vectors [N, 2] in the frames whose first axes are (axis_x, axis_y), [N]."""
    return np.column_stack(
        [axis_x * vectors[:, 0] + axis_y * vectors[:, 1], axis_x * vectors[:, 1] - axis_y * vectors[:, 0]]
    )


def _wheels_of(states: Floats) -> Floats:
    turn = states[:, 4] * (AXLE_M / 2)
    return np.column_stack([states[:, 3] - turn, states[:, 3] + turn])


def _fit_regions(seen: _Seen, parameters: WorldModelParameters, generator: np.random.Generator) -> WorldModel:
    trees, least, bins = parameters.model_trees, parameters.model_leaf_steps, parameters.model_bins
    errors = seen.commanded - seen.speeds
    robot_moved = np.column_stack([seen.in_robots_frame(seen.after[:, 0:2] - seen.before[:, 0:2]), seen.turn])
    ball_moved = seen.after[:, 5:7] - seen.before[:, 5:7]
    ball_changes = seen.after[:, 7:9] - seen.before[:, 7:9]

    def wheels_where(chosen: NDArray[np.bool_]) -> Wheels:
        return fit_wheels(errors[chosen], seen.changes[chosen], robot_moved[chosen], seen.after[chosen, 3:5], bins)

    def rolling_where(chosen: NDArray[np.bool_]) -> Rolling:
        return fit_rolling(seen.before[chosen, 7:9], seen.after[chosen, 7:9], ball_moved[chosen])

    robot_wall_m, ball_robot_m, ball_wall_m = (
        parameters.model_robot_wall_m,
        parameters.model_ball_robot_m,
        parameters.model_ball_wall_m,
    )
    if robot_wall_m < 0.0:
        wheels = wheels_where(seen.robot_wall[:, 0] > np.median(seen.robot_wall[:, 0]))
        missed = np.abs(seen.changes - np.interp(errors, wheels.errors, wheels.changes)).max(axis=1)
        robot_wall_m = fitted_distance(seen.robot_wall[:, 0], missed)
    if min(ball_robot_m, ball_wall_m) < 0.0:
        far = [m > np.median(m) for m in (seen.ball_robot_m, seen.ball_wall[:, 0])]
        rolling = rolling_where(far[0] & far[1])
        missed = np.abs(ball_changes - (rolling.keep - 1.0) * seen.before[:, 7:9]).max(axis=1)
        if ball_robot_m < 0.0:
            ball_robot_m = fitted_distance(seen.ball_robot_m[far[1]], missed[far[1]])
        if ball_wall_m < 0.0:
            ball_wall_m = fitted_distance(seen.ball_wall[far[0], 0], missed[far[0]])

    near = seen.robot_wall[:, 0] < robot_wall_m
    by_robot = seen.ball_robot_m < ball_robot_m
    by_wall = ~by_robot & (seen.ball_wall[:, 0] < ball_wall_m)
    wheels, rolling = wheels_where(_some(~near)), rolling_where(_some(~by_robot & ~by_wall))

    free = _free_motion(wheels, seen.speeds, errors)
    normal = seen.in_robots_frame(seen.robot_wall[:, 1:3])
    next_m = seen.robot_wall[:, 0] + (normal * free[:, 0:2]).sum(axis=1)
    bearing = -rotated(normal, *directions(free[:, 2]))
    robot_x = np.column_stack([seen.before[:, 3:5], free[:, 3:5], next_m, bearing])
    robot_y = np.column_stack([robot_moved - free[:, 0:3], seen.after[:, 3:5] - free[:, 3:5], seen.touched])

    velocity = rolling.keep * seen.before[:, 7:9]
    moved = rolling.travel_s * seen.before[:, 7:9]
    normal = seen.ball_wall[:, 1:3]
    next_m = seen.ball_wall[:, 0] + (normal * moved).sum(axis=1)
    missed = seen.after[:, 7:9] - velocity, ball_moved - moved
    axis = directions(seen.after[:, 2])
    relative = rotated(velocity, *axis)
    relative[:, 0] -= seen.after[:, 3]
    place = rotated(seen.before[:, 5:7] + moved - seen.after[:, 0:2], *axis)
    ball_x = np.column_stack([place, relative, seen.after[:, 3:5], next_m, rotated(normal, *axis)])
    ball_y = np.column_stack([rotated(each, *axis) for each in missed])
    axis = normal[:, 0], normal[:, 1]
    wall_x = np.column_stack([next_m, rotated(velocity, *axis)])
    wall_y = np.column_stack([rotated(each, *axis) for each in missed])
    return EMPTY._replace(
        family=REGIONS,
        trees=trees,
        known_sizes=parameters.model_known_sizes,
        robot_wall_m=float(robot_wall_m),
        ball_robot_m=float(ball_robot_m),
        ball_wall_m=float(ball_wall_m),
        wheels=wheels,
        rolling=rolling,
        robot_wall=fit_forest(robot_x[near], robot_y[near], trees, least, generator),
        ball_robot=fit_forest(ball_x[by_robot], ball_y[by_robot], trees, least, generator),
        ball_wall=fit_forest(wall_x[by_wall], wall_y[by_wall], trees, least, generator),
    )


def _free_motion(wheels: Wheels, speeds: Floats, errors: Floats) -> Floats:
    """Eq. 21 for N steps: displacement along the heading, to the left, turn, next speed and turn rate, [N, 5]."""
    left, right = (speeds + np.interp(errors, wheels.errors, wheels.changes)).T
    speed, rate = (left + right) / 2, (right - left) / AXLE_M
    return np.column_stack([wheels.advance * speed, wheels.drift * speed * rate, wheels.turn * rate, speed, rate])


def _some(chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The chosen steps, or all if none is chosen."""
    return chosen if chosen.any() else ~chosen


def _fit_whole(
    seen: _Seen, family: int, parameters: WorldModelParameters, generator: np.random.Generator
) -> WorldModel:
    x = np.column_stack([seen.before[:, 0:2], seen.cosine, seen.sine, seen.before[:, 3:9], seen.commanded])
    change = seen.after - seen.before
    change[:, 2] = seen.turn
    y = np.column_stack([change, seen.touched])
    model = EMPTY._replace(family=family, trees=parameters.model_trees, known_sizes=parameters.model_known_sizes)
    if family == FOREST:
        least = min(parameters.model_leaf_steps, len(x) // 2)  # nothing stands in for a forest without a split
        return model._replace(whole=fit_forest(x, y, parameters.model_trees, least, generator))
    if family == NEIGHBOURS:
        return model._replace(neighbours=fit_neighbours(x, y), nearest=parameters.model_neighbours)
    return model._replace(linear=least_squares(np.column_stack([x, np.ones(len(x))]), y))


def least_squares(x: Floats, y: Floats) -> Floats:
    """The weights w with the least square error of x w = y, slightly regularized; not by BLAS, whose results differ between
    processors.

    Args:
        x: [N, d].
        y: [N, m].

    Returns:
        [d, m]
    """
    d = x.shape[1]
    both = np.column_stack([x, y])
    system = np.array([(both * x[:, i : i + 1]).sum(axis=0) for i in range(d)])
    for i in range(d):
        system[i, i] += _RIDGE * (1.0 + system[i, i])
    for i in range(d):  # Gauss-Jordan; the matrix is positive definite, so no pivot is 0
        system[i] /= system[i, i]
        for other in range(d):
            if other != i:
                system[other] -= system[other, i] * system[i]
    return np.ascontiguousarray(system[:, d:])


def fitted_distance(distance: Floats, missed: Floats) -> float:
    """The distance from which on the model of a free body holds: beyond it, hardly any error is larger than those far away.

    Args:
        distance: to what may be near [m], [N].
        missed: error of the free body's model, [N].
    """
    far = distance > np.median(distance)
    if not far.any():
        return 0.0
    exceeding = distance[missed > _EXCEEDS * np.quantile(missed[far], _FAR_QUANTILE)]
    return float(np.quantile(exceeding, _FAR_QUANTILE)) if len(exceeding) else 0.0


def fitted_gap(real: Transitions) -> int:
    """The steps without contact after which a contact counts as a new collision: the fewest seen before one, or 1 if none was."""
    gaps: list[int] = []
    for step in np.flatnonzero(real.collides).tolist():
        earlier = np.flatnonzero((real.touched[:step] > 0.0) & (real.episode[:step] == real.episode[step]))
        if len(earlier):
            gaps.append(step - int(earlier[-1]) - 1)
    return min(gaps, default=1)


def fitted_gain_deviation(real: Transitions) -> float:
    """The spread, over episodes and wheels, of the ratio of a wheel's settled speed to the commanded one."""
    commanded, reached = WHEEL_RADIUS_M * real.commands, _wheels_of(real.after)
    settled = (np.abs(commanded - _wheels_of(real.before)) < _SETTLED_M_S) & (np.abs(commanded) > _FAST_M_S)
    gains: list[float] = []
    for wheel in range(2):
        own = settled[:, wheel]
        c, u, episode = commanded[own, wheel], reached[own, wheel], real.episode[own]
        enough = np.bincount(episode) >= _SETTLED_STEPS
        ratio = np.bincount(episode, weights=c * u)[enough] / np.bincount(episode, weights=c * c)[enough]
        gains += ratio.tolist()
    return float(np.std(gains)) if len(gains) > 1 else 0.0
