"""Watches over a graph from its start to its end: a domain of its own, the start barrier, who dies, who asks for the end."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping, Sequence
from contextlib import closing, nullcontext
from time import monotonic, sleep
from typing import TYPE_CHECKING

from fbql_common.core.errors import BadInput

from fbql.cli.exit_codes import DONE, FAILED, INCOMPLETE
from fbql.cli.interrupts import Interrupts
from fbql.cli.panel import Panel
from fbql.graph import graph
from fbql.graph.domains import free_domain
from fbql.graph.observer import Observer
from fbql.graph.processes import NodeProcess, start, stop
from fbql.match.options import Match

if TYPE_CHECKING:  # it takes message packages that a bring-up without it need not load
    from fbql.graph.foxglove_live import FoxgloveLive

BEFORE_THE_MATCH = "the match had not begun"
_LOOK_S = 0.05
_DISCOVERY_S = 3.0
"""Within this every participant of a domain announces itself again [s]."""
_WORDS_S = 3.0


class Failure(Exception):
    """The graph did not do its job; the text says what happened."""


class Supervision:
    """One graph from its start to its end.

    Args:
        domain_id: None for a free one, which is held while the graph runs.
        start_timeout_s: within this every node and topic must be there.
        live: where people watch, if they do.
    """

    def __init__(
        self,
        mode: graph.Mode,
        domain_id: int | None,
        start_timeout_s: float,
        panel: Panel,
        interrupts: Interrupts,
        live: FoxgloveLive | None = None,
    ) -> None:
        self._mode = mode
        self._domain_id = domain_id
        self._start_timeout_s = start_timeout_s
        self._panel = panel
        self._interrupts = interrupts
        self._live = live
        self._started: list[NodeProcess] = []

    def run(self, match: Match) -> int:
        """Plays the match in its run directory; every process has ended when this returns or raises.

        Returns:
            0 when fusion ended well or a signal asked for the end, 1 on a failure, 3 when fusion could not record all.

        Raises:
            BadInput: refused before any process was started.
            Interrupted: a signal came before any process was started.
        """
        with nullcontext(self._domain_id) if self._domain_id is not None else free_domain() as domain_id:
            # Logs stay with the run, wherever HOME is.
            os.environ["ROS_LOG_DIR"] = str(match.out / "log")
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            if self._domain_id is not None:
                self._refuse_twins(match, domain_id)
            commands = graph.commands(match, self._mode, graph.write_parameters(match, self._mode))
            self._interrupts.check(BEFORE_THE_MATCH)
            names = graph.node_names(match)
            how = "a process each" if self._mode.processes == "many" else "all in one process"
            self._panel.say(f"bringing up {len(names)} nodes, {how}, in ROS_DOMAIN_ID={domain_id}")
            code = DONE
            try:
                self._start(commands, match, {**os.environ, "ROS_DOMAIN_ID": str(domain_id)})
                self._wait_for_words()
                with closing(Observer(domain_id)) as observer:
                    if self._live is not None:
                        self._live.attach(observer, list(match.behaviors))
                    self._wait_for_graph(observer, match)
                    self._watch(observer)
            except Failure as failure:
                self._panel.say(f"{failure}")
                code = FAILED
            finally:
                killed = stop(self._started)
                self._panel.close()
        if killed:
            self._panel.say(f"did not end in time and had to be killed: {', '.join(killed)}")
            code = FAILED
        completeness = self._completeness()
        return code or completeness

    def _start(self, commands: Mapping[str, Sequence[str]], match: Match, environment: dict[str, str]) -> None:
        for name, command in commands.items():
            try:
                self._started.append(start(name, command, environment, match.out / "log"))
            except OSError as error:
                raise Failure(f"'{name}' can't be started: {command[0]}: {error.strerror}") from None

    def _completeness(self) -> int:
        """Says it when fusion could not record everything. The files that say so may be missing for the same reason."""
        if not self._started or self._started[-1].exit_code != INCOMPLETE:
            return DONE
        fusion = self._started[-1]
        reasons = fusion.errors() or [f"see {fusion.log_file}"]
        self._panel.say(f"the recording is incomplete: {'; '.join(reasons)}")
        return INCOMPLETE

    def _refuse_twins(self, match: Match, domain_id: int) -> None:
        """Two nodes of one name break a graph in ways that are hard to see. A free domain can't have them."""
        deadline = monotonic() + _DISCOVERY_S
        twins: list[str] = []
        with closing(Observer(domain_id)) as observer:
            while not (twins or self._interrupts.came or monotonic() > deadline):
                observer.look(_LOOK_S)
                twins = sorted(set(observer.nodes()) & set(graph.node_names(match)))
        if twins:
            raise BadInput(
                f"node '{twins[0]}' runs already in ROS_DOMAIN_ID={domain_id}; "
                "end it, or unset ROS_DOMAIN_ID to get a free domain"
            )

    def _wait_for_words(self) -> None:
        """Until every process has said something, for a moment: then it is in the graph, or about to be.

        Whoever joins a domain announces itself several times at first, and is asked for once only later, so that an
        observer that joins before the nodes often finds them with the next periodic announcement, 3 s late.
        """
        deadline = monotonic() + _WORDS_S
        while not self._interrupts.came and monotonic() < deadline:
            self._fail_on_exit()
            if all(process.log_file.stat().st_size for process in self._started):
                return
            sleep(_LOOK_S)

    def _wait_for_graph(self, observer: Observer, match: Match) -> None:
        """The start barrier: until every node and topic is there. Fusion itself waits for its inputs meanwhile."""
        deadline = monotonic() + self._start_timeout_s
        names = graph.node_names(match)
        while not self._interrupts.came:
            observer.look(_LOOK_S)
            self._fail_on_exit()
            # A short match may be over before anybody saw all of it.
            if observer.status or self._started[-1].exit_code is not None:
                return
            missing = observer.missing(names, list(match.behaviors))
            if not missing:
                return
            if monotonic() > deadline:
                raise Failure(f"after {self._start_timeout_s:g} s the graph still lacks {', '.join(missing)}")

    def _watch(self, observer: Observer) -> None:
        """Until fusion has ended, or a signal asks for the end."""
        fusion = self._started[-1]
        while not self._interrupts.came:
            observer.look(_LOOK_S)
            if observer.status:
                self._panel.show(observer.status)
            if fusion.exit_code in (DONE, INCOMPLETE):
                return
            self._fail_on_exit()

    def _fail_on_exit(self) -> None:
        for process in self._started:
            code = process.exit_code
            if code is None or (process is self._started[-1] and code in (DONE, INCOMPLETE)):
                continue
            what = f"node '{process.name}'" if self._mode.processes == "many" else "the process of all nodes"
            how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
            raise Failure(f"{what} {how}; its output ({process.log_file}):\n{process.tail()}")
