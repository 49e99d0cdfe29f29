"""A recording of a node that was driven by hand, computed again: `replay.py --verify` without the command around it."""

from __future__ import annotations

from pathlib import Path

from fbql.replay.recomputation import (
    RecordedBehaviors,
    recorded_parameters,
    recorded_playing_trees,
    recorded_policy,
    recorded_trees,
)
from fbql.replay.verification import Verification, verify
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_recording.run import open_run


def verification_of(path: Path) -> Verification:
    """What verifying the run says."""
    run = open_run(path)
    parameters, notes = recorded_parameters(run)
    assert notes == []
    behaviors = RecordedBehaviors(run, recorded_trees(run), {})
    session = SoccerSession(parameters, recorded_policy(run), recorded_playing_trees(run))
    return verify(run, session, behaviors, lambda _: None)
