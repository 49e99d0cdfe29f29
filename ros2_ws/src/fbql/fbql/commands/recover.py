"""Recovers the undamaged part of a recording as a new run directory, and reports what is lost."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from time import monotonic
from typing import Any

from fbql_common.core.text import as_lines
from fbql_common.files import remedy
from fbql_recording.recovery.parts import Gap
from fbql_recording.recovery.recover import Recovery, recover

from fbql.cli.exit_codes import DONE, FAILED, INCOMPLETE
from fbql.cli.interrupts import Interrupts
from fbql.cli.output import LiveLine, json_text, print_result
from fbql.cli.parser import Parser, output_path


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(
        prog=program,
        description="Repairs a recording that was cut off or damaged: writes everything undamaged to a new run "
        "directory, which any bag reader can read to its end, and reports what is lost. No message whose CRC does not "
        "match is kept. The recording itself is never changed.",
        epilog="Exit codes: 0 nothing is lost; 1 failed; 2 bad input, or nothing to recover; 3 something is lost: the new "
        "recording is marked as incomplete.",
    )
    command.add_argument(
        "run", type=Path, metavar="RUN", help="run directory, ROS 2 bag (MCAP), .mcap or .mcap.active file"
    )
    command.add_argument(
        "--out", type=output_path, metavar="DIR", help="the new run directory (beside it, RUN_recovered)"
    )
    command.add_argument("--json", action="store_true", help="print one JSON object, and nothing else, on stdout")
    command.add_argument(
        "--allow-incomplete", action="store_true", help="exit with 0 instead of 3 if something is lost"
    )
    return command


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Recovers the recording. Returns 0, 1 if it could not be written, or 3 if something is lost."""
    begun_s = monotonic()
    with closing(LiveLine()) as line:

        def progress(words: str) -> None:
            interrupts.check()
            line.show(words)

        try:
            found = recover(arguments.run, arguments.out, progress)
        except OSError as error:
            line.complain(
                f"{error.filename}: cannot be written ({error.strerror}); nothing was written; {remedy(error)}"
            )
            return FAILED
    print_result(json_text(_values(found, monotonic() - begun_s)) if arguments.json else _words(found))
    return DONE if found.is_complete or arguments.allow_incomplete else INCOMPLETE


def _values(found: Recovery, seconds: float) -> dict[str, Any]:
    return {
        "messages": found.messages,
        "steps": found.steps,
        "chunks_lost": found.chunks_lost,
        "path": str(found.path),
        "complete": found.is_complete,
        "messages_lost": sum(found.messages_lost.values()),
        "messages_lost_by_topic": found.messages_lost,
        "messages_lost_exact": found.is_exact,
        "steps_lost": max(found.messages_lost.values(), default=0),
        "attachments_lost": found.attachments_lost,
        "cut_off": bool(found.cut_off),
        "lost_before": found.lost_before,
        "lost": [
            {
                "file": name,
                "begin": gap.begin,
                "end": gap.end,
                "why": gap.why,
                "chunks": gap.chunks,
                "start_ns": gap.start_ns,
                "end_ns": gap.end_ns,
                "messages": sum(gap.messages.values()),
            }
            for name, gap in found.gaps
        ],
        "notes": found.notes,
        "seconds": round(seconds, 3),
    }


def _words(found: Recovery) -> str:
    lines = [f"recovered {found.messages} messages, {found.steps} steps"]
    lines += [f"damaged, but without loss: {note}" for note in found.notes]
    lines += [f"lost: {name}: {_gap(gap)}" for name, gap in found.gaps]
    lines += [f"lost: {name}: the file was cut off; anything after the last flush is missing" for name in found.cut_off]
    lines += [f"lost before: {what}" for what in found.lost_before]
    if found.messages_lost:
        topics = ", ".join(f"{count} of {topic}" for topic, count in found.messages_lost.items())
        how = "" if found.is_exact else ", at least"
        lines.append(f"lost in total{how}: {sum(found.messages_lost.values())} messages ({topics})")
    elif not found.is_exact and found.gaps:
        lines.append("how many messages are lost is unknown")
    if found.is_complete:
        lines.append("nothing is lost")
    return as_lines([*lines, f"recording  {found.path}"])


def _gap(gap: Gap) -> str:
    words = [gap.why]
    if gap.start_ns is not None and gap.end_ns is not None:
        words.append(f"{gap.start_ns / 1e9:.3f} s to {gap.end_ns / 1e9:.3f} s")
    if gap.messages:
        words.append(f"{sum(gap.messages.values())} messages")
    return ", ".join(words)
