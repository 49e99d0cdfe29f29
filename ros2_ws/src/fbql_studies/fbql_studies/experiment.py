"""Run a study over many seeds, in parallel on all cores or on a cluster. It resumes where an earlier run was stopped."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

from fbql.cli.exit_codes import DONE, FAILED
from fbql.cli.interrupts import Interrupted, Interrupts
from fbql.cli.missing import what_is_missing
from fbql.cli.output import complain, print_result, say, warn
from fbql.cli.parser import Parser, add_json_option, output_path
from fbql.cli.places import RUNS
from fbql.statistics.tables import Table, as_markdown, as_text
from fbql_common.core.errors import BadInput
from fbql_common.core.text import as_lines
from fbql_common.files import write_atomically
from fbql_recording.run_directory import own_revision

from fbql_studies.runner.store import Store
from fbql_studies.runner.study import STUDIES, Result, Study, StudyTask, study_of
from fbql_studies.runner.workers import TaskEnd, run_locally, run_on_cluster, time_left_s

_RUNNER_OPTIONS = ("study", "jobs", "out", "scheduler", "json")


def run(options: Any, interrupts: Interrupts) -> int:
    """Runs the remaining tasks, and reports the whole study. Returns 0, or 1 if a task failed."""
    out = options.out or RUNS / f"study-{options.study}"
    return run_study(options.study, STUDIES[options.study], study_of(options.study), options, out, interrupts)


def run_study(name: str, module: str, study: Study, options: Any, out: Path, interrupts: Interrupts) -> int:
    """Runs the remaining tasks of a study, and reports the whole study. Returns 0, or 1 if a task failed.

    Args:
        module: the study's module, which workers can import.
        options: the study's own, and those of `add_runner_options`.
        out: directory of the results.
    """
    if options.jobs is not None and options.scheduler:
        complain("--jobs has no effect with --scheduler: the cluster's workers are used")
    if options.jobs is None:
        options.jobs = usable_cores()
    if options.jobs < 1:
        raise BadInput(f"--jobs is {options.jobs}; it must be 1 or more")
    tasks = study.tasks(options)
    out = out.absolute()
    own = {key: value for key, value in vars(options).items() if key not in _RUNNER_OPTIONS}
    with Store(out, {"study": name, "options": json.loads(json.dumps(own, default=str))}) as store:
        _run(module, options, store, tasks, interrupts)
        results = {task.key: result for task in tasks if (result := store.result_of(task.key)) is not None}
        if interrupts.came and len(results) < len(tasks):
            raise Interrupted("stopped; the same command resumes from here")
        failed = {task.key: store.failure_of(task.key) for task in tasks if task.key not in results}
        table = study.table(results)
        shown = study.words(table)
        summary = {
            "study": name,
            "table": table,
            "columns": {each: study.COLUMNS[each] for each in dict.fromkeys(column for row in table for column in row)},
            "out": str(out),
            "options": own,
            "git_revision": ", ".join(store.revisions()) or "unknown",
            "tasks": len(tasks),
            "done": len(results),
            "failed": failed,
        }
        text = json.dumps(summary, default=str, allow_nan=False)
        write_atomically(out / "table.json", f"{text}\n".encode())
        page = "\n\n".join(f"{title}\n\n{as_markdown(each)}" for title, each in shown.items())
        write_atomically(out / "tables.md", f"{page}\n".encode())
        files = _figures(study, results, out)
    print_result(text if options.json else _as_text(summary, shown, files))
    return FAILED if failed else DONE


def _figures(study: Study, results: Mapping[str, Result], out: Path) -> list[Path]:
    """Draws the figures; without Matplotlib one line says so, and the tables, which took long, are kept and printed."""
    try:
        return study.figures(results, out)
    except ModuleNotFoundError as error:
        missing = what_is_missing(error.name or "")
        if missing is None:
            raise
        warn([f"no figures: {missing}"])
        return []


def parser(program: str) -> Parser:
    """The command line."""
    result = Parser(prog=program, description=__doc__)
    studies = result.add_subparsers(dest="study", required=True, metavar="NAME", parser_class=Parser)
    for name in STUDIES:
        study = study_of(name)
        own = studies.add_parser(name, help=study.DESCRIPTION, description=study.DESCRIPTION)
        study.add_options(own)
        add_runner_options(own, f"runs/study-{name}", "fewer seeds or trees")
    return result


def add_runner_options(parser: Parser, out: str, fewer: str) -> None:
    """Adds the options of running a study.

    Args:
        out: where the results go by default.
        fewer: what an earlier run may have had fewer of, to be extended.
    """
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="workers on this machine (one for each core that it may use)"
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run on the Dask cluster of this scheduler instead (docs/studies.md describes how to start one; scheduler "
        "and workers need this project installed)",
    )
    parser.add_argument(
        "--out", type=output_path, metavar="DIR", help=f"directory of the results ({out}); one with {fewer} is extended"
    )
    add_json_option(parser)


def usable_cores() -> int:
    """Number of cores that this process may use, which `taskset` and container managers limit."""
    return len(os.sched_getaffinity(0))


def _run(module: str, options: Any, store: Store, tasks: Sequence[StudyTask], interrupts: Interrupts) -> None:
    waiting = [task for task in tasks if store.result_of(task.key) is None]
    done = len(tasks) - len(waiting)
    if done:
        say(f"{done} of {len(tasks)} tasks are already done")
    if not waiting:
        return
    revision = own_revision()
    if done and not store.revisions():
        store.add_revision("unknown")
    if done and store.revisions() != [revision]:
        say("note: they were done by another revision of the project; choose another --out to run all tasks again")
    begun_s = monotonic()
    took_s: list[float] = []
    for count, ended in enumerate(_task_ends(module, options, store, waiting, interrupts), start=1):
        if not ended.failure:
            store.add_revision(revision)
            took_s.append(ended.seconds)
        left_s = time_left_s(monotonic() - begun_s, took_s, len(waiting) - count, ended.workers)
        state = f"FAILED: {ended.failure}" if ended.failure else f"done, about {left_s:.0f} s left"
        say(f"[{done + count}/{len(tasks)}] {ended.key} {state}")


def _task_ends(
    module: str, options: Any, store: Store, tasks: Sequence[StudyTask], interrupts: Interrupts
) -> Iterator[TaskEnd]:
    def stopped() -> bool:
        return interrupts.came != 0

    if options.scheduler:
        return run_on_cluster(options.scheduler, module, tasks, store, stopped)
    return run_locally(module, tasks, store, options.jobs, stopped)


def _as_text(summary: Mapping[str, Any], shown: Mapping[str, Table], figures: Sequence[Path]) -> str:
    lines = [f"{title}\n\n{as_text(each)}\n" for title, each in shown.items() if each.body] or ["no results"]
    notes = [f"{summary['done']} of {summary['tasks']} tasks; results in {summary['out']}: tables.md and table.json"]
    notes += [f"FAILED {key}: {reason}" for key, reason in summary["failed"].items()]
    notes += [f"figure {file}" for file in figures if file.suffix == ".svg"]
    return "\n".join([*lines, as_lines(notes)])
