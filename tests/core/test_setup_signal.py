"""A signal that comes between a step's announcement and the start of its program ends the set-up as any other does."""

from __future__ import annotations

from pathlib import Path
from typing import Never

import pytest
from environment import set_up
from environment.progress import Step
from environment.set_up import SetUp
from setup_target import made_target


def test_a_signal_before_the_installer_starts_is_not_taken_for_a_missing_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = made_target(tmp_path)
    (target.site_packages / "pip").mkdir(parents=True)
    target.state.mkdir(parents=True, exist_ok=True)

    def end(*_: object, **__: object) -> Never:
        raise SystemExit(129)

    monkeypatch.setattr(set_up, "run", end)
    work = SetUp(target, "run", {"PATH": ""}, lock=-1)
    with pytest.raises(SystemExit, match="129"):
        work.install_from(target.run_lock, Step(1, 1, "installing"))
    assert not work.has_changed_environment
