"""A behavior of one's own by the commands alone, as docs/add_a_behavior.md says: recorded, induced, fused by name, in real processes."""

from __future__ import annotations

import json
import shutil
import signal
from collections.abc import Callable
from pathlib import Path

import domain_coordinator
import pytest
from bringup_run import Run
from commands import train
from fbql_behaviors.storage import load_tree
from places import ROOT
from run_directory_reader import digest_of, messages_of, parameters_of, summary_of

Start = Callable[..., Run]
TREES = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees"
EXAMPLE = ROOT / "examples/shooting"
OBSERVATION = ("--observation", str(EXAMPLE / "shooting.py"))
NAMES = ("ball_seeking", "wall_avoiding", "approaching", "shooting")
FOUR = ("--set", f"behaviors={','.join(NAMES)}", "--set", "layers=shooting,wall_avoiding,approaching,ball_seeking")
MATCH = (*FOUR, "--episodes", "1", "--max-steps", "120", "--seed", "4", "--json")


def well_ended(run: Run) -> Run:
    assert run.exit_code() == 0, run.stderr
    assert run.processes() == {}
    return run


@pytest.fixture
def trees(tmp_path: Path) -> Path:
    """A directory with the trees of all four."""
    place = tmp_path / "trees"
    shutil.copytree(TREES, place)
    shutil.copy(EXAMPLE / "shooting.json", place)
    return place


def test_it_is_recorded_induced_and_explained(start: Start, tmp_path: Path) -> None:
    demonstrate = ("shooting", *OBSERVATION, "--demonstrations", "8")
    recorded = well_ended(start(*demonstrate, script="demonstrate.py"))
    tree = tmp_path / "shooting.json"
    induce = ("shooting", *OBSERVATION, "--demos", str(recorded.out), "--out", str(tree), "--report", "--json")
    result = json.loads(well_ended(start(*induce, out=False, script="induce.py")).stdout)
    assert result["leaves"] == load_tree(tree).leaf_count
    assert "shooting" in tree.with_suffix(".html").read_text()
    explained = well_ended(start("explain", str(tree), out=False, script="tree.py"))
    assert "ball" in explained.stdout and "goal" in explained.stdout


@pytest.mark.parametrize("processes", ["many", pytest.param("one", marks=pytest.mark.long)])
def test_four_behaviors_play_the_same_match_in_many_processes_in_one_and_without_ros(
    start: Start, trees: Path, processes: str
) -> None:
    # one episode by Subsumption, one by what was learned in it
    words = ("--controller", "fbql_literal", "--guided", "1", *MATCH, "--trees", str(trees), *OBSERVATION)
    graph = well_ended(start(*words, "--processes", processes))
    without = well_ended(start(*words, script="train.py"))
    digests = {json.loads(run.stdout)["digest"] for run in (graph, without)}
    assert len(digests) == 1
    messages = messages_of(graph.out)
    assert {f"/behaviors/{name}" for name in NAMES} < {message.topic for message in messages}
    assert digest_of(messages) == summary_of(graph.out)["digest"]
    source = f"{EXAMPLE / 'shooting.py'}:shooting"
    for run in (graph, without):
        nodes = parameters_of(run.out)
        assert [nodes[name].get("observation", "") for name in NAMES] == ["", "", "", source]


def test_in_one_process_it_plays_the_requested_goals_as_it_does_without_ros(
    start: Start, trees: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--controller", "subsumption", *FOUR, "--goals", "1", "--seed", "4", "--json", "--trees", str(trees))
    graph = json.loads(well_ended(start(*words, *OBSERVATION, "--processes", "one")).stdout)
    assert train([*words, *OBSERVATION, "--out", str(trees.parent / "without")]) == 0
    without = json.loads(capsys.readouterr().out)
    assert graph["digest"] == without["digest"]
    assert (graph["goals"], graph["episodes"]) == (1, without["episodes"])


def test_its_node_is_run_by_ros2_run_and_fused_by_naming_it(start: Start, trees: Path) -> None:
    """Each node in a terminal of its own, as the page says; the match is the one that train.py plays without ROS."""
    with domain_coordinator.domain_id() as domain_id:

        def run(package: str, executable: str, *parameters: str) -> Run:
            words = [word for parameter in parameters for word in ("-p", parameter)]
            renamed = ["-r", "__node:=shooting"] if executable == "behavior" else []
            environment = {"ROS_DOMAIN_ID": str(domain_id), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
            arguments = ("run", package, executable, "--ros-args", *renamed, *words)
            return start(*arguments, script="ros2", out=False, environment=environment)

        nodes = [run("fbql_sim", "simulator", "seed:=4", "max_steps:=120")]
        nodes += [run("fbql_behaviors", name) for name in NAMES[:3]]
        source = f"{EXAMPLE / 'shooting.py'}:shooting"
        nodes.append(
            run("fbql_behaviors", "behavior", f"tree_file:={trees / 'shooting.json'}", f"observation:={source}")
        )
        layers = "layers:=[shooting, wall_avoiding, approaching, ball_seeking]"
        match = ("controller:=uniform", "seed:=4", "episodes:=1", layers)
        fusion = run("fbql_fusion", "fusion", f"behaviors:=[{', '.join(NAMES)}]", *match)
        well_ended(fusion)
        for node in nodes:
            node.send(signal.SIGINT)
        for node in nodes:
            well_ended(node)
    (directory,) = (fusion.place / "runs").iterdir()
    words = ("--controller", "uniform", *MATCH, "--trees", str(trees), *OBSERVATION)
    without_ros = json.loads(well_ended(start(*words, script="train.py")).stdout)
    assert summary_of(directory)["digest"] == without_ros["digest"]
    assert 0 < without_ros["steps"] <= 120


def test_a_behavior_whose_observation_nobody_told_is_refused(start: Start, trees: Path) -> None:
    run = start(*MATCH, "--trees", str(trees))
    assert run.exit_code() == 2
    assert run.stderr.count("\n") == 1
    assert f"{trees}/shooting.json: unknown behavior 'shooting'" in run.stderr
    assert not run.out.exists()
