"""The learners: each gets a budget of simulated steps on training seeds, then plays frozen on other episodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import process_time
from typing import Any

from fbql.match.in_process import play
from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.session import Session
from fbql_sim.core.world_loop import WorldLoop
from fbql_sim.gymnasium_env import WheelsEnv

from fbql_studies.methods import SENSED, SENSED_CRITIC
from fbql_studies.peers import tabular
from fbql_studies.peers.course import Course
from fbql_studies.peers.play import Act, cost, score_in, score_of_session
from fbql_studies.peers.team_env import BlendEnv, SelectionEnv
from fbql_studies.peers.wheels import wheels_env
from fbql_studies.tree_play import Score
from fbql_studies.tuning import TUNING_SEED

REWARD_COLLISION = -0.3
"""Of the peers. The printed -5 is ruinous for learners; FBQL has its own, `FusionParameters.reward_collision`."""
CHOOSING_EPISODES = 20
"""Training episodes on which it is chosen how a policy plays."""
TABULAR = "tabular Q, one behavior"
PPO_BLEND, PPO_WHEELS, PPO_SHAPED = "ppo, blend weights", "ppo, raw wheels", "ppo, raw wheels, shaped"
FBQL_LITERAL, FBQL = "fbql literal", "fbql"
CONTROLLERS: dict[str, tuple[str, Mapping[str, Any]]] = {
    FBQL_LITERAL: ("fbql_literal", {}),
    FBQL: ("fbql", {}),
    SENSED: ("fbql", SENSED_CRITIC),
}
"""Method -> its controller, and what is changed of the defaults."""
NEED_PPO = (PPO_BLEND, PPO_WHEELS, PPO_SHAPED)
LEARNERS = (TABULAR, PPO_BLEND, PPO_WHEELS, PPO_SHAPED, *CONTROLLERS)


@dataclass(frozen=True)
class Lesson:
    """What a learner is given."""

    behaviors: Sequence[Behavior]
    budget: int
    """Simulated steps of the training."""
    training_seed: int
    evaluation_seed: int
    episodes: int
    """Episodes of the evaluation."""


@dataclass(frozen=True)
class Learned:
    """What came of it."""

    score: Score
    course: Course
    played: str
    """How the frozen policy played."""
    training_s: float
    """Processor time of the training."""


def learn(method: str, lesson: Lesson) -> Learned:
    """Trains a method of LEARNERS and plays it frozen."""
    if method == TABULAR:
        return _tabular(lesson)
    if method in CONTROLLERS:
        return _session(*CONTROLLERS[method], lesson)
    return _ppo(method, lesson)


def _tabular(lesson: Lesson) -> Learned:
    parameters = tabular.TabularParameters()
    env = SelectionEnv(lesson.behaviors, hold_steps=parameters.hold_steps, reward_collision=REWARD_COLLISION)
    begun_s = process_time()
    q, course = tabular.train(env, lesson.budget, lesson.training_seed, parameters)
    seconds = process_time() - begun_s
    ways = {"greedy": 0.0, "epsilon": parameters.epsilon_end}
    acts = {name: partial(tabular.acts_by, q, epsilon) for name, epsilon in ways.items()}
    return _played(env, acts, course, seconds, lesson)


def _ppo(method: str, lesson: Lesson) -> Learned:
    from fbql_studies.peers import ppo  # an optional extra

    parameters = ppo.SETTINGS["blend" if method == PPO_BLEND else "wheels"]

    def make() -> Any:
        if method == PPO_BLEND:
            return BlendEnv(lesson.behaviors, hold_steps=parameters.hold_steps, reward_collision=REWARD_COLLISION)
        return wheels_env(parameters.hold_steps, method == PPO_SHAPED, reward_collision=REWARD_COLLISION)

    begun_s = process_time()
    model, course = ppo.train(make, lesson.budget, lesson.training_seed, parameters)
    seconds = process_time() - begun_s
    acts = {name: partial(ppo.acts_by, model, name == "drawn") for name in ("mean", "drawn")}
    return _played(make(), acts, course, seconds, lesson)


def _played(
    env: WheelsEnv, acts: dict[str, Callable[[int], Act]], course: Course, seconds: float, lesson: Lesson
) -> Learned:
    """Plays in the way that costs the least on training episodes; the first of equal ones."""
    way = min(acts, key=lambda name: cost(score_in(env, acts[name](TUNING_SEED), TUNING_SEED, CHOOSING_EPISODES)))
    score = score_in(env, acts[way](lesson.evaluation_seed), lesson.evaluation_seed, lesson.episodes)
    return Learned(score, course, way, seconds)


def _session(controller: str, changes: Mapping[str, Any], lesson: Lesson) -> Learned:
    """A controller of fusion: guided episodes first, then it drives and learns; then frozen from its policy."""
    fusion = FusionParameters(controller=controller, seed=lesson.training_seed, **changes)
    session = Session(fusion)
    loop, course = WorldLoop(), Course(lesson.budget)

    def episode_ended() -> bool:
        record = session.records[-1]
        course.steps = session.steps
        course.end(record.steps, record.outcome)
        return not course.is_over

    begun_s = process_time()
    play(session, loop, lesson.behaviors, episode_ended)
    seconds = process_time() - begun_s
    frozen = replace(fusion, seed=lesson.evaluation_seed, episodes=lesson.episodes, learn=False)
    score = score_of_session(frozen, lesson.behaviors, loop, session.policy())
    return Learned(score, course, "frozen", seconds)
