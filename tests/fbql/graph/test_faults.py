"""What goes wrong under bringup: nodes that die, hang or never start, a full disk, a hostile environment."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path

import domain_coordinator
import pytest
from bringup_run import BEHAVIORS, END_S, Run, in_namespace
from run_directory_reader import finalised, summary_of

Start = Callable[..., Run]
ENDLESS = ("--goals", "100000", "--seed", "1")
ONE = ("--processes", "one")


# Nodes that die


@pytest.mark.parametrize(
    "name", ["wall_avoiding", *(pytest.param(name, marks=pytest.mark.long) for name in ("simulator", *BEHAVIORS[::2]))]
)
def test_a_node_that_is_killed_ends_the_run_and_is_named(start: Start, name: str) -> None:
    run = start(*ENDLESS)
    run.until_playing()
    os.kill(run.nodes()[name], signal.SIGKILL)
    assert run.exit_code(END_S) == 1
    assert run.processes() == {}
    summary = summary_of(run.out)
    played = f"{summary['goals']} of 100000 goals"
    ending = f"bringup.py: node '{name}' was ended by SIGKILL after {played}; its output ({run.out}/log/{name}.log):\n"
    assert ending in run.stderr
    assert f"ENDED EARLY after {played}" in run.stdout
    assert f"[{name}]: " in run.stderr
    assert finalised(run.out) == summary["messages_recorded"] >= 6 * summary["steps"] > 0


def test_fusion_killed_ends_the_simulator_and_the_rest(start: Start) -> None:
    run = start(*ENDLESS)
    run.until_playing()
    os.kill(run.nodes()["fusion"], signal.SIGKILL)
    assert run.exit_code(END_S) == 1
    assert run.processes() == {}
    assert "node 'fusion' was ended by SIGKILL" in run.stderr
    assert f"there is no summary; see {run.out}/log" in run.stderr
    assert run.stdout == ""
    assert f"python3 scripts/recover.py {run.out}" in run.stderr
    # What was flushed is there for recovery; nothing pretends to be whole.
    assert (run.out / "run_0.mcap.active").stat().st_size > 100_000
    assert not (run.out / "metadata.yaml").exists()


def test_the_process_of_all_nodes_killed_ends_the_run(start: Start) -> None:
    run = start(*ENDLESS, *ONE)
    run.until_playing()
    (graph,) = (pid for pid, line in run.processes().items() if "one_process" in line)
    os.kill(graph, signal.SIGKILL)
    assert run.exit_code(END_S) == 1
    assert "the process of all nodes was ended by SIGKILL" in run.stderr


@pytest.mark.long
def test_a_node_that_hangs_ends_the_run_by_the_bounded_wait_of_lockstep(start: Start) -> None:
    """Fusion names the behavior that does not answer, after 10 s."""
    run = start(*ENDLESS)
    run.until_playing()
    os.kill(run.nodes()["approaching"], signal.SIGSTOP)
    assert run.exit_code(25) == 1
    assert run.processes() == {}
    assert "no answer from approaching" in run.stderr
    assert "did not end in time and had to be killed: approaching" in run.stderr
    assert finalised(run.out) == summary_of(run.out)["messages_recorded"]


@pytest.mark.long
def test_all_nodes_that_hang_together_end_the_run(start: Start) -> None:
    """Nobody inside of it can tell: bringup does, when no step was played for 30 s."""
    run = start(*ENDLESS, *ONE)
    run.until_playing()
    (graph,) = (pid for pid, line in run.processes().items() if "one_process" in line)
    os.kill(graph, signal.SIGSTOP)
    assert run.exit_code(45) == 1
    assert run.processes() == {}
    assert f"bringup.py: no step was played for 30 s: a node hangs; see {run.out}/log\n" in run.stderr


# Nodes that never start


def broken_python(place: Path, executable: str, code: str) -> dict[str, str | None]:
    """The environment of a user whose Python start-up file breaks one executable."""
    start_up = place / "start_up"
    start_up.mkdir()
    (start_up / "sitecustomize.py").write_text(
        f"import os, signal, sys\nif any(word.endswith('/{executable}') for word in sys.orig_argv):\n    {code}\n"
    )
    return {"PYTHONPATH": os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), str(start_up)]))}


def test_a_node_that_fails_at_the_start_ends_the_rest_with_its_words_shown(start: Start, tmp_path: Path) -> None:
    code = "print('this Python is broken', file=sys.stderr, flush=True); os._exit(7)"
    run = start(*ENDLESS, environment=broken_python(tmp_path, "wall_avoiding", code))
    assert run.exit_code() == 1
    assert run.processes() == {}
    assert "node 'wall_avoiding' ended with exit code 7 after 0 of 100000 goals; its output" in run.stderr
    assert "\nthis Python is broken\n" in run.stderr


def test_a_node_that_never_comes_up_is_named_by_the_start_barrier(start: Start, tmp_path: Path) -> None:
    environment = broken_python(tmp_path, "simulator", "signal.pause()")
    run = start(*ENDLESS, "--start-timeout", "3", environment=environment)
    assert run.exit_code() == 1
    assert run.processes() == {}
    assert "after 3 s the graph still lacks node 'simulator'" in run.stderr
    assert "a publisher on '/world'" in run.stderr


def test_a_node_of_the_same_name_in_the_domain_is_refused(start: Start, tmp_path: Path) -> None:
    with domain_coordinator.domain_id() as domain_id:
        environment = {"ROS_DOMAIN_ID": str(domain_id)}
        first = start(*ENDLESS, *ONE, "--realtime", "2", "--max-steps", "30", environment=environment)
        first.until_playing()
        second = start("--episodes", "1", environment=environment)
        assert second.exit_code() == 2
        assert second.stdout == ""
        assert second.stderr.count("\n") == 1
        assert "is already running in ROS_DOMAIN_ID" in second.stderr
        assert not second.out.exists()
        assert first.popen.poll() is None
        first.send(signal.SIGTERM)
        assert first.exit_code(END_S) == 0


@pytest.mark.parametrize("value", ["500", "-1", "mine", "9" * 4500], ids=["too high", "negative", "word", "endless"])
def test_a_domain_that_cannot_be_is_refused(start: Start, value: str) -> None:
    run = start("--episodes", "1", environment={"ROS_DOMAIN_ID": value})
    assert run.exit_code() == 2
    assert run.stderr.startswith(f"bringup.py: ROS_DOMAIN_ID is '{value}'; set a number from 0 to 232")
    assert not run.out.exists()


def test_security_that_cannot_be_had_is_refused(start: Start) -> None:
    run = start("--episodes", "1", environment={"ROS_SECURITY_ENABLE": "true"})
    assert run.exit_code() == 2
    assert run.stderr.startswith("bringup.py: ROS_SECURITY_ENABLE is true, but")
    assert run.stderr.count("\n") == 1
    assert not run.out.exists()


SHORT = ("--controller", "subsumption", "--episodes", "2", "--max-steps", "50", "--seed", "3", "--json", *ONE)
SHORT_DIGEST = "1f91001a6d8ca45713d60a4a450a6e17b0f34784db88a54de1e97b7c5a636e8e"


def test_a_hostile_environment_is_set_aside_with_lines_before_anything_starts(start: Start) -> None:
    hostile = {
        "ROS_DISCOVERY_SERVER": "127.0.0.1:11811",
        "ROS_SUPER_CLIENT": "True",
        "ROS_STATIC_PEERS": "no.such.host",
        "ROS_LOCALHOST_ONLY": "1",
        "RMW_IMPLEMENTATION": "rmw_nothing_cpp",
        "FASTRTPS_DEFAULT_PROFILES_FILE": "/nowhere/profiles.xml",
        "FASTDDS_BUILTIN_TRANSPORTS": "nonsense",
        "RCUTILS_LOGGING_USE_STDOUT": "1",
    }
    run = start(*SHORT, environment=hostile)
    assert run.exit_code() == 0, run.stderr
    assert json.loads(run.stdout)["digest"] == SHORT_DIGEST
    lines = run.stderr.splitlines()
    begins = next(i for i, line in enumerate(lines) if line.startswith("bringing up"))
    for name in hostile.keys() - {"RCUTILS_LOGGING_USE_STDOUT"}:
        assert [i for i, line in enumerate(lines) if name in line and i < begins], name


LOCK = """python3 -c 'import fcntl, os, time
parent = os.getppid()
held = [open(f"/dev/shm/fastrtps_port{port}_el", "w") for port in range(7000, 7040)]
[fcntl.flock(each, fcntl.LOCK_EX) for each in held]
open("/dev/shm/locked", "w")
while os.getppid() == parent: time.sleep(0.1)' > /dev/null 2>&1 & while [ ! -e /dev/shm/locked ]; do sleep 0.05; done"""
"""A process that holds the locks of the ports of shared memory for as long as the shell lives."""
SHARED_MEMORY = {
    "tiny": "mount -t tmpfs -o size=100k tmpfs /dev/shm",
    "read-only": "mount -t tmpfs -o ro tmpfs /dev/shm",
    "locked": f"mount -t tmpfs -o size=64m tmpfs /dev/shm && {LOCK}",
    "locked beside its ports": (
        f"mount -t tmpfs -o size=64m tmpfs /dev/shm && for port in $(seq 7000 7039); do > /dev/shm/fastrtps_port$port; done; {LOCK}"
    ),
}


