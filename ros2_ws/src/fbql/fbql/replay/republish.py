"""`replay RUN`: publishes every recorded message on ROS again, byte for byte, with /clock.

It uses its own domain, so that a live graph is not disturbed. Each topic has the quality of service that it was
recorded with. A reliable topic waits now and then until its subscribers have acknowledged what was published, so that a
fast replay does not outrun its subscribers.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import rclpy
from fbql_behaviors.core.tree import Tree
from fbql_common.core.errors import BadInput
from fbql_common.core.topic_names import CLOCK
from fbql_common.middleware import prepare_middleware
from fbql_common.terminal.keys import WATCHING_KEYS, Key, KeyDecoder
from fbql_common.terminal.screen import RawTerminal
from fbql_recording.mcap.reader import Message, Topic
from fbql_recording.run import Run
from rclpy._rclpy_pybind11 import RCLError
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.validate_full_topic_name import validate_full_topic_name
from rosgraph_msgs.msg import Clock

from fbql.cli.interrupts import Interrupts
from fbql.cli.output import LiveLine, complain, json_text, output_aside, print_result, say, warn
from fbql.graph.domains import MAX_DOMAIN_ID, free_domain
from fbql.graph.observer import DISCOVERY_S
from fbql.replay.recomputation import recorded_trees
from fbql.replay.topics import ReplayViews, class_of, qos_of
from fbql.watch.pace import Pace
from fbql.watch.page import PICTURE_S
from fbql.watch.view import END_S, View

NODE = "replay"
NS = 1_000_000_000
_LAST_NS = 2**31 * NS - 1
"""Latest time of a ROS message, whose seconds have 32 bits [ns]."""
_LOOK_S = 0.02
_PATIENCE_S = 4.0
"""How long a subscriber may take to acknowledge before the replay continues without it [s]."""
_ASK_AGAIN = Duration(seconds=0.02)
_DEPTH = 20
"""Messages of a topic that may wait to be acknowledged. 10 are a fourth slower, bursts of 80 overflow a subscriber."""


def republish_run(run: Run, arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Replays a run. Returns 0. Raises BadInput."""
    window = _Window(run, arguments)
    topics = _topics(run, arguments.topics)
    prepare_middleware(complain)
    domain = arguments.domain
    if domain is not None and not 0 <= domain <= MAX_DOMAIN_ID:
        raise BadInput(f"--domain {domain}: a domain is a number from 0 to {MAX_DOMAIN_ID}")
    with (
        nullcontext(domain) if domain is not None else free_domain() as domain_id,
        closing(Stage(run, topics, domain_id, not arguments.no_clock, views=arguments.topics is None)) as stage,
        closing(LiveLine()) as line,
    ):
        if domain is not None:
            stage.refuse_twins(interrupts)
        say(f"replaying {run.path} in ROS_DOMAIN_ID={domain_id}: {len(topics)} topics, {window.words}")
        with _keyboard(arguments.watch is None) as keys:
            if keys is not None and keys.taken:
                say("space: pause, continue; s: one step; + -: faster, slower; q: quit")
            stage.wait_for_subscribers(arguments.wait, interrupts, may_have_twins=domain is not None)
            with nullcontext() if arguments.watch is None else _view(run, arguments.watch, domain_id) as screen:
                replay = _Replay(run, arguments, window, stage, line, keys, screen, interrupts)
                replay.play()
        replayed = replay.report()
        if arguments.json:
            found = {"domain": domain_id, "topics": stage.names, "left_out": stage.left_out, **replayed}
            print_result(json_text({**found, "complete": run.is_complete}))
    return 0


@contextmanager
def _keyboard(wanted: bool) -> Generator[RawTerminal | None]:
    """The keyboard, if there is one."""
    try:
        terminal = RawTerminal() if wanted else None
    except OSError:
        terminal = None
    if terminal is None:
        yield None
        return
    with terminal:
        terminal.take()
        yield terminal


