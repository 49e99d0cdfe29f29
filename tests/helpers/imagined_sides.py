"""A learned model of the task of `two_sides`, so that a learner that imagines can be tested without the soccer's.

Which way each behavior moves the point on either side, and how much the point drifts, is fitted to the real steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from fbql_common.core.command_space import Command
from fbql_common.core.errors import BadInput
from fbql_common.core.types import World
from fbql_fusion.core.learners.dyna.learner import FbqlModel
from fbql_fusion.core.learners.features import Features, Situation
from fbql_fusion.core.learners.linear import row_sum
from fbql_fusion.core.learners.ppo.equations import softmax
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.registry import make_controller
from fbql_fusion.core.session import Session
from fbql_fusion.core.tasks.interface import Imagined
from fbql_fusion.core.tasks.soccer.subsumption import Subsumption
from fbql_fusion.core.tasks.soccer.task import SoccerTask
from numpy.typing import NDArray
from two_sides import MAX_STEPS


class ImaginedSides:
    """See `fbql_fusion.core.tasks.interface.Imagination`."""

    def __init__(self, goal: float = 10.0) -> None:
        self.tree_hashes = ("hash of up", "hash of down")
        self.fits = 0
        self.episodes: list[int] = []
        """Episodes of each time that it played."""
        self._goal = goal
        self._steps: list[tuple[float, ...]] = []
        """x, y, velocity, next x, next y, whether that ended the episode."""
        self._open: list[tuple[float, ...]] = []
        self._at: tuple[float, float] | None = None

    def begin(self, world: World) -> None:
        self.forget_episode()
        self._at = _point(world)

    def add(self, command: Command, world: World) -> None:
        assert self._at is not None
        now = _point(world)
        self._open.append((*self._at, command[0], *now, float(world.terminated)))
        self._at = now
        if world.ended:
            self._steps += self._open
            self.forget_episode()

    def forget_episode(self) -> None:
        self._open, self._at = [], None

    def __len__(self) -> int:
        return len(self._steps)

    def fit(self, features: Features, generator: np.random.Generator) -> bool:
        if not self._steps:
            return False
        self.fits += 1
        x, y, velocity, next_x, next_y, ended = np.array(self._steps).T
        moved = (ended == 0.0) & (np.abs(next_y - y) < 0.1)
        self._pull = [
            float(((next_y - y) * velocity)[side].sum() / max((velocity**2)[side].sum(), 1e-9))
            for side in (moved & (x < 0.5), moved & (x >= 0.5))
        ]
        self._drift = float(np.std((next_x - x)[moved & (x > 0.2) & (x < 0.8)])) if moved.any() else 0.1
        self._features = features
        return True

    def play(
        self,
        theta: NDArray[np.float64],
        episodes: int,
        hold_steps: int,
        discount: float,
        generator: np.random.Generator,
    ) -> Imagined:
        self.episodes.append(episodes)
        lengths, terminated, rows, drivers, probs = [], [], list[list[int]](), list[int](), list[float]()
        rewards, discounts = list[float](), list[float]()
        for _ in range(episodes):
            x, y, steps, count, over = generator.random(), 0.5, 0, 0, False
            while not over and steps < MAX_STEPS:
                row = self._row(x, y)
                weights = softmax(row_sum(theta, self._features.active_in(row)))
                driver = int(generator.random() >= weights[0])
                rows.append(row)
                drivers.append(driver)
                probs.append(weights[driver])
                rewards.append(0.0)
                discounts.append(1.0)
                count += 1
                for _ in range(hold_steps):
                    y += self._pull[x >= 0.5] * (1.0, -1.0)[driver]
                    x = min(abs(x + generator.normal(0.0, self._drift)), 0.999)
                    steps += 1
                    over = not 0.02 < y < 0.98
                    rewards[-1] += discounts[-1] * over * (self._goal if y > 0.5 else -self._goal)
                    discounts[-1] *= discount
                    if over or steps == MAX_STEPS:
                        break
            rows.append(self._row(x, min(max(y, 0.0), 1.0)))
            lengths.append(count)
            terminated.append(over)
        return Imagined(
            np.array(lengths), np.array(terminated), np.array(rows), np.array(drivers), np.array(probs),
            np.array(rewards), np.array(discounts),
        )  # fmt: skip

    def _row(self, x: float, y: float) -> list[int]:
        leaves = (int(4.0 * min(y, 0.999)), int(4.0 * x))
        inputs = (y - 0.5, x - 0.5, 0.5 - y, 0.5 - x, 1.0 - 2.0 * y, 1.0 - 2.0 * x, (y - 0.5) / 2.0, 0.0)
        return self._features.row(
            Situation(leaves, ((x,), (y, 1.0 - y)), inputs if self._features.critic_features else ())
        )

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        return {"sides": np.array(self._steps, dtype=np.float64).reshape(-1, 6)}

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        if "sides" not in arrays:
            raise BadInput("the policy has no array 'sides'")
        self._steps = [tuple(row) for row in arrays["sides"].tolist()]


def _point(world: World) -> tuple[float, float]:
    return world.ball_y_m + 0.5, world.ball_x_m + 0.5


def session_of(
    given: FusionParameters, imagination: ImaginedSides, policy: Policy | None = None
) -> Session[Any, Any, Any]:
    """A session in which fbql_model imagines the task of `two_sides`."""
    task, guide = SoccerTask(given.reward_goal, given.reward_own_goal, given.collision_reward), Subsumption(given)
    learner = make_controller(given, task, guide, imagination)
    assert isinstance(learner, FbqlModel)
    return Session(given, task, guide, learner, policy)
