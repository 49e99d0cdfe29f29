"""A recorded run as one page that explains it."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.core.text import as_lines
from fbql_common.files import atomic_text, output_directory
from fbql_recording.run import Run, open_run
from fbql_recording.tables import FORMATS, write_episodes, write_steps

from fbql.cli.exit_codes import DONE, INCOMPLETE
from fbql.cli.interrupts import Interrupts
from fbql.cli.output import LiveLine, json_text, print_result, warn, writing
from fbql.cli.parser import RUN_HELP, Parser, add_json_option, add_recording_options, output_path
from fbql.report.mux import write_mux_page
from fbql.report.page import write_page
from fbql.report.texts import plain

PAGE = "report.html"
"""Name of the page in a run directory."""


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(
        prog=program,
        description="Writes the report of a recorded run: one HTML page that needs no network, with the field, every "
        "behavior's leaf in words, weights, Q, rewards, timelines, parameters and hashes; of a mux with its episodes and who drove.",
        epilog="Exit codes: 0 done; 1 failed; 2 bad input; 3 done, but the recording is incomplete.",
    )
    command.add_argument("run", type=Path, metavar="RUN", help=RUN_HELP)
    command.add_argument("--out", type=output_path, metavar="FILE", help=f"the page (RUN/{PAGE}; beside an .mcap file)")
    command.add_argument(
        "--figures",
        action="store_true",
        help="also write figures (PDF and SVG: steps, collisions, failures, success rate), and episodes and steps as CSV "
        "and Parquet, into a directory beside the page",
    )
    command.add_argument("--force", action="store_true", help="replace an existing page and figures")
    add_recording_options(command)
    add_json_option(command)
    return command


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Writes the page. Returns 0, or 3 if the recording is incomplete."""
    run = open_run(arguments.run, skip_corrupt=arguments.skip_corrupt)
    if run.is_of_mux and arguments.figures:
        raise BadInput(f"{run.path}: a run of a mux has no figures; leave out --figures")
    out = arguments.out or default_page(run.path)
    figures = out.with_name(f"{out.stem}-figures") if arguments.figures else None
    for path in (out, figures):
        if path is not None and path.exists() and not arguments.force:
            raise BadInput(f"{path} exists; --force replaces it, --out FILE writes elsewhere")
    result = _write(run, out, figures, interrupts)
    warn(run.warnings)
    print_result(json_text(result) if arguments.json else _words(result))
    return DONE if arguments.allow_incomplete or run.is_complete else INCOMPLETE


def default_page(run: Path) -> Path:
    """Where the page of a run goes: into its directory, or beside a file."""
    return run / PAGE if run.is_dir() else run.with_name(f"{run.name.split('.mcap')[0]}-{PAGE}")


def _write(run: Run, out: Path, figures: Path | None, interrupts: Interrupts) -> dict[str, Any]:
    """Writes the page completely or not at all."""
    total = max(run.counts.values(), default=0)

    def progress(steps: int) -> None:
        interrupts.check()
        line.show(f"{what}: {steps} of {total} steps")

    what = "page"
    files: list[Path] = []
    with closing(LiveLine()) as line, writing(out), atomic_text(out) as file:
        if run.is_of_mux:
            driven = write_mux_page(run, file, progress)
            steps, episodes = sum(each.steps for each in driven), len(driven)
        else:
            contents = write_page(run, file, progress)
            steps, episodes = contents.steps, len(contents.episodes)
            if figures is not None:
                what = "tables"
                with writing(figures), output_directory(figures, is_ours=True):
                    files = _figures(run, contents.episodes, figures, progress)
    return {
        "path": str(out),
        "bytes": out.stat().st_size,
        "steps": steps,
        "episodes": episodes,
        "complete": run.is_complete,
        "files": [str(file) for file in files],
    }


def _figures(run: Run, episodes: Any, directory: Path, progress: Callable[[int], None]) -> list[Path]:
    """Writes the figures and tables of a run. Returns the files."""
    from fbql.report.figures import write_figures  # matplotlib takes a second, and is an extra

    controller = run.parameters.get("fusion", {}).get("controller", "")
    files = write_figures(episodes, plain(f"{run.path.name} {controller}"), directory)
    tables = {name: [directory / f"{name}{ending}" for ending in FORMATS] for name in ("episodes", "steps")}
    write_episodes(run, *tables["episodes"], episodes=episodes)
    write_steps(run, *tables["steps"], progress=progress)
    return [*files, *tables["episodes"], *tables["steps"]]


def _words(found: dict[str, Any]) -> str:
    size = f"{found['bytes'] / 1e6:.1f} MB"
    page = f"report {found['path']} ({size}; {found['steps']} steps, {found['episodes']} episodes)"
    return as_lines([page, *(f"file {file}" for file in found["files"])])
