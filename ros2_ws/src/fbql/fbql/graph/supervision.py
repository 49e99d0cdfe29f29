"""Supervises a graph from start to end: its domain, the start barrier, nodes that die, signals that ask it to end."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from functools import partial
from pathlib import Path
from time import monotonic, sleep
from typing import TYPE_CHECKING, Protocol

from fbql_common.core.errors import BadInput
from fbql_common.core.recording_names import CONFIG
from fbql_common.files import DISK_FAILURES, remedy
from fbql_common.spin import how_ended

from fbql.cli.exit_codes import BAD_INPUT, DONE, FAILED, INCOMPLETE
from fbql.cli.interrupts import Interrupts
from fbql.cli.output import LiveLine
from fbql.graph import launch
from fbql.graph.domains import free_domain
from fbql.graph.observer import Observer
from fbql.graph.processes import NodeProcess, start, stop
from fbql.match.options import Match
from fbql.match.result import Asked, export_text, played_so_far, status_line

if TYPE_CHECKING:  # it takes message packages that a bring-up without it need not load
    from fbql.graph.foxglove_live import FoxgloveLive

BEFORE_THE_MATCH = "the match had not begun"
_LOOK_S = 0.05
"""How long to receive messages between two checks of the processes [s]."""
_FIRST_OUTPUT_S = 3.0
_STALLED_S = 30.0
"""How long no step may be played before a node counts as hung [s]: longer than any node waits for another."""
_LAST_COUNT_S = 0.3
"""The simulator publishes its counts again within this time [s]."""
_LAST_MOMENT_S = 1.5
"""How long the end of a watched match stays on the screen [s]."""
_SHARED_MEMORY_ERROR = b"RTPS_TRANSPORT_SHM"
"""How Fast DDS names itself in an error about shared memory."""


class Watch(Protocol):
    """A view of the match in this command, which may set the pace of a match in lockstep."""

    @property
    def is_on(self) -> bool:
        """Whether somebody watches."""
        ...

    @property
    def takes_terminal(self) -> bool:
        """Whether it is on the terminal, where nothing else can be shown."""
        ...

    @property
    def holds(self) -> bool:
        """Whether the match waits for whoever watches."""
        ...

    def attach(self, observer: Observer, behaviors: Sequence[str]) -> None:
        """Subscribes to the match."""

    def on_screen(self, log: Path) -> AbstractContextManager[None]:
        """A context in which the match is shown; `log` receives what would otherwise be printed into it."""
        ...

    def look(self, observer: Observer, duration_s: float) -> None:
        """Receives messages for this long, and shows them."""


class GraphFailed(Exception):
    """The graph failed; the text says how.

    Args:
        process: the process that ended, if that is the cause; its output is shown.
        is_refusal: whether the run could not begin: nothing was played, and nothing is worth keeping.
    """

    def __init__(self, text: str, process: NodeProcess | None = None, *, is_refusal: bool = False) -> None:
        super().__init__(text)
        self.process = process
        self.is_refusal = is_refusal

    @property
    def output(self) -> str:
        """The end of what the process printed, where that says why it ended: one that SIGINT ended while it was still
        being loaded printed only how far it had come."""
        return "" if self.process is None or self.process.exit_code == -signal.SIGINT else self.process.tail()


class Supervision:
    """One graph from its start to its end.

    Args:
        domain_id: None for a free one, which is reserved while the graph runs.
        start_timeout_s: how long every node and topic may take to appear [s].
        live: the live viewer, if there is one.
        watch: the view in this command, if there is one.
    """

    def __init__(
        self,
        mode: launch.Mode,
        domain_id: int | None,
        start_timeout_s: float,
        line: LiveLine,
        interrupts: Interrupts,
        live: FoxgloveLive | None = None,
        watch: Watch | None = None,
    ) -> None:
        self._mode = mode
        self._domain_id = domain_id
        self._start_timeout_s = start_timeout_s
        self.domain_id = domain_id
        """The domain of the graph, once it runs."""
        self._line = line
        self._interrupts = interrupts
        self._live = live
        self._view = watch
        self._started: list[NodeProcess] = []
        self._out = Path()
        self.missed_ticks: int | None = None
        """Real time: steps that could not be done in time; None in lockstep, or where the simulator was not heard."""

    @property
    def is_in_real_time(self) -> bool:
        """Whether the simulator steps on a clock, and so can miss ticks."""
        return self._mode.realtime > 0

    def run(self, match: Match) -> int:
        """Plays the match in its run directory; every process has ended when this returns or raises.

        Returns:
            0 when fusion succeeded or a signal requested the end, 1 on a failure, 3 when the recording is incomplete.

        Raises:
            BadInput: refused before any process was started, or by fusion before the run began.
            Interrupted: a signal came before any process was started.
        """
        with nullcontext(self._domain_id) if self._domain_id is not None else free_domain() as domain_id:
            # Logs stay with the run, wherever HOME is.
            self._out = match.out
            os.environ["ROS_LOG_DIR"] = str(match.out / "log")
            if self._domain_id is not None:
                self._refuse_twins(match, domain_id)
            commands = launch.commands(match, self._mode, launch.write_parameters(match, self._mode))
            self._interrupts.check(BEFORE_THE_MATCH)
            names = launch.node_names(match)
            how = "one process each" if self._mode.processes == "many" else "all in one process"
            self.domain_id = domain_id
            launch.write_domain(match, export_text(domain_id))
            self._line.say(
                f"bringing up {len(names)} nodes, {how}; to see it from a second shell: {export_text(domain_id)}"
            )
            failure: GraphFailed | None = None
            try:
                self._start(commands, match, {**os.environ, "ROS_DOMAIN_ID": str(domain_id)})
                self._wait_for_output()
                with closing(Observer(domain_id)) as observer:
                    if self._live is not None:
                        self._live.attach(observer, list(match.behaviors))
                    if self._view is not None:
                        self._view.attach(observer, list(match.behaviors))
                    self._wait_for_graph(observer, match)
                    with self._view.on_screen(match.out / "log" / "bringup.log") if self._view else nullcontext():
                        self._watch(observer, match)
            except GraphFailed as error:
                failure = error
            finally:
                killed = stop(self._started)
                self._line.close()
        if failure is not None and failure.is_refusal:
            raise BadInput(failure)
        if failure is not None:
            self._line.complain(_failure_text(failure, match), failure.output)
        if killed:
            self._line.complain(f"did not end in time and had to be killed: {', '.join(killed)}")
        self._report_shared_memory()
        completeness = self._completeness()
        return FAILED if failure is not None or killed else completeness

    def _report_shared_memory(self) -> None:
        """Sums up, in one line for the user, what the nodes' middleware logged about shared memory."""
        troubled = [process.name for process in self._started if _SHARED_MEMORY_ERROR in process.log_file.read_bytes()]
        if troubled:
            self._line.complain(
                f"shared memory failed in {', '.join(troubled)}, whose messages went over UDP; see {self._started[0].log_file.parent}; "
                "to repair it, when no ROS program runs: rm -f /dev/shm/fastrtps_* /dev/shm/sem.fastrtps_*"
            )

    def _start(self, commands: Mapping[str, Sequence[str]], match: Match, environment: dict[str, str]) -> None:
        for name, command in commands.items():
            try:
                self._started.append(start(name, command, environment, match.out / "log"))
            except OSError as error:
                where = os.fsdecode(error.filename or command[0])
                text = f"'{name}' can't be started: {where}: {error.strerror}"
                if error.errno in DISK_FAILURES:
                    raise GraphFailed(f"{text}; {remedy(error)}", is_refusal=True) from None
                raise GraphFailed(text) from None

    def _completeness(self) -> int:
        """Reports it if fusion could not record everything: the files that record this may be missing for the same
        reason."""
        if not self._started or self._started[-1].exit_code != INCOMPLETE:
            return DONE
        fusion = self._started[-1]
        reasons = fusion.errors() or [f"see {fusion.log_file}"]
        self._line.complain(f"the recording is incomplete: {'; '.join(reasons)}")
        return INCOMPLETE

    def _refuse_twins(self, match: Match, domain_id: int) -> None:
        """Two nodes of one name break a graph in ways that are hard to see. A free domain has none."""
        names = set(launch.node_names(match))
        with closing(Observer(domain_id)) as observer:
            twins = observer.discover(lambda: sorted(set(observer.nodes()) & names), self._interrupts)
        if twins:
            raise BadInput(
                f"node '{twins[0]}' is already running in ROS_DOMAIN_ID={domain_id}; "
                "end it, or unset ROS_DOMAIN_ID to get a free domain"
            )

    def _wait_for_output(self) -> None:
        """Waits until every process has printed something: then it is in the graph, or about to join.

        A participant announces itself several times when it joins a domain, and only every 3 s later on: an observer
        that joins before the nodes often finds them 3 s late.
        """
        deadline = monotonic() + _FIRST_OUTPUT_S
        while not self._interrupts.came and monotonic() < deadline:
            self._fail_on_exit()
            if all(process.log_file.stat().st_size for process in self._started):
                return
            sleep(_LOOK_S)

    def _wait_for_graph(self, observer: Observer, match: Match) -> None:
        """The start barrier: waits until every node and topic is there, while fusion waits for its inputs."""
        deadline = monotonic() + self._start_timeout_s
        names = launch.node_names(match)
        while not self._interrupts.came:
            observer.look(_LOOK_S)
            self._fail_on_exit()
            # A short match may be over before all of it was seen.
            if observer.status or self._started[-1].exit_code is not None:
                return
            missing = observer.missing(names, list(match.behaviors))
            if not missing:
                return
            if monotonic() > deadline:
                raise GraphFailed(f"after {self._start_timeout_s:g} s the graph still lacks {', '.join(missing)}")

    def _watch(self, observer: Observer, match: Match) -> None:
        """Waits until fusion has ended, or a signal requests the end. A node that hangs, and so cannot end, is a
        failure."""
        fusion = self._started[-1]
        stalled_s = _STALLED_S + (10 * match.simulation.dt_s / self._mode.realtime if self._mode.realtime else 0.0)
        place, moved_s = ("",) * 3, monotonic()
        while not self._interrupts.came:
            self._look(observer, _LOOK_S)
            if observer.status and not (self._view and self._view.takes_terminal):
                self._line.show(partial(status_line, observer.status))
            if self.is_in_real_time:
                self.missed_ticks = observer.missed_ticks
            if fusion.exit_code in (DONE, INCOMPLETE):
                if self.is_in_real_time:
                    observer.look(_LAST_COUNT_S)
                    self.missed_ticks = observer.missed_ticks
                if self._view is not None and self._view.is_on:
                    self._look(observer, _LAST_MOMENT_S)
                return
            self._fail_on_exit()
            now_at = tuple(observer.status.get(name, "") for name in ("episode", "step", "reflects_s"))
            if now_at != place or (self._view and self._view.holds):
                place, moved_s = now_at, monotonic()
            elif monotonic() - moved_s > stalled_s:
                raise GraphFailed(f"no step was played for {stalled_s:g} s: a node hangs; see {match.out / 'log'}")

    def _look(self, observer: Observer, duration_s: float) -> None:
        """Receives messages for this long."""
        if self._view is None:
            observer.look(duration_s)
        else:
            self._view.look(observer, duration_s)

    def _fail_on_exit(self) -> None:
        for process in self._started:
            code = process.exit_code
            if code is None or (process is self._started[-1] and code in (DONE, INCOMPLETE)):
                continue
            if code == BAD_INPUT and process is self._started[-1] and not (self._out / CONFIG).exists():
                said = process.tail().splitlines()
                raise GraphFailed(
                    said[-1]
                    if said
                    else f"{self._out}: the run can't begin: not even its log can be written; make room there",
                    is_refusal=True,
                )
            what = f"node '{process.name}'" if self._mode.processes == "many" else "the process of all nodes"
            raise GraphFailed(f"{what} {how_ended(code)}", process)


def _failure_text(failure: GraphFailed, match: Match) -> str:
    """What failed, and how much was played until then."""
    shortfall = Asked(match.fusion.episodes, match.fusion.goals).shortfall(*played_so_far(match.out))
    shown = f"; its output ({failure.process.log_file}):" if failure.process and failure.output else ""
    return f"{failure}{shortfall and f' after {shortfall}'}{shown}"
