"""The set-up's work, in order: the virtual environment, its packages, the workspace."""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import os
import re
import shutil
import signal
import stat
import sys
from collections.abc import Generator, Mapping
from pathlib import Path
from xml.etree import ElementTree

from . import child
from .child import ChildError, explain, explain_refusal
from .interpreter import Interpreter, find_interpreter
from .progress import SetUpError, Step, say
from .target import BUILD_STAMP, ENVIRONMENT_STAMP, EXTRAS, UNFINISHED, Package, Target, write_stamp
from .variables import BOOTSTRAPPED, build_environment, tool_environment

# The one requirement that exists as source only. It is built with the locked setuptools, not with a downloaded one.
SOURCE_ONLY = "empy"
BUILD_TOOL = "setuptools"
# The set-up removes a directory only if one of these is in it.
MARKS = (ENVIRONMENT_STAMP, UNFINISHED, BUILD_STAMP)
# What the installers say when all is downloaded and they begin to change the environment.
PIP_BEGINS = "Installing collected packages"
UV_BEGINS = "Prepared"


def set_up(target: Target, purpose: str, environ: Mapping[str, str]) -> list[Package]:
    """Bring the environment to the state that the checkout requires; returns the packages of the workspace.

    Raises SetUpError, with everything it started ended.
    """
    check_path(target.root)
    try:
        with ended_by_signals(), readable_as(target.root), exclusive(target.state / "lock") as lock:
            work = SetUp(target, purpose, environ, lock)
            work.go()
            return work.packages
    except OSError as error:
        raise explain_refusal(error, target.root) from error


def check_path(root: Path) -> None:
    """Raise SetUpError if the ROS build tools can't handle the checkout's path."""
    odd = sorted(set(re.findall(r"[^A-Za-z0-9._+/-]", str(root))))
    if odd:
        raise SetUpError(
            f"the path {root} contains {', '.join(map(repr, odd))}, on which the ROS 2 build tools fail. "
            "Move the checkout to a path of plain letters, digits and . _ + - and start again."
        )


