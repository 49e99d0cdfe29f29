"""Several recordings of one behavior's demonstrations as one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fbql_behaviors.core.patterns import Demonstration
from fbql_behaviors.demonstration_storage import Recording, load_recordings
from fbql_common.core.errors import BadInput

from fbql.demonstrations.origins import Origin, origins_of
from fbql.demonstrations.recording import in_sequence


def recordings_of(paths: Sequence[Path], behavior: str | None = None) -> list[Recording]:
    """The recordings at these places, or below these directories, all of one behavior and with demonstrations.

    Raises BadInput: one can't be read, or is of another behavior than `behavior` or, without that, than the first.
    """
    found = [recording for path in paths for recording in load_recordings(path)]
    wanted = behavior or found[0].behavior
    for recording in found:
        if not recording.behavior or recording.behavior != wanted:
            held = recording.behavior or "no behavior"
            raise BadInput(f"{recording.file}: holds demonstrations of '{held}', not of '{wanted or 'any behavior'}'")
        if not recording.demonstrations:
            raise BadInput(f"{recording.file}: holds no demonstration: no world state with its command")
    return found


def merge(recordings: Sequence[Recording]) -> tuple[list[Demonstration], list[Origin]]:
    """The demonstrations of all recordings, in their order, and where they come from. Raises BadInput."""
    demonstrations: list[Demonstration] = []
    origins: list[Origin] = []
    for recording in recordings:
        first = len(demonstrations)
        numbers = {part.worlds[0].episode: first + index for index, part in enumerate(recording.demonstrations)}
        origins += [origin.renumbered(numbers) for origin in origins_of(recording.about, recording.file)]
        demonstrations += recording.demonstrations
    return in_sequence(demonstrations), origins
