"""`scripts/ros2`: `run`, `pkg` and looking at a graph, where no real `ros2` is installed; with its arguments, output and
exit codes.

The wheels bring no ros2cli. With a sourced system Jazzy this steps aside for the real one. Packages and executables are
looked up by the ament index, which is files: a prefix holds a package when it has the marker
share/ament_index/resource_index/packages/NAME. Of several prefixes the first on AMENT_PREFIX_PATH wins. Looking at a
graph needs ROS, so it is a program inside the environment: `fbql.ros2cli`.
"""

from __future__ import annotations

import argparse
import errno
import os
import shlex
import shutil
import sys
from pathlib import Path
from typing import NoReturn

from .progress import shown, write
from .ready import ROOT, environment_or_exit
from .signals import let_signals_in
from .target import matches, split_path, target_for

MARKERS = Path("share", "ament_index", "resource_index", "packages")
SCRIPTS = ROOT / "scripts"
GRAPH = {"topic": "list, info, echo, hz", "node": "list, info", "param": "list, get"}
"""The commands that look at a graph, with the verbs supported here."""
VERBS = ("run", "pkg", *GRAPH)


class NotThere(Exception):
    """The requested object does not exist; the arguments are the lines that ros2 prints in that case."""


def main(argv: list[str]) -> int:
    """Do what `ros2 ARGV` does. Returns an exit code, or does not return: the executable takes this process's place."""
    try:
        try:
            return answer(argv)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.ENOSPC):
            raise
        # What is still buffered must not fail once more when Python exits. A reader that left is no error.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:
            return 0
        write(f"ros2: stdout: cannot be written ({error.strerror}); make room there, or choose another place\n")
        return 1


def answer(argv: list[str]) -> int:
    """As `main`, for readers of stdout that stay."""
    if target_for(ROOT, os.environ).underlay and real_ros2(os.environ.get("PATH", "")) is not None:
        _, environ = environment_or_exit()
        real = str(real_ros2(environ["PATH"]))
        become([real, *argv], environ)
    if argv and not argv[0].startswith("-") and argv[0] not in VERBS:
        write(f"'ros2 {shown(argv[0])}' needs a real ros2 (an installed ROS 2 Jazzy); here are: {', '.join(VERBS)}\n")
        return 2
    if argv and argv[0] in GRAPH:
        target, environ = environment_or_exit()
        become([str(target.venv / "bin" / "python"), "-P", "-m", "fbql.ros2cli", *argv], environ)
    arguments = make_parser().parse_args(argv)
    if arguments.work is None:
        arguments.help()
        return 0
    _, environ = environment_or_exit()
    try:
        arguments.work(arguments, find_packages(split_path(environ["AMENT_PREFIX_PATH"])), environ)
    except NotThere as error:
        write("".join(f"{shown(line)}\n" for line in error.args))
        return 1
    return 0


class Parser(argparse.ArgumentParser):
    """Reports a usage error in printable lines, of which the last names the word as it was typed."""

    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        self.exit(2, f"{self.prog}: error: {shown(message)}\n")


