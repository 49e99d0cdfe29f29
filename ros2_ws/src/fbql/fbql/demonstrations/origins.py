"""The origin of demonstrations: who gave them, and how each world started, so that it can be driven again; merging
recordings."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fbql_behaviors.core.patterns import Demonstration
from fbql_behaviors.demonstration_storage import Recording, check_behavior, load_recordings
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import from_mapping
from fbql_sim.core.parameters import SimulationParameters

from fbql.demonstrations.recording import in_sequence

ORIGINS_KEY = "origins"
"""Key in a recording's description of itself; the value is a JSON list of `Origin` objects."""


@dataclass(frozen=True)
class Origin:
    """The origin of demonstrations that one instructor gave in one world."""

    instructor: str
    """scripted, or keyboard for a person."""
    simulation: SimulationParameters
    episode_seeds: Mapping[int, int]
    """Episode -> seed of its world."""
    details: Mapping[str, object] = field(default_factory=dict[str, object])
    """Anything else worth keeping."""

    def renumbered(self, numbers: Mapping[int, int]) -> Origin:
        """The same with new episode numbers (old -> new); episodes without one are left out."""
        kept = {numbers[episode]: seed for episode, seed in self.episode_seeds.items() if episode in numbers}
        return Origin(self.instructor, self.simulation, kept, self.details)


def about_origins(origins: Sequence[Origin]) -> dict[str, object]:
    """The origins as a recording's description of itself holds them."""
    return {ORIGINS_KEY: [asdict(origin) for origin in origins]}


def origins_of(about: Mapping[str, str], where: object) -> list[Origin]:
    """The origins that a recording names; empty if it names none. Raises BadInput if they can't be read."""
    try:
        return [_origin(each) for each in json.loads(about.get(ORIGINS_KEY, "[]"))]
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise BadInput(f"{where}: the origin of its demonstrations cannot be read ({error})") from None


def _origin(stored: Mapping[str, Any]) -> Origin:
    seeds = {int(episode): int(seed) for episode, seed in stored["episode_seeds"].items()}
    if min(seeds.values(), default=0) < 0:
        raise ValueError("a seed is negative")
    simulation = from_mapping(SimulationParameters, stored["simulation"], "simulation")
    return Origin(str(stored["instructor"]), simulation, seeds, dict(stored["details"]))


def recordings_of(paths: Sequence[Path], behavior: str | None = None) -> list[Recording]:
    """The recordings at these paths, or below these directories, all of one behavior and with demonstrations.

    Raises BadInput: one can't be read, or is not of `behavior` (of the first one's behavior, if that is None).
    """
    found = [recording for path in paths for recording in load_recordings(path)]
    wanted = behavior or found[0].behavior
    for recording in found:
        check_behavior(recording, wanted)
        if not recording.demonstrations:
            raise BadInput(f"{recording.file}: holds no demonstration: no world state with a command")
    return found


def merge(recordings: Sequence[Recording]) -> tuple[list[Demonstration], list[Origin]]:
    """The demonstrations of all recordings, in order, and their origins. Raises BadInput."""
    demonstrations: list[Demonstration] = []
    origins: list[Origin] = []
    for recording in recordings:
        first = len(demonstrations)
        numbers = {part.worlds[0].episode: first + index for index, part in enumerate(recording.demonstrations)}
        origins += [origin.renumbered(numbers) for origin in origins_of(recording.about, recording.file)]
        demonstrations += recording.demonstrations
    return in_sequence(demonstrations), origins
