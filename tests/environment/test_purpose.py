"""What a start installs is what it needs: a study's help can be read without the packages of studies."""

from __future__ import annotations

import sys

import pytest
from environment import enter


class Asked(Exception):
    """Which purpose an environment was asked for."""


@pytest.mark.parametrize(
    ("purpose", "argv", "asked"),
    [
        ("study", ["paper"], "study"),
        ("study", ["paper", "--help"], "run"),
        ("study", ["-h"], "run"),
        ("test", ["--help"], "test"),
        ("run", [], "run"),
    ],
)
def test_help_alone_installs_no_study_packages(
    purpose: str, argv: list[str], asked: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(purpose: str) -> None:
        raise Asked(purpose)

    monkeypatch.setattr(sys.modules["environment.enter"], "environment_or_exit", refuse)
    monkeypatch.setattr(sys, "argv", ["command.py", *argv])
    monkeypatch.delenv("_FBQL_ENTERED", raising=False)
    with pytest.raises(Asked, match=f"^{asked}$"):
        enter("experiment", purpose=purpose)
