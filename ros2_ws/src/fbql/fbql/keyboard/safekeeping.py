"""What was demonstrated so far, on disk while the sitting goes on, so that not even a power cut takes all of it.

Each demonstration is a whole recording of its own, below the directory of the sitting's; they go when that is written.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fbql_behaviors.core.patterns import Demonstration
from fbql_common.core.errors import BadInput
from fbql_sim.core.parameters import SimulationParameters

from fbql.demonstrations.origins import Origin, about_origins
from fbql.demonstrations.recording import in_sequence, make_directory, save_demonstrations, say, write_demonstrations
from fbql.keyboard.sitting import Kept

UNFINISHED = "unfinished"


class Safekeeping:
    """The recording of a sitting, in a directory of its own."""

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
        """Keeps a copy of a demonstration. When that fails, gives the reason; it can still be written at the end."""
        place = self.directory / UNFINISHED / f"{self._count:04}"
        self._count += 1
        self._copies.append(place)
        reasons: list[str] = []
        try:
            save_demonstrations(place, *self._recording([kept]), reasons.append)
        except BadInput as error:
            reasons.append(str(error))
        return reasons[0] if reasons else None

    def drop(self) -> None:
        """Drops the copy of the last one that is still kept."""
        shutil.rmtree(self._copies.pop(), ignore_errors=True)

    def finish(self, kept: Sequence[Kept], report: Callable[[str], None] = say) -> bool:
        """Writes all that is kept as one recording; without any, nothing is left. False when the disk failed.

        The copies stay where it could not be written. Raises BadInput when nothing can be written there at all.
        """
        if not kept:
            shutil.rmtree(self.directory, ignore_errors=True)
            return True
        if not write_demonstrations(self.directory, *self._recording(kept), report):
            return False
        shutil.rmtree(self.directory / UNFINISHED, ignore_errors=True)
        return True

    def _recording(self, kept: Sequence[Kept]) -> tuple[str, list[Demonstration], dict[str, object]]:
        """Behavior, demonstrations and what is said about them."""
        seeds = {episode: each.seed for episode, each in enumerate(kept)}
        origin = Origin("keyboard", self._simulation, seeds, self._details)
        return self._behavior, in_sequence(each.demonstration for each in kept), about_origins([origin])
