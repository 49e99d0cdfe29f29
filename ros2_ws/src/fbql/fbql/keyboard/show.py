"""Shows demonstrations in the terminal, at the speed they were driven or another."""

from __future__ import annotations

import select
from collections.abc import Sequence
from time import monotonic

from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.demonstration_storage import Recording
from fbql_recording.core.decoding import NS

from fbql.cli.interrupts import Interrupts
from fbql.keyboard.page import PICTURE_S, page, replay_side
from fbql.terminal.keys import Key
from fbql.terminal.screen import Terminal


def show(recordings: Sequence[Recording], realtime: float, ascii_only: bool, interrupts: Interrupts) -> None:
    """Shows all demonstrations one after the other, until the last is over, the person has seen enough, or a signal came.

    Raises BadInput for a terminal that can't be drawn on, or a behavior that is not known.
    """
    interrupts.install()
    parts = [(recording.behavior, part) for recording in recordings for part in recording.demonstrations]
    observation = observation_of(recordings[0].behavior)
    with Terminal(ascii_only) as terminal:
        number, begun_s = 0, monotonic()
        while 0 <= number < len(parts) and not (interrupts.came or terminal.gone):
            behavior, part = parts[number]
            played_ns = part.worlds[0].stamp_ns + (monotonic() - begun_s) * realtime * NS
            at = max(index for index, world in enumerate(part.worlds) if world.stamp_ns <= played_ns)
            world, command = part.worlds[at], part.commands[at]
            side = replay_side(behavior, observation, number + 1, len(parts), world, command)
            columns, rows = terminal.size
            terminal.show(page(world, side, "", columns, rows, terminal.ascii_only))
            terminal.stopped()
            select.select([terminal], [], [], PICTURE_S)
            step = 1 if at == len(part.worlds) - 1 else 0
            for key in terminal.pressed():
                if key is Key.FINISH:
                    return
                step = {Key.NEXT: 1, Key.UNDO: -1}.get(key, step)
            if step:
                number, begun_s = max(number + step, 0), monotonic()
