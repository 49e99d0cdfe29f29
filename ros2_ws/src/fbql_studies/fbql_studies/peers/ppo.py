"""Stable-Baselines3's PPO in our environments. The extra `peers`.

Torch computes on one thread, so that the same seed gives the same policy bit for bit on one machine, and tasks side by side
don't fight for cores.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecNormalize

from fbql_studies.peers.course import Course
from fbql_studies.peers.ppo_settings import PpoParameters

MakeEnv = Callable[[], gymnasium.Env[Any, Any]]
FOREVER = 2**62


class _Parts(torch.nn.Module):
    """The hidden layers of an actor that does not see the last inputs, and of a critic that sees them all."""

    def __init__(
        self, sensed: int, inputs: int, layers: dict[str, list[int]], activation: type[torch.nn.Module]
    ) -> None:
        super().__init__()
        self._sensed = sensed
        self.actor = MlpExtractor(sensed, {"pi": layers["pi"], "vf": []}, activation)
        self.critic = MlpExtractor(inputs, {"pi": [], "vf": layers["vf"]}, activation)
        self.latent_dim_pi, self.latent_dim_vf = self.actor.latent_dim_pi, self.critic.latent_dim_vf

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        return self.actor.forward_actor(features[:, : self._sensed])

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        return self.critic.forward_critic(features)


class InformedCritic(ActorCriticPolicy):
    """A policy whose critic is asymmetric (Pinto et al. 2018, arXiv 1710.06542): it alone sees the last inputs.

    Args:
        critic_only: how many these are.
    """

    def __init__(self, *arguments: Any, critic_only: int, **more: Any) -> None:
        self._critic_only = critic_only
        super().__init__(*arguments, **more)

    def _build_mlp_extractor(self) -> None:
        inputs = self.features_dim
        self.mlp_extractor = _Parts(inputs - self._critic_only, inputs, self.net_arch, self.activation_fn)  # type: ignore[assignment,arg-type]


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
    environments: VecEnv = DummyVecEnv([make_env] * parameters.environments)
    critic_only: int = getattr(environments.envs[0], "critic_only", 0)  # type: ignore[attr-defined]  # of a DummyVecEnv
    discount = parameters.discount**parameters.hold_steps
    if parameters.scales_rewards:
        environments = VecNormalize(environments, norm_obs=False, gamma=discount)
    layers = list(parameters.layers)
    kwargs: dict[str, Any] = {"log_std_init": parameters.log_std_init, "net_arch": {"pi": layers, "vf": layers}}
    model = PPO(
        InformedCritic if critic_only else "MlpPolicy",
        environments,
        n_steps=parameters.decisions,
        batch_size=parameters.batch,
        n_epochs=parameters.epochs,
        learning_rate=parameters.learning_rate,
        gamma=discount,
        gae_lambda=parameters.trace,
        clip_range=parameters.clip,
        ent_coef=parameters.entropy,
        policy_kwargs=kwargs | ({"critic_only": critic_only} if critic_only else {}),
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