class SetUp:
    """One run of the set-up, with the lock held: work that another process did while we waited for the lock is not
    redone."""

    def __init__(self, target: Target, purpose: str, environ: Mapping[str, str], lock: int) -> None:
        self.target = target
        self.environ = environ
        self.lock = lock
        self.logs = target.state / "log"
        self.logs.mkdir(exist_ok=True)
        self.has_changed_environment = False
        self.packages = target.packages()
        held = target.installed()
        """What is installed; empty without a usable environment."""
        wanted = [extra for extra in EXTRAS if extra == purpose or extra in held] or ["run"]
        self.purposes = [each for each in wanted if not target.has_installed(each)]
        """What to install for. Extras already in the environment are kept up to date as well."""
        self.held = held

    def go(self) -> None:
        """Determine what needs to be done, check that it can be done, and do it."""
        todo = []
        if self.purposes:
            if not self.held:
                interpreter = find_interpreter(self.environ, with_rclpy=bool(self.target.underlay))
                text = f"making {self.target.venv.name} with Python {interpreter.version} ({interpreter.executable})"
                todo.append((text, lambda step: self.make_venv(interpreter, step)))
            # These, cart of induce.py among them, are the reasons for a command that worked before to install again.
            why = (
                " for studies, once"
                if "study" in self.purposes
                else " to read bags, once"
                if "bags" in self.purposes
                else ""
            )
            todo.append((f"installing {len(self.target.requirements(self.purposes))} packages{why}", self.install))
        stale = self.target.stale(self.packages) if self.held else [package.name for package in self.packages]
        if stale:
            self.check_workspace(stale)
            names = ", ".join(stale) if len(stale) < 4 else f"{len(stale)} packages"
            todo.append((f"building {names}", self.build))
        for number, (text, work) in enumerate(todo, start=1):
            step = Step(number, len(todo), text)
            try:
                work(step)
            except BaseException as failure:
                step.failed()
                if not isinstance(failure, ChildError):
                    raise
                error = explain(failure, text, self.target.root)
                if not self.target.installed():
                    remove(self.target.venv)  # half-made, it would only fill the disk
                raise error from failure
            step.done()
        for leftover in self.target.leftovers(self.packages):
            for place in self.places(leftover.name):
                remove(place)

    def make_venv(self, interpreter: Interpreter, step: Step) -> None:
        """Recreate the virtual environment."""
        self.clear(self.target.venv)
        self.target.venv.mkdir()
        (self.target.venv / UNFINISHED).touch()
        # With pip even if uv installs the locks: the documents name `python -m pip install` for the optional extras.
        options = [] if interpreter.has_ensurepip else ["--without-pip"]
        options += ["--system-site-packages"] if self.target.underlay else []
        self.run("venv", [interpreter.executable, "-m", "venv", *options, str(self.target.venv)], step)

    def install(self, step: Step) -> None:
        """Install what the locks list, checking the hashes; a usable environment is first marked as changing."""
        entries = self.target.requirements(self.purposes)
        files = {"build-tool": entries[BUILD_TOOL]} if SOURCE_ONLY in entries else {}
        files["requirements"] = "\n".join(entries.values())
        unfinished = self.target.venv / UNFINISHED
        unfinished.touch()
        try:
            for name, text in files.items():
                path = self.target.state / f"{name}.txt"
                path.write_text(text + "\n")
                self.install_from(path, step)
        except BaseException:
            if self.held and not self.has_changed_environment:
                unfinished.unlink()
            raise
        open_up(self.target.venv, self.target.root)
        installed = {
            "run",
            *self.purposes,
            *(each for each in self.held if self.target.lock_hash(each) == self.held[each]),
        }
        stamp = {each: self.target.lock_hash(each) for each in sorted(installed)}
        write_stamp(self.target.venv / ENVIRONMENT_STAMP, {"path": str(self.target.venv), **stamp})
        unfinished.unlink()

    def install_from(self, requirements: Path, step: Step) -> None:
        """Install one requirements file. uv is faster; pip knows its own configuration."""
        python = str(self.target.python)
        common = ["--require-hashes", "--no-deps", "--only-binary", ":all:", "--no-binary", SOURCE_ONLY]
        common += ["-r", str(requirements)]
        uv = self.which("uv")
        if uv is not None:
            options = ["--python", python, "--compile-bytecode", "--no-build-isolation-package", SOURCE_ONLY]
            try:
                self.has_changed_environment = True  # unless it says that it failed before
                return self.run("install-uv", [uv, "pip", "install", *options, *common], step)
            except ChildError as failure:
                self.has_changed_environment = UV_BEGINS in failure.output
        if not (self.target.site_packages / "pip").is_dir():
            self.run("ensurepip", [python, "-m", "ensurepip"], step)
        options = ["--disable-pip-version-check", "--no-input", "--no-user", "--retries", "2"]
        options += ["--no-build-isolation", "--use-pep517"]
        log = self.logs / "install-pip.txt"
        log.write_bytes(b"")  # what an earlier pip did is not what this one did, and a signal may come before it starts
        try:
            self.run("install-pip", [python, "-m", "pip", "install", *options, *common], step)
        finally:
            self.has_changed_environment |= PIP_BEGINS in log.read_text(errors="replace")

    def check_workspace(self, names: list[str]) -> None:
        """Raise SetUpError if a package to build is not valid, or its build tools are not installed."""
        packages = [package for package in self.packages if package.name in names]
        for package in packages:
            try:
                ElementTree.parse(package.path / "package.xml")
            except ElementTree.ParseError as error:
                raise SetUpError(f"{package.path}/package.xml is not XML: {error}. Fix it and start again.") from None
            if not package.name:
                raise SetUpError(f"{package.path}/package.xml has no <name>. Fix it and start again.")
        if self.target.underlay and self.which("colcon") is None:
            raise SetUpError(
                "colcon is not on PATH. Install it, for example with "
                "`sudo apt install python3-colcon-common-extensions`, and start again."
            )
        tools = {
            "CMake": ("cmake",),
            "a C compiler": (self.environ.get("CC", "").split(" ")[0], "cc", "gcc", "clang"),
            "a C++ compiler": (self.environ.get("CXX", "").split(" ")[0], "c++", "g++", "clang++"),
            "make": ("make", "ninja"),
        }
        missing = [tool for tool, programs in tools.items() if self.which(*programs) is None]
        if missing and any(package.is_compiled for package in packages):
            raise SetUpError(
                f"compiling the messages needs {', '.join(missing)}, which cannot be found. Install them, for example with "
                "`sudo apt install build-essential cmake`, and start again."
            )

    def build(self, step: Step) -> None:
        """Build the stale packages, each from scratch, so that no removed file or message stays behind."""
        wanted = self.target.fingerprints(self.packages)
        stale = self.target.stale(self.packages)
        layout = self.target.install / ".colcon_install_layout"
        if layout.exists() and layout.read_text().strip() != "isolated":
            self.set_aside(self.target.install)
            stale = [package.name for package in self.packages]
        for name in stale:
            build, install = self.places(name)
            if build.is_dir() and (install / BUILD_STAMP).exists():
                (build / BUILD_STAMP).touch()  # earlier versions stamped the install space alone
            for place in (build, install):
                self.clear(place)
                place.mkdir(parents=True)
                (place / BUILD_STAMP).touch()
        colcon = self.which("colcon") if self.target.underlay else str(self.target.venv / "bin" / "colcon")
        command = [str(colcon), "--log-base", str(self.target.log), "build", "--base-paths", "src", "--symlink-install"]
        command += ["--build-base", str(self.target.build), "--install-base", str(self.target.install)]
        log = self.logs / "build.txt"
        log.write_bytes(b"")  # what an earlier build finished is not what this one did
        try:
            environ = build_environment(self.target, self.environ)
            self.run("build", [*command, "--packages-select", *stale], step, environ)
        finally:
            finished = re.findall(r"^Finished <<< (\S+)", log.read_text(errors="replace"), flags=re.MULTILINE)
            for name in set(stale).intersection(finished):
                write_stamp(self.target.install / name / BUILD_STAMP, self.target.stamp(name, wanted[name]))

    def places(self, name: str) -> tuple[Path, Path]:
        """Where a package is built and installed; its stamp is in the second one."""
        return self.target.build / name, self.target.install / name

    def clear(self, path: Path) -> None:
        """Make room at `path`. What the set-up did not make itself is moved away and kept."""
        if is_ours(path):
            remove(path)
        elif path.exists() or path.is_symlink():
            self.set_aside(path)

    def set_aside(self, path: Path) -> None:
        """Move away something that is in the way."""
        kept = self.target.state / "set-aside"
        kept.mkdir(exist_ok=True)
        number = next(number for number in itertools.count(1) if not os.path.lexists(kept / f"{path.name}-{number}"))
        place = kept / f"{path.name}-{number}"
        shutil.move(path, place)
        say(f"{path} was not made by this set-up: it is now {place}")

    def which(self, *names: str) -> str | None:
        """The first of these programs that is on PATH."""
        found = (shutil.which(name, path=self.environ.get("PATH")) for name in names if name)
        return next((path for path in found if path), None)

    def run(self, log: str, command: list[str], step: Step, environ: dict[str, str] | None = None) -> None:
        """Run a program of this set-up; pip and uv need none of the wheels' libraries."""
        environ = environ or {**tool_environment(self.environ), BOOTSTRAPPED: "1", "UV_PYTHON_DOWNLOADS": "never"}
        if not writable_cache(environ):
            cache = self.target.state / "cache"
            cache.mkdir(exist_ok=True)
            environ = {**environ, "XDG_CACHE_HOME": str(cache)}
        place = self.target.workspace
        child.run(command, environ=environ, log=self.logs / f"{log}.txt", lock=self.lock, step=step, cwd=place)


