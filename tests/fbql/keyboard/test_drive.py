"""A person demonstrates: keys into a terminal, a live graph, and a recording that a tree is made from."""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import signal
import termios
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic

import pytest
from bringup_run import END_S, HOSTILE, Run, Terminal, in_namespace
from fbql.demonstrations.replay import verify
from fbql_behaviors.demonstration_storage import load_demonstrations, load_recordings
from patience import PATIENCE_S

Start = Callable[..., Run]
BEHAVIOR = "ball_seeking"


class Screen:
    """A terminal with somebody before it, who types, and reads what was not there before."""

    def __init__(self, terminal: Terminal | None = None) -> None:
        self.terminal = terminal or Terminal()
        self.text = ""
        self.read = 0
        """Up to where `text` was read."""
        self._open = True

    def type(self, keys: str) -> None:
        self.terminal.type(keys.encode())

    def until(self, run: Run, pattern: str) -> None:
        """Reads on until something is shown that was not read before."""
        deadline = monotonic() + PATIENCE_S
        while not (found := re.compile(pattern).search(self.text, self.read)):
            ended = run.popen.poll() is not None
            with contextlib.suppress(UnicodeDecodeError):  # half a character has come
                self.text = self.terminal.shown
            if (ended and not re.compile(pattern).search(self.text, self.read)) or monotonic() > deadline:
                pytest.fail(f"'{pattern}' is not shown; the last that is: {self.text[-2000:]!r}")
            select.select([], [], [], 0.02)
        self.read = found.end()

    def hang_up(self) -> None:
        """Closes the terminal, as its window's button does."""
        if self._open:
            self._open = False
            self.terminal.close()


@pytest.fixture
def screen() -> Iterator[Screen]:
    made = Screen()
    yield made
    made.hang_up()


@pytest.fixture
def sit_down(start: Start, screen: Screen) -> Callable[..., Run]:
    """Starts to demonstrate at the screen, and waits until one can drive."""

    def begin(*arguments: str) -> Run:
        run = start(
            *(BEHAVIOR, "--keyboard", "--json", "--realtime", "4", *arguments),
            script="demonstrate.py",
            terminal=screen.terminal,
            environment={"TERM": "xterm-256color", "LC_ALL": "C.UTF-8", "NO_COLOR": "1"},
        )
        screen.until(run, "begins with your first key")
        return run

    return begin


def drive(run: Run, screen: Screen, keys: str, steps: int) -> None:
    """Drives until the screen counts at least so many steps."""
    screen.type(keys)
    while True:
        screen.until(run, r"s, (?=\d+ steps)")
        if int(screen.text[screen.read :].split()[0]) >= steps:
            return


def recorded(path: Path) -> list[int]:
    """Lengths of the demonstrations, which must be those that driving again gives."""
    assert verify(list(load_recordings(path))).identical
    return [len(part.worlds) for part in load_demonstrations(path, BEHAVIOR)]


