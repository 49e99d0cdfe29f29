"""What a mux that learns has saved when its process is killed: as much as a run that ended well, up to the last episode."""

from __future__ import annotations

from pathlib import Path

import pytest
from fbql_fusion import mux_recorder
from fbql_fusion.mux_recorder import MuxRecorder
from fbql_fusion.policy_storage import load_policy, policy_bytes
from recorded_rail import record_rail


def killed_rail(path: Path, monkeypatch: pytest.MonkeyPatch, period_s: float, **changes: object) -> Path:
    """A run whose recorder was never closed."""
    with monkeypatch.context() as patch:
        patch.setattr(mux_recorder, "SAVE_PERIOD_S", period_s)
        patch.setattr(MuxRecorder, "close", lambda self: None)
        return record_rail(path, 7, **changes) / "policy.npz"


def test_what_was_learned_is_saved_before_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ended = record_rail(tmp_path / "ended", 7) / "policy.npz"
    killed = killed_rail(tmp_path / "killed", monkeypatch, 0.0)
    assert killed.read_bytes() == ended.read_bytes()
    assert policy_bytes(load_policy(killed)) == killed.read_bytes(), "it can be continued from"


def test_it_is_not_saved_more_often_than_stated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not killed_rail(tmp_path / "killed", monkeypatch, 3600.0).exists()


def test_a_policy_that_is_only_played_is_not_saved_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    policy = record_rail(tmp_path / "learned", 7) / "policy.npz"
    assert not killed_rail(tmp_path / "played", monkeypatch, 0.0, learn=False, policy=str(policy)).exists()
