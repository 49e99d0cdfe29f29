"""A person demonstrates at the keyboard: sets up the graph, runs the loop (keys in, commands out, a picture), saves it all."""

from __future__ import annotations

import os
import tempfile
from contextlib import ExitStack
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from fbql_behaviors.core.observation import Observation, observation_of
from fbql_behaviors.core.recipes import recipe_of
from fbql_common.core.types import World
from fbql_common.middleware import prepare_middleware
from fbql_common.terminal.keys import DRIVING, Key
from fbql_common.terminal.screen import Screen

from fbql.cli.interrupts import Interrupts
from fbql.cli.output import complain, output_aside
from fbql.demonstrations.instruct import simulation_of, starts
from fbql.graph.domains import domain_from, free_domain
from fbql.keyboard.live import LiveSimulator
from fbql.keyboard.page import driving_side
from fbql.keyboard.sitting import Kept, Safekeeping, Sitting
from fbql.keyboard.steering import Steering
from fbql.watch.page import PICTURE_S, page

LOOK_S = 1 / 60
"""Longest time between two checks of the keys [s]."""
_SHORTEST_LOOK_S = 0.0005


class Drive:
    """The loop of one sitting.

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
        screen: Screen,
        interrupts: Interrupts,
        step_s: float,
        realtime: float,
    ) -> None:
        self._behavior = behavior
        self._observation = observation
        self._sitting = sitting
        self._safekeeping = safekeeping
        self._screen = screen
        self._interrupts = interrupts
        self._step_s = step_s
        self._period_s = step_s / realtime
        self._steering = Steering()
        self._world: World | None = None
        self._late: World | None = None
        self._asked = -1
        self._due_s = 0.0
        self._drawn_s = float("-inf")
        self._message = "bringing up the simulator"
        self._finished = False

    def deliver(self, world: World) -> None:
        """Receives a world state."""
        if world.episode != self._sitting.episode:
            return
        if self._sitting.answered(world) is None:
            self._world = world
        else:
            self._late = world

    def run(self, live: LiveSimulator) -> str | None:
        """Drives until the person has finished, a signal came, or the terminal was closed. Returns what went wrong, if anything."""
        while not (self._finished or self._interrupts.came or self._screen.gone):
            if problem := live.problem():
                return problem
            now_s = monotonic()
            if self._screen.stopped():
                self._steering.stop()
            for key in self._screen.pressed():
                self._take(key, now_s)
            if live.ready and self._asked != self._sitting.episode:
                self._begin(live)
            self._answer(live, now_s)
            if now_s - self._drawn_s >= PICTURE_S:
                self._draw(now_s)
            live.look(self._pause_s())
        return None

    def _pause_s(self) -> float:
        """How long to receive messages: until the next step is due, if there is one."""
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
        """Sends the next command when it is due, and repeats the command of a world state that came again."""
        if self._late is not None:
            command = self._sitting.answered(self._late)
            self._late = None
            if command is not None:
                live.send(command)
        if self._world is None or now_s < self._due_s or not self._sitting.awaits(self._world):
            return
        live.send(self._sitting.drive(self._world, *self._steering.command(now_s)))
        # Lost time is not made up for: the world would rush.
        self._due_s = max(self._due_s + self._period_s, now_s)

    def _take(self, key: Key, now_s: float) -> None:
        if key in DRIVING:
            if self._asked == self._sitting.episode:
                self._steering.press(key, now_s)
                self._sitting.begun = True
        elif key is Key.NEXT:
            self._next()
        elif key is Key.UNDO:
            self._undo()
        else:
            self._finished = True

    def _next(self) -> None:
        self._steering.stop()
        demonstration = self._sitting.next()
        if demonstration is None:
            self._message = "another start"
            return
        self._message = f"kept demonstration {len(self._sitting.kept)}: {len(demonstration.worlds)} steps"
        if self._sitting.patterns >= self._sitting.wanted:
            self._message += "; a tree needs no more patterns than these"
        if trouble := self._safekeeping.keep(self._sitting.kept[-1]):
            self._message = trouble

    def _undo(self) -> None:
        self._steering.stop()
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
        ascii_only = self._screen.ascii_only
        side = driving_side(
            self._behavior,
            self._observation,
            self._sitting,
            self._steering,
            self._world,
            now_s,
            self._step_s,
            ascii_only,
        )
        columns, rows = self._screen.size
        self._screen.show(page(self._world, side, self._message, columns, rows, ascii_only))


class SittingResult(NamedTuple):
    """The outcome of a sitting."""

    kept: list[Kept]
    well: bool
    """Whether nothing went wrong; errors are reported already."""


def demonstrate_by_keyboard(
    behavior: str, seed: int, realtime: float, out: Path, ascii_only: bool, interrupts: Interrupts
) -> SittingResult:
    """A person demonstrates; what was kept is in `out` when this returns.

    Raises BadInput before anybody has driven, and then leaves nothing behind.
    """
    observation, recipe, simulation = observation_of(behavior), recipe_of(behavior), simulation_of(behavior)
    prepare_middleware(complain)
    given_domain = domain_from()
    screen = Screen(ascii_only)
    sitting = Sitting((start for start, _ in starts(behavior, seed)), recipe.every, recipe.patterns)
    safekeeping = Safekeeping(out, behavior, simulation, {"seed": seed, "realtime": realtime})
    drive = Drive(behavior, observation, sitting, safekeeping, screen, interrupts, simulation.dt_s, realtime)
    written, problem = False, None
    with ExitStack() as closing:
        domain = closing.enter_context(free_domain()) if given_domain is None else given_domain
        log_directory = Path(closing.enter_context(tempfile.TemporaryDirectory(prefix="fbql-demonstrate-")))
        os.environ["ROS_LOG_DIR"] = str(log_directory)
        closing.enter_context(output_aside(log_directory / "instructor.log"))
        shared = given_domain is not None
        live = LiveSimulator(simulation, domain, shared, dict(os.environ), log_directory, drive.deliver, interrupts)
        closing.enter_context(live)
        safekeeping.open()
        try:
            with screen:
                problem = drive.run(live)
        finally:
            # However the driving ended: first of all, what was demonstrated is written.
            sitting.keep()
            written = safekeeping.finish(sitting.kept, complain)
    if problem:
        what, _, output = problem.partition("\n")
        complain(what, output)
    if interrupts.came and sitting.kept and written:
        complain(f"ended by {interrupts.name}; what was demonstrated until then is saved")
    return SittingResult(sitting.kept, written and problem is None)
