"""Runs a study over seeds, side by side on all cores or on a cluster; goes on where an earlier run was stopped."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from shutil import get_terminal_size
from time import monotonic
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_fusion.atomic_file import write_atomically
from fbql_fusion.run_directory import git_revision
from studies.store import Store
from studies.study import STUDIES, Row, Task, study_of
from studies.workers import Ended, run_locally, run_on_cluster

from launcher.interrupts import Interrupts
from launcher.options import ROOT, RUNS, Parser

PROGRAM = "experiment.py"
_DONE, _FAILED, _BAD_INPUT = 0, 1, 2
_COMMON = ("study", "jobs", "out", "scheduler", "json")


def main(argv: Sequence[str]) -> int:
    """Runs the command. Gives the exit code."""
    options = _parser().parse_args(list(argv))
    interrupts = Interrupts()
    try:
        return _main(options, interrupts)
    except BadInput as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return _BAD_INPUT


def _main(options: Any, interrupts: Interrupts) -> int:
    if options.jobs < 1:
        raise BadInput(f"--jobs is {options.jobs}; it must be 1 or more")
    study = study_of(options.study)
    tasks = study.tasks(options)
    out = (options.out or RUNS / f"study-{options.study}").absolute()
    own = {name: value for name, value in vars(options).items() if name not in _COMMON}
    with Store(out, {"study": options.study, "options": json.loads(json.dumps(own, default=str))}) as store:
        _run(options, store, tasks, interrupts)
        results = {task.key: result for task in tasks if (result := store.result_of(task.key)) is not None}
        if interrupts.came and len(results) < len(tasks):
            print(f"{PROGRAM}: stopped; the same command goes on from here", file=sys.stderr)
            return _FAILED
        failed = {task.key: store.failure_of(task.key) for task in tasks if task.key not in results}
        summary = {
            "table": study.table(results),
            "out": str(out),
            "options": own,
            "git_revision": git_revision(ROOT),
            "tasks": len(tasks),
            "done": len(results),
            "failed": failed,
        }
        text = json.dumps(summary, default=str, allow_nan=False)
        write_atomically(out / "table.json", f"{text}\n".encode())
        files = study.figures(results, out)
    print(text if options.json else _worded(summary, files))
    return _FAILED if failed else _DONE


def _parser() -> Parser:
    parser = Parser(prog=PROGRAM, description=__doc__)
    studies = parser.add_subparsers(dest="study", required=True, metavar="NAME", parser_class=Parser)
    for name in STUDIES:
        study = study_of(name)
        own = studies.add_parser(name, help=study.DESCRIPTION, description=study.DESCRIPTION)
        study.add_options(own)
        own.add_argument(
            "--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="workers on this machine (all cores)"
        )
        own.add_argument(
            "--scheduler",
            metavar="ADDRESS",
            help="run on the Dask cluster of this scheduler instead, whose workers are started in this project's "
            "environment with scripts/ on PYTHONPATH",
        )
        own.add_argument("--out", type=Path, metavar="DIR", help=f"directory of the results (runs/study-{name})")
        own.add_argument("--json", action="store_true", help="print one JSON object on stdout and nothing else there")
    return parser


def _run(options: Any, store: Store, tasks: Sequence[Task], interrupts: Interrupts) -> None:
    """Runs what is not done yet."""
    waiting = [task for task in tasks if store.result_of(task.key) is None]
    done = len(tasks) - len(waiting)
    if done:
        print(f"{done} of {len(tasks)} tasks are done already", file=sys.stderr)
    begun_s = monotonic()
    for count, ended in enumerate(_ended(options, store, waiting, interrupts), start=1):
        left_s = (monotonic() - begun_s) / count * (len(waiting) - count)
        state = f"FAILED: {ended.failure}" if ended.failure else "done"
        print(
            f"[{done + count}/{len(tasks)}] {ended.key} {state}, about {left_s:.0f} s left", file=sys.stderr, flush=True
        )


def _ended(options: Any, store: Store, tasks: Sequence[Task], interrupts: Interrupts) -> Iterator[Ended]:
    def stopped() -> bool:
        return interrupts.came != 0

    module = STUDIES[options.study]
    if options.scheduler:
        return run_on_cluster(options.scheduler, module, tasks, store, stopped)
    return run_locally(module, tasks, store, options.jobs, stopped)


def _worded(summary: Mapping[str, Any], figures: Sequence[Path]) -> str:
    lines = [as_text(summary["table"]), f"{summary['done']} of {summary['tasks']} tasks; results in {summary['out']}"]
    lines += [f"FAILED {key}: {reason}" for key, reason in summary["failed"].items()]
    lines += [f"figure {file}" for file in figures]
    return "\n".join(lines)


def as_text(rows: Sequence[Row], width: int | None = None) -> str:
    """Rows as tables with aligned columns; rows of other columns begin a new table.

    Args:
        width: characters a line may have, that of the terminal where it is not given. A table that is wider goes on below
            with its other columns, the first one repeated.
    """
    if not rows:
        return "no results"
    width = width or get_terminal_size((160, 0)).columns
    return "\n\n".join(
        _table(columns, list(part), width) for columns, part in groupby(rows, key=lambda row: tuple(row))
    )


def _table(columns: Sequence[str], rows: Sequence[Row], width: int) -> str:
    cells = [columns, *([_cell(row[column]) for column in columns] for row in rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(columns))]
    parts: list[list[int]] = [[0]]
    for i in range(1, len(columns)):
        if len(parts[-1]) > 1 and sum(widths[j] + 2 for j in (*parts[-1], i)) - 2 > width:
            parts.append([0])
        parts[-1].append(i)
    return "\n\n".join("\n".join("  ".join(row[i].rjust(widths[i]) for i in part) for row in cells) for part in parts)


def _cell(value: object) -> str:
    if value is None:
        return "n/a"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
