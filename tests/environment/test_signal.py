"""A signal that comes between a step's announcement and the start of its program ends the set-up as any other does."""

from __future__ import annotations

from pathlib import Path
from typing import Never

import pytest
from environment import set_up
from environment.progress import Step
from environment.set_up import PIP_BEGINS, SetUp
from setup_target import made_target


@pytest.mark.parametrize("earlier", [None, PIP_BEGINS])
def test_a_signal_before_the_installer_starts_is_no_missing_log_and_no_earlier_installation(
    earlier: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = made_target(tmp_path)
    (target.site_packages / "pip").mkdir(parents=True)
    target.state.mkdir(parents=True, exist_ok=True)

    def end(*_: object, **__: object) -> Never:
        raise SystemExit(129)

    monkeypatch.setattr(set_up, "run", end)
    work = SetUp(target, "run", {"PATH": ""}, lock=-1)
    if earlier is not None:
        (work.logs / "install-pip.txt").write_text(earlier)
    with pytest.raises(SystemExit, match="129"):
        work.install_from(target.run_lock, Step(1, 1, "installing"))
    assert not work.has_changed_environment
