"""`scripts/recover.py`: what is sound in a damaged recording as a new run directory, and what of it is lost.

Exit codes: 0 nothing is lost, 1 failed, 2 bad input or nothing to recover, 3 the new recording is incomplete.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from launcher.interrupts import Interrupted, Interrupts

if TYPE_CHECKING:
    from fbql_analysis.salvage import Loss

    from launcher.recovery import Recovery

PROGRAM = "recover.py"
DONE, FAILED, BAD_INPUT, INCOMPLETE = 0, 1, 2, 3


def main(argv: Sequence[str]) -> int:
    """Runs the command. Gives the exit code."""
    # Before all else: importing takes a second, in which a signal would end in a traceback.
    interrupts = Interrupts()
    from fbql_common.core.errors import BadInput

    from launcher.panel import print_result
    from launcher.progress_line import ProgressLine
    from launcher.recovery import recover

    arguments = parser().parse_args(list(argv))
    begun_s = monotonic()
    try:
        with closing(ProgressLine()) as line:

            def progress(words: str) -> None:
                interrupts.check()
                line.show(words)

            found = recover(arguments.run, arguments.out, progress)
    except BadInput as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return BAD_INPUT
    except OSError as error:
        print(f"{PROGRAM}: {error.filename or arguments.run}: {error.strerror}; nothing was written", file=sys.stderr)
        return FAILED
    except Interrupted:
        print(f"{PROGRAM}: ended by {interrupts.name}; nothing was written", file=sys.stderr)
        return FAILED
    print_result(json.dumps(_values(found, monotonic() - begun_s)) if arguments.json else _words(found))
    return DONE if found.is_complete or arguments.allow_incomplete else INCOMPLETE


def parser() -> argparse.ArgumentParser:
    """The command line."""
    from launcher.options import Parser

    command = Parser(
        prog=PROGRAM,
        description="Repairs a recording that was cut off or damaged: writes everything that is sound to a new run "
        "directory, which every reader of bags reads to its end, and says what is lost. No message whose CRC does not "
        "match is kept. The recording itself is never changed.",
        epilog="Exit codes: 0 nothing is lost; 1 failed; 2 bad input, or nothing to recover; 3 something is lost: the new "
        "recording is incomplete, and says so to whoever reads it.",
    )
    command.add_argument(
        "run", type=Path, metavar="RUN", help="run directory, bag of ROS 2 (MCAP), .mcap or .mcap.active file"
    )
    command.add_argument("--out", type=Path, metavar="DIR", help="the new run directory (beside it, RUN_recovered)")
    command.add_argument("--json", action="store_true", help="print one JSON object on stdout and nothing else there")
    command.add_argument("--allow-incomplete", action="store_true", help="exit with 0, not 3, where something is lost")
    return command


def _values(found: Recovery, seconds: float) -> dict[str, Any]:
    return {
        "messages": found.messages,
        "steps": found.steps,
        "chunks_lost": found.chunks_lost,
        "path": str(found.path),
        "complete": found.is_complete,
        "messages_lost": sum(found.messages_lost.values()),
        "messages_lost_by_topic": found.messages_lost,
        "steps_lost": max(found.messages_lost.values(), default=0),
        "attachments_lost": found.attachments_lost,
        "cut_off": bool(found.cut_off),
        "lost_before": found.lost_before,
        "lost": [
            {
                "file": name,
                "begin": loss.begin,
                "end": loss.end,
                "why": loss.why,
                "chunks": loss.chunks,
                "start_ns": loss.start_ns,
                "end_ns": loss.end_ns,
                "messages": sum(loss.messages.values()),
            }
            for name, loss in found.losses
        ],
        "notes": found.notes,
        "seconds": round(seconds, 3),
    }


def _words(found: Recovery) -> str:
    lines = [f"recovered {found.messages} messages, {found.steps} steps"]
    lines += [f"damaged, but nothing is lost by it: {note}" for note in found.notes]
    lines += [f"lost: {name}: {_loss(loss)}" for name, loss in found.losses]
    lines += [
        f"lost: {name}: the file has no end; what came after the last flush is not in it" for name in found.cut_off
    ]
    lines += [f"lost before: {what}" for what in found.lost_before]
    if found.messages_lost:
        topics = ", ".join(f"{count} of {topic}" for topic, count in found.messages_lost.items())
        lines.append(f"lost in all, at least: {sum(found.messages_lost.values())} messages ({topics})")
    if found.is_complete:
        lines.append("nothing is lost")
    return "\n".join([*lines, f"recording  {found.path}"])


def _loss(loss: Loss) -> str:
    words = [loss.why]
    if loss.start_ns is not None and loss.end_ns is not None:
        words.append(f"{loss.start_ns / 1e9:.3f} s to {loss.end_ns / 1e9:.3f} s")
    if loss.messages:
        words.append(f"{sum(loss.messages.values())} messages")
    return ", ".join(words)
