"""A study for the tests of the runner: quick tasks that draw a number, fail, kill their worker, wait, or stand in their result's way.

Each attempt of a task leaves a line in the file `attempts` of the directory that it is given.
"""

from __future__ import annotations

import argparse
import os
import signal
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
from fbql.statistics.tables import Row, Table
from fbql_common.core.errors import BadInput
from fbql_common.files import write_atomically
from fbql_studies.runner.study import Result, StudyTask

DESCRIPTION = "a study for tests"
CAPTIONS = {"figure": "a figure"}
COLUMNS = {"mean": "the mean of what was drawn", "n": "of how many tasks"}
WAIT_S = 60.0


def add_options(parser: argparse.ArgumentParser) -> None:
    """How many tasks draw a number, and what other tasks do."""
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--others", nargs="*", default=[])
    parser.add_argument("--place", default="")


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """The tasks that draw, then the others."""
    if options.seeds < 0:
        raise BadInput(f"--seeds is {options.seeds}")
    names = [*(f"draw{seed}" for seed in range(options.seeds)), *options.others]
    return [StudyTask(name, {"name": name, "place": options.place}) for name in names]


def run(parameters: dict[str, Any]) -> Result:
    """Does what the task's name says."""
    name, place = parameters["name"], Path(parameters["place"])
    with (place / "attempts").open("a") as file:
        file.write(f"{name}\n")
    if name == "raise":
        raise ValueError("this task\nalways fails")
    if name == "unwritable":
        (place / "out/tasks/unwritable.json").mkdir(exist_ok=True)
    if name == "infinite":
        return {"value": float("inf")}
    if name == "kill" or (name == "kill_once" and attempts(place).count(name) == 1):
        os.kill(os.getpid(), signal.SIGKILL)
    if name == "wait":
        (place / "waits").write_text(str(os.getpid()))
        wait_for(place / "gate")
    seed = int(name.removeprefix("draw")) if name.startswith("draw") else 0
    return {"value": np.random.default_rng(seed).random(), "measured": {"process": os.getpid()}}


def table(results: Mapping[str, Result]) -> list[Row]:
    """One row: the mean, and of how many tasks."""
    values = [result["value"] for result in results.values()]
    return [{"mean": sum(values) / len(values) if values else None, "n": len(values)}]


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """The row in words."""
    return {"what was drawn": Table(["tasks", "mean"], [[str(row["n"]), f"{row['mean']}"] for row in rows])}


def figures(_results: Mapping[str, Result], directory: Path) -> list[Path]:
    """A file, as if it were drawn."""
    path = directory / "figure.svg"
    write_atomically(path, b"<svg/>")
    return [path]


def attempts(place: Path) -> list[str]:
    """The attempts so far, by the tasks' names."""
    return (place / "attempts").read_text().split()


def wait_for(path: Path) -> None:
    """Waits until a file is there, a minute at most."""
    end_s = monotonic() + WAIT_S
    while not path.exists():
        if monotonic() > end_s:
            raise TimeoutError(f"{path} did not come within {WAIT_S:.0f} s")
        sleep(0.02)
