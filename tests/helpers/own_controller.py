"""A controller as a user writes it in a file of their own, and a clean registry afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fbql_fusion.core import registry
from fbql_fusion.core.controllers.parameters import CONTROLLERS, MUX_CONTROLLERS

SOURCE = '''"""A bandit: every behavior has a value, and the best one drives but for a share of random choices."""

from dataclasses import dataclass

import numpy as np
from fbql_common.core.parameters import parameter
from fbql_fusion.core.controllers.parameters import SessionParameters


class Bandit:
    @dataclass(frozen=True)
    class Parameters(SessionParameters):
        bandit_rate: float = parameter(0.1, "step size of a value", low=0.0, high=1.0)
        bandit_random: float = parameter(0.2, "share of random choices", low=0.0, high=1.0)

    def __init__(self, parameters, generator):
        self.parameters = parameters
        self.generator = generator
        self.values = np.zeros(len(parameters.behaviors))
        self.driver = 0

    def begin_episode(self, phase):
        random = self.generator.random() < self.parameters.bandit_random
        self.driver = int(self.generator.integers(len(self.values)) if random else self.values.argmax())

    def select(self, world, joint_state, outputs):
        weights = tuple(1.0 if i == self.driver else 0.0 for i in range(len(self.values)))
        return weights, self.driver, tuple(self.values.tolist()), weights

    def learn(self, transition):
        error = transition.reward - self.values[self.driver]
        self.values[self.driver] += self.parameters.bandit_rate * error

    def to_arrays(self):
        return {"values": self.values.copy()}

    def load_arrays(self, arrays):
        self.values[:] = arrays["values"]
'''


NOT_SAVED = """import numpy as np


class A:
    def __init__(self, parameters, generator):
        self.weights = tuple(1.0 / len(parameters.behaviors) for _ in parameters.behaviors)

    def begin_episode(self, phase): ...
    def learn(self, transition): ...
    def load_arrays(self, arrays): ...
    def select(self, world, joint_state, outputs):
        return self.weights, -1, (), ()
    def to_arrays(self):
        return LEARNED
"""
"""One that plays, but whose learned values can't be kept; put an expression in the place of LEARNED."""


def bandit(directory: Path) -> str:
    """Writes it into a directory. Returns what --controller takes."""
    (directory / "bandit.py").write_text(SOURCE)
    return f"{directory / 'bandit.py'}:Bandit"


@contextmanager
def only_ours() -> Iterator[None]:
    """Forgets the controllers that are registered within, as far as they were not before."""
    before = set(CONTROLLERS)
    try:
        yield
    finally:
        for name in set(CONTROLLERS) - before:
            del registry._registered[name]
            CONTROLLERS.remove(name)
            MUX_CONTROLLERS.remove(name)
