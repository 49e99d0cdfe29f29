"""Plays a match without ROS, in one loop of the same core objects: the same options, results and digest as bringup."""

from __future__ import annotations

import argparse
from contextlib import closing
from functools import partial
from importlib import import_module

from fbql_common.files import output_directory
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_recording.core.episodes import Episode
from fbql_recording.core.metrics import EpisodeRecord

from fbql.cli.exit_codes import DONE, INCOMPLETE
from fbql.cli.interrupts import Interrupts
from fbql.cli.output import LiveLine, complain, json_text, print_result, writing
from fbql.cli.parser import Parser
from fbql.match.in_process import play_match, status_of
from fbql.match.options import match_from, match_parser, policy_summary
from fbql.match.result import Asked, status_line, summary_text

LOG_EVERY_S = 10.0
FIGURES = "figures"
"""Name of their directory in a run directory."""


def parser(program: str) -> Parser:
    """The command line."""
    result = match_parser(
        program, "Plays a match in one process without ROS, as fast as possible. No messages are recorded."
    )
    result.add_argument(
        "--figures",
        action="store_true",
        help=f"also draw steps, collisions, failures and success rate from goal to goal, as PDF and SVG, into RUN/{FIGURES}",
    )
    return result


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Plays the match. Returns 0, or 3 if a result could not be written."""
    # Matplotlib is an extra: refused before anything is played.
    figures = import_module("fbql.report.figures") if arguments.figures else None
    match = match_from(arguments)
    for note in match.notes:
        complain(note)
    with closing(LiveLine(log_every_s=LOG_EVERY_S, keep=True)) as line:

        def episode_ended(session: SoccerSession, elapsed_s: float) -> bool:
            line.show(partial(status_line, status_of(session, elapsed_s)))
            return not interrupts.came

        match, session, summary = play_match(match, episode_ended=episode_ended)
    if figures is not None:
        directory = match.out / FIGURES
        with writing(directory), output_directory(directory, is_ours=True):
            figures.write_figures([_as_recorded(each) for each in session.records], match.fusion.controller, directory)
    values = summary._asdict()
    asked = Asked(match.fusion.episodes, match.fusion.goals)
    if interrupts.came:
        shortfall = asked.shortfall(summary.episodes, summary.goals)
        complain(
            f"ended by {interrupts.name}{shortfall and f' after {shortfall}'}; what was played until then is complete"
        )
    text = summary_text(values, match.out, match.simulation.dt_s, policy_summary(match), asked)
    print_result(json_text(values) if arguments.json else text)
    return INCOMPLETE if summary.incomplete else DONE


def _as_recorded(record: EpisodeRecord) -> Episode:
    """An episode in the form in which a recording would have it."""
    return Episode(
        record.index,
        first_step=0,
        phase=record.phase.name.lower(),
        outcome=record.outcome,
        steps=record.steps,
        collisions_begun=record.collisions_begun,
        collision_steps=record.collision_steps,
    )
