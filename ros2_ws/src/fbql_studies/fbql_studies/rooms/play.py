"""Episodes in rooms, in-process, driven by rules that need no learning; `learned` has those of the mux."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from fbql_common.core.command_space import Command

from fbql_studies.rooms.maps import Room
from fbql_studies.rooms.priorities import Gates, Setting
from fbql_studies.rooms.robot import MAX_STEPS, SPACE, Ranges, Reading
from fbql_studies.rooms.sources import SOURCES, Source
from fbql_studies.rooms.worlds import World

SUCCESS, COLLISION, TIMEOUT = "success", "collision", "timeout"


class End(NamedTuple):
    """How one episode ended."""

    seed: int
    """The seed of the room."""
    outcome: str
    """success, collision or timeout"""
    steps: int
    cost: int
    """Its steps; a failure counts MAX_STEPS, however early it came."""


def outcome_of(reading: Reading) -> str:
    """The word for how an episode ended; empty if it has not."""
    if reading.terminated:
        return COLLISION if reading.collided else SUCCESS
    return TIMEOUT if reading.truncated else ""


def end_of(room: Room, reading: Reading) -> End:
    """The end of an episode in its last reading."""
    outcome = outcome_of(reading)
    return End(room.seed, outcome, reading.step, reading.step if outcome == SUCCESS else MAX_STEPS)


def drive(
    world: World, rooms: Iterable[Room], choose: Callable[[Reading], Command], begin: Callable[[], None]
) -> Iterator[End]:
    """Drives through rooms by a rule. `begin` is called before each."""
    for room in rooms:
        begin()
        reading = world.reset(room)
        while not (reading.terminated or reading.truncated):
            reading = world.step(*SPACE.limited(choose(reading)))
        yield end_of(room, reading)


def _heard(reading: Reading) -> tuple[Ranges, float, float]:
    return reading.ranges, reading.goal_distance_m, reading.goal_bearing_rad


def alone(source: Source, world: World, rooms: Iterable[Room]) -> Iterator[End]:
    """One source drives."""
    return drive(world, rooms, lambda reading: source(*_heard(reading)), lambda: None)


def blended(
    weights: Sequence[float], world: World, rooms: Iterable[Room], sources: Mapping[str, Source] = SOURCES
) -> Iterator[End]:
    """All sources drive, by constant weights."""

    def choose(reading: Reading) -> Command:
        heard = _heard(reading)
        commands = [source(*heard) for source in sources.values()]
        return tuple(sum(w * x for w, x in zip(weights, axis, strict=True)) for axis in zip(*commands, strict=True))

    return drive(world, rooms, choose, lambda: None)


def by_priorities(setting: Setting, world: World, rooms: Iterable[Room]) -> Iterator[End]:
    """Priorities drive. Only the source that drives computes a command."""
    gates = Gates(setting)
    sources = list(SOURCES.values())

    def choose(reading: Reading) -> Command:
        open_now = gates.open(reading)
        return sources[next(i for i in gates.order if open_now[i])](*_heard(reading))

    return drive(world, rooms, choose, gates.reset)
