"""What bringup's options do, and what is refused: in one line, with exit code 2, and nothing left behind."""

from __future__ import annotations

import json
import pickle
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from bringup_run import Run, in_namespace
from commands import bringup, train
from fbql_behaviors.storage import load_tree, save_tree
from fbql_fusion.policy_storage import load_policy
from places import ROOT
from run_directory_reader import digest_of, episodes_of, messages_of, parameters_of, summary_of

Start = Callable[..., Run]
Refused = Callable[..., None]
TREES = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees"
ONE = ("--processes", "one")
LITERAL = ("--controller", "fbql_literal")


def well_ended(run: Run) -> Run:
    assert run.exit_code() == 0, run.stderr
    assert run.processes() == {}
    return run


def trained(capsys: pytest.CaptureFixture[str], out: Path, *words: str) -> dict[str, Any]:
    """The result of `train.py`, whose options of the match are the same, in this process."""
    assert train([*words, "--json", "--out", str(out)]) == 0
    return json.loads(capsys.readouterr().out)


def test_goals_end_the_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert trained(capsys, tmp_path / "run", "--goals", "2", "--seed", "1")["goals"] == 2


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Two episodes that are too short for a goal, with parameters of fusion and of the simulation."""
    settings = ("ball_robot_friction=0.1", "tie_rule=first", "learn=false", "max_steps=30")
    options = [word for setting in (*settings, "layers=approaching,ball_seeking") for word in ("--set", setting)]
    place = tmp_path_factory.mktemp("short")
    run = Run(place, [*ONE, "--episodes", "2", *options, "--out", str(place / "run")])
    yield well_ended(run)
    run.kill()


def test_an_episode_that_takes_too_long_is_a_timeout_and_no_success(short: Run) -> None:
    summary = summary_of(short.out)
    assert (summary["episodes"], summary["timeouts"], summary["steps"]) == (2, 2, 60)
    assert (summary["success_rate"], summary["cost_per_goal"], summary["mean_steps_per_goal"]) == (0.0, None, None)
    assert [row["outcome"] for row in episodes_of(short.out)] == ["timeout", "timeout"]
    assert "n/a" in short.stdout


def test_set_reaches_every_parameter_of_fusion_and_simulation(short: Run) -> None:
    parameters = parameters_of(short.out)
    assert parameters["simulator"]["ball_robot_friction"] == 0.1
    assert parameters["simulator"]["max_steps"] == 30
    assert parameters["fusion"]["tie_rule"] == "first"
    assert parameters["fusion"]["learn"] is False
    assert parameters["fusion"]["layers"] == ["approaching", "ball_seeking"]


def test_without_recording_there_is_a_result_and_no_recording(start: Start) -> None:
    run = well_ended(start(*ONE, "--episodes", "1", "--max-steps", "30", "--no-record"))
    summary = summary_of(run.out)
    assert (summary["steps"], summary["messages_recorded"], summary["incomplete"]) == (30, 0, False)
    assert {path.name for path in run.out.iterdir()} == {
        *("config.yaml", "episodes.csv", "log", "summary.json", "trees", "policy.npz"),
    }


def test_guided_episodes_come_first_are_listed_and_not_counted(start: Start) -> None:
    run = well_ended(start(*ONE, *LITERAL, "--guided", "2", "--episodes", "1", "--max-steps", "200", "--seed", "3"))
    rows = episodes_of(run.out)
    assert [row["phase"] for row in rows] == ["guided", "guided", "learning"]
    summary = summary_of(run.out)
    assert summary["episodes"] == 1
    assert summary["steps"] == sum(int(row["steps"]) for row in rows)
    phases = {
        message.fields.episode: message.fields.phase for message in messages_of(run.out) if "decision" in message.topic
    }
    assert phases == {0: 0, 1: 0, 2: 1}
    assert load_policy(run.out / "policy.npz").kind == "fbql_literal"


def test_a_learned_policy_is_played_on_and_frozen_on_request(
    start: Start, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trained(capsys, tmp_path / "learned", *LITERAL, "--guided", "2", "--episodes", "1", "--seed", "3")
    policy = tmp_path / "learned" / "policy.npz"
    going_on = ["--policy", str(policy), *LITERAL, "--episodes", "1", "--max-steps", "700", "--seed", "4"]
    graph = start(*going_on, "--learn", *ONE, "--json")
    learning, frozen = tmp_path / "learning", tmp_path / "frozen"
    digest = trained(capsys, learning, *going_on, "--learn")["digest"]
    trained(capsys, frozen, *going_on, "--no-learn")
    assert json.loads(well_ended(graph).stdout)["digest"] == digest
    for out in (graph.out, learning, frozen):
        assert [row["phase"] for row in episodes_of(out)] == ["evaluation" if out == frozen else "learning"]
        before, after = load_policy(policy).arrays, load_policy(out / "policy.npz").arrays
        same = all((before[name].shape == after[name].shape and (before[name] == after[name]).all()) for name in before)
        assert same == (out == frozen)


def test_the_presets_are_other_thresholds(start: Start, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    match = ("--episodes", "1", "--max-steps", "300", "--seed", "2", "--controller", "subsumption")
    paper = start(*ONE, *match, "--preset", "paper", "--json")
    thresholds = ("--set", "wall_threshold_m=0.07", "--set", "approach_threshold_rad=2.2")
    spelled = trained(capsys, tmp_path / "spelled", *match, *thresholds)["digest"]
    tuned = trained(capsys, tmp_path / "tuned", *match)["digest"]
    assert json.loads(well_ended(paper).stdout)["digest"] == spelled != tuned


def test_some_of_the_behaviors_can_play_and_a_tree_can_have_a_name_of_its_own(start: Start, tmp_path: Path) -> None:
    shutil.copy(TREES / "ball_seeking.json", tmp_path / "chaser.json")
    shutil.copy(TREES / "wall_avoiding.json", tmp_path)
    behaviors = "behaviors=wall_avoiding,chaser"
    run = start(
        *ONE,
        "--trees",
        str(tmp_path),
        "--set",
        behaviors,
        "--set",
        "layers=wall_avoiding,chaser",
        "--episodes",
        "1",
        "--max-steps",
        "40",
    )
    messages = messages_of(well_ended(run).out)
    assert {message.topic for message in messages} == {
        *("/world", "/wheel_command", "/fusion/decision"),
        *("/behaviors/wall_avoiding", "/behaviors/chaser"),
    }
    assert digest_of(messages) == summary_of(run.out)["digest"]


def test_the_run_is_named_after_time_controller_and_seed_unless_told(start: Start) -> None:
    match = ("--episodes", "1", "--max-steps", "30", "--seed", "718281", "--json")
    before = set((ROOT / "runs").glob("*"))
    # Three that begin in the same second have a directory each.
    runs = [start(*match, out=False, script="train.py") for _ in range(3)]
    for run in runs:
        assert run.exit_code() == 0, run.stderr
    made = set((ROOT / "runs").glob("*-fbql-s718281*")) - before
    try:
        summaries = [summary_of(path) for path in made]
    finally:
        for path in made:
            shutil.rmtree(path)
    assert len(summaries) == len(runs)
    assert all(json.loads(run.stdout) in summaries for run in runs)


def test_a_reader_that_leaves_and_a_disk_that_is_full_are_no_traceback(start: Start) -> None:
    run = start(*ONE, "--episodes", "1", "--max-steps", "30", before=["sh", "-c", '"$@" > /dev/full', "sh"])
    assert run.exit_code() == 1
    assert "the result on stdout: cannot be written (No space left on device)" in run.stderr
    assert "it is also in" in run.stderr
    assert "Traceback" not in run.stderr
    closed = ["bash", "-c", '"$@" | true; exit "${PIPESTATUS[0]}"', "sh"]
    run = start("--episodes", "1", "--max-steps", "30", before=closed, script="train.py")
    assert run.exit_code() == 0
    assert "Traceback" not in run.stderr
    assert "Exception" not in run.stderr


@pytest.mark.parametrize("command", [bringup, train])
def test_help_tells_every_option_and_each_default_that_is_a_value(
    command: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(["--help"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    for option in (
        "--controller",
        "--episodes",
        "--goals",
        "--guided",
        "--seed",
        "--policy",
        "--trees",
        "--out",
        "--json",
    ):
        assert f" {option} " in text, option
    assert "truncated: a timeout (default: 4000)" in text
    assert "default: None" not in text
    assert "default: False" not in text


# Bad input


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--nonsense"], "unrecognized arguments: --nonsense"),
        (["--controller", "best"], "unknown controller"),
        (["--episodes", "0"], "--episodes is 0"),
        (["--episodes", "99999999999999999999"], "--episodes is 9"),
        (["--seed", "-1"], "--seed is -1"),
        (["--set", "nonsense"], "--set nonsense"),
        (["--set", "learning_rate=nan"], "--set learning_rate is nan"),
        (["--set", "behaviors=ball_seeking,fusion"], "'fusion', which is the name of another node"),
        (["--realtime", "nan"], "--realtime"),
        (["--guided", "-1"], "--guided is -1; it must be 0 or more"),
        (["--episode", "3"], "--episode"),
        (["--trees", "missing"], "--trees missing: none of ball_seeking.json"),
        (["--policy", "missing", *LITERAL], "--policy missing"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_refused_in_one_line(refused: Refused, words: list[str], reason: str) -> None:
    refused(reason, *words)


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Refused:
    """refused(reason, *words): in this process; exit code 2, one line with the reason, and nothing left behind."""

    def check(reason: str, *words: str, out: Path = tmp_path / "refused") -> None:
        assert bringup([*words, "--out", str(out)]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.count("\n") == 1
        assert reason in said.err
        assert not (tmp_path / "refused").exists()

    return check


def refused_as_a_process(run: Run, reason: str) -> None:
    """The same of the real command, and nothing of it still runs."""
    assert run.exit_code() == 2, run.stderr
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1
    assert reason in run.stderr
    assert not run.out.exists()
    assert run.processes() == {}


def test_the_real_command_refuses_it_and_leaves_no_process(start: Start) -> None:
    refused_as_a_process(start("--policy", "missing", *LITERAL), "--policy missing")


def test_a_policy_file_that_is_none_is_refused(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "garbage.npz").write_bytes(b"garbage")
    (tmp_path / "pickle.npz").write_bytes(pickle.dumps({"q": [1.0]}))
    for name in ("garbage", "pickle"):
        refused("not a policy file", "--policy", str(tmp_path / f"{name}.npz"), *LITERAL)


def test_a_policy_that_does_not_fit_is_refused(
    refused: Refused, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trained(capsys, tmp_path / "run", *LITERAL, "--guided", "1", "--episodes", "1", "--max-steps", "30")
    policy = ("--policy", str(tmp_path / "run" / "policy.npz"))
    refused("controller 'subsumption' takes no policy", *policy, "--controller", "subsumption")
    refused("controller 'fbql_literal', not to 'fbql'", *policy)
    trees = tmp_path / "trees"
    shutil.copytree(TREES, trees)
    tree = load_tree(trees / "wall_avoiding.json")
    save_tree(trees / "wall_avoiding.json", replace(tree, origin={"method": "by hand"}))
    refused("learned with another tree of wall_avoiding", *policy, *LITERAL, "--trees", str(trees))


@pytest.mark.parametrize("damage", ["truncated", "another behavior's"])
def test_a_tree_that_cannot_be_used_is_refused(refused: Refused, tmp_path: Path, damage: str) -> None:
    trees = tmp_path / "trees"
    shutil.copytree(TREES, trees)
    if damage == "truncated":
        (trees / "approaching.json").write_bytes((TREES / "approaching.json").read_bytes()[:500])
    else:
        shutil.copy(TREES / "wall_avoiding.json", trees / "approaching.json")
    refused(f"{trees}/approaching.json: ", "--trees", str(trees))


@pytest.mark.parametrize("kind", ["directory", "file", "dangling link"])
def test_a_run_is_never_overwritten(refused: Refused, tmp_path: Path, kind: str) -> None:
    out = tmp_path / "there"
    if kind == "directory":
        out.mkdir()
    elif kind == "file":
        out.write_text("mine")
    else:
        out.symlink_to(tmp_path / "nowhere")
    refused(f"{out} exists; a run is never overwritten", out=out)
    assert kind != "file" or out.read_text() == "mine"
    assert kind != "directory" or list(out.iterdir()) == []
    assert not (tmp_path / "nowhere").exists()


def test_a_run_in_a_directory_that_is_missing_is_refused(refused: Refused, tmp_path: Path) -> None:
    refused(f"there is no directory {tmp_path}/missing", out=tmp_path / "missing/run")
    assert not (tmp_path / "missing").exists()


def test_a_run_on_a_read_only_file_system_is_refused(start: Start, tmp_path: Path) -> None:
    place = tmp_path / "read_only"
    place.mkdir()
    before = in_namespace(f"mount --bind '{place}' '{place}' && mount -o remount,ro,bind '{place}'")
    refused_as_a_process(start("--out", str(place / "run"), out=False, before=before), "Read-only file system")
    assert list(place.iterdir()) == []
