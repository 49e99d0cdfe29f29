"""The files beside a damaged recording: what they can repair in it, and which of them are copied."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from fbql_common.core.plain_json import json_from
from fbql_common.core.recording_names import CONFIG, EPISODES, POLICY, TREES
from fbql_common.core.types import Phase
from fbql_common.files import write_atomically
from mcap.records import Attachment

from fbql_recording.core.metrics import Digest, EpisodeRecord, step_bytes, summarise
from fbql_recording.core.steps import Step
from fbql_recording.plain_yaml import mapping_from_yaml
from fbql_recording.run import Run
from fbql_recording.run_directory import custom_data
from fbql_recording.run_files import read_inside

SUMMARY = "summary.json"
_MEDIA_TYPES = {CONFIG: "application/yaml", EPISODES: "text/csv", POLICY: "application/octet-stream"}
_TREE_TYPE = "application/json"


class RunDirectoryFiles:
    """The files of a run directory; none for a file alone, or for a bag that is not one of our runs.

    Args:
        directory: where the recording is.
    """

    def __init__(self, directory: Path | None) -> None:
        self._data: dict[str, bytes] = {}
        """By name, which is the same in the directory and in a recording."""
        config = None if directory is None else read_inside(directory, CONFIG)
        if directory is None or config is None or custom_data_of(config) is None:
            return
        trees = directory / TREES
        names = [f"{TREES}{path.name}" for path in sorted(trees.glob("*.json"))] if trees.is_dir() else []
        for name in (CONFIG, EPISODES, POLICY, SUMMARY, *names):
            data = read_inside(directory, name)
            if data is not None:
                self._data[name] = data

    def attachments(self, found: Mapping[str, Attachment]) -> list[Attachment]:
        """Those that the recording should have and lacks; also takes over those that only the recording has."""
        lacking = [
            Attachment(0, 0, name, _MEDIA_TYPES.get(name, _TREE_TYPE), data)
            for name, data in self._data.items()
            if name != SUMMARY and name not in found
        ]
        for name, attachment in found.items():
            plain = name.removeprefix(TREES)
            if name in _MEDIA_TYPES or (name.startswith(TREES) and plain and "/" not in plain and "\0" not in plain):
                self._data.setdefault(name, attachment.data)
        return lacking

    def about(self, recorded: Mapping[str, str], notes: list[str]) -> dict[str, str]:
        """The recording's description of its run, corrected by its configuration, which a CRC covers."""
        told = custom_data_of(self._data.get(CONFIG, b""))
        mended = {**recorded, **told} if told else dict(recorded)
        if recorded and mended != dict(recorded):
            notes.append("what the recording says about its run is damaged; it is taken from the configuration")
        return mended

    def write_to(self, directory: Path, is_complete: bool) -> None:
        """Writes them to the new run directory; a summary says whether the recording is complete. Raises OSError."""
        for name, data in self._data.items():
            if name == SUMMARY and not is_complete:
                data = _incomplete(data)
            (directory / name).write_bytes(data)

    def write_summary(self, run: Run, messages: int) -> int:
        """Reads the new recording to its end; returns its number of steps.

        A run that was killed has no summary: one is computed from the recorded data. Raises BadInput, OSError.
        """
        told = custom_data_of(self._data.get(CONFIG, b""))
        if SUMMARY in self._data or told is None or EPISODES not in self._data:
            return sum(1 for _ in run.step_data())
        digest = Digest()
        count = 0
        has_gap = False

        def digested() -> Iterator[Step]:
            nonlocal count, has_gap
            for step in run.steps():
                count += 1
                has_gap |= step.after_gap
                if step.world is not None and step.command is not None:
                    digest.add(step_bytes(step.world, step.command.left_rad_s, step.command.right_rad_s))
                yield step

        episodes = run.episodes(digested())
        records = [
            EpisodeRecord(
                index=episode.index,
                phase=Phase[episode.phase.upper()],
                seed=episode.seed,
                outcome=episode.outcome,
                steps=episode.steps,
                collisions_begun=episode.collisions_begun or 0,
                collision_steps=episode.collision_steps or 0,
                return_=episode.return_ or 0.0,
                degraded=bool(episode.degraded),
            )
            for episode in episodes
            if episode.outcome is not None and episode.phase is not None and episode.seed is not None
        ]
        if not has_gap:
            summary = summarise(
                controller=told["controller"],
                seed=int(told["seed"]),
                records=records,
                steps=sum(episode.steps for episode in episodes),
                digest=digest.hex,
                messages_recorded=messages,
                incomplete=True,
            )
            write_atomically(run.path / SUMMARY, (json.dumps(summary._asdict(), indent=2) + "\n").encode())
        return count


def custom_data_of(config: bytes) -> dict[str, str] | None:
    """A recording's description of its run, from its configuration; None if that is not one of ours."""
    try:
        about = custom_data(mapping_from_yaml(config, CONFIG))
        int(about["seed"])
    except (ValueError, KeyError, TypeError):
        return None
    return about


def _incomplete(summary: bytes) -> bytes:
    try:
        values: dict[str, Any] = {**json_from(summary), "incomplete": True}
    except (ValueError, TypeError):
        return summary
    return (json.dumps(values, indent=2) + "\n").encode()
