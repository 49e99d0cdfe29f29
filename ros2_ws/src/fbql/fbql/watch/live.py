"""Watching a graph that plays: shows its latest moment and, in lockstep, sets the pace of the match.

In lockstep the simulator steps when a command arrives, so whoever holds commands back sets the pace: the simulator subscribes
to `watch/wheel_command` instead of `wheel_command`, and this passes on each command of fusion, byte for byte, when it is due.
Commands, their order and the worlds that follow are those of the unwatched match, since a lockstep match does not depend on
when messages arrive. In real time the simulator keeps its own clock: it is only watched, and nothing is held back.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from time import monotonic

from fbql_common.core.topic_names import DECISION, WHEEL_COMMAND, WORLD, behavior_topic
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_common.qos import STEP_QOS
from fbql_common.terminal.keys import Key
from fbql_common.wire import MESSAGES, Rejected, decode_command
from rclpy.publisher import Publisher

from fbql.cli.output import output_aside
from fbql.graph.launch import PACED_COMMAND
from fbql.graph.observer import Observer
from fbql.watch.pace import Pace
from fbql.watch.view import END_S, View

_LOOK_S = 1 / 60
"""Longest time between two checks of the keys [s]."""
_SHORTEST_LOOK_S = 0.0005


class LiveWatch:
    """A graph that plays, in a view.

    Args:
        sets_pace: whether the match waits for it (lockstep).
        takes_terminal: whether the view is on the terminal, so that nothing else must be printed there.
    """

    def __init__(self, view: View, sets_pace: bool, takes_terminal: bool) -> None:
        self._screen = view
        self._takes_terminal = takes_terminal
        self._pace = Pace(1.0, monotonic, catches_up=False)
        self._sets_pace = sets_pace
        self._screen.pace = self._pace if sets_pace else None
        self._publisher: Publisher | None = None
        self._place: tuple[int, int, int] = (-1, -1, -1)
        """Stamp, episode and step of the command that came last."""
        self._data = b""
        self._waits = False
        """Whether that command is held back."""
        self._after_end: dict[str, bytes] | None = None
        """Messages that arrive while the end of an episode is shown, by topic."""
        self.is_on = False
        """Whether it is shown."""
        self._left = False
        """Whether the person has stopped watching."""
        self._closing = ExitStack()

    @property
    def takes_terminal(self) -> bool:
        """Whether it is on the terminal, where nothing else can be shown."""
        return self.is_on and self._takes_terminal

    @property
    def holds(self) -> bool:
        """Whether the match waits for the person."""
        return self._waits

    def attach(self, observer: Observer, behaviors: Sequence[str]) -> None:
        """Subscribes to the match; in lockstep the match then waits for `look`."""
        self._screen.message = f"ROS_DOMAIN_ID={observer.domain_id}; Ctrl-C ends the match"
        if self._sets_pace:
            self._publisher = observer.node.create_publisher(MESSAGES[WheelCommand], PACED_COMMAND, STEP_QOS)
        topics = {WORLD: World, **{behavior_topic(name): BehaviorOutput for name in behaviors}}
        for topic, kind in {**topics, DECISION: Decision, WHEEL_COMMAND: WheelCommand}.items():
            observer.hear(MESSAGES[kind], topic, STEP_QOS, partial(self._hear, topic))

    @contextmanager
    def on_screen(self, log: Path) -> Generator[None]:
        """A context in which the match is shown, until the person stops watching.

        Args:
            log: receives what would otherwise be printed into the picture.
        """
        with self._closing:
            self._closing.enter_context(output_aside(log) if self._takes_terminal else nullcontext())
            self._closing.enter_context(self._screen)
            self.is_on = True
            try:
                yield
            finally:
                self.is_on = False

    def look(self, observer: Observer, duration_s: float) -> None:
        """Receives messages for this long, passes on commands that are due, draws, and takes keys."""
        end_s = monotonic() + duration_s
        while (left_s := end_s - monotonic()) > 0:
            for key in self._screen.keys() if self.is_on else ():
                self._take(key)
            self._pass_on()
            if self.is_on:
                self._screen.draw()
            observer.look(min(left_s, self._pause_s()))

    def _pause_s(self) -> float:
        if not self._waits or self._pace.is_paused:
            return _LOOK_S
        return min(max(self._pace.left_s(self._place[0]), _SHORTEST_LOOK_S), _LOOK_S)

    def _take(self, key: Key) -> None:
        if key is Key.FINISH:
            self.is_on, self._left = False, True
            self._closing.close()
        elif key is Key.NEXT and self._after_end is not None:
            self._begin_episode()
            self._pace.restart()
        elif self._sets_pace:
            self._pace.take(key)

    def _hear(self, topic: str, data: bytes) -> None:
        if topic == WHEEL_COMMAND and self._sets_pace:
            self._hold(data)
        if self._left:
            return
        if self._after_end is not None:
            self._after_end[topic] = data
            return
        self._screen.hear(topic, data)
        if self._sets_pace and topic == DECISION and self._screen.moments.has_ended and not self._pace.hurries:
            self._after_end = {}
            self._pace.linger(END_S)

    def _hold(self, data: bytes) -> None:
        """Takes a command: the first for a world state is the one that counts; it is sent again when it arrives again."""
        try:
            command = decode_command(data)
        except Rejected:
            return
        place = command.stamp_ns, command.episode, command.step
        if place != self._place:
            if place[1] != self._place[1]:
                self._pace.arrive()
            self._place, self._data, self._waits = place, data, True
            self._pass_on()
        elif not self._waits:
            self._send()

    def _pass_on(self) -> None:
        """Sends the command that waits, if it is due: at once when nobody watches any more."""
        if self._waits and (self._left or (self.is_on and self._screen.ready and self._pace.ask(self._place[0]))):
            self._waits = False
            self._send()
            world = self._screen.moments.world
            if world is not None and world.episode != self._place[1]:
                self._begin_episode()

    def _begin_episode(self) -> None:
        """Shows what arrived while the end of the last episode was shown."""
        kept, self._after_end = self._after_end, None
        for topic, data in (kept or {}).items():
            self._screen.hear(topic, data)

    def _send(self) -> None:
        if self._publisher is not None:
            self._publisher.publish(self._data)
