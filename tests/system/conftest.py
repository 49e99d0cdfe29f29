"""Commands of ours as real processes, none of which outlives its test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bringup_run import Run


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    """Starts a command of ours with its run in a directory of the test: start(*arguments, ...). See `Run`."""
    started: list[Run] = []

    def begin(*arguments: str, out: bool = True, **options: object) -> Run:
        place = tmp_path / str(len(started))
        place.mkdir()
        words = [*arguments, "--out", str(place / "run")] if out else list(arguments)
        started.append(Run(place, words, **options))
        return started[-1]

    yield begin
    for run in started:
        run.close()