def make_parser() -> argparse.ArgumentParser:
    """The command line of ros2cli, as far as it is supported here."""
    parser = Parser(prog="ros2", description="The part of ros2 that starts executables and looks at a graph.")
    parser.set_defaults(work=None, help=parser.print_help)
    verbs = parser.add_subparsers(metavar=f"{{{','.join(VERBS)}}}")
    run = verbs.add_parser("run", help="Run a package specific executable", description="Run an executable.")
    run.add_argument("--prefix", help="Command to put before the executable, quoted if it has spaces ('gdb --args')")
    run.add_argument("package_name", help="Name of the ROS package")
    run.add_argument("executable_name", help="Name of the executable")
    run.add_argument("argv", nargs=argparse.REMAINDER, help="Pass arbitrary arguments to the executable")
    run.set_defaults(work=run_executable)
    for name, those in GRAPH.items():
        verbs.add_parser(name, help=f"Various {name} related sub-commands: {those}", add_help=False)
    package = verbs.add_parser("pkg", help="Various package related sub-commands", description="Look at packages.")
    package.set_defaults(help=package.print_help)
    verbs = package.add_subparsers(metavar="{executables,list,prefix}")
    executables = verbs.add_parser("executables", help="Output a list of package specific executables")
    executables.add_argument("package_name", nargs="?", help="The package name")
    executables.add_argument("--full-path", action="store_true", help="Show full path of each executable")
    executables.set_defaults(work=list_executables)
    verbs.add_parser("list", help="Output a list of available packages").set_defaults(work=list_packages)
    prefix = verbs.add_parser("prefix", help="Output the prefix path of a package")
    prefix.add_argument("package_name", help="The package name")
    prefix.set_defaults(work=show_prefix)
    return parser


def run_executable(arguments: argparse.Namespace, packages: dict[str, Path], environ: dict[str, str]) -> None:
    """`ros2 run [--prefix COMMAND] PACKAGE EXECUTABLE ...`"""
    found = find_executables(packages, arguments.package_name)
    paths = [str(path) for path in found if path.name == arguments.executable_name]
    if not paths:
        raise NotThere("No executable found")
    if len(paths) > 1:
        raise NotThere("Multiple executables found:", *(f"- {path}" for path in paths))
    command = [*shlex.split(arguments.prefix or ""), *paths, *arguments.argv]
    try:
        # Our commands let signals in when they are loaded.
        become(command, environ, let_in=arguments.package_name != "fbql" or bool(arguments.prefix))
    except OSError as error:
        raise NotThere(f"{command[0]} does not start: {error.strerror}") from None


def become(command: list[str], environ: dict[str, str], *, let_in: bool = True) -> NoReturn:
    """Has a program take this process's place, which inherits that signals wait unless they are let in."""
    if let_in:
        let_signals_in()
    os.execvpe(command[0], command, environ)


def list_executables(arguments: argparse.Namespace, packages: dict[str, Path], environ: dict[str, str]) -> None:
    """`ros2 pkg executables [--full-path] [PACKAGE]`"""
    for package in sorted(packages) if arguments.package_name is None else [arguments.package_name]:
        for path in find_executables(packages, package):
            print(shown(path if arguments.full_path else f"{package} {path.name}"))


def list_packages(arguments: argparse.Namespace, packages: dict[str, Path], environ: dict[str, str]) -> None:
    """`ros2 pkg list`"""
    print("\n".join(map(shown, sorted(packages))))


def show_prefix(arguments: argparse.Namespace, packages: dict[str, Path], environ: dict[str, str]) -> None:
    """`ros2 pkg prefix PACKAGE`"""
    if arguments.package_name not in packages:
        raise NotThere("Package not found")
    print(shown(packages[arguments.package_name]))


def find_packages(prefixes: list[Path]) -> dict[str, Path]:
    """Every package of the index, with its prefix."""
    found: dict[str, Path] = {}
    for prefix in prefixes:
        for marker in matches(prefix / MARKERS, "[!.]*"):
            found.setdefault(marker.name, prefix)
    return found


def find_executables(packages: dict[str, Path], package: str) -> list[Path]:
    """The executable files of a package, sorted. Raises NotThere if there is no such package."""
    if package not in packages:
        raise NotThere(f"Package '{package}' not found")
    place = packages[package] / "lib" / package
    shown = (path for path in place.rglob("*") if "/." not in str(path.parent.relative_to(packages[package])))
    return sorted(path for path in shown if path.is_file() and os.access(path, os.X_OK))


def real_ros2(path: str) -> str | None:
    """The first `ros2` on the search path `path` that is not the one beside this package."""
    others = [str(entry) for entry in split_path(path) if entry.resolve() != SCRIPTS]
    return shutil.which("ros2", path=os.pathsep.join(others)) if others else None
