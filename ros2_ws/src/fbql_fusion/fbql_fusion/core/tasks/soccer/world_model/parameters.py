"""The parameters of the world model: what structure is built in, and how episodes are imagined."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import owned_by, parameter

from fbql_fusion.core.controllers.parameters import SessionParameters

FAMILIES = ("regions", "forest", "neighbours", "linear")
"""`regions`: robot and ball separately, each free or near something, in the frame of what is near; the others: one
regression of the change of the whole state on state and command, without any knowledge of soccer."""


@owned_by("fbql_model")
@dataclass(frozen=True)
class WorldModelParameters(SessionParameters):
    """The parameters of eqs. 21 to 28 in `docs/imagination.md`."""

    model_family: str = parameter(
        "regions",
        "what predicts the next state: models of robot and ball, free and near something (regions), or one regression on the "
        "whole state, by extra-trees (forest), by the nearest neighbours (neighbours) or linear",
        choices=FAMILIES,
    )
    model_robot_wall_m: float = parameter(
        0.085, "distance from which on the model treats the robot as free of walls; negative: fitted", unit="m",
        low=-1.0, high=10.0,
    )  # fmt: skip
    model_ball_robot_m: float = parameter(
        0.11, "distance from which on the model treats the ball as free of the robot; negative: fitted", unit="m",
        low=-1.0, high=10.0,
    )  # fmt: skip
    model_ball_wall_m: float = parameter(
        0.075, "distance from which on the model treats the ball as free of walls; negative: fitted", unit="m",
        low=-1.0, high=10.0,
    )  # fmt: skip
    model_known_sizes: bool = parameter(
        True, "whether the known sizes keep robot, ball and walls from overlapping in imagined episodes"
    )
    model_mirror: bool = parameter(True, "whether the model is also fitted to the mirror image of each step")
    model_gain_deviation: float = parameter(
        0.02, "standard deviation of a wheel's gain in imagined episodes, constant in each; negative: fitted",
        low=-1.0, high=0.5,
    )  # fmt: skip
    model_trees: int = parameter(
        5, "trees in a forest of the model; a random one of them predicts each step", low=1, high=100
    )
    model_leaf_steps: int = parameter(3, "least number of steps in a leaf of such a tree", low=1, high=1000)
    model_neighbours: int = parameter(
        3, "nearest real steps in the family of neighbours; one of them, at random, predicts a step", low=1, high=100
    )
    model_bins: int = parameter(
        80, "bins in which the model averages how a wheel follows its command", low=2, high=10_000
    )
    model_capacity: int = parameter(
        65_536,
        "real steps that the model is fitted to: the latest whole episodes that do not exceed it",
        low=100,
        high=10_000_000,
    )

    imagined_observed_starts: float = parameter(
        0.7, "share of the imagined episodes that begin near an observed start; the others begin in any observed state",
        low=0.0, high=1.0,
    )  # fmt: skip
    imagined_start_jitter_m: float = parameter(
        0.02, "largest distance of such a start to the observed one, along x and along y", unit="m", low=0.0, high=0.5
    )
    imagined_max_steps: int = parameter(
        1500, "steps after which an imagined episode is truncated", low=1, high=1_000_000
    )
