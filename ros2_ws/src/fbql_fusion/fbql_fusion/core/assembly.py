"""Puts together what belongs to one step: the world state and every behavior's answer to it.

Messages arrive in any order, twice, late or not at all; a step is decided once, and only with what belongs to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from fbql_common.core.types import BehaviorOutput, World


class Arrival(Enum):
    """What a world state is to the episode under way."""

    NEW = "new"
    AGAIN = "again"
    """Its step was decided already: the answer got lost, repeat it."""
    OLD = "old"
    """Of an older step, or of an episode that is not under way."""


class StepAssembly:
    """Collects the messages of the step that is decided next.

    A behavior is live, and so waited for, until `drop_missing` and again from its next answer on.
    """

    def __init__(self, behaviors: Sequence[str]) -> None:
        self._names = tuple(behaviors)
        self._outputs: list[BehaviorOutput | None] = [None] * len(self._names)
        self._data = [b""] * len(self._names)
        self.live = [True] * len(self._names)
        self._heard = [False] * len(self._names)
        self.episode: int | None = None
        self.decided_step = -1
        self.world: World | None = None
        self.world_data = b""

    def begin(self, episode: int) -> None:
        """A new episode was asked for: only its worlds count from here on, from step 0."""
        self.episode = episode
        self.decided_step = -1
        self.world = None

    def add_world(self, world: World, data: bytes) -> Arrival:
        """Takes a world state that is new; tells what it is."""
        if world.episode != self.episode:
            return Arrival.OLD
        if world.step == self.decided_step:
            return Arrival.AGAIN
        if world.step < self.decided_step or (self.decided_step < 0 and world.step != 0):
            return Arrival.OLD
        self.world, self.world_data = world, data
        return Arrival.NEW

    def add_output(self, index: int, output: BehaviorOutput, data: bytes) -> None:
        """Takes a behavior's answer; whether it belongs to the step is seen when the step is complete."""
        self._outputs[index], self._data[index] = output, data
        self.live[index] = self._heard[index] = True

    @property
    def all_heard(self) -> bool:
        """Whether every behavior has ever answered. Until then the graph is still coming up."""
        return all(self._heard)

    def complete(self) -> bool:
        """Whether the world state and the answer of every live behavior are there."""
        world = self.world
        if world is None or True not in self.live:
            return False
        for output, live in zip(self._outputs, self.live, strict=True):
            if live and (output is None or output.step != world.step or not _answers(output, world)):
                return False
        return True

    def answers(self) -> list[BehaviorOutput | None]:
        """For each behavior its answer to the world state of the step; None where there is none."""
        world = self.world
        if world is None:
            return [None] * len(self._names)
        return [output if output is not None and _answers(output, world) else None for output in self._outputs]

    def answer_data(self) -> list[bytes]:
        """The bytes of answers(), empty where there is none."""
        return [data if answer is not None else b"" for answer, data in zip(self.answers(), self._data, strict=True)]

    def missing(self) -> list[str]:
        """Names of the behaviors that have not answered the world state of the step."""
        return [name for name, answer in zip(self._names, self.answers(), strict=True) if answer is None]

    def drop_missing(self) -> list[str]:
        """Waits no longer for the live behaviors that have not answered; gives their names."""
        dropped: list[str] = []
        for index, answer in enumerate(self.answers()):
            if answer is None and self.live[index]:
                self.live[index] = False
                dropped.append(self._names[index])
        return dropped

    def decided(self) -> None:
        """The step is done: its world state is not waited for again."""
        if self.world is not None:
            self.decided_step = self.world.step
            self.world = None


def _answers(output: BehaviorOutput, world: World) -> bool:
    return output.step == world.step and output.episode == world.episode and output.stamp_ns == world.stamp_ns
