"""The run directory: never overwritten, whole files only, and a full disk stops nothing."""

import json
import subprocess
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import yaml
from fbql_common.core.errors import BadInput
from fbql_common.core.types import Phase
from fbql_fusion.core.policy import Policy
from fbql_fusion.policy_storage import load_policy, policy_bytes
from fbql_recording.core.metrics import EpisodeRecord, summarise
from fbql_recording.run_directory import (
    RunDirectory,
    create_next_run_directory,
    create_run_directory,
    git_revision,
    software_versions,
)
from file_limit import largest_file
from patience import PATIENCE_S

GOAL = EpisodeRecord(0, Phase.GUIDED, 2**63 - 1, "goal", 120, 2, 17, 9.5, False)
TIMEOUT = EpisodeRecord(1, Phase.EVALUATION, 5, "timeout", 4000, 0, 0, 0.1 + 0.2, True)
SUMMARY = summarise("uniform", 1, [TIMEOUT], 4000, "00", wall_s=2.0, messages_recorded=5)
POLICY = Policy("fbql_literal", ("b",), ("h",), (3,), {"q": np.zeros((1, 1))})


class Reports(list[str]):
    """What was reported."""

    __call__ = list.append


@pytest.fixture
def run(tmp_path: Path) -> Iterator[RunDirectory]:
    create_run_directory(tmp_path / "run")
    made = RunDirectory(tmp_path / "run", {}, [], Reports())
    yield made
    made.close()


def test_episodes_are_rows_that_are_there_as_soon_as_they_end(run):
    assert (run.path / "episodes.csv").read_text() == (
        "index,phase,seed,outcome,steps,collisions_begun,collision_steps,return\n"
    )
    run.add_episode(GOAL)
    run.add_episode(TIMEOUT)
    assert (run.path / "episodes.csv").read_text().splitlines()[1:] == [
        "0,guided,9223372036854775807,goal,120,2,17,9.5",
        "1,evaluation,5,timeout,4000,0,0,0.30000000000000004",
    ]


def test_summary_has_exactly_its_keys_and_null_where_there_is_nothing(run):
    run.write_summary(SUMMARY)
    assert json.loads((run.path / "summary.json").read_text()) == {
        "controller": "uniform",
        "seed": 1,
        "episodes": 1,
        "goals": 0,
        "own_goals": 0,
        "timeouts": 1,
        "success_rate": 0.0,
        "cost_per_goal": None,
        "mean_steps_per_goal": None,
        "collisions_begun": 0,
        "collision_steps": 0,
        "steps": 4000,
        "wall_s": 2.0,
        "steps_per_s": 2000.0,
        "digest": "00",
        "messages_recorded": 5,
        "incomplete": False,
    }


def test_config_and_trees_are_kept_with_the_run(tmp_path):
    (tmp_path / "wall_avoiding.json").write_text("{}")
    create_run_directory(tmp_path / "run")
    config = {"parameters": {"fusion": {"seed": 3, "behaviors": ["a", "b"]}}, "versions": software_versions()}
    run = RunDirectory(tmp_path / "run", config, [tmp_path / "wall_avoiding.json"], Reports())
    assert yaml.safe_load((run.path / "config.yaml").read_text()) == config
    assert (run.path / "trees/wall_avoiding.json").read_text() == "{}"
    assert (run.path / "log").is_dir()
    run.close()


def test_policy_is_kept_with_the_run(run):
    run.write_policy(lambda: policy_bytes(POLICY))
    assert load_policy(run.path / "policy.npz").kind == "fbql_literal"
    assert not run.failed


# Where it can't be


@pytest.mark.parametrize("kind", ["directory", "file", "dangling link"])
def test_a_run_directory_is_never_overwritten(tmp_path, kind):
    path = tmp_path / "run"
    if kind == "directory":
        path.mkdir()
    elif kind == "file":
        path.touch()
    else:
        path.symlink_to(tmp_path / "nowhere")
    with pytest.raises(BadInput, match="never overwritten"):
        create_run_directory(path)


def test_runs_of_one_name_that_begin_at_once_get_a_directory_each(tmp_path):
    count = 8
    together = threading.Barrier(count)

    def begin(_):
        together.wait(timeout=PATIENCE_S)
        return create_next_run_directory(tmp_path, "run")

    with ThreadPoolExecutor(count) as pool:
        made = sorted(pool.map(begin, range(count)))
    assert made == [tmp_path / "run", *(tmp_path / f"run-{number}" for number in range(1, count))]
    assert all((path / "trees").is_dir() and (path / "log").is_dir() for path in made)


def test_where_no_run_can_be_made_no_other_name_is_tried(tmp_path):
    with pytest.raises(BadInput, match="there is no directory"):
        create_next_run_directory(tmp_path / "missing", "run")


