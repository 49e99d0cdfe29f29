"""What the middleware reads from the environment: what is set aside, with a line each, and when a user's choice stays."""

from __future__ import annotations

import fcntl
import os
import socket
from pathlib import Path
from threading import Event

import pytest
from fbql_common import middleware
from fbql_common.core.errors import BadInput
from fbql_common.middleware import (
    ELSEWHERE,
    PROFILES,
    RANGE,
    prepare_middleware,
    prepare_node,
    shared_memory_problem,
)


@pytest.fixture(autouse=True)
def _plain_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    environment = {name: value for name, value in os.environ.items() if name not in {*ELSEWHERE, *PROFILES, RANGE}}
    monkeypatch.setattr(os, "environ", environment)
    monkeypatch.setattr(middleware, "shared_memory_problem", lambda: "")


def told(prepare=prepare_middleware) -> list[str]:
    lines: list[str] = []
    prepare(lines.append)
    assert not [line for line in lines if "\n" in line or "\x1b" in line]
    return lines


def profile() -> str:
    (name,) = {Path(os.environ[each]).name for each in PROFILES}
    return name


def test_a_graph_gets_the_profile_that_binds_to_loopback_without_a_word() -> None:
    assert told() == []
    assert profile() == "loopback.xml"
    assert told() == [], "a process that is started with it"
    assert told(prepare_node) == []


@pytest.mark.parametrize("name", ELSEWHERE)
def test_a_variable_that_leads_elsewhere_is_set_aside_with_a_line(name: str) -> None:
    os.environ[name] = "some\x1b[2Jwhere\n"
    (line,) = told()
    assert name in line and "set aside" in line
    assert name not in os.environ


def test_the_deprecated_localhost_only_is_set_aside_with_a_line() -> None:
    os.environ["ROS_LOCALHOST_ONLY"] = "1"
    (line,) = told()
    assert "ROS_LOCALHOST_ONLY is set aside" in line
    assert "ROS_LOCALHOST_ONLY" not in os.environ


@pytest.mark.parametrize("name", PROFILES)
def test_a_users_own_profile_stays_and_is_named(tmp_path: Path, name: str) -> None:
    os.environ[name] = str(tmp_path / "mine.xml")
    (tmp_path / "mine.xml").write_text("<profiles/>")
    (line,) = told()
    assert "mine.xml" in line and "is used instead of our profile" in line
    assert os.environ[name] == str(tmp_path / "mine.xml")
    assert os.environ[RANGE] == "LOCALHOST"


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_that_is_not_there_is_set_aside_with_a_line(name: str) -> None:
    os.environ[name] = "/nowhere/mine.xml"
    (line,) = told()
    assert f"{name}='/nowhere/mine.xml' is set aside: the file can't be read (No such file or directory)" in line
    assert profile() == "loopback.xml"


def test_a_middleware_that_is_not_installed_is_set_aside_with_a_line() -> None:
    os.environ["RMW_IMPLEMENTATION"] = "rmw_nothing_cpp"
    (line,) = told()
    reason = "RMW_IMPLEMENTATION='rmw_nothing_cpp' is not installed (installed: rmw_fastrtps_cpp)"
    assert line == f"{reason}: it is set aside"
    assert profile() == "loopback.xml"


def test_security_is_refused() -> None:
    os.environ["ROS_SECURITY_ENABLE"] = "True"
    with pytest.raises(BadInput, match="built without DDS-Security"):
        told()


def test_a_node_started_by_hand_stays_local_only_where_that_is_asked_for() -> None:
    os.environ[RANGE] = "SUBNET"
    os.environ["ROS_STATIC_PEERS"] = "10.0.0.1"
    assert told(prepare_node) == []
    assert os.environ["ROS_STATIC_PEERS"] == "10.0.0.1"
    os.environ[RANGE] = "localhost"
    assert "ROS_STATIC_PEERS" in " ".join(told(prepare_node))
    assert profile() == "loopback.xml"


