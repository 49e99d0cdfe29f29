"""A recording of a node that was driven by hand, computed again: `replay.py --verify` without the command around it."""

from __future__ import annotations

from pathlib import Path

from fbql_analysis import open_run
from fbql_fusion.core.session import Session
from launcher.recomputation import Team, recorded_parameters, recorded_policy, recorded_trees
from launcher.verification import Verification, verify


def verification_of(path: Path) -> Verification:
    """What verifying the run says."""
    run = open_run(path)
    parameters, notes = recorded_parameters(run)
    assert notes == []
    team = Team(run, recorded_trees(run), {})
    return verify(run, Session(parameters, recorded_policy(run)), team, lambda _: None)
