"""Drives the simulator again with the commands of demonstrations, and compares it with what was recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fbql_behaviors.core.patterns import Demonstration
from fbql_behaviors.demonstration_storage import Recording
from fbql_common.core.types import World
from fbql_recording.message_definitions import step_messages
from fbql_sim.core.world_loop import WorldLoop

from fbql.demonstrations.origins import origins_of


@dataclass(frozen=True)
class DemonstrationReplay:
    """The result of driving demonstrations again."""

    steps: int = 0
    """Steps that are identical bit for bit, up to the first difference."""
    first_difference: str | None = None
    without_start: int = 0
    """Demonstrations that can't be driven again, because the recording does not name their start."""

    @property
    def identical(self) -> bool:
        """Whether every demonstration was driven again and every step was identical."""
        return self.first_difference is None and self.without_start == 0


def verify(recordings: Sequence[Recording]) -> DemonstrationReplay:
    """Drives every demonstration again from its start, up to the first difference. Raises BadInput."""
    steps = without_start = 0
    for recording in recordings:
        starts = _starts(recording)
        for demonstration in recording.demonstrations:
            episode = demonstration.worlds[0].episode
            if episode not in starts:
                without_start += 1
                continue
            loop, seed = starts[episode]
            same, difference = _drive_again(demonstration, loop, seed)
            steps += same
            if difference is not None:
                return DemonstrationReplay(
                    steps, f"{recording.file}: demonstration {episode}, {difference}", without_start
                )
    return DemonstrationReplay(steps, None, without_start)


def _starts(recording: Recording) -> Mapping[int, tuple[WorldLoop, int]]:
    """Episode -> the world it was driven in, and its seed."""
    starts: dict[int, tuple[WorldLoop, int]] = {}
    for origin in origins_of(recording.about, recording.file):
        loop = WorldLoop(origin.simulation)
        starts.update({episode: (loop, seed) for episode, seed in origin.episode_seeds.items()})
    return starts


def _drive_again(demonstration: Demonstration, loop: WorldLoop, seed: int) -> tuple[int, str | None]:
    """How many steps are the same, and the first difference in words."""
    encode_world = step_messages()[World].codec.encode
    world = loop.reset(0, seed)
    for count, (recorded, command) in enumerate(zip(demonstration.worlds, demonstration.commands, strict=True)):
        # Episode number and time differ when the same moment is driven again.
        again = world._replace(stamp_ns=recorded.stamp_ns, episode=recorded.episode)
        if encode_world(again) != encode_world(recorded):
            return count, f"step {recorded.step}: {_first_difference(recorded, again)}"
        if world.ended:
            return count, f"step {recorded.step}: the episode has ended, but the recording continues"
        world = loop.step(command.left_rad_s, command.right_rad_s)
    return len(demonstration.worlds), None


def _first_difference(recorded: World, again: World) -> str:
    fields = zip(World._fields, recorded, again, strict=True)
    name, was, now = next((name, was, now) for name, was, now in fields if repr(was) != repr(now))
    return f"{name} was {was!r} and is now {now!r}"
