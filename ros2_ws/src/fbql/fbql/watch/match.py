"""The text beside and below the field while a match is watched."""

from __future__ import annotations

import textwrap

from fbql_common.core.types import DRIVER_BLEND, Decision, Phase
from fbql_common.terminal.screen import Line

from fbql.watch.moments import Moments
from fbql.watch.pace import Pace
from fbql.watch.page import SIDE_COLUMNS, STRONG, cut, named, page
from fbql.watch.words import why

SENTENCE_ROWS = 3
"""Lines for the sentence below the field."""
_NAME_COLUMNS = 15
_BAR_COLUMNS = SIDE_COLUMNS - _NAME_COLUMNS - 6
_MOST_BEHAVIORS = 6
_OWN_PACE = (("q", "stop watching"),)
_KEYS = (("space", "pause, continue"), ("s", "one step"), ("+ -", "faster, slower"), ("n", "next episode"), *_OWN_PACE)


def match_page(
    moments: Moments, pace: Pace | None, message: str, columns: int, rows: int, ascii_only: bool
) -> list[Line]:
    """The lines of a screen of `columns` x `rows` characters that shows a moment.

    Args:
        pace: the pace that the keys change; None where the match keeps its own time.
        message: the last line, behind how the last episode ended.
    """
    sentence = textwrap.wrap(why(moments), columns - 1, max_lines=SENTENCE_ROWS, placeholder=" ...")
    sentence += [""] * (SENTENCE_ROWS - len(sentence))
    below: list[Line] = [[(line, "")] for line in sentence]
    side = match_side(moments, pace, ascii_only)
    last = "; ".join(text for text in (moments.score.last, message) if text)
    return page(moments.world, side, last, columns, rows, ascii_only, below=below, trail=moments.trail)


def match_side(moments: Moments, pace: Pace | None, ascii_only: bool) -> list[Line]:
    """The lines beside the field: episode, score, weights, wheels, pace and keys."""
    decision, world, score, command = moments.decision, moments.world, moments.score, moments.command
    phase = "" if decision is None else Phase(decision.phase).name.lower() if decision.phase in list(Phase) else "?"
    seconds = moments.seconds
    when = (
        "..." if world is None else f"step {world.step}" if seconds is None else f"{seconds:.1f} s, step {world.step}"
    )
    wheels = "-" if command is None else f"{command.left_rad_s:+.1f}  {command.right_rad_s:+.1f} rad/s"
    return [
        cut([("" if decision is None else f"{decision.controller}, {phase}", STRONG)], SIDE_COLUMNS),
        named("" if world is None else f"episode {world.episode}", when),
        named("goals", str(score.goals)),
        named("own goals, timeouts", f"{score.own_goals}, {score.timeouts}"),
        [],
        *_weights(decision, ascii_only),
        named("wheels", wheels),
        [],
        [("the match keeps its own time" if pace is None else pace.words, STRONG)],
        *([(key.ljust(6), STRONG), (text, "")] for key, text in (_OWN_PACE if pace is None else _KEYS)),
    ]


def _weights(decision: Decision | None, ascii_only: bool) -> list[Line]:
    """A bar for each behavior; a mark before the one that drives alone."""
    if decision is None:
        return []
    guided = decision.phase == Phase.GUIDED
    learned = bool(decision.learned_weights) and not guided
    weights = decision.learned_weights if learned else decision.weights
    title = "learned weights" if learned else "weights"
    title += "" if decision.driver == DRIVER_BLEND else "; > drives alone"
    lines: list[Line] = [[(title, "")]]
    for index, (name, weight) in enumerate(zip(decision.behaviors, weights, strict=False)):
        if index == _MOST_BEHAVIORS:
            lines.append([("...", "")])
            break
        drives = index == decision.driver
        filled = round(min(max(weight, 0.0), 1.0) * _BAR_COLUMNS)
        bar = ("#" if ascii_only else "█") * filled
        text = f"{'>' if drives else ' '} {name}"[:_NAME_COLUMNS].ljust(_NAME_COLUMNS)
        lines.append([(f"{text} {bar.ljust(_BAR_COLUMNS)}{weight:5.2f}", STRONG if drives else "")])
    return [*lines, []]
