"""`scripts/demonstrate.py BEHAVIOR --keyboard`: what is checked, brought up and written around the driving."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.recipes import recipe_of
from fbql_common.spin import refuse_security

from fbql.cli.interrupts import Interrupts
from fbql.cli.panel import Panel
from fbql.demonstrations.instruct import simulation_of, starts
from fbql.graph.domains import domain_from, free_domain
from fbql.keyboard.drive import Drive
from fbql.keyboard.live import LiveSimulator
from fbql.keyboard.safekeeping import Safekeeping
from fbql.keyboard.sitting import Kept, Sitting
from fbql.terminal.screen import Terminal


class Outcome(NamedTuple):
    """What a sitting came to."""

    kept: list[Kept]
    well: bool
    """Whether nothing went wrong; what did is said."""


def demonstrate_by_keyboard(
    behavior: str, seed: int, realtime: float, out: Path, ascii_only: bool, interrupts: Interrupts
) -> Outcome:
    """A person demonstrates; what was kept is in `out` when this returns.

    Raises BadInput before anybody has driven; nothing is left behind then.
    """
    observation, recipe, simulation = observation_of(behavior), recipe_of(behavior), simulation_of(behavior)
    refuse_security()
    given_domain = domain_from()
    terminal = Terminal(ascii_only)
    sitting = Sitting((start for start, _ in starts(behavior, seed)), recipe.every, recipe.patterns)
    safekeeping = Safekeeping(out, behavior, simulation, {"seed": seed, "realtime": realtime})
    drive = Drive(behavior, observation, sitting, safekeeping, terminal, interrupts, simulation.dt_s, realtime)
    panel = Panel()
    written, problem = False, None
    with ExitStack() as closing:
        domain = closing.enter_context(free_domain()) if given_domain is None else given_domain
        log_directory = Path(closing.enter_context(tempfile.TemporaryDirectory(prefix="fbql-demonstrate-")))
        os.environ["ROS_LOG_DIR"] = str(log_directory)
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        closing.enter_context(_stderr_to(log_directory / "instructor.log"))
        shared = given_domain is not None
        live = LiveSimulator(simulation, domain, shared, dict(os.environ), log_directory, drive.deliver)
        closing.enter_context(live)
        safekeeping.open()
        try:
            with terminal:
                problem = drive.run(live)
        finally:
            # However the driving ended, what was demonstrated is written, and first of all.
            sitting.keep()
            written = safekeeping.finish(sitting.kept, panel.say)
    if problem:
        panel.say(problem)
    if interrupts.came and sitting.kept and written:
        panel.say(f"ended by {interrupts.name}; what was demonstrated until then is written")
    return Outcome(sitting.kept, written and problem is None)


@contextmanager
def _stderr_to(file: Path) -> Generator[None]:
    """Sends what would be printed into the picture to a file, and prints it afterwards."""
    sys.stderr.flush()
    kept = os.dup(2)
    with file.open("wb") as stream:
        os.dup2(stream.fileno(), 2)
    try:
        yield
    finally:
        sys.stderr.flush()
        os.dup2(kept, 2)
        os.close(kept)
        if text := file.read_text(errors="replace"):
            Panel().say(text.rstrip())
