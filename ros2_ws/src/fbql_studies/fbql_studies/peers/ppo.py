"""Stable-Baselines3's PPO in our environments. The extra `peers`.

Torch computes on one thread, so that the same seed gives the same policy bit for bit on one machine, and tasks side by side
don't fight for cores.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv

from fbql_studies.peers.course import Course

MakeEnv = Callable[[], gymnasium.Env[Any, Any]]
FOREVER = 2**62


@dataclass(frozen=True)
class PpoParameters:
    """Settings of PPO; the rest are Stable-Baselines3's defaults."""

    hold_steps: int
    """Steps of the simulator that an action is held for."""
    environments: int = 8
    decisions: int = 256
    """Decisions of each environment between two updates."""
    batch: int = 256
    epochs: int = 10
    learning_rate: float = 3e-4
    discount: float = 0.999
    """Per step of the simulator."""
    entropy: float = 0.003
    log_std_init: float = 0.0


SETTINGS = {
    "blend": PpoParameters(hold_steps=10, decisions=128),
    "wheels": PpoParameters(hold_steps=8, discount=0.9975),
}
"""Chosen on tuning seeds and on the shipped trees."""


class _Count(BaseCallback):
    """Records the course, and ends the training when the budget is used up."""

    def __init__(self, course: Course) -> None:
        super().__init__()
        self._course = course

    def _on_step(self) -> bool:
        for index, (info, done) in enumerate(zip(self.locals["infos"], self.locals["dones"], strict=True)):
            self._course.add(info, bool(done), index)
        return not self._course.is_over


def train(make_env: MakeEnv, budget: int, seed: int, parameters: PpoParameters) -> tuple[PPO, Course]:
    """Learns until the budget of simulated steps is used up."""
    torch.set_num_threads(1)
    course = Course(budget, parameters.environments)
    model = PPO(
        "MlpPolicy",
        DummyVecEnv([make_env] * parameters.environments),
        n_steps=parameters.decisions,
        batch_size=parameters.batch,
        n_epochs=parameters.epochs,
        learning_rate=parameters.learning_rate,
        gamma=parameters.discount**parameters.hold_steps,
        ent_coef=parameters.entropy,
        policy_kwargs={"log_std_init": parameters.log_std_init},
        seed=seed,
        device="cpu",
    )
    model.learn(FOREVER, callback=_Count(course))
    return model, course


def acts_by(model: PPO, drawn: bool, seed: int) -> Callable[[Any], Any]:
    """Frozen play: actions drawn from the policy, or its mean."""
    model.set_random_seed(seed)

    def act(observation: Any) -> Any:
        return model.predict(observation, deterministic=not drawn)[0]

    return act
