"""What a person demonstrates in one go: the demonstration under way, those that are kept, and what is dropped."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from fbql_behaviors.core.patterns import Demonstration
from fbql_common.core.types import WheelCommand, World


class Kept(NamedTuple):
    """A demonstration that is kept, and the seed of the world it was given in."""

    seed: int
    demonstration: Demonstration


class Sitting:
    """Demonstrations from one start after the other.

    A demonstration begins with the first key that drives; before that the world stands still. It ends with its last
    command that moves a wheel: standing about afterwards is no part of it. What the person drops is driven again from
    the same start, under a new episode number, so that a late message of the old one is never taken for the new.

    Args:
        starts: seeds of the worlds to begin with, without end.
        every: every so many steps a pattern is taken.
        wanted: patterns that the behavior's recipe takes at most.
    """

    def __init__(self, starts: Iterator[int], every: int, wanted: int) -> None:
        self._starts = starts
        self._every = every
        self.wanted = wanted
        self.kept: list[Kept] = []
        self.episode = 0
        """Number of the episode under way."""
        self.seed = next(starts)
        """Seed of its world."""
        self.begun = False
        """Whether a key that drives was pressed in it; who takes the keys says so."""
        self._worlds: list[World] = []
        self._commands: list[WheelCommand] = []

    @property
    def steps(self) -> int:
        """Steps of the demonstration under way."""
        return len(self._worlds)

    @property
    def patterns(self) -> int:
        """Patterns so far, the demonstration under way counted too."""
        lengths = [len(kept.demonstration.worlds) for kept in self.kept] + [self._moving_steps()]
        return min(sum(-(-length // self._every) for length in lengths), self.wanted)

    def awaits(self, world: World) -> bool:
        """Whether a world state is to be answered now: the next of the episode under way, which has begun."""
        return self.begun and world.episode == self.episode and world.step == len(self._worlds) and not world.ended

    def answered(self, world: World) -> WheelCommand | None:
        """The command that was given in a world state which comes once more; None when there was none."""
        if world.episode == self.episode and world.step < len(self._commands):
            return self._commands[world.step]
        return None

    def drive(self, world: World, left_rad_s: float, right_rad_s: float) -> WheelCommand:
        """Answers a world state that is awaited [rad/s]. Gives the command."""
        command = WheelCommand(world.stamp_ns, world.episode, world.step, left_rad_s, right_rad_s)
        self._worlds.append(world)
        self._commands.append(command)
        return command

    def keep(self) -> Demonstration | None:
        """Keeps the demonstration under way, and gives it; None when nothing was driven."""
        length = self._moving_steps()
        if length == 0:
            return None
        demonstration = Demonstration(tuple(self._worlds[:length]), tuple(self._commands[:length]))
        self.kept.append(Kept(self.seed, demonstration))
        self._anew()
        return demonstration

    def next(self) -> Demonstration | None:
        """Goes on to another start, keeping what was driven, which it gives."""
        demonstration = self.keep()
        if demonstration is None:
            self._anew()
        self.seed = next(self._starts)
        return demonstration

    def undo(self) -> bool | None:
        """Drops the demonstration under way, to be driven again (False), else the last one kept (True).

        None when there is nothing to drop.
        """
        if self._worlds:
            self._anew()
            return False
        if self.kept:
            self.kept.pop()
            return True
        return None

    def _anew(self) -> None:
        self.episode += 1
        self.begun = False
        self._worlds, self._commands = [], []

    def _moving_steps(self) -> int:
        """Steps of the demonstration under way up to the last command that moves a wheel."""
        length = len(self._commands)
        while length and self._commands[length - 1][3:] == (0.0, 0.0):
            length -= 1
        return length