def writable_cache(environ: Mapping[str, str]) -> bool:
    """Whether the installers can write to the cache that the user's variables name."""
    home = Path(environ.get("HOME") or os.devnull)
    cache = Path(environ.get("XDG_CACHE_HOME") or home / ".cache")
    try:
        place = cache if cache.exists() or cache.is_symlink() else cache.parent
        return place.is_dir() and os.access(place, os.W_OK | os.X_OK)
    except OSError:  # such as a name that is too long
        return False


def is_ours(path: Path) -> bool:
    """Whether the set-up made the directory `path`: then one of its stamps is in it. An empty one counts as ours."""
    if path.is_symlink() or not path.is_dir():
        return False
    try:
        return any((path / mark).exists() for mark in MARKS) or not any(path.iterdir())
    except OSError:  # somebody else's, which can't be read
        return False


def remove(path: Path) -> None:
    """Remove a directory that the set-up made. Its stamps are emptied first and removed last: an interrupted removal
    leaves neither what looks like finished work nor what looks like somebody else's."""
    if not is_ours(path):
        return
    marks = [path / mark for mark in MARKS if (path / mark).exists()]
    for mark in marks:
        os.truncate(mark, 0)
    for entry in path.iterdir():
        if entry in marks:
            continue
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        else:
            entry.unlink()
    for mark in marks:
        mark.unlink()
    path.rmdir()


@contextlib.contextmanager
def readable_as(root: Path) -> Generator[None, None, None]:
    """Make new files as readable for others as the checkout is, whatever the umask: who can read it can then run it."""
    before = os.umask(0o077)
    os.umask(before & ~(root.stat().st_mode & 0o055))
    try:
        yield
    finally:
        os.umask(before)


def open_up(directory: Path, root: Path) -> None:
    """Make what is in a directory as readable for others as the checkout is: a cache may have given private files."""
    others = root.stat().st_mode & 0o055
    for place, directories, files in os.walk(directory):
        for name in (*directories, *files):
            path = os.path.join(place, name)  # noqa: PTH118 - tens of thousands of files
            mode = os.lstat(path).st_mode
            if stat.S_ISLNK(mode):
                continue
            owner = mode & 0o500
            wanted = mode | ((owner >> 3 | owner >> 6) & others)
            if wanted != mode:
                os.chmod(path, stat.S_IMODE(wanted))  # noqa: PTH101


@contextlib.contextmanager
def exclusive(path: Path) -> Generator[int, None, None]:
    """Hold the lock file at `path`; yields its descriptor. Waits, with a message, while another process holds it.

    The lock belongs to the open file (flock), not to this process: a child that inherits the descriptor holds it too.
    So when this process is killed, its installer or compiler, still writing, keeps the next set-up waiting.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(descriptor, 32, 0).decode(errors="replace").strip()
            say(f"another set-up of this checkout is running (process {holder or 'unknown'}); waiting for it ...")
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        os.truncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        yield descriptor
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def ended_by_signals() -> Generator[None, None, None]:
    """Turn SIGTERM and SIGHUP into an orderly exit that also ends the programs we started."""
    numbers = [each for each in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(each) is signal.SIG_DFL]
    try:
        for number in numbers:  # nohup's choice stays
            signal.signal(number, lambda number, frame: sys.exit(128 + number))
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)
