"""The rooms over ROS: played, trained and drawn by the commands of examples/rooms/README.md, in one process."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from fbql_common.wire import decode_mux_decision
from fbql_fusion.core.mux.learning import NODE
from fbql_fusion.policy_storage import load_policy
from fbql_recording.run import open_run
from fbql_studies.rooms.maps import room_of
from fbql_studies.rooms.robot import RANGE_M, SPACE
from fbql_studies.rooms.sources import SECTORS_DEG
from fbql_studies.rooms.tree_source import sources_with_tree
from fbql_studies.rooms.worlds import TwinWorld
from places import ROOT

SOURCES = sources_with_tree()
PLACE = ROOT / "examples" / "rooms"
PATIENCE_S = 240


@pytest.fixture
def rooms(domain: dict[str, str], tmp_path: Path):
    """Runs rooms.py with these arguments in a directory of its own."""

    def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, str(PLACE / "rooms.py"), *arguments],
            cwd=tmp_path,
            env={**os.environ, **domain, "FBQL_COMPILE": "0", **environment},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )

    return run


def verified(run: Path) -> bool:
    """Whether replay finds a recording identical."""
    words = [sys.executable, str(ROOT / "scripts" / "replay.py"), str(run), "--verify", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    return done.returncode == 0 and json.loads(done.stdout)["identical"]


def test_it_is_trained_in_lockstep_and_what_it_learned_is_played_in_irsim_and_drawn(rooms, tmp_path: Path) -> None:
    pytest.importorskip("irsim", reason="IR-SIM is in requirements/rooms.txt")
    pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")
    trained = rooms("train", "--episodes", "2", "--out", "mux")
    assert trained.returncode == 0, trained.stderr
    assert load_policy(tmp_path / "mux" / "policy.npz").behaviors == tuple(sorted(SOURCES))
    with (tmp_path / "mux" / "episodes.csv").open() as file:
        assert [row["phase"] for row in csv.DictReader(file)] == ["learning"] * 2
    assert verified(tmp_path / "mux")

    played = rooms("play", "--episodes", "1", "--policy", "mux/policy.npz", "--out", "played")
    assert played.returncode == 0, played.stderr
    assert "1 room: " in played.stderr
    assert played.stdout == "run played\n"
    summary = json.loads((tmp_path / "played" / "summary.json").read_text())
    with (tmp_path / "played" / "trails.csv").open() as file:
        trail = list(csv.DictReader(file))
    assert summary["episodes"] == 1
    assert summary["steps"] == len(trail) - 1
    first = room_of("traps", int(trail[0]["room"]))
    assert (float(trail[0]["x_m"]), float(trail[0]["y_m"])) == first.start[:2]
    assert {row["driver"] for row in trail} <= SOURCES.keys(), "every source is heard at every decision"
    assert verified(tmp_path / "played")

    drawn = rooms("show", "played")
    assert drawn.returncode == 0, drawn.stderr
    assert drawn.stdout == "picture played/rooms.png\npage played/report.html\n"
    assert (tmp_path / "played" / "rooms.png").read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "played" / "report.html").read_text()
    assert "data:image/png;base64," in page
    assert summary["digest"] in page


def test_every_decision_is_made_on_the_sensors_and_commands_of_its_own_step_and_by_the_priorities_of_the_file(
    rooms, tmp_path: Path
) -> None:
    played = rooms("play", "--episodes", "1", "--world", "twin", "--out", "by_priorities")
    assert played.returncode == 0, played.stderr
    run = open_run(tmp_path / "by_priorities")
    decisions = [decode_mux_decision(message.data) for message in run.messages(["/fusion/decision"])]
    names = list(run.parameters[NODE]["observations"])
    world = TwinWorld()
    reading = world.reset(room_of("traps", 50_000))
    for decision in decisions:
        seen = reading.ranges.astype(np.float32).astype(np.float64)  # a LaserScan has 32 bits a range
        heard = (seen, reading.goal_distance_m, reading.goal_bearing_rad)
        assert decision.commands == tuple(x for name in decision.behaviors for x in SOURCES[name](*heard)), (
            decision.step
        )
        near = seen[24:49].min()
        observed = dict(zip(names, decision.observed, strict=True))
        assert (observed["goal_distance"], observed["near"]) == (reading.goal_distance_m, near)
        if not (decision.terminated or decision.truncated):
            expected = "back" if near <= 0.3 else "wall_left" if near <= 0.9 else "goal"
            assert decision.behaviors[decision.driver] == expected
            reading = world.step(*decision.command)
    assert reading.terminated or reading.truncated
    assert verified(tmp_path / "by_priorities")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("train", "--out", "taken"),
            "taken already holds a run; a run is never overwritten, choose another directory",
        ),
        (("play", "--policy", "nowhere.npz"), "nowhere.npz: no such file"),
        (("play", "--episodes", "0"), "parameter 'episodes' is 0"),
        (("play", "--episodes", "ten"), "argument --episodes: invalid int value: 'ten'"),
        (("play", "--out", "nowhere/run"), "there is no directory"),
        (("show", "taken"), "taken/trails.csv: no such file"),
        (("show", "taken", "--rooms", "-1"), "--rooms is -1; it must be at least 1"),
        ((), "the following arguments are required: command"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(rooms, tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "config.yaml").touch()
    refused = rooms(*words)
    assert refused.returncode == 2
    assert said in refused.stderr
    assert len(refused.stderr.splitlines()) == 1, refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_a_missing_extra_is_one_line_that_says_what_to_install(rooms, tmp_path: Path) -> None:
    (tmp_path / "absent").mkdir()
    (tmp_path / "absent" / "irsim.py").write_text(
        "raise ModuleNotFoundError(\"No module named 'irsim'\", name='irsim')\n"
    )
    refused = rooms("play", PYTHONPATH=os.pathsep.join([str(tmp_path / "absent"), os.environ.get("PYTHONPATH", "")]))
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert "IR-SIM, which is not installed" in line and "rooms" in line


def test_the_file_of_the_mux_has_the_robot_of_the_rooms() -> None:
    parameters = yaml.safe_load((PLACE / "mux.yaml").read_text())[NODE]["ros__parameters"]
    assert parameters["topics"].keys() == SOURCES.keys()
    assert [(axis["low"], axis["high"], axis["levels"]) for axis in parameters["axes"].values()] == [
        tuple(axis[2:]) for axis in SPACE.axes
    ]
    scans = [each for each in parameters["observations"].values() if each["topic"] == "scan"]
    assert {each["high"] for each in scans} == {RANGE_M}
    for each, (right, left) in zip(scans[: len(SECTORS_DEG)], SECTORS_DEG, strict=True):
        assert each["field"] == f"ranges[{round(right / 5) + 36}:{round(left / 5) + 37}].min"