@contextmanager
def _view(run: Run, way: str, domain_id: int) -> Generator[View]:
    """The view that shows the match; on a terminal, whatever is printed meanwhile appears afterwards."""
    name = run.path.resolve().name
    if way == "terminal":
        from fbql.watch.terminal import MatchScreen

        with (
            tempfile.NamedTemporaryFile(prefix="fbql-replay-") as log,
            output_aside(Path(log.name)),
            MatchScreen(_trees(run), f"{name} in ROS_DOMAIN_ID={domain_id}") as screen,
        ):
            yield screen
        return
    from fbql.watch.browser import BrowserPage

    decides = str(run.parameters.get("fusion", {}).get("controller", ""))
    headline = f"{decides} · replayed in ROS_DOMAIN_ID={domain_id}".removeprefix(" · ")
    with BrowserPage(run.recorded, _trees(run), name, headline, say, [decides]) as page:
        yield page


def _trees(run: Run) -> Iterable[Tree]:
    """The trees in the recording; where one is damaged, a warning instead."""
    try:
        return recorded_trees(run).values()
    except BadInput as error:
        warn([f"rules are not shown: {error}"])
        return ()


class _Window:
    """Which part of the recording is replayed."""

    def __init__(self, run: Run, arguments: argparse.Namespace) -> None:
        for name, low in (("rate", 0.0), ("start", 0.0), ("duration", 0.0), ("wait", 0.0)):
            value = getattr(arguments, name)
            if value is not None and not (math.isfinite(value) and value >= low):
                raise BadInput(f"--{name} {value:g}: must be {low:g} or more")
        if run.start_ns is None or run.end_ns is None:
            raise BadInput(f"{run.path}: it has no messages; there is nothing to replay")
        self.start_ns = run.start_ns + round(arguments.start * NS)
        self.end_ns = min(run.end_ns, _LAST_NS) + 1
        late = f"{run.path}: it has messages with a log time of more than {_LAST_NS / NS:.0f} s, which a ROS clock cannot show"
        if run.start_ns > _LAST_NS:
            raise BadInput(f"{late}, and no others")
        if run.end_ns > _LAST_NS:
            warn([f"{late}; they are left out"])
        if arguments.duration is not None:
            self.end_ns = min(self.end_ns, self.start_ns + round(arguments.duration * NS))
        if self.start_ns > min(run.end_ns, _LAST_NS):
            length_s = (min(run.end_ns, _LAST_NS) - run.start_ns) / NS
            raise BadInput(f"--start {arguments.start:g}: the recording is {length_s:.3f} s long")
        self.words = f"{(self.end_ns - 1 - self.start_ns) / NS:.1f} s"
        self.words += f" at {arguments.rate:g} times real time" if arguments.rate else " as fast as possible"


def _topics(run: Run, wanted: list[str] | None) -> list[Topic]:
    if wanted is None:
        return list(run.topics.values())
    names = {name if name.startswith("/") else f"/{name}" for name in wanted}
    unknown = sorted(names - run.topics.keys())
    if unknown:
        raise BadInput(f"{run.path}: it has no topic {unknown[0]}; it has {', '.join(sorted(run.topics))}")
    return [run.topics[name] for name in run.topics if name in names]