@pytest.mark.parametrize("kind", SHARED_MEMORY)
def test_shared_memory_that_fails_costs_a_line_and_no_result(start: Start, kind: str) -> None:
    run = start(*SHORT, before=in_namespace(f"{{ {SHARED_MEMORY[kind]}; }}"))
    assert run.exit_code() == 0, run.stderr
    assert json.loads(run.stdout)["digest"] == SHORT_DIGEST
    said = [line for line in run.stderr.splitlines() if line.startswith("bringup.py: shared memory ")]
    assert len(said) == 1, run.stderr
    assert "/dev/shm/fastrtps_*" in said[0]


# Where nothing can be written


def test_a_full_disk_costs_the_recording_and_not_the_match(start: Start, tmp_path: Path) -> None:
    disk, copy = tmp_path / "disk", tmp_path / "copy"
    disk.mkdir()
    before = in_namespace(f"mount -t tmpfs -o size=400k tmpfs '{disk}'", f"cp -a '{disk}/run' '{copy}'")
    match = ("--controller", "subsumption", "--episodes", "6", "--seed", "3", "--json")
    full = start(*match, *ONE, "--out", str(disk / "run"), out=False, before=before)
    whole = start(*match, script="train.py")
    assert whole.exit_code() == 0
    assert full.exit_code() == 3, full.stderr
    assert full.stderr.count("the recording is incomplete: recording FAILED, the run continues without it") == 1
    assert "No space left on device" in full.stderr
    assert "Traceback" not in full.stderr
    assert full.stdout, full.stderr
    found, expected = json.loads(full.stdout), json.loads(whole.stdout)
    assert found["incomplete"] is True
    assert found["digest"] == expected["digest"]
    assert 0 < found["messages_recorded"] < 6 * found["steps"]
    assert json.loads((copy / "summary.json").read_text()) == found
    assert not (copy / "metadata.yaml").exists()
    assert len(list(copy.glob("*.active"))) == 1


@pytest.mark.parametrize("kind", ["unset", "read-only"])
def test_a_home_that_cannot_be_written_is_no_hindrance(start: Start, tmp_path: Path, kind: str) -> None:
    home = tmp_path / "home"
    home.mkdir()
    environment, before = {"HOME": None}, []
    if kind == "read-only":
        environment = {"HOME": str(home)}
        before = in_namespace(f"mount --bind '{home}' '{home}' && mount -o remount,ro,bind '{home}'")
    run = start(*ONE, "--episodes", "1", "--max-steps", "30", environment=environment, before=before)
    assert run.exit_code() == 0, run.stderr
    assert list(home.iterdir()) == []
    assert (run.out / "log/graph.log").stat().st_size > 0
