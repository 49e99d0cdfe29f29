"""Signals to bringup and to its nodes, at any time: everything ends within 5 s, the recording is finished, no process is
left, and nothing reads as if all had been played."""

from __future__ import annotations

import itertools
import json
import os
import signal
from collections.abc import Callable

import pytest
from bringup_run import END_S, Run, Terminal
from measure.command_process import NODES
from run_directory_reader import finalised, summary_of

Start = Callable[..., Run]
ENDLESS = ("--goals", "100000", "--seed", "1")
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def ended_well(run: Run) -> None:
    """The run ended as asked: what was played is all there."""
    assert run.exit_code(END_S) == 0, run.stderr
    assert run.processes() == {}
    assert "Traceback" not in run.stderr
    summary = summary_of(run.out)
    assert summary["episodes"] >= 1
    assert summary["incomplete"] is False
    assert finalised(run.out) == summary["messages_recorded"] >= 6 * summary["steps"]


@pytest.mark.parametrize(("number", "processes"), [(signal.SIGHUP, "many"), (signal.SIGINT, "one")])
def test_a_signal_ends_the_run_with_all_that_was_played(start: Start, number: signal.Signals, processes: str) -> None:
    run = start(*ENDLESS, "--json", "--processes", processes)
    run.until_playing()
    run.send(number)
    ended_well(run)
    summary = summary_of(run.out)
    assert f"ended by {number.name} after {summary['goals']} of 100000 goals; what was played" in run.stderr
    assert json.loads(run.stdout) == summary


def test_a_signal_ends_the_graph_in_one_process(start: Start) -> None:
    run = start(*ENDLESS, "--processes", "one")
    run.until_playing()
    run.send(signal.SIGTERM)
    ended_well(run)
    assert "ENDED EARLY after" in run.stdout
    assert "success rate" not in run.stdout


# Signals to a node, which it survives long enough to end in good order


def failed_by_signal(run: Run, who: str, how: str) -> None:
    """The run failed, said so with what had been played, and kept that."""
    assert run.exit_code(END_S) == 1, run.stderr
    assert run.processes() == {}
    summary = summary_of(run.out)
    played = f"{summary['episodes']} of 100000 episodes"
    assert f"bringup.py: {who} was ended by {how} after {played}; its output (" in run.stderr
    assert f"ENDED EARLY after {played}" in run.stdout
    assert "success rate" not in run.stdout
    assert finalised(run.out) == summary["messages_recorded"]


MANY_EPISODES = ("--episodes", "100000", "--seed", "1")


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("fusion", signal.SIGTERM),
        ("simulator", signal.SIGHUP),
        ("wall_avoiding", signal.SIGINT),
        *(
            pytest.param(name, number, marks=pytest.mark.long)
            for name, number in itertools.product(NODES, SIGNALS)
            if (name, number)
            not in {("fusion", signal.SIGTERM), ("simulator", signal.SIGHUP), ("wall_avoiding", signal.SIGINT)}
        ),
    ],
)
def test_a_signal_to_a_node_fails_the_run_and_is_named(start: Start, name: str, number: signal.Signals) -> None:
    run = start(*MANY_EPISODES)
    run.until_playing()
    os.kill(run.nodes()[name], number)
    failed_by_signal(run, f"node '{name}'", number.name)


@pytest.mark.parametrize(
    "number", [signal.SIGINT, *(pytest.param(each, marks=pytest.mark.long) for each in SIGNALS[1:])]
)
def test_a_signal_to_the_process_of_all_nodes_fails_the_run(start: Start, number: signal.Signals) -> None:
    run = start(*MANY_EPISODES, "--processes", "one")
    run.until_playing()
    (graph,) = (pid for pid, line in run.processes().items() if "one_process" in line)
    os.kill(graph, number)
    failed_by_signal(run, "the process of all nodes", number.name)


def test_a_second_signal_changes_nothing(start: Start) -> None:
    run = start(*ENDLESS)
    run.until_playing()
    run.send(signal.SIGINT)
    run.send(signal.SIGINT)
    run.until(lambda: set(run.nodes()) != set(NODES), "a node has ended")
    run.send(signal.SIGTERM)
    ended_well(run)
    assert "ended by SIGINT" in run.stderr


def test_control_c_at_a_terminal_ends_the_run(start: Start) -> None:
    """The terminal sends SIGINT to its foreground group: to the launcher, and not to the nodes."""
    terminal = Terminal()
    run = start(*ENDLESS, terminal=terminal)
    run.until_playing()
    terminal.type(b"\x03\x03")
    ended_well(run)
    assert "ended by SIGINT" in terminal.shown
    terminal.close()


def test_a_terminal_that_is_closed_ends_the_run(start: Start) -> None:
    """SIGHUP, and from then on every line that is said fails."""
    terminal = Terminal()
    run = start(*ENDLESS, "--processes", "one", terminal=terminal)
    run.until_playing()
    terminal.close()
    ended_well(run)


MOMENTS: dict[str, Callable[[Run], object]] = {
    "at once": lambda run: True,
    "when the run directory is made": lambda run: run.out.exists(),
    "when the first node is started": lambda run: run.nodes(),
    "when the last node is started": lambda run: "fusion" in run.nodes(),
    "when the recording is begun": lambda run: list(run.out.glob("*.active")),
}


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_signal_during_the_start_ends_it_and_leaves_no_half_recording(start: Start, moment: str) -> None:
    run = start(*ENDLESS)
    run.until(lambda: MOMENTS[moment](run), moment)
    run.send(signal.SIGTERM)
    code = run.exit_code(END_S)
    assert run.processes() == {}
    assert "Traceback" not in run.stderr
    if (run.out / "summary.json").exists():
        assert code == 0
        assert finalised(run.out) == summary_of(run.out)["messages_recorded"]
    elif run.out.exists():
        assert code == 1
        assert f"ended by SIGTERM before there was a result; see {run.out}/log" in run.stderr
        assert not list(run.out.glob("*.mcap*"))
    else:
        # So early that it is not yet ours to answer, or before anything was begun.
        assert code in (1, -signal.SIGTERM)


@pytest.mark.parametrize("processes", ["many", "one"])
def test_a_launcher_that_is_killed_leaves_no_orphan_and_a_whole_recording(start: Start, processes: str) -> None:
    run = start(*ENDLESS, "--processes", processes)
    run.until_playing()
    run.send(signal.SIGKILL)
    run.gone_within(END_S)
    summary = summary_of(run.out)
    assert finalised(run.out) == summary["messages_recorded"] >= 6 * summary["steps"] > 0
