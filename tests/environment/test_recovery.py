"""A set-up that is cut off leaves nothing running, and the next start gets to the same end."""

from __future__ import annotations

import contextlib
import os
import random
import select
import signal
import subprocess
import time
from pathlib import Path
from typing import Never

import pytest
from environment.progress import Step
from environment.set_up import PIP_BEGINS, SetUp
from places import ROOT
from setup_checkout import command, fresh_environment, make_checkout, run, start
from setup_target import made_target

SPEAK = ("ros2", "run", "speaker", "speak")
PATIENCE_S = 300


class Started:
    """A start under way, in a process group of its own, as a shell makes it."""

    def __init__(self, checkout: Path) -> None:
        self.process = subprocess.Popen(
            command(checkout, *SPEAK),
            env=fresh_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
            # Where the suite itself runs under nohup, SIGHUP would be ignored in all that it starts.
            preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
        )
        self.said = ""

    def wait_until_said(self, words: str) -> None:
        """Wait until stderr holds `words`."""
        assert self.process.stderr is not None
        until = time.monotonic() + PATIENCE_S
        while words not in self.said:
            ready, _, _ = select.select([self.process.stderr], [], [], max(0.0, until - time.monotonic()))
            data = os.read(self.process.stderr.fileno(), 4096) if ready else b""
            assert data, f"waited for {words!r}; it said {self.said!r}"
            self.said += data.decode()

    def wait_until_at_work(self, checkout: Path) -> None:
        """Wait until a program that the set-up started runs in `checkout`."""
        until = time.monotonic() + PATIENCE_S
        while len(processes_in(checkout)) < 2:
            assert time.monotonic() < until, f"waited for a second process; it said {self.said!r}"
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(0.02)

    def end(self, number: int) -> tuple[int, str]:
        """Send a signal; the exit code, and all that was said."""
        self.process.send_signal(number)
        _, rest = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, self.said + rest.decode()


def processes_in(checkout: Path) -> dict[int, str]:
    """The command lines, by process id, of the processes that name the checkout or work in it."""
    found: dict[int, str] = {}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            place = (process / "cwd").readlink()
        except OSError:
            continue
        if str(checkout) in words or place.is_relative_to(checkout):
            found[int(process.name)] = words
    return found


def kill_all_in(checkout: Path) -> None:
    """As when the machine loses power: the set-up, and the installer or the build that works for it."""
    for pid in sorted(processes_in(checkout)):
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


@pytest.mark.parametrize(
    ("number", "step", "code"),
    [(signal.SIGINT, "making .venv", 130), (signal.SIGTERM, "installing", 143), (signal.SIGHUP, "installing", 129)],
)
def test_a_signal_ends_the_set_up_with_all_that_it_started(
    tmp_path: Path, number: signal.Signals, step: str, code: int
) -> None:
    checkout = make_checkout(tmp_path / "checkout")
    started = Started(checkout)
    started.wait_until_said(step)
    ended, said = started.end(number)
    assert ended == code, said
    assert "Traceback" not in said
    assert processes_in(checkout) == {}


def test_after_a_kill_the_next_start_waits_for_what_still_runs_and_makes_afresh_what_was_cut_off(
    tmp_path: Path,
) -> None:
    checkout = make_checkout(tmp_path / "checkout")
    first = Started(checkout)
    first.wait_until_said("installing")
    first.wait_until_at_work(checkout)
    first.end(signal.SIGKILL)
    second = Started(checkout)
    second.wait_until_said("building")
    assert "another set-up of this checkout is running" in second.said
    assert "making .venv" in second.said
    second.wait_until_at_work(checkout)
    kill_all_in(checkout)
    second.process.communicate(timeout=PATIENCE_S)
    third = start(checkout, *SPEAK, "on")
    assert third.stdout == "speaks on\n", third.stderr
    assert "[set-up 1/1] building speaker" in third.stderr