class Stage:
    """The node that publishes what was recorded, and views of it where somebody subscribes.

    Topics whose type is not installed, or was recorded with another definition, are left out with a warning.

    Args:
        clock: whether the time is published.
        views: whether poses and markers are made of the world states.

    Raises:
        BadInput: no topic is left.
    """

    def __init__(self, run: Run, topics: list[Topic], domain_id: int, clock: bool, views: bool) -> None:
        self._context = rclpy.Context()
        args = ["--ros-args", "--disable-external-lib-logs"]
        rclpy.init(
            args=args, context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO
        )
        self._domain_id = domain_id
        self._node = Node(
            NODE, context=self._context, use_global_arguments=False, enable_rosout=False, start_parameter_services=False
        )
        self._outlets: dict[str, Outlet] = {}
        self.left_out: list[str] = []
        """Topics that can't be published."""
        for topic in topics:
            try:
                self._outlets[topic.name] = self._outlet(topic)
            except BadInput as error:
                warn([f"left out: {error}"])
                self.left_out.append(topic.name)
        if not self._outlets:
            self.close()
            raise BadInput("none of the topics can be published here")
        self._views = ReplayViews(self._node, run, self.names if views else [])
        self._clock: Outlet | None = None
        """Used where /clock was not recorded; a recorded one is among the outlets."""
        if clock and CLOCK not in self._outlets:
            self._clock = Outlet(self._node, Clock, CLOCK, QoSProfile(depth=_DEPTH))
        self._clock_ns = -1

    def _outlet(self, topic: Topic) -> Outlet:
        """Raises BadInput for a topic that can't be published."""
        try:
            validate_full_topic_name(topic.name)
            return Outlet(self._node, class_of(topic), topic.name, qos_of(topic))
        except NameValidationException as error:
            reason = str(error).partition(":\n")[0]
            raise BadInput(f"topic '{topic.name}': {reason}") from None
        except (RCLError, TypeError, OverflowError, RuntimeError) as error:
            reason = str(error).strip().partition("\n")[0]
            raise BadInput(f"{topic.name}: it can't be published as it was recorded ({reason})") from None

    @property
    def names(self) -> list[str]:
        """The published topics."""
        return list(self._outlets)

    def publish(self, message: Message) -> None:
        """Publishes a message, and before it the time, if that has changed."""
        if message.log_time_ns != self._clock_ns and self._clock is not None:
            self._clock_ns = message.log_time_ns
            clock = Clock()
            clock.clock.sec, clock.clock.nanosec = divmod(self._clock_ns, NS)
            self._clock.publish(clock)
        self._outlets[message.topic].publish(message.data)
        self._views.show(message.topic, message.data)

    def refuse_twins(self, interrupts: Interrupts) -> None:
        """Raises BadInput if another publisher of one of the topics appears in this domain within `DISCOVERY_S`."""
        deadline = monotonic() + DISCOVERY_S
        while monotonic() < deadline and not interrupts.came:
            self._refuse_twin()
            sleep(_LOOK_S)

    def wait_for_subscribers(self, patience_s: float, interrupts: Interrupts, may_have_twins: bool) -> None:
        """Waits until every topic has a subscriber, or this long [s]: subscribers miss what is published before.

        On a busy machine a twin may show up as late as now. Raises BadInput for it.
        """
        deadline = monotonic() + patience_s
        while monotonic() < deadline and not interrupts.came:
            if may_have_twins:
                self._refuse_twin()
            if all(outlet.publisher.get_subscription_count() for outlet in self._all()):
                return
            sleep(_LOOK_S)

    def _refuse_twin(self) -> None:
        for name in self._outlets:
            if self._node.count_publishers(name) > 1:
                raise BadInput(
                    f"another node publishes {name} in ROS_DOMAIN_ID={self._domain_id}; "
                    "end it, or leave out --domain to get a free domain"
                )

    def settle(self) -> int:
        """Waits until everything is acknowledged. Returns how often so far a subscriber was too late."""
        deadline_s = monotonic() + _PATIENCE_S
        for outlet in self._all():
            outlet.settle(deadline_s)
        return sum(outlet.late for outlet in self._all())

    def _all(self) -> list[Outlet]:
        return [*([] if self._clock is None else [self._clock]), *self._outlets.values()]

    def close(self) -> None:
        """Ends the node."""
        self._node.destroy_node()
        self._context.try_shutdown()


class Outlet:
    """One published topic. If it is reliable and its history bounded, it waits until its subscribers have acknowledged
    the message that would drop out of it next."""

    def __init__(self, node: Node, message_type: type, name: str, qos: QoSProfile) -> None:
        if qos.durability is DurabilityPolicy.VOLATILE:
            # The depth only matters here: late subscribers get none of the messages.
            qos.history, qos.depth = HistoryPolicy.KEEP_LAST, _DEPTH
        self.publisher = node.create_publisher(message_type, name, qos)
        self._publish = self.publisher.publish
        # In a full history the next message replaces the first. Fast DDS asks its readers to acknowledge at once when the
        # history is full, and otherwise every 3 s.
        is_bounded = qos.reliability is not ReliabilityPolicy.BEST_EFFORT and qos.history is HistoryPolicy.KEEP_LAST
        self._depth = qos.depth if is_bounded else 0
        self._unacknowledged = 0
        self.late = 0
        """How often a subscriber did not acknowledge in time."""

    def publish(self, data: Any) -> None:
        """Publishes a message, or recorded bytes as they are."""
        if self._depth and self._unacknowledged == self._depth:
            self.settle(monotonic() + _PATIENCE_S)
        self._publish(data)
        self._unacknowledged += 1

    def settle(self, deadline_s: float) -> None:
        """Waits until everything is acknowledged, at most up to this time of the steady clock."""
        if not (self._depth and self._unacknowledged):
            return
        self._unacknowledged = 0
        while self.publisher.get_subscription_count() and not self.publisher.wait_for_all_acked(_ASK_AGAIN):
            if monotonic() > deadline_s:
                self.late += 1
                return


