"""One sitting at the keyboard: the demonstration in progress, those that are kept, and their copies on disk.

Each kept demonstration is written immediately as a separate recording, below the directory of the sitting's recording,
so that not even a power cut loses all of them; the copies are removed when the complete recording is written.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from fbql_behaviors.core.patterns import Demonstration
from fbql_common.core.errors import BadInput
from fbql_common.core.types import WheelCommand, World
from fbql_common.files import remedy
from fbql_sim.core.parameters import SimulationParameters

from fbql.cli.output import say
from fbql.demonstrations.origins import Origin, about_origins
from fbql.demonstrations.recording import in_sequence, make_directory, save_demonstrations, write_demonstrations

UNFINISHED = "unfinished"
"""Subdirectory of the copies."""


class Kept(NamedTuple):
    """A demonstration that is kept, and the seed of the world it was given in."""

    seed: int
    demonstration: Demonstration


class Sitting:
    """Demonstrations from one start after another.

    A demonstration begins with the first driving key; before that the world stands still. It ends with its last command
    that moves a wheel: standing still afterwards is not part of it. A demonstration that is dropped is driven again from the
    same start, under a new episode number, so that a late message of the old one is never taken for the new.

    Args:
        starts: seeds of the worlds to begin with, without end.
        every: a pattern is taken every this many steps.
        wanted: most patterns that the behavior's recipe takes.
    """

    def __init__(self, starts: Iterator[int], every: int, wanted: int) -> None:
        self._starts = starts
        self._every = every
        self.wanted = wanted
        self.kept: list[Kept] = []
        self.episode = 0
        """Number of the episode in progress."""
        self.seed = next(starts)
        """Its seed."""
        self.begun = False
        """Whether a driving key was pressed in it; set by whoever reads the keys."""
        self._worlds: list[World] = []
        self._commands: list[WheelCommand] = []

    @property
    def steps(self) -> int:
        """Steps of the demonstration in progress."""
        return len(self._worlds)

    @property
    def patterns(self) -> int:
        """Patterns so far, including the demonstration in progress."""
        lengths = [len(kept.demonstration.worlds) for kept in self.kept] + [self._moving_steps()]
        return min(sum(-(-length // self._every) for length in lengths), self.wanted)

    def awaits(self, world: World) -> bool:
        """Whether a world state must be answered now: it is the next one of an episode that has begun."""
        return self.begun and world.episode == self.episode and world.step == len(self._worlds) and not world.ended

    def answered(self, world: World) -> WheelCommand | None:
        """The command that already answered a world state; None if it is a new one."""
        if world.episode == self.episode and world.step < len(self._commands):
            return self._commands[world.step]
        return None

    def drive(self, world: World, left_rad_s: float, right_rad_s: float) -> WheelCommand:
        """Answers the awaited world state with wheel velocities [rad/s]. Returns the command."""
        command = WheelCommand(world.stamp_ns, world.episode, world.step, left_rad_s, right_rad_s)
        self._worlds.append(world)
        self._commands.append(command)
        return command

    def keep(self) -> Demonstration | None:
        """Keeps the demonstration in progress, and returns it; None if nothing was driven."""
        length = self._moving_steps()
        if length == 0:
            return None
        demonstration = Demonstration(tuple(self._worlds[:length]), tuple(self._commands[:length]))
        self.kept.append(Kept(self.seed, demonstration))
        self._restart()
        return demonstration

    def next(self) -> Demonstration | None:
        """Keeps what was driven, moves on to another start, and returns what was kept."""
        demonstration = self.keep()
        if demonstration is None:
            self._restart()
        self.seed = next(self._starts)
        return demonstration

    def undo(self) -> bool | None:
        """Drops the demonstration in progress, to be driven again (False), else the last one kept (True).

        None if there is nothing to drop.
        """
        if self._worlds:
            self._restart()
            return False
        if self.kept:
            self.kept.pop()
            return True
        return None

    def _restart(self) -> None:
        self.episode += 1
        self.begun = False
        self._worlds, self._commands = [], []

    def _moving_steps(self) -> int:
        """Steps up to the last command that moves a wheel."""
        length = len(self._commands)
        while length and self._commands[length - 1][3:] == (0.0, 0.0):
            length -= 1
        return length


class Safekeeping:
    """The recording of a sitting, in its own directory."""

    def __init__(
        self, directory: Path, behavior: str, simulation: SimulationParameters, details: Mapping[str, object]
    ) -> None:
        self.directory = directory
        self._behavior = behavior
        self._simulation = simulation
        self._details = details
        self._count = 0
        self._copies: list[Path] = []

    def open(self) -> None:
        """Makes the directory. Raises BadInput when it exists or cannot be made."""
        make_directory(self.directory)

    def keep(self, kept: Kept) -> str | None:
        """Writes a copy of a demonstration. Returns the reason when that fails; the demonstration can still be written
        at the end."""
        place = self.directory / UNFINISHED / f"{self._count:04}"
        self._count += 1
        self._copies.append(place)
        try:
            save_demonstrations(place, *self._recording([kept]))
        except BadInput as error:
            return str(error)
        except OSError as error:
            return f"{place}: cannot be written ({error.strerror}); {remedy(error)}"
        return None

    def drop(self) -> None:
        """Removes the copy of the last one that is still kept."""
        shutil.rmtree(self._copies.pop(), ignore_errors=True)

    def finish(self, kept: Sequence[Kept], report: Callable[[str], None] = say) -> bool:
        """Writes the kept demonstrations as one recording and removes the copies. False when the disk failed: they stay.

        Without any demonstration the directory is removed. Raises BadInput when nothing can be written there at all.
        """
        if not kept:
            shutil.rmtree(self.directory, ignore_errors=True)
            return True
        try:
            write_demonstrations(self.directory, *self._recording(kept))
        except OSError as error:
            report(f"{self.directory}: cannot be written ({error.strerror}); what was kept is in {UNFINISHED} there")
            return False
        shutil.rmtree(self.directory / UNFINISHED, ignore_errors=True)
        return True

    def _recording(self, kept: Sequence[Kept]) -> tuple[str, list[Demonstration], dict[str, object]]:
        """Behavior, demonstrations and their origin."""
        seeds = {episode: each.seed for episode, each in enumerate(kept)}
        origin = Origin("keyboard", self._simulation, seeds, self._details)
        return self._behavior, in_sequence(each.demonstration for each in kept), about_origins([origin])
