"""A controller of the user's own in one file: the same in train and bringup, verified, changed by what-if."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import fbql
import pytest
from bringup_run import Run
from commands import replay, train
from own_controller import NOT_SAVED, bandit, only_ours


@pytest.fixture(autouse=True)
def clean() -> Iterator[None]:
    """No test leaves a controller behind."""
    with only_ours():
        yield


def test_a_controller_in_one_file_takes_part_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = bandit(tmp_path)
    words = ["--controller", source, "--set", "bandit_rate=0.5", "--guided", "1", "--episodes", "2", "--seed", "3"]
    words += ["--max-steps", "400", "--json"]
    with only_ours():
        assert train([*words, "--out", str(tmp_path / "trained")]) == 0
    digest = json.loads(capsys.readouterr().out)["digest"]

    run = Run(tmp_path, [*words, "--out", str(tmp_path / "run"), "--processes", "one"])
    try:
        assert run.exit_code() == 0, run.stderr
    finally:
        run.kill()
    summary = json.loads(run.stdout)
    assert (summary["digest"], summary["controller"]) == (digest, "Bandit")

    with only_ours():
        assert replay([str(run.out), "--verify", "--controller", source, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["identical"]
    for name, options, code in (
        ("it is only named by the recording", ["--verify"], 2),
        ("another one", ["--verify", "--controller", "uniform"], 2),
        ("another parameter", ["--controller", source, "--set", "bandit_random=1"], 0),
    ):
        with only_ours():
            assert replay([str(run.out), *options]) == code, name
    said = capsys.readouterr()
    assert "unknown controller 'Bandit'; name its file with --controller FILE.py:Bandit" in said.err
    assert "(the recording has a copy, controllers/Bandit.py)" in said.err
    assert "what if: bandit_random=1.0" in said.out

    policy = str(tmp_path / "trained" / "policy.npz")
    assert train([*words, "--policy", policy, "--out", str(tmp_path / "on")]) == 0
    assert train(["--controller", "fbql_literal", "--policy", policy, "--out", str(tmp_path / "no")]) == 2
    assert "the policy belongs to controller 'Bandit', not to 'fbql_literal'" in capsys.readouterr().err


def test_a_run_whose_learned_values_cannot_be_kept_is_finished_as_incomplete(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.py").write_text(NOT_SAVED.replace("LEARNED", "1 / 0"))
    words = [
        "--controller",
        str(tmp_path / "own.py"),
        "--episodes",
        "1",
        "--guided",
        "0",
        "--max-steps",
        "60",
        "--json",
    ]
    assert train([*words, "--out", str(tmp_path / "trained")]) == 3
    told = capsys.readouterr()
    line = (
        "policy.npz could not be written, the run continues, incomplete: controller 'A': ZeroDivisionError in line 14"
    )
    assert line in told.err
    run = Run(tmp_path, [*words, "--out", str(tmp_path / "run"), "--processes", "one"])
    try:
        assert run.exit_code() == 3, run.stderr
    finally:
        run.kill()
    assert line in run.stderr
    for directory in (tmp_path / "trained", run.out):
        summary = json.loads((directory / "summary.json").read_text())
        assert (summary["incomplete"], summary["episodes"]) == (True, 1)
    assert next(run.out.glob("*.mcap"))

    result = fbql.play(str(tmp_path / "own.py"), episodes=1, guided=0, max_steps=60)
    assert result.summary["episodes"] == 1 and result.policy is None
    assert result.notes == ("what was learned is lost: controller 'A': ZeroDivisionError in line 14: division by zero",)
