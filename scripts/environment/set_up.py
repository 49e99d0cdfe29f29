"""The set-up's work, in order: the virtual environment, its packages, the workspace. Reached only when some of it
is not there or not up to date.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import signal
import sys
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from types import FrameType

from . import stamps, virtual, workspace
from .child import ChildError, explain, run
from .errors import SetUpError, from_os_error
from .exclusive import exclusive
from .interpreter import Interpreter, find_interpreter
from .process import BOOTSTRAPPED, build_environment, tool_environment
from .progress import Step
from .target import Target

# The one requirement that exists as source only. It is built with the locked setuptools, not with a downloaded one.
SOURCE_ONLY = "empy"
BUILD_TOOL = "setuptools"
# What the installers say when all is downloaded and they begin to change the environment.
PIP_BEGINS = "Installing collected packages"
UV_BEGINS = "Prepared"
CMAKE_HINT = "Install them, for example with `sudo apt install build-essential cmake`, and start again."


def set_up(target: Target, purpose: str, environ: Mapping[str, str]) -> None:
    """Bring the environment to what the checkout asks for. Raises SetUpError, with everything it started ended."""
    check_path(target.root)
    try:
        with ending_on_signals(), exclusive(target.state / "lock") as lock:
            SetUp(target, purpose, environ, lock).go()
    except OSError as error:
        raise from_os_error(error, str(target.root)) from error


def check_path(root: Path) -> None:
    """Raise SetUpError where the checkout's own path is one that the ROS build tools break on."""
    odd = sorted(set(re.findall(r"[^A-Za-z0-9._+/-]", str(root))))
    if odd:
        raise SetUpError(
            f"the path {root} contains {', '.join(map(repr, odd))}, on which the ROS 2 build tools break. "
            "Move the checkout to a path of plain letters, digits and . _ + - and start again."
        )


