"""`scripts/ros2 topic | node | param` in a second shell, with the line that bringup printed, while it runs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from bringup_run import BEHAVIORS, Run
from fbql.ros2cli.topic import rate_text
from places import ROOT

Start = Callable[..., Run]
LINE = re.compile(r"export (ROS_DOMAIN_ID=\d+) (ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST)")
PATIENCE_S = 60.0


def ros2(place: Path, exported: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    """The command in a shell of its own."""
    own = {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "FASTRTPS", "FASTDDS"))}
    return subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "ros2"), *words],
        env={**own, "ROS_LOG_DIR": str(place), **exported},
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip


def test_a_second_shell_sees_the_graph_with_the_line_that_bringup_printed(start: Start, tmp_path: Path) -> None:
    run = start("--realtime", "1", "--processes", "one", "--episodes", "100", "--controller", "subsumption")
    run.until(lambda: LINE.search(run.stderr), "the line for a second shell")
    line = LINE.search(run.stderr)
    assert line is not None
    exported = dict(variable.split("=") for variable in line.groups())
    run.until_playing()

    said = ros2(tmp_path, exported, "topic", "echo", "fusion/decision", "--once")
    assert said.returncode == 0, said.stderr
    text, end = said.stdout.removesuffix("---\n"), said.stdout[-4:]
    decision = yaml.safe_load(text)
    assert (end, decision["behaviors"], decision["controller"]) == ("---\n", list(BEHAVIORS), "subsumption")
    assert (sum(decision["weights"]), decision["header"]["frame_id"]) == (1.0, "field")

    topics = ros2(tmp_path, exported, "topic", "list", "-t").stdout.splitlines()
    assert "/world [fbql_msgs/msg/WorldState]" in topics
    assert topics == sorted(topics)
    assert len(topics) > 10
    assert ros2(tmp_path, exported, "topic", "info", "world").stdout == (
        "Type: fbql_msgs/msg/WorldState\nPublisher count: 1\nSubscription count: 4\n"
    )
    nodes = ros2(tmp_path, exported, "node", "list").stdout.splitlines()
    assert nodes == sorted(f"/{name}" for name in (*BEHAVIORS, "bringup", "fusion", "simulator"))
    told = ros2(tmp_path, exported, "node", "info", "/fusion").stdout
    assert "  Publishers:\n" in told
    assert "    /fusion/decision: fbql_msgs/msg/FusionDecision\n" in told
    assert ros2(tmp_path, exported, "param", "get", "fusion", "controller").stdout == "String value is: subsumption\n"
    assert "  tree_file\n" in ros2(tmp_path, exported, "param", "list", "/approaching").stdout

    rate = ["timeout", "-s", "INT", "25"]
    said = subprocess.run(
        [*rate, sys.executable, str(ROOT / "scripts" / "ros2"), "topic", "hz", "world", "--window", "50"],
        env={**os.environ, **exported}, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    found = re.search(
        r"average rate: (\d+\.\d{3})\n\tmin: [\d.]+s max: [\d.]+s std dev: [\d.]+s window: \d+", said.stdout
    )
    assert found is not None, said.stderr
    assert float(found[1]) > 0.0


@pytest.mark.parametrize(
    ("words", "code", "error"),
    [
        (("topic", "pub", "/x"), 2, "ros2: 'ros2 topic pub' needs a real ros2 (an installed ROS 2 Jazzy); here are: list, info, echo, hz"),
        (("topic", "info", "nothing"), 1, "Unknown topic '/nothing'"),
        (("topic", "echo", "nothing"), 1, "Could not determine the type for the passed topic"),
        (("topic", "echo", "nothing", "no_msgs/msg/No"), 1, "The message type 'no_msgs/msg/No' is invalid"),
        (("node", "info", "nobody"), 1, "Unable to find node 'nobody'"),
        (("param", "get", "nobody", "x"), 1, "Node not found"),
    ],
)  # fmt: skip
def test_what_is_not_there_is_said_as_ros2_says_it(
    words: tuple[str, ...], code: int, error: str, tmp_path: Path, domain: dict[str, str]
) -> None:
    waits = () if code == 2 else ("--spin-time", "0.5")
    said = ros2(tmp_path, domain, *words, *waits)
    assert (said.returncode, said.stdout, said.stderr.splitlines()[-1]) == (code, "", error)


def test_a_rate_is_that_of_the_messages_in_the_window() -> None:
    assert rate_text([10.0, 10.25, 10.5, 11.0]) == (
        "average rate: 3.000\n\tmin: 0.250s max: 0.500s std dev: 0.11785s window: 3"
    )
