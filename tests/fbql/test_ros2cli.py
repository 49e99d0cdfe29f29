"""`scripts/ros2 topic | node | param` in a second shell, with the line that bringup printed, while it runs."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from bringup_run import BEHAVIORS, Run
from fbql.ros2cli import param
from fbql.ros2cli.graph import Absent, show
from fbql.ros2cli.topic import _text as message_text
from fbql.ros2cli.topic import rate_text
from patience import PATIENCE_S
from places import ROOT
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters
from std_msgs.msg import String

Start = Callable[..., Run]
LINE = re.compile(r"export (ROS_DOMAIN_ID=\d+) (ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST)")


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


FORGED = "grün\x1b[2J\u202e\x85\nros2: all is well"


def test_a_message_that_is_echoed_is_yaml_of_printable_lines() -> None:
    shown = message_text(String(data=FORGED), None, full_length=True)
    assert all(line.isprintable() for line in shown.split("\n"))
    assert yaml.safe_load(shown) == {"data": FORGED}
    assert message_text(String(data="grün 球"), None, full_length=True) == "data: grün 球\n"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (
            ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=FORGED),
            "grün\\x1b[2J\\u202e\\x85\\nros2: all is well",
        ),
        (ParameterValue(type=ParameterType.PARAMETER_STRING_ARRAY, string_array_value=["\x1b"]), "['\\x1b']"),
    ],
)
def test_a_parameter_that_is_shown_is_one_printable_line(
    value: ParameterValue, shown: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(param, "_full_name", lambda *_: "/node")
    monkeypatch.setattr(param, "_ask", lambda *_: GetParameters.Response(values=[value]))
    asked = Namespace(node_name="node", parameter_name="text", spin_time=0.0, hide_type=True)
    param.get_parameter(None, asked)  # type: ignore[arg-type] - nothing is asked for
    assert capsys.readouterr().out == f"{shown}\n"


def test_what_stdout_can_not_encode_is_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    show("grün\x1b[2J\n球")
    assert stream.buffer.getvalue() == b"gr\\xfcn\\x1b[2J\n\\u7403\n"  # type: ignore[attr-defined]


def test_a_parameter_of_an_unknown_type_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(param, "_full_name", lambda *_: "/node")
    monkeypatch.setattr(param, "_ask", lambda *_: GetParameters.Response(values=[ParameterValue(type=77)]))
    asked = Namespace(node_name="node", parameter_name="text", spin_time=0.0, hide_type=True)
    with pytest.raises(Absent, match="Unknown parameter type '77'"):
        param.get_parameter(None, asked)  # type: ignore[arg-type]
