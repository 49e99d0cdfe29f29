"""Whatever a recorded run holds: each command works with it, reports what is wrong, or refuses it in one line."""

from __future__ import annotations

import os
import random
import re
import shutil
from dataclasses import replace
from pathlib import Path

import commands
import pytest
import yaml
from damaged_recordings import mcap_of
from fbql_recording.run import open_run
from fuzzing import LONGEST_COMMAND_S, bounded, dice, finite_json, odd_bytes, odd_copy, read_or_refused
from mcap.records import Attachment
from mcap_contents import Contents, contents_of, odd_contents
from recorded_match import record_match

COMMANDS: dict[str, list[str]] = {
    "recover": ["--out", "OUT"],
    "report": ["--out", "OUT"],
    "compare": ["OTHER"],
    "replay": ["--verify"],
    "what if": ["--set", "weight_gain=0.05", "--csv", "OUT.csv"],
    "what else": ["--set", "learning_rate=0.2", "--controller", "fbql_literal"],
    "demonstrate": ["--replay", "RUN", "--json"],
    "induce": ["ball_seeking", "--demos", "RUN", "--trials", "2", "--out", "OUT.json"],
}
"""Commands that read a run, and what is typed behind it."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of seven steps, in which something is learned. Not to be changed."""
    place = tmp_path_factory.mktemp("recorded") / "run"
    return record_match(place, max_steps=6, episodes=2, controller="fbql_literal", guided=1)


@pytest.fixture(scope="module")
def contents(recorded: Path) -> Contents:
    return contents_of(mcap_of(recorded).read_bytes())


@pytest.fixture(scope="module")
def undescribed(contents: Contents) -> Contents:
    """Without the files in the recording, so that those beside it are read."""
    return replace(contents, data=[part for part in contents.data if not isinstance(part, Attachment)])


def change_beside(run: Path, rng: random.Random) -> str:
    """Changes one of the files beside the recording, or none."""
    name = rng.choice(("", "metadata.yaml", "config.yaml", "episodes.csv", "summary.json"))
    path = run / name
    if name.endswith(".yaml"):
        path.write_text(yaml.safe_dump(odd_copy(yaml.safe_load(path.read_text()), rng)))
    elif name:
        path.write_bytes(odd_bytes(path.read_bytes(), rng, b"[" * 3000))
    return name


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_works_with_any_recording_or_says_what_is_wrong(
    recorded, contents, undescribed, place, capsys, monkeypatch, command
):
    monkeypatch.setattr(os, "fsync", lambda _: None)
    name = "replay" if command.startswith("what") else command
    for number, rng in enumerate(dice(8)):
        run = Path(shutil.copytree(recorded, place / "run"))
        what, _, data = odd_contents(contents if rng.random() < 0.7 else undescribed, rng)
        mcap_of(run).write_bytes(odd_bytes(data, rng) if rng.random() < 0.15 else data)
        case = number, what, change_beside(run, rng)
        given = str(run if rng.random() < 0.7 else mcap_of(run))
        texts = {"OUT": str(place / "out"), "OTHER": str(recorded), "RUN": given}
        words = [re.sub("^(OUT|OTHER|RUN)", lambda match: texts[match[0]], word) for word in COMMANDS[command]]  # noqa: B023
        if "RUN" not in COMMANDS[command]:
            words = [given, *words]
        is_json = rng.random() < 0.5 and "--json" not in words
        if command in ("report", "compare", "what if", "what else") and rng.random() < 0.5:
            words.append("--skip-corrupt")
        with bounded(LONGEST_COMMAND_S):
            code = getattr(commands, name)([*words, *["--json"] * is_json])
        out, err = capsys.readouterr()
        said = err.splitlines()
        assert code in ((0, 1, 2, 3) if name in ("replay", "demonstrate") else (0, 2, 3)), case
        assert all(line.isprintable() for line in [*out.splitlines(), *said]), case
        assert (not out and said) if code == 2 else code == 0 or out or said, case
        if out and (is_json or "--json" in words):
            finite_json(out)
        if code == 0 and name in ("report", "compare"):
            found = read_or_refused(lambda given=given: open_run(given, skip_corrupt=True))
            assert found is None or found.is_complete or said, case
        assert not [path.name for path in place.iterdir() if path.name.endswith(".tmp")], case
        for path in place.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
