"""The course: shows a lesson, and checks the student's answer."""

from __future__ import annotations

import argparse
from pathlib import Path

from fbql_common.core.errors import BadInput
from fbql_common.core.text import one_line

from fbql.cli.exit_codes import DONE, FAILED
from fbql.cli.interrupts import Interrupts
from fbql.cli.output import complain, json_text, print_result, say
from fbql.cli.parser import Parser, add_json_option, without_effect
from fbql.cli.places import command_text
from fbql.course.lessons import CHECKS, check, text_of


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(
        prog=program,
        description="The course: shows a lesson, and with --check checks what you did.",
        epilog="Exit codes: 0 done, or the answer is right; 1 it is not; 2 bad input.",
    )
    command.add_argument(
        "number", type=int, nargs="?", metavar="N", help=f"lesson, {min(CHECKS)} to {max(CHECKS)} (a list of them)"
    )
    command.add_argument(
        "--check", nargs="*", metavar="ANSWER", help="check the task of the lesson; the lesson says what it asks for"
    )
    command.add_argument(
        "--work",
        type=Path,
        metavar="DIR",
        help="with --check: directory that the lesson's commands wrote to (runs/course)",
    )
    add_json_option(command)
    return command


def run(arguments: argparse.Namespace, _interrupts: Interrupts) -> int:
    """Shows or checks. Returns 0, or 1 for a wrong answer."""
    if arguments.check is None:
        for note in without_effect(arguments, ["work"], "without --check"):
            complain(note)
        text = text_of(arguments.number).rstrip()
        print_result(json_text({"lesson": arguments.number, "text": text}) if arguments.json else text)
        return DONE
    if arguments.number is None:
        raise BadInput(f"which lesson? {command_text('lesson')} N --check ANSWER")
    verdict = check(arguments.number, arguments.check, arguments.work)
    if arguments.json:
        print_result(json_text({"lesson": arguments.number, "right": verdict.right, "line": verdict.line}))
    elif verdict.right:
        print_result(one_line(f"Right: {verdict.line}."))
        if arguments.number < max(CHECKS):
            say(f"Next: {command_text('lesson')} {arguments.number + 1}")
        else:
            say("That was the last lesson. docs/add_a_behavior.md and docs/add_a_controller.md lead further.")
    else:
        complain(f"not yet: {verdict.line}")
    return DONE if verdict.right else FAILED
