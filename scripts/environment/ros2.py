"""`scripts/ros2`: `run` and `pkg` where no real `ros2` is installed, with its arguments, output and exit codes.

The wheels bring no ros2cli. With a sourced system Jazzy this steps aside for the real one.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import sys
from pathlib import Path

from . import ament_index
from .enter import ROOT, environment_or_exit
from .target import split_path, target_for

VERBS = ("run", "pkg")
SCRIPTS = ROOT / "scripts"


def main(argv: list[str]) -> int:
    """Do what `ros2 ARGV` does. Returns an exit code, or does not return: the executable takes this process's place."""
    if target_for(ROOT, os.environ).underlay and real_ros2(os.environ.get("PATH", "")) is not None:
        _, environ = environment_or_exit()
        real = real_ros2(environ["PATH"])
        assert real is not None
        os.execve(real, [real, *argv], environ)
    if argv and not argv[0].startswith("-") and argv[0] not in VERBS:
        return fail(f"'ros2 {argv[0]}' needs a real ros2 (an installed ROS 2 Jazzy); here are: {', '.join(VERBS)}", 2)
    parser = make_parser()
    arguments = parser.parse_args(argv)
    if arguments.work is None:
        arguments.help()
        return 0
    _, environ = environment_or_exit()
    prefixes = split_path(environ["AMENT_PREFIX_PATH"])
    return arguments.work(arguments, ament_index.packages(prefixes), environ)


def make_parser() -> argparse.ArgumentParser:
    """The command line of ros2cli, as far as it goes here."""
    parser = argparse.ArgumentParser(
        prog="ros2", description="The part of ros2 that finds packages and starts their executables."
    )
    parser.set_defaults(work=None, help=parser.print_help)
    verbs = parser.add_subparsers(metavar="{run,pkg}")
    run = verbs.add_parser("run", help="Run a package specific executable", description="Run an executable.")
    run.add_argument("--prefix", help="Command to put before the executable, quoted if it has spaces ('gdb --args')")
    run.add_argument("package_name", help="Name of the ROS package")
    run.add_argument("executable_name", help="Name of the executable")
    run.add_argument("argv", nargs=argparse.REMAINDER, help="Pass arbitrary arguments to the executable")
    run.set_defaults(work=run_executable)
    package = verbs.add_parser("pkg", help="Various package related sub-commands", description="Look at packages.")
    package.set_defaults(work=None, help=package.print_help)
    package_verbs = package.add_subparsers(metavar="{executables,list,prefix}")
    executables = package_verbs.add_parser("executables", help="Output a list of package specific executables")
    executables.add_argument("package_name", nargs="?", help="The package name")
    executables.add_argument("--full-path", action="store_true", help="Show full path of each executable")
    executables.set_defaults(work=list_executables)
    package_verbs.add_parser("list", help="Output a list of available packages").set_defaults(work=list_packages)
    prefix = package_verbs.add_parser("prefix", help="Output the prefix path of a package")
    prefix.add_argument("package_name", help="The package name")
    prefix.set_defaults(work=show_prefix)
    return parser


def run_executable(arguments: argparse.Namespace, packages: dict[str, Path], environ: dict[str, str]) -> int:
    """`ros2 run [--prefix COMMAND] PACKAGE EXECUTABLE ...`"""
    package, name = arguments.package_name, arguments.executable_name
    if package not in packages:
        return fail(f"Package '{package}' not found")
    paths = [path for path in ament_index.executables(packages[package], package) if path.name == name]
    if not paths:
        return fail("No executable found")
    if len(paths) > 1:
        return fail("\n- ".join(["Multiple executables found:", *map(str, paths)]))
    command = [*shlex.split(arguments.prefix or ""), str(paths[0]), *arguments.argv]
    try:
        os.execvpe(command[0], command, environ)
    except OSError as error:
        return fail(f"{command[0]} does not start: {error.strerror}")


def list_executables(arguments: argparse.Namespace, packages: dict[str, Path], environ: dict[str, str]) -> int:
    """`ros2 pkg executables [--full-path] [PACKAGE]`"""
    chosen = packages if arguments.package_name is None else [arguments.package_name]
    for package in sorted(chosen):
        if package not in packages:
            return fail(f"Package '{package}' not found")
        for path in ament_index.executables(packages[package], package):
            sys.stdout.write(f"{path}\n" if arguments.full_path else f"{package} {path.name}\n")
    return 0


def list_packages(arguments: argparse.Namespace, packages: dict[str, Path], environ: dict[str, str]) -> int:
    """`ros2 pkg list`"""
    sys.stdout.write("".join(f"{package}\n" for package in sorted(packages)))
    return 0


def show_prefix(arguments: argparse.Namespace, packages: dict[str, Path], environ: dict[str, str]) -> int:
    """`ros2 pkg prefix PACKAGE`"""
    if arguments.package_name not in packages:
        return fail("Package not found")
    sys.stdout.write(f"{packages[arguments.package_name]}\n")
    return 0


def real_ros2(path: str) -> str | None:
    """The first `ros2` on the search path `path` that is not the one beside this package."""
    others = [str(entry) for entry in split_path(path) if entry.resolve() != SCRIPTS]
    return shutil.which("ros2", path=os.pathsep.join(others)) if others else None


def fail(line: str, code: int = 1) -> int:
    """Say what is wrong, and return the exit code for it."""
    sys.stderr.write(f"{line}\n")
    return code
