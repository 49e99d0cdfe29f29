"""Shows demonstrations in the terminal, at the speed they were driven or another."""

from __future__ import annotations

import select
from collections.abc import Sequence
from time import monotonic

from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.demonstration_storage import Recording
from fbql_common.terminal.keys import Key
from fbql_common.terminal.screen import Screen
from fbql_recording.core.decoding import NS

from fbql.cli.interrupts import Interrupts
from fbql.keyboard.page import PICTURE_S, page, replay_side


def show(recordings: Sequence[Recording], realtime: float, ascii_only: bool, interrupts: Interrupts) -> None:
    """Shows all demonstrations one after another, until the last one ends, the person quits, or a signal comes.

    Raises BadInput for a terminal that can't be drawn on, or an unknown behavior.
    """
    interrupts.install()
    parts = [(recording.behavior, part) for recording in recordings for part in recording.demonstrations]
    observation = observation_of(recordings[0].behavior)
    with Screen(ascii_only) as screen:
        number, begun_s = 0, monotonic()
        while 0 <= number < len(parts) and not (interrupts.came or screen.gone):
            behavior, part = parts[number]
            played_ns = part.worlds[0].stamp_ns + (monotonic() - begun_s) * realtime * NS
            at = max(index for index, world in enumerate(part.worlds) if world.stamp_ns <= played_ns)
            world, command = part.worlds[at], part.commands[at]
            side = replay_side(behavior, observation, number + 1, len(parts), world, command)
            columns, rows = screen.size
            screen.show(page(world, side, "", columns, rows, screen.ascii_only))
            screen.stopped()
            select.select([screen], [], [], PICTURE_S)
            step = 1 if at == len(part.worlds) - 1 else 0
            for key in screen.pressed():
                if key is Key.FINISH:
                    return
                step = {Key.NEXT: 1, Key.UNDO: -1}.get(key, step)
            if step:
                number, begun_s = max(number + step, 0), monotonic()