class SetUp:
    """One run of the set-up, with the lock held: what another process did while we waited for it is not redone."""

    def __init__(self, target: Target, purpose: str, environ: Mapping[str, str], lock: int) -> None:
        self.target = target
        self.purpose = purpose
        self.environ = environ
        self.lock = lock
        self.logs = target.state / "log"
        self.logs.mkdir(exist_ok=True)
        self.has_changed_environment = False

    def go(self) -> None:
        """Find out what is to be done, check that it can be done, and do it."""
        self.packages = workspace.find_packages(self.target.workspace / "src")
        todo: list[tuple[str, Callable[[Step], None]]] = []
        wants_install = not virtual.is_installed(self.target, self.purpose)
        if wants_install:
            if not virtual.is_usable(self.target):
                interpreter = find_interpreter(self.environ, with_rclpy=bool(self.target.underlay))
                text = f"making {self.target.venv.name} with Python {interpreter.version} ({interpreter.executable})"
                todo.append((text, lambda step: self.make_venv(interpreter, step)))
            entries = [virtual.requirements(self.target.lock_of(each).read_text()) for each in self.purposes()]
            count = len({name for each in entries for name in each})
            # Studies, and cart of induce.py, are the one reason for a command that worked before to install again.
            why = f" of {self.target.study_lock.name}, once" if "study" in self.purposes() else ""
            todo.append((f"installing {count} packages{why}", self.install))
        stale = self.stale_packages()
        if stale:
            self.check_build_tools(stale)
            names = ", ".join(stale) if len(stale) < 4 else f"{len(stale)} packages"
            todo.append((f"building {names}", self.build))
        for number, (text, work) in enumerate(todo, start=1):
            step = Step(number, len(todo), text)
            try:
                work(step)
            except ChildError as failure:
                step.failed()
                error = explain(failure, text, self.target.root)
                if not virtual.is_usable(self.target):
                    remove(self.target.venv)  # half-made, it would only fill the disk
                raise error from failure
            except BaseException:
                step.failed()
                raise
            step.done()
        for leftover in workspace.leftover_packages(self.target, self.fingerprints()):
            remove(leftover)
            remove(self.target.build / leftover.name)

    def purposes(self) -> list[str]:
        """What to install for. Extras that are in an environment already are kept up to date with it."""
        held = virtual.stamp_of(self.target)
        wanted = [extra for extra in virtual.EXTRAS if extra == self.purpose or extra in held]
        return [extra for extra in wanted if not virtual.is_installed(self.target, extra)] or ["run"]

    def fingerprints(self) -> dict[str, str]:
        """What each package of the workspace would be built from now."""
        return workspace.fingerprints(self.target, self.packages)

    def stale_packages(self) -> list[str]:
        """The packages to build. All of them where the environment they are built in is yet to be made."""
        if not virtual.is_usable(self.target):
            return [package.name for package in self.packages]
        return workspace.stale_packages(self.target, self.fingerprints())

    def make_venv(self, interpreter: Interpreter, step: Step) -> None:
        """Make the virtual environment anew."""
        remove(self.target.venv)
        virtual.mark_unfinished(self.target)
        with_pip = interpreter.has_ensurepip and self.uv() is None
        options = [*([] if with_pip else ["--without-pip"])]
        if self.target.underlay:
            options.append("--system-site-packages")
        command = [interpreter.executable, "-m", "venv", *options, str(self.target.venv)]
        self.run(command, self.tool_environment(), "venv", step)

    def install(self, step: Step) -> None:
        """Install what the lock says, with its hashes checked. uv is faster; pip knows its own configuration."""
        purposes, hashes = self.purposes(), virtual.lock_hashes(self.target)
        lock_files = [self.target.lock_of(purpose) for purpose in purposes]
        stamp = {"path": str(self.target.venv), "run": hashes["run"]}
        for extra in virtual.EXTRAS:
            if extra in purposes or virtual.is_installed(self.target, extra):
                stamp[extra] = hashes[extra]
        entries = virtual.requirements(lock_files[0].read_text())
        first: list[Path] = []
        if SOURCE_ONLY in entries:
            build_tool = self.target.state / "build-tool.txt"
            build_tool.write_text(entries[BUILD_TOOL] + "\n")
            first = [build_tool]
        was_usable = virtual.is_usable(self.target)
        virtual.mark_unfinished(self.target)
        try:
            for requirements in (*first, *lock_files):
                self.install_from(requirements, step)
        except BaseException:
            if was_usable and not self.has_changed_environment:
                virtual.unmark_unfinished(self.target)
            raise
        virtual.mark_finished(self.target, stamp)

    def install_from(self, requirements: Path, step: Step) -> None:
        """Install one requirements file."""
        python = str(self.target.python)
        common = ["--require-hashes", "--no-deps", "--only-binary", ":all:", "--no-binary", SOURCE_ONLY]
        common += ["-r", str(requirements)]
        uv = self.uv()
        if uv is not None:
            options = ["--python", python, "--compile-bytecode", "--no-build-isolation-package", SOURCE_ONLY]
            try:
                self.has_changed_environment = True  # unless it says that it failed before
                self.run([uv, "pip", "install", *options, *common], self.tool_environment(), "install-uv", step)
            except ChildError as failure:
                self.has_changed_environment = UV_BEGINS in failure.output
            else:
                return
        if not (self.target.site_packages / "pip").is_dir():
            self.run([python, "-m", "ensurepip"], self.tool_environment(), "ensurepip", step)
        options = ["--disable-pip-version-check", "--no-input", "--no-user", "--retries", "2"]
        options += ["--no-build-isolation", "--use-pep517"]
        log = self.logs / "install-pip.txt"
        log.write_bytes(b"")  # what an earlier pip did is not what this one did, and a signal may come before it starts
        try:
            self.run([python, "-m", "pip", "install", *options, *common], self.tool_environment(), "install-pip", step)
        finally:
            self.has_changed_environment |= PIP_BEGINS in log.read_text(errors="replace")

    def uv(self) -> str | None:
        """The uv on PATH, if any."""
        return shutil.which("uv", path=self.environ.get("PATH"))

    def tool_environment(self) -> dict[str, str]:
        """The variables for pip and uv, which need none of the wheels' libraries."""
        return {**tool_environment(self.environ), BOOTSTRAPPED: "1", "UV_PYTHON_DOWNLOADS": "never"}

    def check_build_tools(self, names: list[str]) -> None:
        """Raise SetUpError when a package is to be compiled and something needed for that is not installed."""
        if self.target.underlay and self.which("colcon") is None:
            raise SetUpError(
                "colcon is not on PATH. Install it, for example with "
                "`sudo apt install python3-colcon-common-extensions`, and start again."
            )
        if not any(package.is_compiled for package in self.packages if package.name in names):
            return
        missing = [] if self.which("cmake") else ["CMake"]
        if not self.which(self.environ.get("CC", "").split(" ")[0], "cc", "gcc", "clang"):
            missing.append("a C compiler")
        if not self.which(self.environ.get("CXX", "").split(" ")[0], "c++", "g++", "clang++"):
            missing.append("a C++ compiler")
        if not self.which("make", "ninja"):
            missing.append("make")
        if missing:
            raise SetUpError(f"the messages are compiled, and {', '.join(missing)} cannot be found. {CMAKE_HINT}")

    def which(self, *names: str) -> str | None:
        """The first of these programs that is on PATH."""
        found = (shutil.which(name, path=self.environ.get("PATH")) for name in names if name)
        return next((path for path in found if path), None)

    def build(self, step: Step) -> None:
        """Build the stale packages, each from nothing, so that no removed file or message stays behind."""
        wanted = self.fingerprints()
        stale = workspace.stale_packages(self.target, wanted)
        for name in stale:
            remove(self.target.install / name)
            remove(self.target.build / name)
        colcon = self.which("colcon") if self.target.underlay else str(self.target.venv / "bin" / "colcon")
        command = [str(colcon), "--log-base", str(self.target.log), "build", "--base-paths", "src"]
        command += ["--build-base", str(self.target.build), "--install-base", str(self.target.install)]
        command += ["--packages-select", *stale]
        environ = build_environment(self.target, self.environ)
        environ["COLCON_HOME"] = str(self.target.state / "colcon")  # the user's colcon defaults are for other work
        (self.logs / "build.txt").write_bytes(b"")  # what an earlier build finished is not what this one did
        try:
            self.run(command, environ, "build", step, cwd=self.target.workspace)
        finally:
            said = (self.logs / "build.txt").read_text(errors="replace")
            finished = re.findall(r"^Finished <<< (\S+)", said, flags=re.MULTILINE)
            for name in set(stale).intersection(finished):
                stamp = workspace.build_stamp(self.target, name, wanted[name])
                stamps.write(self.target.install / name / workspace.STAMP, stamp)

    def run(self, command: list[str], environ: dict[str, str], log: str, step: Step, cwd: Path | None = None) -> None:
        """Run a program of this set-up."""
        run(command, environ=environ, log=self.logs / f"{log}.txt", lock=self.lock, step=step, cwd=cwd)


def remove(path: Path) -> None:
    """Remove a directory and all in it. The stamps go first: a removal cut short must not look like finished work."""
    for stamp in (virtual.STAMP, workspace.STAMP):
        (path / stamp).unlink(missing_ok=True)
    if path.is_symlink():
        path.unlink()
    elif path.exists():
        shutil.rmtree(path)


@contextlib.contextmanager
def ending_on_signals() -> Generator[None, None, None]:
    """Turn SIGTERM and SIGHUP into an orderly end, which takes the programs that run for us along."""

    def end(number: int, frame: FrameType | None) -> None:
        sys.exit(128 + number)

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    changed = [number for number, handler in before.items() if handler is signal.SIG_DFL]  # nohup's choice stays
    try:
        for number in changed:
            signal.signal(number, end)
        yield
    finally:
        for number in changed:
            signal.signal(number, signal.SIG_DFL)
