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
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.world_loop import WorldLoop
from fbql_sim.gymnasium_env import WheelsEnv

from fbql_studies.common.methods import FBQL, SENSED, SENSED_CRITIC
from fbql_studies.common.play import Score, score_of
from fbql_studies.common.tuning import TUNING_SEED
from fbql_studies.peers import tabular
from fbql_studies.peers.choice_env import ChoiceEnv
from fbql_studies.peers.course import Course
from fbql_studies.peers.fair_ppo import STEPS, FairPpo, of_setting
from fbql_studies.peers.play import Act, score_in
from fbql_studies.peers.ppo_settings import SETTINGS
from fbql_studies.peers.team_env import BlendEnv, SelectionEnv
from fbql_studies.peers.wheels import wheels_env

REWARD_COLLISION = -0.3
"""The peers' reward for a collision: the printed -5 is ruinous for learners. FBQL has its own parameter."""
CHOOSING_EPISODES = 20
"""Training episodes on which the way to play a policy is chosen, or fewer if it is then judged on fewer."""
TABULAR = "tabular Q, one behavior"
PPO_BLEND, PPO_WHEELS, PPO_SHAPED = "ppo, blend weights", "ppo, raw wheels", "ppo, raw wheels, shaped"
FBQL_LITERAL = "fbql literal"
CONTROLLERS: dict[str, tuple[str, Mapping[str, Any]]] = {
    FBQL_LITERAL: ("fbql_literal", {}),
    FBQL: (FBQL, {}),
    SENSED: (FBQL, SENSED_CRITIC),
}
"""Method -> its controller, and the parameters that differ from its defaults."""
NEED_PPO = (PPO_BLEND, PPO_WHEELS, PPO_SHAPED, *STEPS)
LEARNERS = (TABULAR, *NEED_PPO, *CONTROLLERS)


@dataclass(frozen=True)
class TrainingPlan:
    """Budget, seeds and behaviors of a training and its evaluation."""

    behaviors: Sequence[Behavior]
    budget: int
    """Simulated steps of the training."""
    training_seed: int
    evaluation_seed: int
    episodes: int
    """Episodes of the evaluation."""


@dataclass(frozen=True)
class Learned:
    """The outcome of a training."""

    score: Score
    course: Course
    played: str
    """How the frozen policy played."""
    training_s: float
    """Processor time of the training."""


def learn(method: str, plan: TrainingPlan) -> Learned:
    """Trains a method of LEARNERS and plays it frozen."""
    if method == TABULAR:
        return _tabular(plan)
    if method in CONTROLLERS:
        return _session(*CONTROLLERS[method], plan)
    if method in STEPS:
        return _fair_ppo(STEPS[method], plan)
    return _ppo(method, plan)


def learn_setting(number: int, informed: bool, plan: TrainingPlan) -> Learned:
    """Trains PPO with one of the settings that are tried, and plays it frozen."""
    return _fair_ppo(of_setting(number, informed), plan)


def _tabular(plan: TrainingPlan) -> Learned:
    parameters = tabular.TabularParameters()
    env = SelectionEnv(plan.behaviors, hold_steps=parameters.hold_steps, reward_collision=REWARD_COLLISION)
    begun_s = process_time()
    q, course = tabular.train(env, plan.budget, plan.training_seed, parameters)
    seconds = process_time() - begun_s
    ways = {"greedy": 0.0, "epsilon": parameters.epsilon_end}
    acts = {name: (env, partial(tabular.acts_by, q, epsilon)) for name, epsilon in ways.items()}
    return _played(acts, course, seconds, plan)


def _ppo(method: str, plan: TrainingPlan) -> Learned:
    from fbql_studies.peers import ppo  # an optional extra

    parameters = SETTINGS["blend" if method == PPO_BLEND else "wheels"]

    def make() -> Any:
        if method == PPO_BLEND:
            return BlendEnv(plan.behaviors, hold_steps=parameters.hold_steps, reward_collision=REWARD_COLLISION)
        return wheels_env(parameters.hold_steps, method == PPO_SHAPED, reward_collision=REWARD_COLLISION)

    begun_s = process_time()
    model, course = ppo.train(make, plan.budget, plan.training_seed, parameters)
    seconds = process_time() - begun_s
    env = make()
    acts = {name: (env, partial(ppo.acts_by, model, name == "drawn")) for name in ("mean", "drawn")}
    return _played(acts, course, seconds, plan)


def _fair_ppo(fair: FairPpo, plan: TrainingPlan) -> Learned:
    from fbql_studies.peers import ppo  # an optional extra

    def make(hold_steps: int) -> ChoiceEnv:
        return ChoiceEnv(
            plan.behaviors,
            selects=fair.selects,
            mirrors=fair.mirrors,
            informed=fair.informed,
            hold_steps=hold_steps,
            reward_collision=FusionParameters().fbql_reward_collision,
        )

    parameters = fair.parameters
    begun_s = process_time()
    model, course = ppo.train(lambda: make(parameters.hold_steps), plan.budget, plan.training_seed, parameters)
    seconds = process_time() - begun_s
    acts = {
        f"{name} for {hold} steps" if len(fair.play_holds) > 1 else name: (
            make(hold),
            partial(ppo.acts_by, model, name == "drawn"),
        )
        for hold in fair.play_holds
        for name in ("best" if fair.selects else "mean", "drawn")
    }
    return _played(acts, course, seconds, plan)


def _played(
    acts: dict[str, tuple[WheelsEnv, Callable[[int], Act]]], course: Course, seconds: float, plan: TrainingPlan
) -> Learned:
    """Plays in the way with the least cost on training episodes; the first of equal ones."""

    def score(way: str, seed: int, episodes: int) -> Score:
        env, act = acts[way]
        return score_in(env, act(seed), seed, episodes)

    choosing = min(CHOOSING_EPISODES, plan.episodes)
    way = min(acts, key=lambda each: score(each, TUNING_SEED, choosing).cost)
    return Learned(score(way, plan.evaluation_seed, plan.episodes), course, way, seconds)


def _session(controller: str, changes: Mapping[str, Any], plan: TrainingPlan) -> Learned:
    """A controller of fusion: guided episodes first, then it drives and learns; then frozen from its policy."""
    fusion = FusionParameters(controller=controller, seed=plan.training_seed, **changes)
    session = SoccerSession(fusion)
    loop, course = WorldLoop(), Course(plan.budget)

    def episode_ended() -> bool:
        record = session.records[-1]
        course.steps = session.steps
        course.end(record.steps, record.outcome)
        return not course.is_over

    begun_s = process_time()
    play(session, loop, plan.behaviors, episode_ended)
    seconds = process_time() - begun_s
    frozen = replace(fusion, seed=plan.evaluation_seed, episodes=plan.episodes, learn=False)
    score = score_of(frozen, plan.behaviors, loop, session.policy())
    return Learned(score, course, "frozen", seconds)
