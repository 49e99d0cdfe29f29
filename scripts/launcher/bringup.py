"""Brings up the graph, watches over it, and tells the result: the main job of the project."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import sys
from collections.abc import Sequence
from time import monotonic

import domain_coordinator
from fbql_common.core.errors import BadInput
from fbql_fusion.run_directory import create_run_directory

from launcher import graph
from launcher.interrupts import Interrupts
from launcher.observer import Observer
from launcher.options import Match, Parser, match_from, match_parser
from launcher.panel import Panel
from launcher.processes import NodeProcess, stop
from launcher.result import next_steps, summary_text

PROGRAM = "bringup.py"
START_TIMEOUT_S = 30.0
_LOOK_S = 0.05
_DISCOVERY_S = 1.0
_DONE, _FAILED, _BAD_INPUT, _INCOMPLETE = 0, 1, 2, 3


class Failure(Exception):
    """The graph did not do its job; the text says what happened."""


def parser() -> Parser:
    """The command line."""
    result = match_parser(
        PROGRAM, "Brings up the ROS 2 graph, plays robot soccer, records the run and prints the result."
    )
    how = result.add_argument_group("how it runs")
    how.add_argument(
        "--processes", choices=("many", "one"), default="many", help="a process for each node, or one for all"
    )
    how.add_argument(
        "--realtime",
        type=float,
        default=0.0,
        metavar="F",
        help="speed relative to real time; 0: lockstep, as fast as it goes",
    )
    how.add_argument("--record", action=argparse.BooleanOptionalAction, default=True, help="record the run to MCAP")
    return result


def main(argv: Sequence[str]) -> int:
    """Runs the command. Gives the exit code."""
    arguments = parser().parse_args(list(argv))
    interrupts = Interrupts()
    try:
        if not 0 <= arguments.realtime <= 100:
            raise BadInput(f"{PROGRAM}: --realtime is {arguments.realtime:g}, outside of [0, 100]")
        match = match_from(arguments, PROGRAM)
        create_run_directory(match.out)
        try:
            return _play(match, graph.Mode(arguments.processes, arguments.realtime, arguments.record), interrupts)
        except BadInput:
            # Nothing was played: leave nothing behind.
            shutil.rmtree(match.out)
            raise
    except BadInput as error:
        print(error, file=sys.stderr)
        return _BAD_INPUT


def _play(match: Match, mode: graph.Mode, interrupts: Interrupts) -> int:
    panel = Panel()
    with _Domain() as domain_id:
        # The launcher's own node logs with the run, too.
        os.environ["ROS_LOG_DIR"] = str(match.out / "log")
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        observer = Observer(domain_id)
        started: list[NodeProcess] = []
        try:
            _refuse_twins(observer, match)
            how = "a process each" if mode.processes == "many" else "in one process"
            panel.say(f"bringing up {len(graph.node_names(match))} nodes, {how}, ROS_DOMAIN_ID={domain_id}")
            environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id)}
            started = graph.start_graph(match, mode, graph.write_parameters(match, mode), environment)
            _wait_for_graph(observer, started, match, interrupts)
            code = _supervise(observer, started, panel, interrupts)
        except Failure as failure:
            panel.say(f"{PROGRAM}: {failure}")
            code = _FAILED
        finally:
            killed = stop(started)
            panel.close()
            observer.close()
    if killed:
        panel.say(f"{PROGRAM}: did not end in time and had to be killed: {', '.join(killed)}")
        code = code or _FAILED
    if interrupts.came:
        panel.say(f"ended by {signal.Signals(interrupts.came).name}; what was played until then is complete")
    return _tell(match, code)


class _Domain:
    """A domain of our own, held while the graph runs; the user's, where ROS_DOMAIN_ID is set."""

    def __enter__(self) -> int:
        text = os.environ.get("ROS_DOMAIN_ID", "")
        self._context = None if text else domain_coordinator.domain_id()
        return int(text) if self._context is None else self._context.__enter__()

    def __exit__(self, *error: object) -> None:
        if self._context is not None:
            self._context.__exit__(None, None, None)


def _refuse_twins(observer: Observer, match: Match) -> None:
    """Two nodes of one name break a graph in ways that are hard to see. Only a domain of the user's can have them."""
    if not os.environ.get("ROS_DOMAIN_ID"):
        return
    observer.look(_DISCOVERY_S)
    twins = sorted(set(observer.nodes()) & set(graph.node_names(match)))
    if twins:
        raise BadInput(
            f"{PROGRAM}: node '{twins[0]}' runs already in ROS_DOMAIN_ID={os.environ['ROS_DOMAIN_ID']}; "
            "end it, or unset ROS_DOMAIN_ID to get a free domain"
        )


def _wait_for_graph(observer: Observer, started: list[NodeProcess], match: Match, interrupts: Interrupts) -> None:
    """The start barrier: until every node and topic is there. Fusion itself waits for its inputs meanwhile."""
    deadline = monotonic() + START_TIMEOUT_S
    names = graph.node_names(match)
    while not interrupts.came:
        observer.look(_LOOK_S)
        _fail_on_exit(started)
        if observer.status or started[-1].exit_code is not None:
            return
        missing = observer.missing(names, list(match.behaviors))
        if not missing:
            return
        if monotonic() > deadline:
            raise Failure(f"after {START_TIMEOUT_S:g} s the graph still lacks {', '.join(missing)}")


def _supervise(observer: Observer, started: list[NodeProcess], panel: Panel, interrupts: Interrupts) -> int:
    fusion = started[-1]
    while not interrupts.came:
        observer.look(_LOOK_S)
        if observer.status:
            panel.show(observer.status)
        if fusion.exit_code in (_DONE, _INCOMPLETE):
            return fusion.exit_code
        _fail_on_exit(started)
    return _DONE


def _fail_on_exit(started: list[NodeProcess]) -> None:
    for process in started:
        code = process.exit_code
        if code is None or (process is started[-1] and code in (_DONE, _INCOMPLETE)):
            continue
        how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
        raise Failure(f"node '{process.name}' {how}; its output ({process.log_file}):\n{process.tail()}")


def _tell(match: Match, code: int) -> int:
    run = match.out
    path = run / "summary.json"
    if not path.is_file():
        print(f"{PROGRAM}: no summary was written; see {run / 'log'}", file=sys.stderr)
        return code or _FAILED
    summary = json.loads(path.read_text())
    text = summary_text(summary, run, match.simulation.dt_s)
    if match.json:
        print(json.dumps(summary))
    else:
        print(text)
        print(next_steps(summary, run))
    return code or (_INCOMPLETE if summary["incomplete"] else _DONE)