@pytest.mark.parametrize("earlier", ["", PIP_BEGINS])
def test_a_signal_before_the_installer_starts_is_no_missing_log_and_no_earlier_installation(
    earlier: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = made_target(tmp_path)
    (target.site_packages / "pip").mkdir(parents=True)
    target.state.mkdir()

    def end(*_: object) -> Never:
        raise SystemExit(129)

    monkeypatch.setattr(SetUp, "run", end)
    work = SetUp(target, "run", {"PATH": ""}, lock=-1)
    (work.logs / "install-pip.txt").write_text(earlier)
    with pytest.raises(SystemExit, match="129"):
        work.install_from(tmp_path / "requirements.txt", Step(1, 1, "installing"))
    assert not work.has_changed_environment


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_a_kill_of_everything_at_any_moment_is_recovered_from(tmp_path: Path) -> None:
    rng = random.Random(2024)
    for attempt in range(12):
        checkout = make_checkout(tmp_path / f"checkout{attempt}")
        started = Started(checkout)
        started.wait_until_said("making")
        with contextlib.suppress(subprocess.TimeoutExpired):
            started.process.wait(rng.uniform(0.0, 7.0))
        kill_all_in(checkout)
        started.process.communicate(timeout=PATIENCE_S)
        said = start(checkout, *SPEAK, str(attempt))
        assert said.stdout == f"speaks {attempt}\n", said.stderr


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_a_real_clone_is_set_up_by_its_first_command_and_the_nodes_import(tmp_path: Path) -> None:
    clone = tmp_path / "clone"
    assert run(["git", "clone", "--quiet", str(ROOT), str(clone)], fresh_environment()).returncode == 0
    said = start(clone, "ros2", "pkg", "executables", "fbql_sim")
    assert said.stdout == "fbql_sim simulator\n", said.stderr
    script = (
        f"source {clone}/scripts/env.sh; python -c 'import rclpy, fbql_msgs.msg as m; print(m.WorldState().episode)'"
    )
    said = run(["bash", "-c", script], fresh_environment())
    assert said.stdout == "0\n", said.stderr
    message = clone / "ros2_ws/src/fbql_msgs/msg/WorldState.msg"
    message.write_text(message.read_text() + "int64 added_by_a_test\n")
    script = script.replace("episode", "added_by_a_test")
    said = run(["bash", "-c", script], fresh_environment())
    assert said.stdout == "0\n", said.stderr
    assert "making" not in said.stderr
    assert "installing" not in said.stderr


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_a_sourced_system_jazzy_is_used_instead_of_the_wheels(tmp_path: Path) -> None:
    """The system is an imitation: an environment elsewhere, found by the variables that a setup.bash would set."""
    clone = tmp_path / "clone"
    assert run(["git", "clone", "--quiet", str(ROOT), str(clone)], fresh_environment()).returncode == 0
    system = tmp_path / "system"
    site = system / "lib/python3.12/site-packages"
    base = fresh_environment()
    python = command(ROOT, "")[0]
    assert run([python, "-m", "venv", str(system)], base).returncode == 0
    install = [str(system / "bin/pip"), "install", "-q", "--only-binary", ":all:", "--no-binary", "empy", "--no-deps"]
    locks = [word for name in ("ros", "run") for word in ("-r", str(ROOT / f"requirements/{name}.txt"))]
    done = run([*install, "--require-hashes", *locks], base)
    assert done.returncode == 0, done.stderr
    assert run([str(system / "bin/pip"), "uninstall", "-q", "-y", "pymunk", "mcap"], base).returncode == 0
    libraries = [str(system / "lib"), *map(str, sorted(site.glob("ros_*.libs")))]
    sourced = {
        "ROS_DISTRO": "jazzy",
        "AMENT_PREFIX_PATH": str(system),
        "CMAKE_PREFIX_PATH": str(system),
        "PYTHONPATH": str(site),
        "LD_LIBRARY_PATH": os.pathsep.join(libraries),
        "PATH": f"{system}/bin{os.pathsep}{base['PATH']}",
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
    }
    said = start(clone, "ros2", "pkg", "prefix", "fbql_msgs", **sourced)
    assert said.stdout == f"{clone}/.setup/system/install/fbql_msgs\n", said.stderr
    assert not (clone / ".venv").exists()
    question = (
        "import rclpy, pymunk, fbql_msgs.msg as m; print(rclpy.__file__, pymunk.__file__, m.WorldState().episode)"
    )
    said = run(["bash", "-c", f"source {clone}/scripts/env.sh; python -c '{question}'"], {**base, **sourced})
    ours = clone / ".venv-system/lib/python3.12/site-packages"
    assert said.stdout == f"{site}/rclpy/__init__.py {ours}/pymunk/__init__.py 0\n", said.stderr
    real = tmp_path / "bin" / "ros2"
    real.parent.mkdir()
    real.write_text('#!/bin/sh\necho "the real one: $*"\n')
    real.chmod(0o755)
    path = f"{sourced['PATH']}{os.pathsep}{real.parent}"
    assert start(clone, "ros2", "topic", "list", **{**sourced, "PATH": path}).stdout == "the real one: topic list\n"