def test_a_place_that_cannot_be_written_is_refused_before_the_start(tmp_path):
    (tmp_path / "file").touch()
    for parent in ("file", "missing"):
        with pytest.raises(BadInput, match=f"there is no directory {tmp_path / parent};"):
            create_run_directory(tmp_path / parent / "run")
    assert not (tmp_path / "missing").exists()
    with pytest.raises(BadInput, match=r"Read-only file system|No such file|Permission denied|not permitted"):
        create_run_directory(Path("/proc/fbql_run"))


def test_a_run_begins_in_a_directory_that_is_there_and_unused(tmp_path, run):
    with pytest.raises(BadInput, match="no such run directory"):
        RunDirectory(tmp_path / "other", {}, [], Reports())
    with pytest.raises(BadInput, match="already holds a run"):
        RunDirectory(run.path, {}, [], Reports())


def test_a_tree_file_that_is_missing_is_named(tmp_path):
    create_run_directory(tmp_path / "run")
    with pytest.raises(BadInput, match=r"gone\.json: can't begin the run"):
        RunDirectory(tmp_path / "run", {}, [tmp_path / "gone.json"], Reports())


# A disk that is full


@pytest.mark.parametrize("size", [10, 1000, 40_000])
def test_a_run_that_cannot_begin_leaves_its_directory_as_it_was(tmp_path, size):
    """At a tree, at the configuration, at the room for the summary."""
    create_run_directory(tmp_path / "run")
    tree = tmp_path / "tree.json"
    tree.write_text("x" * 500)
    with (
        largest_file(size),
        pytest.raises(BadInput, match=r"can't begin the run \(File too large\); make room there, or"),
    ):
        RunDirectory(tmp_path / "run", {"config": "y" * 2000}, [tree], Reports())
    assert sorted(path.name for path in (tmp_path / "run").rglob("*")) == ["log", "trees"]


def test_a_run_that_cannot_begin_keeps_the_files_that_were_there(tmp_path):
    """The tree that is played may stand where its copy goes."""
    create_run_directory(tmp_path / "run")
    tree, episodes = tmp_path / "run/trees/tree.json", tmp_path / "run/episodes.csv"
    tree.write_text("{}")
    episodes.write_text("mine")
    with pytest.raises(BadInput, match=r"episodes\.csv: can't begin the run \(File exists\)"):
        RunDirectory(tmp_path / "run", {}, [tree], Reports())
    assert (tree.read_text(), episodes.read_text()) == ("{}", "mine")
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["episodes.csv", "log", "trees"]


def test_a_full_disk_is_reported_once_leaves_whole_rows_and_is_incomplete(tmp_path):
    reports = Reports()
    create_run_directory(tmp_path / "run")
    run = RunDirectory(tmp_path / "run", {}, [], reports)
    with largest_file(150):
        for _ in range(5):
            run.add_episode(GOAL)
        run.write_policy(lambda: policy_bytes(POLICY))
        run.write_summary(SUMMARY)
    assert run.failed
    assert len(reports) == 1
    assert "episodes.csv could not be written" in reports[0]
    rows = (run.path / "episodes.csv").read_text().splitlines()[1:]
    assert rows == ["0,guided,9223372036854775807,goal,120,2,17,9.5"]
    assert sorted(path.name for path in run.path.iterdir()) == ["config.yaml", "episodes.csv", "log", "trees"]
    run.write_summary(SUMMARY)
    assert json.loads((run.path / "summary.json").read_text())["incomplete"] is True
    run.close()


def test_a_policy_that_is_not_finite_is_reported_and_not_written(tmp_path):
    reports = Reports()
    create_run_directory(tmp_path / "run")
    run = RunDirectory(tmp_path / "run", {}, [], reports)
    run.write_policy(lambda: policy_bytes(POLICY._replace(arrays={"q": np.array([[np.nan]])})))
    assert run.failed
    assert "not finite" in reports[0]
    assert not (run.path / "policy.npz").exists()
    run.close()


# What made it


def test_revision_is_the_commit_and_says_when_files_differ(tmp_path):
    def git(*words: str) -> str:
        identity = ["-c", "user.name=t", "-c", "user.email=t@t.invalid", "-c", "commit.gpgsign=false"]
        command = ["git", "-C", str(tmp_path), *identity, *words]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    assert git_revision(tmp_path / "missing") == "unknown"
    git("init", "-q")
    (tmp_path / "file").write_text("1")
    git("add", "file")
    git("commit", "-q", "-m", "first")
    commit = git("rev-parse", "HEAD")
    assert git_revision(tmp_path) == commit
    (tmp_path / "file").write_text("2")
    assert git_revision(tmp_path) == commit + "+changes"


def test_versions_name_what_the_numbers_depend_on():
    versions = software_versions()
    assert versions["python"].startswith("3.12")
    assert versions["numpy"] == np.__version__
