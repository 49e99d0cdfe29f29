"""Play controllers and parameters over several values, each with the same seeds, and compare them. It resumes where it stopped."""

from __future__ import annotations

import argparse

from fbql.cli.interrupts import Interrupts
from fbql.cli.parser import Parser
from fbql.cli.places import new_path

from fbql_studies.experiment import add_runner_options, run_study
from fbql_studies.sweep import study


def parser(program: str) -> Parser:
    """The command line."""
    result = Parser(
        prog=program,
        description="Plays every combination of the values given for --controller and --set, each with the same seeds, as "
        "train does. The table has 95 % intervals and compares each combination with the first one.",
        epilog=f"for example: {program} --seeds 10 --controller fbql --set fbql_hold_s=0.02,0.1,0.25 --episodes 100",
    )
    study.add_options(result)
    add_runner_options(result, "runs/TIME-sweep", "fewer seeds")
    return result


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Plays what remains, and reports the whole sweep. Returns 0, or 1 if a match failed."""
    out = arguments.out or new_path("sweep")
    return run_study("sweep", study.__name__, study, arguments, out, interrupts)
