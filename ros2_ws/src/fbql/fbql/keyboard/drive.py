"""The loop in which a person drives: keys in, commands out, world states back, and a picture of it all."""

from __future__ import annotations

from time import monotonic

from fbql_behaviors.core.observation import Observation
from fbql_common.core.types import World

from fbql.cli.interrupts import Interrupts
from fbql.keyboard.driving import Driving
from fbql.keyboard.live import LiveSimulator
from fbql.keyboard.page import PICTURE_S, driving_side, page
from fbql.keyboard.safekeeping import Safekeeping
from fbql.keyboard.sitting import Sitting
from fbql.terminal.keys import DRIVING, Key
from fbql.terminal.screen import Terminal

LOOK_S = 1 / 60
"""Keys are taken in at least so often [s]."""
_SHORTEST_LOOK_S = 0.0005


class Drive:
    """One sitting at the terminal.

    Args:
        step_s: duration of a step of the world [s].
        realtime: speed relative to real time.
    """

    def __init__(
        self,
        behavior: str,
        observation: Observation,
        sitting: Sitting,
        safekeeping: Safekeeping,
        terminal: Terminal,
        interrupts: Interrupts,
        step_s: float,
        realtime: float,
    ) -> None:
        self._behavior = behavior
        self._observation = observation
        self._sitting = sitting
        self._safekeeping = safekeeping
        self._terminal = terminal
        self._interrupts = interrupts
        self._step_s = step_s
        self._period_s = step_s / realtime
        self._driving = Driving()
        self._world: World | None = None
        self._late: World | None = None
        self._asked = -1
        self._due_s = 0.0
        self._drawn_s = float("-inf")
        self._message = "bringing up the simulator"
        self._finished = False

    def deliver(self, world: World) -> None:
        """Takes in a world state."""
        if world.episode != self._sitting.episode:
            return
        if self._sitting.answered(world) is None:
            self._world = world
        else:
            self._late = world

    def run(self, live: LiveSimulator) -> str | None:
        """Drives until the person has finished, a signal came, or the terminal was closed. Gives what went wrong."""
        while not (self._finished or self._interrupts.came or self._terminal.gone):
            if problem := live.problem():
                return problem
            now_s = monotonic()
            if self._terminal.stopped():
                self._driving.stop()
            for key in self._terminal.pressed():
                self._take(key, now_s)
            if live.ready and self._asked != self._sitting.episode:
                self._begin(live)
            self._answer(live, now_s)
            if now_s - self._drawn_s >= PICTURE_S:
                self._draw(now_s)
            live.look(self._pause_s())
        return None

    def _pause_s(self) -> float:
        """How long to look for what comes: until the next step is due, if there is one to come."""
        if not self._sitting.begun or self._world is None or self._world.ended:
            return LOOK_S
        return min(max(self._due_s - monotonic(), _SHORTEST_LOOK_S), LOOK_S)

    def _begin(self, live: LiveSimulator) -> None:
        if self._asked < 0:
            self._message = ""
        self._asked = self._sitting.episode
        self._late = None
        live.begin(self._asked, self._sitting.seed)

    def _answer(self, live: LiveSimulator, now_s: float) -> None:
        """Sends the next command when it is due, and again the command of a world state that came again."""
        if self._late is not None:
            command = self._sitting.answered(self._late)
            self._late = None
            if command is not None:
                live.send(command)
        if self._world is None or now_s < self._due_s or not self._sitting.awaits(self._world):
            return
        live.send(self._sitting.drive(self._world, *self._driving.command(now_s)))
        # Time that was lost is not caught up with: the world would rush.
        self._due_s = max(self._due_s + self._period_s, now_s)

    def _take(self, key: Key, now_s: float) -> None:
        if key in DRIVING:
            if self._asked == self._sitting.episode:
                self._driving.press(key, now_s)
                self._sitting.begun = True
        elif key is Key.NEXT:
            self._next()
        elif key is Key.UNDO:
            self._undo()
        else:
            self._finished = True

    def _next(self) -> None:
        self._driving.stop()
        demonstration = self._sitting.next()
        if demonstration is None:
            self._message = "another start"
            return
        self._message = f"kept demonstration {len(self._sitting.kept)}: {len(demonstration.worlds)} steps"
        if self._sitting.patterns >= self._sitting.wanted:
            self._message += "; these are all the patterns a tree is made from"
        if trouble := self._safekeeping.keep(self._sitting.kept[-1]):
            self._message = trouble

    def _undo(self) -> None:
        self._driving.stop()
        dropped_kept = self._sitting.undo()
        if dropped_kept is None:
            self._message = "there is nothing to drop"
        elif dropped_kept:
            self._safekeeping.drop()
            self._message = f"dropped demonstration {len(self._sitting.kept) + 1}"
        else:
            self._message = "dropped; drive it again from the same start"

    def _draw(self, now_s: float) -> None:
        self._drawn_s = now_s
        ascii_only = self._terminal.ascii_only
        side = driving_side(
            self._behavior,
            self._observation,
            self._sitting,
            self._driving,
            self._world,
            now_s,
            self._step_s,
            ascii_only,
        )
        columns, rows = self._terminal.size
        self._terminal.show(page(self._world, side, self._message, columns, rows, ascii_only))
