"""A task for learners without a simulator: each of two behaviors is right on one side and wrong on the other.

A point drifts at random between left and right, 0 to 1, and is driven up or down. "up" drives it up on the left half and
down on the right half; "down" does the opposite. The goal is at the top, the own goal at the bottom, the start half way: a
controller that always takes the same behavior, or a random one, scores in half of the episodes. Nothing else is rewarded.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np
from fbql_common.core.types import BehaviorOutput, Decision, World
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession

UP, DOWN = 0, 1
BEHAVIORS = ["up", "down"]
MAX_STEPS = 120
LEAF_COUNT = 4
Answers = list[BehaviorOutput | None]
Heard = Callable[[World, Answers], Answers]


def parameters(learner: str = "fbql", **changes: object) -> FusionParameters:
    """Parameters of a learner for this task, which has no mirror and is learned in few episodes.

    Args:
        learner: `fbql`, `fbql_model` or `fbql_value`.
        changes: parameters; `own_` stands for the learner's name, so that `own_hold_s` is a parameter of each.
    """
    values: dict[str, object] = {
        "controller": learner,
        "behaviors": list(BEHAVIORS),
        "layers": list(BEHAVIORS),
        "guided": 0,
        "fbql_mirror": False,
        "own_hold_s": 3 / 60,
        "own_play_s": 3 / 60,
    }
    given = {re.sub(r"^own_", f"{learner}_", name): value for name, value in (values | changes).items()}
    return FusionParameters(**given)  # pyright: ignore[reportArgumentType]


def world_state(episode: int, step: int, **changes: object) -> World:
    """A world state without events."""
    base = World(
        1 + step, episode, step, 0.0, 0.0, 0.1, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.9, 0.0,
        False, False, False, False, False, False,
    )  # fmt: skip
    return base._replace(**changes)


def answer(
    name: str, reference: float, leaf_id: int, observation: Sequence[float], **changes: object
) -> BehaviorOutput:
    """The answer of a behavior of this task: both wheels at `reference`."""
    made = BehaviorOutput(
        1, 0, 0, name, reference, reference, leaf_id, LEAF_COUNT, f"hash of {name}", False, tuple(observation)
    )
    return made._replace(**changes)


class TwoSides:
    """One episode after the other, each from its own seed."""

    def __init__(self) -> None:
        self._rng = np.random.default_rng(0)
        self._x = self._y = 0.0

    def reset(self, episode: int, seed: int) -> World:
        """The first world state of an episode."""
        self._rng = np.random.default_rng(seed)
        self._x, self._y = self._rng.random(), 0.5
        return self._world(episode, 0)

    def answers(self) -> Answers:
        """ "up" senses where the point is from left to right, "down" how high it is. The leaves are quarters of it."""
        x, y = self._x, self._y
        return [answer("up", 1.0, int(4.0 * y), [x]), answer("down", -1.0, int(4.0 * x), [y, 1.0 - y])]

    def step(self, world: World, velocity: float) -> World:
        """The next world state, after both wheels were driven at this velocity."""
        self._x += self._rng.normal(0.0, 0.06)
        self._x = min(max(abs(self._x), 0.0), 0.999)
        self._y += 0.04 * velocity * (1.0 if self._x < 0.5 else -1.0)
        step = world.step + 1
        if self._y >= 0.98 or self._y <= 0.02:
            won = self._y > 0.5
            self._y = 0.5
            return self._world(world.episode, step, goal=won, own_goal=not won, terminated=True)
        return self._world(world.episode, step, truncated=step == MAX_STEPS)

    def _world(self, episode: int, step: int, **changes: object) -> World:
        """The world state: the ball is the point, the robot is opposite."""
        x, y = self._x - 0.5, self._y - 0.5
        place = {"ball_x_m": y, "ball_y_m": x, "ball_vx_m_s": y / 2.0, "robot_x_m": -y, "robot_y_m": -x}
        return world_state(episode, step, **(place | changes))


def play(session: SoccerSession, episodes: int, heard: Heard = lambda _, answers: answers) -> list[Decision]:
    """Plays a number of episodes. `heard` may alter the behaviors' answers to a world state."""
    task, decisions = TwoSides(), list[Decision]()
    for _ in range(episodes):
        begun = session.next_episode()
        assert begun is not None
        world = task.reset(*begun)
        while True:
            command, decision = session.decide(world, heard(world, task.answers()))
            decisions.append(decision)
            if world.ended:
                break
            world = task.step(world, command.left_rad_s)
    return decisions


def goals(session: SoccerSession, last: int) -> float:
    """The share of goals among the last episodes."""
    return sum(record.outcome == "goal" for record in session.records[-last:]) / last
