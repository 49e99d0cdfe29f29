"""The settings of PPO: those of the peers' rows, and the space in which the study tunes them. Needs no torch."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace

import numpy as np


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
    trace: float = 0.95
    """lambda of GAE, per decision."""
    clip: float = 0.2
    entropy: float = 0.003
    log_std_init: float = 0.0
    layers: tuple[int, ...] = (64, 64)
    """Widths of the hidden layers, of the policy and of the critic."""
    scales_rewards: bool = False
    """Whether rewards are divided by the running deviation of their discounted sum."""


SETTINGS = {
    "blend": PpoParameters(hold_steps=10, decisions=128),
    "wheels": PpoParameters(hold_steps=8, discount=0.9975),
}
"""Chosen on tuning seeds and on the shipped trees."""
FBQL_HOLD_STEPS, FBQL_PLAY_STEPS = 4, 2
"""How long fbql holds a decision while it learns, and when it does not."""
PUBLISHED_DISCOUNT = 0.99
"""Per decision."""
PUBLISHED = PpoParameters(
    hold_steps=1, environments=1, decisions=2048, batch=64, discount=PUBLISHED_DISCOUNT, entropy=0.0
)
"""The defaults of Stable-Baselines3, which are those of Schulman et al. 2017."""
PUBLISHED_HELD = replace(PUBLISHED, hold_steps=FBQL_HOLD_STEPS, discount=PUBLISHED_DISCOUNT ** (1.0 / FBQL_HOLD_STEPS))
"""The same, with fbql's hold."""

FIRST_SETTING = PpoParameters(hold_steps=FBQL_HOLD_STEPS, discount=0.998, learning_rate=1e-3, layers=(128, 128))
"""Chosen by hand; the other settings that the study tries change it at random."""
TRIED: dict[str, tuple[object, ...]] = {
    "decisions": (128, 256, 512),
    "batch": (128, 256, 1024),
    "epochs": (4, 10, 20),
    "learning_rate": (1e-4, 3e-4, 1e-3, 2e-3),
    "discount": (0.997, 0.998, 0.999),
    "trace": (0.9, 0.95, 0.98),
    "clip": (0.1, 0.2, 0.4),
    "entropy": (0.0, 0.003, 0.01),
    "layers": ((64, 64), (128, 128), (256, 256)),
    "scales_rewards": (False, True),
}
"""The values that the study tries, each as likely as another."""
TUNED_SENSED, TUNED_INFORMED = 0, 0
"""The number of the setting with the least cost/goal on the training episodes, without and with an informed critic."""


def setting(number: int) -> PpoParameters:
    """A setting of those that are tried. It depends on its number alone, so that more can be tried later."""
    if number == 0:
        return FIRST_SETTING
    generator = np.random.default_rng(number)
    drawn = {name: values[int(generator.integers(len(values)))] for name, values in TRIED.items()}
    return replace(FIRST_SETTING, **drawn)  # type: ignore[arg-type]  # each value is one of its field's


def as_text(parameters: PpoParameters) -> str:
    """What the study tunes of a setting, for a table."""
    values = asdict(parameters)
    named = [field.name for field in fields(parameters) if field.name in TRIED]
    return ", ".join(f"{name} {_value(values[name])}" for name in named)


def _value(value: object) -> str:
    if isinstance(value, tuple):
        return "x".join(map(str, value))
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else f"{value:g}"
