"""Kernels are compiled when something is about to learn, once, unless the process asks that they are not."""

from __future__ import annotations

import pytest
from fbql_common.core import kernels


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the compiler was asked to do."""
    made: list[str] = []
    monkeypatch.setattr(kernels, "_compilers", [])
    kernels.set_compiler(lambda: made.append("compiled"))
    return made


def test_they_are_compiled_once(calls: list[str]) -> None:
    kernels.prepare()
    kernels.prepare()
    assert calls == ["compiled"]


def test_a_process_that_must_not_pause_leaves_them_interpreted(calls: list[str]) -> None:
    kernels.leave_interpreted()
    kernels.prepare()
    assert calls == []
