"""Shared by the tests of the learners that hold their decisions, on the task of `two_sides`.

A test whose argument `learner` is parametrised by LEARNERS is a rule for each of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from fbql_common.core.types import NO_LEAF, Phase
from fbql_fusion.core.controllers.interface import Transition
from fbql_fusion.core.learners.ppo.learner import Fbql
from fbql_fusion.core.learners.value.learner import FbqlValue
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.registry import make_controller
from fbql_fusion.core.session import episode_seed
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.core.tasks.soccer.subsumption import Subsumption
from fbql_fusion.core.tasks.soccer.task import SoccerTask
from numpy.typing import NDArray
from two_sides import UP, Answers, Heard, TwoSides, answer, parameters, play, world_state

LEARNERS = ("fbql", "fbql_value")
TABLE = {"fbql": "theta", "fbql_value": "values"}
"""Learner -> the array of its policy that its weights are made of."""
Arrays = dict[str, NDArray[Any]]
GOAL = {"goal": True, "terminated": True}
TIMEOUT = {"truncated": True}


def learned(session: SoccerSession) -> Policy:
    """The policy of a session that has one."""
    policy = session.policy()
    assert policy is not None
    return policy


def arrays_of(session: SoccerSession) -> Arrays:
    """The arrays of its policy."""
    return dict(learned(session).arrays)


def equal(one: Arrays, other: Arrays) -> bool:
    """Whether they are the same bit for bit."""
    return one.keys() == other.keys() and all(np.array_equal(array, other[name]) for name, array in one.items())


def anywhere(seed: int) -> Heard:
    """Replaces the observations by random ones at every step, which no learner has met."""
    rng = np.random.default_rng(seed)
    return lambda _, answers: [
        x and x._replace(observation=tuple(rng.random(len(x.observation)).tolist())) for x in answers
    ]


def learner_of(given: FusionParameters) -> Fbql | FbqlValue:
    """The learner that the parameters name, without a session around it."""
    learner = make_controller(given, SoccerTask(1.0, -1.0, 0.0), Subsumption(given))
    assert isinstance(learner, Fbql | FbqlValue)
    return learner


def live(learner: Fbql | FbqlValue, numbers: range, phase: Phase) -> None:
    """Plays the episodes of these numbers with a learner, as a session does."""
    task, up_always = TwoSides(), ((1.0, 0.0), UP)
    for number in numbers:
        learner.begin_episode(phase)
        world = task.reset(number, episode_seed(9, number))
        before: tuple[tuple[int, ...], tuple[float, ...], int] | None = None
        while True:
            outputs = task.answers()
            joint_state = tuple(NO_LEAF if x is None else x.leaf_id for x in outputs)
            if before is not None:
                reward = 10.0 * world.goal - 10.0 * world.own_goal
                learner.learn(Transition(*before, reward, joint_state, world.terminated, world.truncated))
            weights, driver, _, _ = learner.select(world, joint_state, outputs)
            if phase is Phase.GUIDED:
                weights, driver = up_always
            before = joint_state, weights, driver
            if world.ended:
                break
            command = (1.0, -1.0)[driver] if driver >= 0 else weights[0] - weights[1]
            world = task.step(world, command)


def stay(
    session: SoccerSession, steps: int, leaves: Callable[[int], tuple[int, int]] = lambda _: (1, 2), **end: bool
) -> list[tuple[int, tuple[float, ...]]]:
    """Driver and weights of each step of an episode in which the world state stays the same."""
    begun = session.next_episode()
    assert begun is not None
    found: list[tuple[int, tuple[float, ...]]] = []
    for step in range(steps + 1):
        up, down = leaves(step)
        outputs: Answers = [answer("up", 1.0, up, [0.3]), answer("down", -1.0, down, [0.5, 0.5])]
        world = world_state(begun[0], step, **((end or TIMEOUT) if step == steps else {}))
        _, decision = session.decide(world, outputs)
        found.append((decision.driver, decision.weights))
    return found[:-1]


def trained(learner: str = "fbql", **changes: Any) -> Policy:
    """The policy of a learner after 30 episodes."""
    session = SoccerSession(parameters(learner, seed=1, **changes))
    play(session, 30)
    return learned(session)


def frozen(policy: Policy, **changes: Any) -> SoccerSession:
    """A session that plays a policy and learns nothing."""
    return SoccerSession(parameters(policy.kind, seed=5, learn=False, **changes), policy)
