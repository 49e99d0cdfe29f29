"""Plays a match without ROS, in one loop of the same core objects: the same options, results and digest as bringup."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from time import monotonic

from fbql_common.core.types import Phase
from fbql_fusion.core.session import Session
from fbql_fusion.policy_storage import policy_bytes
from fbql_recording.run_directory import RunDirectory, git_revision, software_versions

from fbql.cli.exit_codes import DONE, INCOMPLETE
from fbql.cli.interrupts import Interrupts
from fbql.cli.panel import Panel, print_result, say
from fbql.cli.parser import Parser
from fbql.cli.places import ROOT
from fbql.match.in_process import own_observation, parts_of, play, rehearse
from fbql.match.options import Match, make_run_directory, match_from, match_parser, policy_told
from fbql.match.result import summary_text


def parser(program: str) -> Parser:
    """The command line."""
    return match_parser(program, "Plays a match in one process without ROS, as fast as it goes. Nothing is recorded.")


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Plays the match. Gives 0, or 3 where a result could not be written."""
    match = match_from(arguments)
    rehearse(match)
    session, loop, behaviors = parts_of(match)
    match = make_run_directory(match)
    files = RunDirectory(match.out, _config(match), list(match.behaviors.values()), say)
    panel = Panel()
    for note in match.notes:
        panel.say(note)
    begun_s = monotonic()

    def episode_ended() -> bool:
        files.add_episode(session.records[-1])
        panel.show(_status(session, monotonic() - begun_s))
        return not interrupts.came

    play(session, loop, behaviors, episode_ended)
    wall_s = monotonic() - begun_s
    panel.close()
    policy = session.policy()
    if policy is not None:
        files.write_policy(lambda: policy_bytes(policy))
    summary = session.summary(wall_s, messages_recorded=0, incomplete=files.failed)
    files.write_summary(summary)
    files.close()
    values = summary._asdict()
    told = summary_text(values, match.out, match.simulation.dt_s, policy_told(match))
    print_result(json.dumps(values) if match.json else told)
    return INCOMPLETE if files.failed else DONE


def _config(match: Match) -> dict[str, object]:
    return {
        "versions": software_versions(),
        "git_revision": git_revision(ROOT),
        "parameters": {
            "simulator": asdict(match.simulation),
            "fusion": {**asdict(match.fusion), "policy": str(match.policy or "")},
            **{
                name: {"tree_file": str(path), **own_observation(match, name)} for name, path in match.behaviors.items()
            },
        },
    }


def _status(session: Session, elapsed_s: float) -> dict[str, str]:
    record = session.records[-1]
    outcomes = [each.outcome for each in session.records if each.phase is not Phase.GUIDED]
    return {
        "episode": str(record.index),
        "phase": record.phase.name.lower(),
        "step": str(record.steps),
        "goals": str(outcomes.count("goal")),
        "own_goals": str(outcomes.count("own_goal")),
        "timeouts": str(outcomes.count("timeout")),
        "steps_per_s": f"{session.steps / elapsed_s:.0f}",
        "weights": "",
    }
