"""Recorded runs side by side."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.core.text import as_lines
from fbql_common.files import write_atomically
from fbql_recording.run import open_run

from fbql.cli.exit_codes import DONE, INCOMPLETE
from fbql.cli.interrupts import Interrupts
from fbql.cli.output import LiveLine, complain, json_text, print_result, warn, writing
from fbql.cli.parser import RUN_HELP, Parser, add_json_option, add_recording_options, output_path, without_effect
from fbql.cli.words import counted
from fbql.report.comparison import (
    IQM,
    MEASURES,
    Group,
    Pair,
    RunResult,
    groups_of,
    has_no_recording,
    name_of,
    pairs_of,
    result_of,
    result_without_recording,
)
from fbql.report.texts import plain
from fbql.statistics.tables import rows_as_text


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(
        prog=program,
        description="Compares runs, also those of train, which are not recorded. Runs with the same controller, trees, policy and parameters are grouped over "
        "their seeds, with 95 % confidence intervals; everything else that differs is listed.",
        epilog="Exit codes: 0 done; 1 failed; 2 bad input; 3 done, but a recording is incomplete.",
    )
    command.add_argument("runs", nargs="+", type=Path, metavar="RUN", help=RUN_HELP)
    command.add_argument("--figure", type=output_path, metavar="FILE", help="draw the comparison, as SVG")
    command.add_argument("--force", action="store_true", help="replace an existing figure")
    add_recording_options(command)
    add_json_option(command)
    return command


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Compares the runs. Returns 0, or 3 if a recording is incomplete."""
    paths = list(dict.fromkeys(path.absolute() for path in arguments.runs))
    if len(paths) < 2:
        raise BadInput("name at least two runs, each once")
    if arguments.figure is None:
        for note in without_effect(arguments, ["force"], "without --figure: nothing is written"):
            complain(note)
    if arguments.figure is not None:
        from fbql.report.comparison_figure import comparison_svg  # matplotlib takes a second, and is an extra

        if arguments.figure.exists() and not arguments.force:
            raise BadInput(f"{arguments.figure} exists; --force replaces it")
    results, warnings = _read(paths, arguments.skip_corrupt, interrupts)
    groups, notes = groups_of(results)
    if arguments.figure is not None:
        with writing(arguments.figure):
            write_atomically(arguments.figure, comparison_svg(groups))
    warn(warnings)
    show = _values if arguments.json else _words
    print_result(show(results, groups, pairs_of(groups), notes))
    return DONE if arguments.allow_incomplete or all(each.is_complete for each in results) else INCOMPLETE


def _read(paths: Sequence[Path], skip_corrupt: bool, interrupts: Interrupts) -> tuple[list[RunResult], list[str]]:
    """The result of each run, and warnings about them."""
    results: list[RunResult] = []
    warnings: list[str] = []
    with closing(LiveLine()) as line:
        for path in paths:
            interrupts.check("nothing was compared")
            line.show(f"reading {path.name}, {len(results) + 1} of {len(paths)}")
            if has_no_recording(path):
                result = result_without_recording(path)
            else:
                run = open_run(path, skip_corrupt=skip_corrupt)
                result = result_of(run)
                warnings += run.warnings
            results.append(replace(result, name=plain(name_of(path, paths))))
    return results, warnings


def _letters(groups: Sequence[Group]) -> dict[str, str]:
    return {run.name: group.letter for group in groups for run in group.runs}


def _values(results: Sequence[RunResult], groups: Sequence[Group], pairs: Sequence[Pair], notes: Sequence[str]) -> str:
    letters = _letters(groups)
    return json_text(
        {
            "runs": [{**each.row, "digest": each.digest, "kind": letters.get(each.name)} for each in results],
            "kinds": [{**each.row, "label": each.label, "setting": each.runs[0].setting} for each in groups],
            "pairs": [asdict(pair) for pair in pairs],
            "notes": list(notes),
        }
    )


def _words(results: Sequence[RunResult], groups: Sequence[Group], pairs: Sequence[Pair], notes: Sequence[str]) -> str:
    letters = _letters(groups)
    parts = [rows_as_text([{"group": letters.get(each.name, "-"), **each.row} for each in results])]
    parts.append(as_lines(f"{group.letter}: {group.label}" for group in groups))
    parts.append(rows_as_text([_short_row(group) for group in groups]))
    parts += [_pair_words(pair) for pair in pairs]
    return "\n\n".join([*parts, as_lines(notes)] if notes else parts)


def _short_row(group: Group) -> dict[str, Any]:
    """Each measure with its interval in one cell."""
    row: dict[str, Any] = {"group": group.letter, "runs": len(group.runs)}
    for measure in (*MEASURES, IQM):
        value, low, high = (group.row[f"{measure}{end}"] for end in ("", "_low", "_high"))
        interval = "" if low is None or high is None else f" ({low:.4g} to {high:.4g})"
        row[measure.replace("_", " ")] = None if value is None else f"{value:.4g}{interval}"
    return row


def _pair_words(pair: Pair) -> str:
    ratio = "n/a" if pair.cost_ratio is None else f"{pair.cost_ratio:.3g}"
    p = "n/a" if pair.p is None else f"{pair.p:.3g}"
    if pair.p_holm is not None and pair.p_holm != pair.p:
        p += f", {pair.p_holm:.3g} adjusted for all comparisons (Holm)"
    improves = "n/a" if pair.improves is None else f"{pair.improves:.2f}"
    if pair.improves_low is not None and pair.improves_high is not None:
        improves += f" ({pair.improves_low:.2f} to {pair.improves_high:.2f})"
    seeds = counted(pair.seeds, "shared seed")
    return (
        f"{pair.letter} against {pair.against}: ratio of steps per goal {ratio}, over {seeds}; p = {p}; "
        f"probability that a run costs less {improves}"
    )
