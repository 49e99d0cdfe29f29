"""Shows demonstrations on a page in a browser, at the speed they were driven or another."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

from fbql_behaviors.demonstration_storage import Recording
from fbql_common.terminal.keys import Key
from fbql_recording.core.columns import Recorded
from fbql_recording.core.steps import Step

from fbql.cli.interrupts import Interrupts
from fbql.cli.output import say
from fbql.cli.words import counted
from fbql.watch.pace import Pace


def show_in_browser(title: str, recordings: Sequence[Recording], realtime: float, interrupts: Interrupts) -> None:
    """Shows all demonstrations one after another, until the last one ends or a signal comes.

    Args:
        title: what is shown; the page's title.

    Raises BadInput where nothing can be served.
    """
    from fbql.watch.browser import BrowserPage

    interrupts.install()
    parts = [part for recording in recordings for part in recording.demonstrations]
    behavior = recordings[0].behavior
    recorded = Recorded(world=True, behaviors=(), outputs=False, command=True, decision=False)
    headline = counted(len(parts), "demonstration")
    with BrowserPage(recorded, (), title, headline, say, shown=behavior) as page:

        def keys(patience_s: float) -> list[Key]:
            return [Key.FINISH] if interrupts.came else page.keys(patience_s)

        pace = page.pace = Pace(realtime, monotonic, keys, page.draw)
        while not (page.ready or pace.quit):
            pace.idle()
        for number, part in enumerate(parts):
            pace.arrive()
            pace.restart()
            for world, command in zip(part.worlds, part.commands, strict=True):
                if not pace.wait(world.stamp_ns):
                    return
                # Demonstrations that were merged may have the same number.
                page.take(Step(world.stamp_ns, number, world.step, world, (), command, None))
