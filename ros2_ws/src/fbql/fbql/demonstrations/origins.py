"""Where demonstrations come from: who gave them, and how the world of each began, so that it can be driven again."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import from_mapping
from fbql_sim.core.parameters import SimulationParameters

ORIGINS_KEY = "origins"
"""Key in what a recording says about itself; the value is a JSON list, one object an `Origin`."""


@dataclass(frozen=True)
class Origin:
    """The origin of demonstrations that one instructor gave in one world."""

    instructor: str
    """scripted, or keyboard for a person."""
    simulation: SimulationParameters
    episode_seeds: Mapping[int, int]
    """Episode -> seed that its world began with."""
    details: Mapping[str, object] = field(default_factory=dict[str, object])
    """What else is worth keeping."""

    def renumbered(self, numbers: Mapping[int, int]) -> Origin:
        """The same with other episode numbers, old -> new; an episode that has none is left out."""
        kept = {numbers[episode]: seed for episode, seed in self.episode_seeds.items() if episode in numbers}
        return Origin(self.instructor, self.simulation, kept, self.details)


def about_origins(origins: Sequence[Origin]) -> dict[str, object]:
    """What a recording says about the origins of its demonstrations."""
    return {ORIGINS_KEY: [asdict(origin) for origin in origins]}


def origins_of(about: Mapping[str, str], where: object) -> list[Origin]:
    """The origins that a recording tells of; none where it does not tell. Raises BadInput for what makes no sense."""
    try:
        return [_origin(told) for told in json.loads(about.get(ORIGINS_KEY, "[]"))]
    except (BadInput, ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadInput(f"{where}: what it says about its origin cannot be read ({error})") from None


def _origin(told: Mapping[str, Any]) -> Origin:
    seeds = {int(episode): int(seed) for episode, seed in told["episode_seeds"].items()}
    if min(seeds.values(), default=0) < 0:
        raise ValueError("a seed is negative")
    simulation = from_mapping(SimulationParameters, told["simulation"], "simulation")
    return Origin(str(told["instructor"]), simulation, seeds, dict(told["details"]))
