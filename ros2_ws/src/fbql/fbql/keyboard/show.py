"""Shows demonstrations in the terminal, at the speed they were driven or another."""

from __future__ import annotations

import select
from collections.abc import Sequence
from time import monotonic

from fbql_behaviors.core.observation import Observation, observation_of
from fbql_behaviors.core.patterns import Demonstration
from fbql_behaviors.demonstration_storage import Recording
from fbql_common.terminal.keys import WATCHING_KEYS, Key
from fbql_common.terminal.screen import Screen

from fbql.cli.interrupts import Interrupts
from fbql.keyboard.page import replay_side
from fbql.watch.pace import Pace
from fbql.watch.page import PICTURE_S, page
from fbql.watch.picture import TRAIL_EVERY, TRAIL_POINTS, Trail


def show(recordings: Sequence[Recording], realtime: float, ascii_only: bool, interrupts: Interrupts) -> None:
    """Shows all demonstrations one after another, until the last one ends, the person quits, or a signal comes.

    Raises BadInput for a terminal that can't be drawn on, or an unknown behavior.
    """
    interrupts.install()
    parts = [(recording.behavior, part) for recording in recordings for part in recording.demonstrations]
    observation = observation_of(recordings[0].behavior)
    with Screen(ascii_only, WATCHING_KEYS) as screen:
        shown = _Show(screen, observation, len(parts), realtime, interrupts)
        number = 0
        while 0 <= number < len(parts) and not shown.pace.quit:
            behavior, part = parts[number]
            number = max(number + shown.play(behavior, number, part), 0)


class _Show:
    """Demonstrations on a screen.

    Args:
        count: how many there are.
    """

    def __init__(
        self, screen: Screen, observation: Observation, count: int, realtime: float, interrupts: Interrupts
    ) -> None:
        self._screen = screen
        self._observation = observation
        self._count = count
        self._interrupts = interrupts
        self.pace = Pace(realtime, monotonic, self._keys, self._draw)
        self._number, self._behavior = 0, ""
        self._part: Demonstration | None = None
        self._at = 0
        self._goes = 0
        """To which demonstration a key leads: 1 the next one, -1 the one before, 0 none has been pressed."""
        self._drawn_s = float("-inf")

    def play(self, behavior: str, number: int, part: Demonstration) -> int:
        """Shows a demonstration. Returns how many to go on by."""
        self._behavior, self._number, self._part, self._at, self._goes = behavior, number, part, 0, 0
        self.pace.hurries = False
        self.pace.restart()
        for self._at, world in enumerate(part.worlds):
            if not self.pace.wait(world.stamp_ns) or self._goes:
                return self._goes
        return 1

    def _keys(self, patience_s: float) -> list[Key]:
        select.select([self._screen], [], [], min(patience_s, PICTURE_S))
        self._screen.stopped()
        keys = self._screen.pressed()
        for key in keys:
            self._goes = {Key.NEXT: 1, Key.UNDO: -1}.get(key, self._goes)
        ended = self._interrupts.came or self._screen.gone
        leaves = [Key.NEXT] if self._goes else []  # what is left of this demonstration is due at once
        return [Key.FINISH] if ended else [*keys, *leaves]

    def _draw(self) -> None:
        now_s = monotonic()
        if self._part is None or now_s - self._drawn_s < PICTURE_S:
            return
        self._drawn_s = now_s
        world, command = self._part.worlds[self._at], self._part.commands[self._at]
        side = replay_side(
            self._behavior, self._observation, self._number + 1, self._count, world, command, self.pace.words
        )
        past = self._part.worlds[max(0, self._at - TRAIL_EVERY * TRAIL_POINTS) : self._at : TRAIL_EVERY]
        robot, ball = (
            [(each.robot_x_m, each.robot_y_m) for each in past],
            [(each.ball_x_m, each.ball_y_m) for each in past],
        )
        columns, rows = self._screen.size
        lines = page(world, side, "", columns, rows, self._screen.ascii_only, trail=Trail(robot, ball))
        self._screen.show(lines)
