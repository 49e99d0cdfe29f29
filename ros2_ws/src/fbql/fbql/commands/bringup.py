"""Brings up the graph, supervises it and prints the result: the main job of the project.

Exit codes: 0 the match was played, or a signal ended it; 1 it failed, or a signal came before there was a result; 2 bad
input: nothing was started and nothing is left behind; 3 the recording is incomplete.
"""

from __future__ import annotations

import argparse
import json
import shlex
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.files import remedy, write_atomically
from fbql_recording.core.columns import Recorded

from fbql.cli.exit_codes import DONE, FAILED, INCOMPLETE
from fbql.cli.interrupts import Interrupted, Interrupts
from fbql.cli.output import LiveLine, Unwritable, json_text, print_result
from fbql.cli.parser import Parser
from fbql.cli.places import command_text
from fbql.match.in_process import rehearse
from fbql.match.options import (
    Match,
    controller_options,
    make_run_directory,
    match_from,
    match_parser,
    policy_summary,
    same_options,
)
from fbql.match.result import Asked, next_steps, summary_text
from fbql.watch.option import add_watch_option, require_way

if TYPE_CHECKING:  # the graph needs ROS, which --help does not; a match that nobody watches loads no view
    from fbql.graph.supervision import Supervision
    from fbql.watch.view import View

START_TIMEOUT_S = 30.0
FOXGLOVE_PORT = 8765
"""Foxglove's default."""
LOG_EVERY_S = 10.0


def parser(program: str) -> Parser:
    """The command line."""
    result = match_parser(
        program, "Brings up the ROS 2 graph, plays robot soccer, records the run and prints the result."
    )
    how = result.add_argument_group("how it runs")
    how.add_argument(
        "--processes", choices=("many", "one"), default="many", help="one process per node, or one for all nodes"
    )
    how.add_argument(
        "--realtime",
        type=float,
        default=0.0,
        metavar="F",
        help="speed relative to real time; 0: lockstep, as fast as possible",
    )
    how.add_argument("--record", action=argparse.BooleanOptionalAction, default=True, help="record the run to MCAP")
    how.add_argument(
        "--foxglove",
        type=int,
        nargs="?",
        const=FOXGLOVE_PORT,
        metavar="PORT",
        help=f"serve every topic live to Foxglove, on this port of this machine ({FOXGLOVE_PORT}; 0: a free one); best "
        "with --realtime; needs the extra foxglove",
    )
    add_watch_option(
        how,
        "watch the match, which stays the same: the field, who drives and why; in real time, or at the speed that --realtime "
        "gives",
    )
    how.add_argument(
        "--start-timeout",
        type=float,
        default=START_TIMEOUT_S,
        metavar="S",
        help="seconds to wait for the nodes to start",
    )
    return result


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Plays the match. Returns the exit code."""
    line = LiveLine(log_every_s=LOG_EVERY_S, keep=True)
    match, supervision = _prepare(arguments, line, interrupts)
    match = make_run_directory(match)
    try:
        code = supervision.run(match)
    except (BadInput, Interrupted):
        shutil.rmtree(match.out)  # nothing was played: leave nothing behind
        raise
    return _report(match, code, arguments.json, line, interrupts, supervision)


def _prepare(arguments: argparse.Namespace, line: LiveLine, interrupts: Interrupts) -> tuple[Match, Supervision]:
    """Refuses everything that can be refused before there is a process or a directory."""
    for name, low, high in (("realtime", 0, 100), ("start_timeout", 0.1, 3600)):
        value = getattr(arguments, name)
        if not low <= value <= high:
            raise BadInput(f"--{name.replace('_', '-')} is {value:g}, outside of [{low:g}, {high:g}]")
    require_way(arguments.watch)
    from fbql_common.middleware import prepare_middleware

    from fbql.graph.domains import domain_from
    from fbql.graph.launch import Mode
    from fbql.graph.supervision import BEFORE_THE_MATCH, Supervision

    prepare_middleware(line.complain)
    domain_id = domain_from()
    match = match_from(arguments)
    rehearse(match)
    for note in match.notes:
        line.complain(note)
    interrupts.check(BEFORE_THE_MATCH)
    paced = arguments.watch is not None and arguments.realtime == 0.0
    mode = Mode(arguments.processes, arguments.realtime, arguments.record, arguments.start_timeout, paced)
    live = None
    if arguments.foxglove is not None:
        from fbql.graph.foxglove_live import FoxgloveLive

        live = FoxgloveLive(arguments.foxglove)
        line.say(f"live in Foxglove: {live.address} (Open connection, Foxglove WebSocket)")
    watch = None
    if arguments.watch is not None:
        from fbql.watch.live import LiveWatch

        watch = LiveWatch(_view(match, arguments.watch, line), paced, takes_terminal=arguments.watch == "terminal")
    return match, Supervision(mode, domain_id, arguments.start_timeout, line, interrupts, live, watch)


def _view(match: Match, way: str, line: LiveLine) -> View:
    """The view that shows the match."""
    trees = [load_tree(file) for file in match.behaviors.values()]
    if way == "terminal":
        from fbql.watch.terminal import MatchScreen

        return MatchScreen(trees)
    from fbql.watch.browser import BrowserPage

    controller, seed = match.fusion.controller, match.fusion.seed
    recorded = Recorded(True, tuple(match.behaviors), True, True, True)
    return BrowserPage(recorded, trees, f"{controller}, live", f"{controller} · seed {seed}", line.say, [controller])


def _report(
    match: Match, code: int, as_json: bool, line: LiveLine, interrupts: Interrupts, supervision: Supervision
) -> int:
    run = match.out
    path = run / "summary.json"
    if not path.is_file():
        cause = f"ended by {interrupts.name} before there was a result" if interrupts.came else "there is no summary"
        line.complain(f"{cause}; see {run / 'log'}")
        if recorded := next(run.glob("*.mcap.active"), None):
            command = f"{command_text('recover')} {shlex.quote(str(run))}"
            line.complain(f"{recorded} was not finished; {command} recovers its messages")
        return code or FAILED
    summary = json.loads(path.read_text())
    asked = Asked(match.fusion.episodes, match.fusion.goals)
    shortfall = asked.shortfall(summary["episodes"], summary["goals"])
    if interrupts.came:
        after = shortfall and f" after {shortfall}"
        line.complain(f"ended by {interrupts.name}{after}; what was played until then is complete")
    elif shortfall and code != FAILED:
        line.complain(f"the match ended after {shortfall}, and nothing says why; see {run / 'log'}")
        code = code or FAILED
    if supervision.is_in_real_time:
        summary["missed_ticks"] = supervision.missed_ticks
        code = _complete_summary(path, summary, line) or code
    text = summary_text(summary, run, match.simulation.dt_s, policy_summary(match), asked)
    again = same_options(match)
    text += f"\n{next_steps(summary, run, again, match.fusion.learn, controller_options(match), supervision.domain_id)}"
    try:
        print_result(json_text(summary) if as_json else text)
    except Unwritable as error:
        line.complain(f"{error}; it is also in {path}")
        return code or FAILED
    return code or (INCOMPLETE if summary["incomplete"] else 0)


def _complete_summary(path: Path, summary: dict[str, Any], line: LiveLine) -> int:
    """Adds to summary.json what only the launcher knows: fusion, which wrote it, does not see the simulator's clock.
    Returns 0, or 1 where it can't be written."""
    try:
        write_atomically(path, f"{json.dumps(summary, indent=2)}\n".encode())
    except OSError as error:
        line.complain(f"{path}: missed_ticks could not be added ({error.strerror}); {remedy(error)}")
        return FAILED
    return DONE
