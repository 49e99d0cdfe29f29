"""`--watch terminal`: a person sees the match, sets its pace, and changes none of it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bringup_run import END_S, Run, Terminal
from run_directory_reader import summary_of

Start = Callable[..., Run]
COLOURLESS = {"TERM": "xterm-256color", "LC_ALL": "C.UTF-8", "NO_COLOR": "1"}
MATCH = ("--goals", "2", "--seed", "0")


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    made = Terminal()
    yield made
    made.close()


def type_when(run: Run, terminal: Terminal, pattern: str, keys: bytes, since: int = 0) -> int:
    """Types once the screen has shown something since a place in what was shown; returns the place."""
    run.until(lambda: re.search(pattern, terminal.shown[since:]), f"the screen shows '{pattern}'")
    place = len(terminal.shown)
    terminal.type(keys)
    return place


@pytest.mark.parametrize("processes", ["many", "one"])
def test_a_watched_match_is_the_match_bit_for_bit(
    start: Start, terminal: Terminal, processes: str, tmp_path: Path
) -> None:
    alone = start(*MATCH, "--json", "--out", str(tmp_path / "alone"), script="train.py", out=False)
    assert alone.exit_code() == 0, alone.stderr
    run = start(*MATCH, "--processes", processes, "--watch", "--json", terminal=terminal, environment=COLOURLESS)
    at = type_when(run, terminal, r"step \d\d", b" ")
    at = type_when(run, terminal, r"paused \(1 x real time\)", b"sss", at)
    at = type_when(run, terminal, r"step \d+", b"n", at)
    at = type_when(run, terminal, "episode 0: (goal|own goal|timeout) after", b"  ", at)
    terminal.type(b"n+++++++++")
    assert run.exit_code() == 0, terminal.shown[-3000:]
    assert json.loads(run.stdout) == summary_of(run.out)
    assert summary_of(run.out)["digest"] == json.loads(alone.stdout)["digest"]
    for words in ("fbql, ", "goals", "drives alone", "pause, continue", "So the command is"):
        assert words in terminal.shown
    assert "\x1b[1;36m" not in terminal.shown, "NO_COLOR"


def test_whoever_stops_watching_gets_the_result_at_once(start: Start, terminal: Terminal) -> None:
    run = start("--goals", "3", "--processes", "one", "--json", "--watch", terminal=terminal, environment=COLOURLESS)
    type_when(run, terminal, r"step \d\d", b"q")
    assert run.exit_code() == 0, terminal.shown[-3000:]
    assert summary_of(run.out)["goals"] == 3
    assert "\x1b[?1049l" in terminal.shown


def test_a_signal_ends_a_paused_match(start: Start, terminal: Terminal) -> None:
    run = start("--goals", "3", "--processes", "one", "--watch", terminal=terminal, environment=COLOURLESS)
    at = type_when(run, terminal, r"step \d\d", b" ")
    type_when(run, terminal, "paused", b"\x03", at)
    assert run.exit_code(END_S + 10.0) == 0
    run.gone_within(END_S)
    assert "ended by SIGINT after 0 of 3 goals" in terminal.shown


@pytest.mark.parametrize(
    ("script", "arguments"),
    [("bringup.py", ("--goals", "1")), ("replay.py", ("RUN",)), ("demonstrate.py", ("--replay", "RUN"))],
)
def test_without_a_terminal_it_is_refused_in_one_line(
    start: Start, script: str, arguments: tuple[str, ...], tmp_path: Path
) -> None:
    run = start(*arguments, "--watch", "terminal", script=script, out=False)
    assert run.exit_code() == 2
    assert run.stderr.splitlines()[-1] == (
        f"{script}: an interactive terminal is needed: standard input is not one; start it in a terminal"
    )


def test_a_replay_is_watched(start: Start, terminal: Terminal, tmp_path: Path) -> None:
    made = start("--goals", "1", "--processes", "one", "--json", "--out", str(tmp_path / "made"), out=False)
    assert made.exit_code() == 0, made.stderr
    run = start(
        *(str(tmp_path / "made"), "--watch", "--json"),
        script="replay.py", terminal=terminal, environment=COLOURLESS, out=False,
    )  # fmt: skip
    at = type_when(run, terminal, r"step \d\d", b" ")
    at = type_when(run, terminal, "paused", b"s", at)
    type_when(run, terminal, r"step \d+", b"n", at)
    assert run.exit_code() == 0, terminal.shown[-3000:]
    result = json.loads(run.stdout)
    assert result["complete"] is True
    assert result["messages"] >= json.loads(made.stdout)["messages_recorded"] - 5
    assert "drives alone, because of its rule" in re.sub(r"\x1b\[\d+H\x1b\[K|\n", " ", terminal.shown)
    assert "episode 0: goal after" in terminal.shown
