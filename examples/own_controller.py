"""Your own controller in one file: a bandit that picks one behavior per episode and learns which pays best.

    python examples/own_controller.py
    python3 scripts/train.py --controller examples/own_controller.py --episodes 50
    python3 scripts/bringup.py --controller examples/own_controller.py --set bandit_rate=0.2
    python3 scripts/replay.py RUN --verify --controller examples/own_controller.py

An installed package instead declares the class as an entry point of the group `fbql.controllers`; --controller takes its name.
"""

from dataclasses import dataclass

import numpy as np
from fbql_common.core.parameters import parameter
from fbql_common.core.types import Phase
from fbql_fusion.core.controllers.parameters import SessionParameters


class Bandit:
    """Epsilon-greedy over the behaviors, one choice per episode (Sutton and Barto 2018, section 2.4)."""

    kind = "Bandit"
    """The name that its policies carry."""

    @dataclass(frozen=True)
    class Parameters(SessionParameters):
        """Its own parameters, known to --set, config.yaml and the fusion node."""

        bandit_rate: float = parameter(0.1, "step size of a value", low=0.0, high=1.0)
        bandit_random: float = parameter(0.2, "share of random choices", low=0.0, high=1.0)

    def __init__(self, parameters, generator):
        self.parameters = parameters
        self.generator = generator  # seeded from the run's seed; the only source of randomness
        self.values = np.zeros(len(parameters.behaviors))
        self.driver = 0
        self.rewards = 0.0

    def begin_episode(self, phase):
        """Chooses who drives in this episode; frozen, the best."""
        explore = phase is Phase.LEARNING and self.generator.random() < self.parameters.bandit_random
        self.driver = int(self.generator.integers(len(self.values)) if explore else self.values.argmax())

    def select(self, world, joint_state, outputs):
        """Returns weights, driver, q and learned weights, one entry per behavior."""
        weights = tuple(float(index == self.driver) for index in range(len(self.values)))
        return weights, self.driver, tuple(self.values.tolist()), weights

    def learn(self, transition):
        """Adds one step's reward; at the end of an episode learns from their sum."""
        self.rewards += transition.reward
        if transition.terminated or transition.truncated:
            self.values[self.driver] += self.parameters.bandit_rate * (self.rewards - self.values[self.driver])
            self.rewards = 0.0

    def to_arrays(self):
        """What a policy file holds."""
        return {"values": self.values.copy()}

    def load_arrays(self, arrays):
        """Takes over what `to_arrays` returned."""
        self.values[:] = arrays["values"]


# %% Registered under a name, it plays like the others; its parameters are set like the others.
if __name__ == "__main__":
    import fbql

    fbql.register_controller("bandit", Bandit)
    # Without a punishment of collisions: they would make it avoid walls rather than score.
    settings = {"bandit_rate": 0.2, "reward_collision": 0.0}
    learned = fbql.train("bandit", episodes=40, max_steps=1000, seed=1, parameters=settings)
    print(f"bandit: {learned.summary['goals']} goals in {learned.summary['episodes']} episodes")
    print("values:", learned.policy.content.arrays["values"].round(1))
    again = fbql.play("bandit", policy=learned.policy, learn=False, episodes=10, max_steps=1000, seed=2)
    print(f"frozen: {again.summary['goals']} goals in {again.summary['episodes']} episodes")
