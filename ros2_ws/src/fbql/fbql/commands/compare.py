"""Recorded runs side by side."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from fbql_common.atomic_file import write_atomically
from fbql_common.core.errors import BadInput
from fbql_recording import open_run

from fbql.cli.exit_codes import DONE, INCOMPLETE
from fbql.cli.interrupts import Interrupts
from fbql.cli.panel import print_result, warn
from fbql.cli.parser import Parser
from fbql.cli.progress_line import ProgressLine
from fbql.report.comparison import MEASURES, kinds_of, name_of, pairs_of, reached
from fbql.report.comparison_svg import picture
from fbql.report.texts import plain
from fbql.statistics.tables import rows_as_text


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(
        prog=program,
        description="Puts recorded runs side by side. Runs of the same controller, trees, policy and parameters are "
        "taken together over their seeds, with 95 % confidence intervals; everything else that differs is named.",
        epilog="Exit codes: 0 done; 1 failed; 2 bad input; 3 done, but a recording is incomplete.",
    )
    command.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="run directory, bag (MCAP), or .mcap file")
    command.add_argument("--figure", type=Path, metavar="FILE", help="draw it, as SVG")
    command.add_argument("--force", action="store_true", help="replace a figure that is there")
    command.add_argument("--allow-incomplete", action="store_true", help="exit with 0, not 3, where one is incomplete")
    command.add_argument("--skip-corrupt", action="store_true", help="leave damaged chunks out instead of ending there")
    command.add_argument("--json", action="store_true", help="print one JSON object on stdout and nothing else there")
    return command


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Compares the runs. Gives 0, or 3 where a recording is incomplete."""
    paths = list(dict.fromkeys(path.absolute() for path in arguments.runs))
    if len(paths) < 2:
        raise BadInput("name two runs or more")
    if arguments.figure is not None and arguments.figure.exists() and not arguments.force:
        raise BadInput(f"{arguments.figure} exists; --force replaces it")
    runs, warnings = _read(paths, arguments.skip_corrupt, interrupts)
    kinds, notes = kinds_of(runs)
    if arguments.figure is not None:
        _draw(kinds, arguments.figure)
    warn(warnings)
    pairs = pairs_of(kinds)
    print_result(
        json.dumps(_values(runs, kinds, pairs, notes)) if arguments.json else _words(runs, kinds, pairs, notes)
    )
    return DONE if arguments.allow_incomplete or all(run.is_complete for run in runs) else INCOMPLETE


def _read(paths: Sequence[Path], skip_corrupt: bool, interrupts: Interrupts) -> tuple[list[Any], list[str]]:
    """What each run reached, and warnings about them."""
    found: list[Any] = []
    warnings: list[str] = []
    with closing(ProgressLine()) as line:
        for path in paths:
            interrupts.check("nothing was compared")
            line.show(f"reading {path.name}, {len(found) + 1} of {len(paths)}")
            run = open_run(path, skip_corrupt=skip_corrupt)
            found.append(replace(reached(run), name=plain(name_of(path, paths))))
            warnings += run.warnings
    return found, warnings


def _draw(kinds: Sequence[Any], path: Path) -> None:
    try:
        write_atomically(path, picture(kinds).encode())
    except OSError as error:
        raise BadInput(f"{path}: can't be written ({error.strerror})") from None


def _values(runs: Sequence[Any], kinds: Sequence[Any], pairs: Sequence[Any], notes: Sequence[str]) -> dict[str, Any]:
    letters = {run.name: kind.letter for kind in kinds for run in kind.runs}
    return {
        "runs": [{**run.row, "digest": run.digest, "kind": letters.get(run.name)} for run in runs],
        "kinds": [{**kind.row, "label": kind.label, "setting": kind.runs[0].setting} for kind in kinds],
        "pairs": [asdict(pair) for pair in pairs],
        "notes": list(notes),
    }


def _words(runs: Sequence[Any], kinds: Sequence[Any], pairs: Sequence[Any], notes: Sequence[str]) -> str:
    letters = {run.name: kind.letter for kind in kinds for run in kind.runs}
    parts = [rows_as_text([{"kind": letters.get(run.name, "-"), **run.row} for run in runs])]
    parts.append("\n".join(f"{kind.letter}: {kind.label}" for kind in kinds))
    parts.append(rows_as_text([_short_row(kind) for kind in kinds]))
    parts += [_pair_words(pair) for pair in pairs]
    return "\n\n".join([*parts, "\n".join(notes)] if notes else parts)


def _short_row(kind: Any) -> dict[str, Any]:
    """Each measure with its interval in one cell."""
    row: dict[str, Any] = {"kind": kind.letter, "runs": len(kind.runs)}
    for measure in MEASURES:
        found = kind.row
        value, low, high = (found[f"{measure}{end}"] for end in ("", "_low", "_high"))
        interval = "" if low is None or high is None else f" ({low:.4g} to {high:.4g})"
        row[measure.replace("_", " ")] = None if value is None else f"{value:.4g}{interval}"
    return row


def _pair_words(pair: Any) -> str:
    ratio = "n/a" if pair.cost_ratio is None else f"{pair.cost_ratio:.3g} times"
    p = "n/a" if pair.p is None else f"{pair.p:.3g}"
    seeds = "1 seed" if pair.seeds == 1 else f"{pair.seeds} seeds"
    return f"{pair.letter} against {pair.against}: a goal costs {ratio} as many steps, over {seeds} that both have; p = {p}"