class _Replay:
    def __init__(
        self,
        run: Run,
        arguments: argparse.Namespace,
        window: _Window,
        stage: Stage,
        line: LiveLine,
        keys: RawTerminal | None,
        screen: View | None,
        interrupts: Interrupts,
    ) -> None:
        self._run = run
        self._window = window
        self._stage = stage
        self._line = line
        self._keys = keys
        self._decoder = KeyDecoder(WATCHING_KEYS)
        self._screen = screen
        self._interrupts = interrupts
        self._loop: bool = arguments.loop
        self._pace = Pace(arguments.rate, monotonic, self._pressed, self._show)
        if screen is not None:
            screen.pace = self._pace
        self._at_ns = window.start_ns
        self._messages = 0
        self._covered_ns = 0
        self._wall_s = 0.0

    def play(self) -> None:
        """Replays."""
        while not (self._screen is None or self._screen.ready or self._pace.quit):
            self._pace.idle()
        begun_s = monotonic()
        again = True
        while again:
            self._pace.restart()
            before = self._messages
            for message in self._recorded():
                if not self._pace.wait(message.log_time_ns):
                    break
                self._at_ns = message.log_time_ns
                self._stage.publish(message)
                self._messages += 1
                if self._screen is not None:
                    self._follow(message, self._screen)
                self._show()
            self._covered_ns += self._at_ns - self._window.start_ns
            again = self._loop and not self._pace.quit and self._messages > before
        if self._screen is not None and not self._pace.quit:
            self._screen.draw()
        self._wall_s = monotonic() - begun_s

    def report(self) -> dict[str, float]:
        """Reports how it went. Returns the figures for --json."""
        wall_s = self._wall_s
        late = self._stage.settle()
        self._line.close()
        covered_s = self._covered_ns / NS
        say(
            f"replayed {self._messages} messages, {covered_s:.1f} s in {wall_s:.1f} s: {covered_s / wall_s:.1f} times real time"
        )
        if self._pace.went_back:
            say(f"the recording's time went back {self._pace.went_back} times; there was no wait at those points")
        if late:
            complain(
                f"{late} times a subscriber did not acknowledge within {_PATIENCE_S:g} s; it may have missed messages"
            )
        return {
            "messages": self._messages,
            "replayed_s": covered_s,
            "seconds": round(wall_s, 3),
            "times_real_time": round(covered_s / wall_s, 2),
            "went_back": self._pace.went_back,
            "late": late,
        }

    def _recorded(self) -> Iterator[Message]:
        return self._run.messages(self._stage.names, self._window.start_ns, self._window.end_ns)

    def _follow(self, message: Message, screen: View) -> None:
        """Shows a message. A skip to the next episode ends with its first world state."""
        before = screen.moments.world
        screen.hear(message.topic, message.data)
        world = screen.moments.world
        if world is before or world is None:
            return
        if before is not None and world.episode != before.episode:
            self._pace.arrive()
        elif world.ended and not self._pace.hurries:
            self._pace.linger(END_S)

    def _pressed(self, patience_s: float) -> list[Key]:
        """The keys pressed; waits for some at most this long."""
        keys: list[Key] = []
        if self._screen is not None:
            keys = self._screen.keys(min(patience_s, PICTURE_S))
        elif self._keys is not None and not self._keys.stopped() and self._keys.take():
            keys = [key for key in self._decoder.feed(self._keys.read(patience_s)) if key is not Key.NEXT]
        else:
            sleep(patience_s)  # at most 0.1 s: Python waits on after a signal
        return [*keys, Key.FINISH] if self._interrupts.came else keys

    def _show(self) -> None:
        if self._screen is not None:
            self._screen.draw()
            return
        window = self._window
        at, length = (self._at_ns - window.start_ns) / NS, (window.end_ns - 1 - window.start_ns) / NS
        paused = "  paused" if self._pace.is_paused else ""
        self._line.show(f"{at:.2f} of {length:.2f} s, {self._messages} messages{paused}")
