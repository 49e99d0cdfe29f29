"""Replays a recorded run: publishes it on ROS, verifies it, or recomputes it with other parameters or trees."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator
from pathlib import Path

from fbql_behaviors.demonstration_storage import BEHAVIOR_KEY
from fbql_common.core.errors import BadInput
from fbql_fusion.controller_loading import is_file
from fbql_fusion.core.tasks.soccer.subsumption import PRESETS
from fbql_recording.run import Run, open_run

from fbql.cli.controllers import add_controller_option
from fbql.cli.exit_codes import DONE, INCOMPLETE
from fbql.cli.interrupts import Interrupts
from fbql.cli.observations import add_observation_option
from fbql.cli.output import complain, warn
from fbql.cli.parser import RUN_HELP, Parser, add_json_option, add_recording_options, output_path, without_effect
from fbql.cli.places import command_text
from fbql.watch.option import add_watch_option, require_way

_ON_ROS = {
    "rate": 1.0,
    "start": 0.0,
    "duration": None,
    "loop": False,
    "topics": None,
    "no_clock": False,
    "domain": None,
    "wait": 1.0,
    "watch": None,
}
"""The options for republishing, with their defaults."""


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Replays the run. Returns 0 (with --verify: identical), 1 if it differs, 3 if the recording is incomplete."""
    _check(arguments)
    for note in _unused(arguments):
        complain(note)
    for name, usual in _ON_ROS.items():
        if getattr(arguments, name) is None:
            setattr(arguments, name, usual)
    run = open_run(arguments.run, skip_corrupt=arguments.skip_corrupt)
    _say_if_demonstrations(run, arguments)
    known = run.warnings
    warn(known)
    code = _command(arguments)(run, arguments, interrupts)
    warn(warning for warning in run.warnings if warning not in known)
    return code or (DONE if arguments.allow_incomplete or run.is_complete else INCOMPLETE)


def _command(arguments: argparse.Namespace):
    """The function that does the work. Only what it needs is imported: verifying needs no ROS."""
    if arguments.verify:
        from fbql.replay.verification import verify_run

        return verify_run
    if _is_what_if(arguments):
        from fbql.replay.what_if_command import what_if_run

        return what_if_run
    from fbql.replay.republish import republish_run

    return republish_run


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(
        prog=program,
        description="Publishes a recorded run on ROS again; with --verify recomputes it and compares every leaf, Q, weight and "
        "command; with --set, --preset, --controller, --policy or --trees shows what would have been decided instead.",
        epilog="Exit codes: 0 done, identical; 1 differs, failed; 2 bad input; 3 the recording is incomplete.",
    )
    command.add_argument("run", type=Path, metavar="RUN", help=RUN_HELP)
    add_recording_options(command)
    add_json_option(command)
    ros = command.add_argument_group("published on ROS (the default)")
    ros.add_argument("--rate", type=float, metavar="F", help="times real time; 0: as fast as possible (1)")
    ros.add_argument("--start", type=float, metavar="S", help="start S seconds into the recording (0)")
    ros.add_argument("--duration", type=float, metavar="S", help="stop after S seconds of the recording")
    ros.add_argument("--loop", action="store_true", help="start over at the end, until q or Ctrl-C")
    ros.add_argument("--topics", nargs="+", metavar="TOPIC", help="publish only these topics")
    ros.add_argument("--no-clock", action="store_true", help="do not publish /clock")
    ros.add_argument("--domain", type=int, metavar="N", help="ROS_DOMAIN_ID to replay in (a free one)")
    ros.add_argument(
        "--wait", type=float, metavar="S",
        help="start when every topic has a subscriber, or after S seconds (1)",
    )  # fmt: skip
    add_watch_option(ros, "watch what is published: the field, who drives and why")
    verified = command.add_argument_group("recomputed")
    verified.add_argument("--verify", action="store_true", help="recompute the run and compare it bit by bit")
    add_observation_option(verified)
    other = command.add_argument_group("what if")
    other.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE",
        help="a different value for a parameter of fusion, such as weight_gain=0.05; may be repeated",
    )  # fmt: skip
    other.add_argument("--preset", choices=tuple(PRESETS), help="different thresholds for Subsumption")
    add_controller_option(other, "a different controller, or, with --verify, the file of the run's own controller")
    other.add_argument("--policy", metavar="FILE", help="a different policy to start from, or none")
    other.add_argument("--trees", type=Path, metavar="DIR", help="directory with NAME.json of each behavior")
    other.add_argument("--csv", type=output_path, metavar="FILE", help="write every step as a table (CSV)")
    other.add_argument("--figure", type=output_path, metavar="FILE", help="draw weights and commands, as SVG")
    return command


def _say_if_demonstrations(run: Run, arguments: argparse.Namespace) -> None:
    """Says which command shows demonstrations, which are published like a match. Raises BadInput where only a match will do."""
    behavior = run.about.get(BEHAVIOR_KEY)
    if not behavior:
        return
    command = f"{command_text('demonstrate')} --replay {shlex.quote(str(arguments.run))}"
    if arguments.verify or _is_what_if(arguments):
        raise BadInput(f"{run.path}: demonstrations of {behavior}, not a match; {command} drives them again")
    complain(f"{run.path}: demonstrations of {behavior}, not a match; {command} shows them")


def _is_what_if(arguments: argparse.Namespace) -> bool:
    return bool(
        arguments.set or arguments.preset or arguments.controller or arguments.policy or arguments.trees is not None
    )


def _only_names_code(arguments: argparse.Namespace) -> bool:
    """Whether the only option of "what if" is a --controller FILE.py:NAME, the code of the run's own controller."""
    changes = arguments.set or arguments.preset or arguments.policy or arguments.trees is not None
    return not changes and is_file(arguments.controller)


def _unused(arguments: argparse.Namespace) -> Iterator[str]:
    """The options that have no effect on what was requested."""
    if arguments.verify or _is_what_if(arguments):
        mode = "--verify" if arguments.verify else "a change such as --set"
        yield from without_effect(arguments, _ON_ROS, f"with {mode}: nothing is published")
    if not arguments.verify and arguments.trees is None:
        yield from without_effect(arguments, ["observation"], "without --verify or --trees: no behavior is recomputed")


def _check(arguments: argparse.Namespace) -> None:
    """Raises BadInput for options that do not go together."""
    what_if = _is_what_if(arguments)
    if arguments.verify and what_if and not _only_names_code(arguments):
        raise BadInput("--verify compares with what was recorded; leave out --set, --trees and other changes")
    if arguments.verify and arguments.skip_corrupt:
        raise BadInput("a run without its damaged chunks can't be verified; leave out --skip-corrupt")
    if arguments.watch is not None and not (arguments.verify or what_if):
        require_way(arguments.watch)
    if (arguments.csv or arguments.figure) and not what_if:
        raise BadInput("--csv and --figure show the effect of a change; add --set, --trees or another one")