@pytest.mark.parametrize(
    "value", ["peer..invalid", "127.0.0.1;peer..invalid", "127.0.0.1:port", "tcp:127.0.0.1", "[::1"]
)
@pytest.mark.parametrize("name", ["ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER"])
def test_a_node_that_would_look_for_a_host_that_can_not_be_found_is_refused(name: str, value: str) -> None:
    os.environ[RANGE] = "SUBNET"
    os.environ[name] = value
    with pytest.raises(BadInput, match=f"^{name}: '.*' can't be found .*; correct it, or unset {name}$"):
        told(prepare_node)


def test_a_name_server_that_does_not_answer_is_waited_for_only_so_long(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = Event()
    monkeypatch.setattr(middleware, "SEARCH_S", 0.05)
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_: answer.wait())
    os.environ[RANGE] = "SUBNET"
    os.environ["ROS_STATIC_PEERS"] = "peer"
    with pytest.raises(BadInput, match=r"^ROS_STATIC_PEERS: 'peer' can't be found \(no answer within 0.05 s\); "):
        told(prepare_node)
    answer.set()


@pytest.mark.parametrize(
    "value", ["127.0.0.1", "127.0.0.1:11811", ";localhost:11811; ", "UDPv4:[127.0.0.1]:11811", "[::1]:11811"]
)
def test_a_discovery_server_that_a_node_uses_is_named(value: str) -> None:
    os.environ[RANGE] = "SUBNET"
    os.environ["ROS_DISCOVERY_SERVER"] = value
    assert told(prepare_node) == [
        f"ROS_DISCOVERY_SERVER={value!r} is in force: nodes find each other through that server alone"
    ]
    assert os.environ["ROS_DISCOVERY_SERVER"] == value


def test_without_shared_memory_the_profile_is_udp_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(middleware, "shared_memory_problem", lambda: "shared memory can't be used: it is broken")
    assert told() == [
        "shared memory can't be used: it is broken; messages go over UDP instead, which changes no result"
    ]
    assert profile() == "loopback_udp.xml"


def test_shared_memory_that_can_be_used_is_no_problem(tmp_path: Path) -> None:
    for name in ("fastrtps_port7000_el", "fastrtps_port7001_el", "fastrtps_ab12"):
        (tmp_path / name).touch()
    (tmp_path / "fastrtps_port7000").write_bytes(bytes(50_000))
    with (tmp_path / "fastrtps_port7000_el").open() as own:
        fcntl.flock(own, fcntl.LOCK_EX)
        assert shared_memory_problem(tmp_path) == ""


def test_a_ros_program_that_just_starts_is_no_problem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It holds the lock of a port that it is about to make."""
    (tmp_path / "fastrtps_port7003_el").touch()
    monkeypatch.setattr(middleware, "sleep", lambda _: (tmp_path / "fastrtps_port7003").write_bytes(bytes(50_000)))
    with (tmp_path / "fastrtps_port7003_el").open() as starting:
        fcntl.flock(starting, fcntl.LOCK_EX)
        assert shared_memory_problem(tmp_path) == ""


@pytest.mark.parametrize("kind", ["absent", "a file", "full", "another user's", "locked"])
def test_shared_memory_that_cannot_be_used_is_told_in_a_line(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "shm"
    if kind != "absent":
        place.touch() if kind == "a file" else place.mkdir()
    if kind == "full":
        monkeypatch.setattr(middleware, "_ROOM_BYTES", 1 << 60)
    if kind == "another user's":
        (place / "fastrtps_port7003_el").touch()
        monkeypatch.setattr(os, "access", lambda *_: False)
    if kind == "locked":
        monkeypatch.setattr(middleware, "MAKING_S", 0.05)
        (place / "fastrtps_port7003_el").touch()
        foreign = (place / "fastrtps_port7003_el").open()
        fcntl.flock(foreign, fcntl.LOCK_EX)
    problem = shared_memory_problem(place)
    assert problem.startswith("shared memory can't be used: ")
    assert "\n" not in problem
    assert f"rm -f {place}/fastrtps_* {place}/sem.fastrtps_*" in problem