def test_what_a_person_drives_becomes_a_tree(
    sit_down: Callable[..., Run], screen: Screen, start: Start, tmp_path: Path
) -> None:
    terminal = os.dup(screen.terminal.descriptor)
    before = termios.tcgetattr(terminal)
    run = sit_down("--seed", "3")
    assert "ball distance" in screen.text
    drive(run, screen, "www\x1b[D", 60)
    screen.type("n")
    screen.until(run, r"kept demonstration 1: \d+ steps")
    drive(run, screen, "ww", 20)
    screen.type("u")
    screen.until(run, "dropped; drive it again")
    drive(run, screen, "w\x1b[C", 30)
    screen.type("n")
    screen.until(run, "kept demonstration 2")
    screen.type("u")
    screen.until(run, "dropped demonstration 2")
    drive(run, screen, "w", 20)
    screen.type("q")
    screen.until(run, r"\?1049l")
    assert run.exit_code(END_S) == 0, run.stderr
    assert run.processes() == {}
    assert termios.tcgetattr(terminal) == before
    os.close(terminal)

    result = json.loads(run.stdout)
    assert (result["demonstrations"], result["path"]) == (2, str(run.out))
    lengths = recorded(run.out)
    assert len(lengths) == 2
    assert lengths[0] >= 60
    assert result["patterns"] == sum(-(-length // 6) for length in lengths)
    first = load_demonstrations(run.out, BEHAVIOR)[0]
    assert max(command.left_rad_s for command in first.commands) == pytest.approx(3 * 88.0 / 14)
    assert any(command.left_rad_s < command.right_rad_s for command in first.commands), "it turned to the left"

    tree = tmp_path / "ball_seeking.json"
    induced = start(BEHAVIOR, "--demos", str(run.out), "--out", str(tree), "--json", script="induce.py", out=False)
    assert induced.exit_code() == 0, induced.stderr
    assert json.loads(induced.stdout)["leaves"] >= 1


def test_nothing_is_lost_when_the_terminal_is_closed(sit_down: Callable[..., Run], screen: Screen) -> None:
    run = sit_down()
    drive(run, screen, "w", 12)
    screen.hang_up()
    assert run.exit_code(END_S) == 0
    assert len(recorded(run.out)) == 1
    run.gone_within(END_S)


def test_nothing_is_lost_when_it_is_interrupted(sit_down: Callable[..., Run], screen: Screen) -> None:
    run = sit_down("--ascii")
    drive(run, screen, "w", 12)
    screen.type("n")
    screen.until(run, "kept demonstration 1")
    drive(run, screen, "w", 12)
    screen.type("\x03")  # by the terminal, as a person does it
    screen.until(run, "ended by SIGINT; what was demonstrated until then is saved")
    assert run.exit_code(END_S) == 0
    assert len(recorded(run.out)) == 2
    run.gone_within(END_S)


def test_when_the_simulator_dies_what_was_driven_is_written(sit_down: Callable[..., Run], screen: Screen) -> None:
    run = sit_down()
    drive(run, screen, "w", 12)
    os.kill(run.nodes()["simulator"], signal.SIGKILL)
    screen.until(run, "the simulator was ended by SIGKILL")
    assert run.exit_code(END_S) == 1
    assert len(recorded(run.out)) == 1


def test_without_a_terminal_it_says_so_in_one_line(start: Start) -> None:
    run = start(BEHAVIOR, "--keyboard", script="demonstrate.py")
    assert run.exit_code() == 2
    assert run.stderr.splitlines()[-1] == (
        "demonstrate.py: an interactive terminal is needed: standard input is not one; start it in a terminal"
    )
    assert not run.out.exists()


def test_a_hostile_environment_costs_lines_and_nothing_that_was_driven(
    start: Start, screen: Screen, tmp_path: Path
) -> None:
    out = tmp_path / "naïve"
    run = start(
        *(BEHAVIOR, "--keyboard", "--json", "--realtime", "4", "--out", str(out)),
        script="demonstrate.py",
        out=False,
        terminal=screen.terminal,
        before=in_namespace("mount -t tmpfs -o ro tmpfs /dev/shm"),
        environment={**HOSTILE, "TERM": "vt100"},
    )
    screen.until(run, "ROS_LOCALHOST_ONLY is set aside")
    screen.until(run, "shared memory can't be used")
    screen.until(run, "begins with your first key")
    drive(run, screen, "www", 30)
    screen.type("q")
    screen.until(run, r"\?1049l")
    assert run.exit_code(END_S) == 0, screen.text
    assert json.loads(run.stdout)["demonstrations"] == 1
    assert recorded(out)[0] >= 30
    assert screen.terminal.shown.isascii()
    assert "Traceback" not in screen.terminal.shown


def test_a_terminal_that_is_too_small_says_so_and_is_given_back(start: Start) -> None:
    small = Screen(Terminal(20, 5))
    run = start(
        *(BEHAVIOR, "--keyboard"),
        script="demonstrate.py",
        terminal=small.terminal,
        environment={**HOSTILE, "TERM": "xterm"},
    )
    small.until(run, "This terminal is 20")
    small.type("q")
    small.until(run, "nothing was demonstrated")
    assert run.exit_code(END_S) == 1
    assert run.processes() == {}
    assert "Traceback" not in small.terminal.shown
    small.hang_up()


@pytest.mark.parametrize("name", [None, "", "dumb", "unknown"])
def test_a_terminal_that_can_not_be_drawn_on_is_one_line(start: Start, name: str | None) -> None:
    terminal = Terminal()
    run = start(BEHAVIOR, "--keyboard", script="demonstrate.py", terminal=terminal, environment={"TERM": name})
    assert run.exit_code() == 2, terminal.shown
    (line,), rest = terminal.lines()
    terminal.close()
    assert line == f"demonstrate.py: an interactive terminal is needed: TERM is '{name or ''}'; start it in another"
    assert rest == [""]
    assert not run.out.exists()
