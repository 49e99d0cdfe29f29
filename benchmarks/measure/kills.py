"""Random signals to random processes of a bring-up at random times: does it end, say so, and keep what it recorded?

Each run starts bringup.py with a match without end, in one process or in several, and sends one signal to bringup.py or
to a node, while the graph starts or while it plays; SIGSTOP stands for a node that hangs. Then it checks:

end       bringup.py ends within 60 s, and within 5 s more no process of it is left
exit      a signal to bringup.py ends the match in good order (0; 1 before the match began; no exit code of its own where it
          was killed); one to a node is a failure (1 or 3); no traceback; stdout is empty or one JSON object. While Python
          itself starts, before any of our code runs, a signal ends bringup.py and a node as it ends every Python program
loss      every command that a listener of another process heard is in the recording, but for those of the last flush
          period (0.5 s) before the signal
recording it is finished and verifies, or `recover` repairs it and the repaired one verifies

Every run is one line of FILE (JSON); an interrupted study continues with the next number.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import closing
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from time import monotonic, sleep
from typing import Any, NamedTuple

import numpy as np
from fbql.cli.app import reporting
from fbql.cli.output import print_result, set_program
from fbql.cli.parser import Parser
from fbql.graph.observer import CommandNode
from fbql.replay.recomputation import RecordedBehaviors, recorded_parameters, recorded_policy, recorded_trees
from fbql.replay.verification import verify
from fbql_common.core.errors import BadInput
from fbql_common.core.topic_names import WHEEL_COMMAND
from fbql_common.wire import decode_command
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_msgs.msg import WheelCommand
from fbql_recording.recovery.recover import recover
from fbql_recording.run import open_run
from rclpy.qos import QoSProfile, ReliabilityPolicy

from measure.command_process import LATE_S, NODES, CommandProcess
from measure.graph import MODES, ROOT
from measure.rows import read_rows, row_appender

PROGRAM = "kills.py"
LAUNCHER = "bringup"
_OUR_FRAME = re.compile(rf'File "{re.escape(str(ROOT))}/(?!\.venv/|scripts/)|enter\(')
TARGETS = {"many": (LAUNCHER, *NODES), "one": (LAUNCHER, "all nodes")}
SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGKILL", "SIGSTOP")
CONTROLLERS = ("subsumption", "uniform", "fbql_literal", "fbql_value", "fbql")
PHASES = ("start", "play")
FLUSH_PERIOD_S = FusionNodeParameters.flush_period_s
"""The longest stretch that a crash may lose [s]."""
LONGEST_WAIT_S = 4.0
"""The signal is sent up to this long after the start, or after the first command [s]."""
HANG_S, GONE_S, START_S = 60.0, 5.0, 60.0


class Plan(NamedTuple):
    """The signal that one bring-up gets, and when."""

    number: int
    processes: str
    controller: str
    target: str
    signal: str
    phase: str
    after_s: float
    """How long after the beginning of the phase [s]."""


def plan(seed: int, number: int) -> Plan:
    """The plan of a run: a function of the study's seed and the run's number."""
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))

    def one_of(choices: Sequence[str]) -> str:
        return choices[generator.integers(len(choices))]

    processes = one_of(MODES)
    target = one_of(TARGETS[processes])
    signals = [name for name in SIGNALS if (target, name) != (LAUNCHER, "SIGSTOP")]  # nobody could end it
    after_s = float(generator.uniform(0.0, LONGEST_WAIT_S))
    return Plan(number, processes, one_of(CONTROLLERS), target, one_of(signals), one_of(PHASES), after_s)


class Listener(CommandNode):
    """Receives the commands of a match, in a process other than those of the graph."""

    def __init__(self, domain_id: int) -> None:
        super().__init__("listener", domain_id)
        self.heard: list[tuple[float, tuple[int, int]]] = []
        """When each command arrived, on the steady clock [s], and its (episode, step)."""
        qos = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.node.create_subscription(WheelCommand, WHEEL_COMMAND, self._note, qos, raw=True)

    def _note(self, data: bytes) -> None:
        command = decode_command(data)
        self.heard.append((monotonic(), (command.episode, command.step)))


class Ear:
    """Receives the commands of a bring-up from the moment its domain is known."""

    def __init__(self) -> None:
        self._listener: Listener | None = None

    @property
    def heard(self) -> list[tuple[float, tuple[int, int]]]:
        """As of `Listener`."""
        return [] if self._listener is None else self._listener.heard

    def join(self, domain_id: int | None) -> None:
        """Joins the graph, unless it is not known yet or was joined before."""
        if self._listener is None and domain_id is not None:
            self._listener = Listener(domain_id)

    def listen(self, duration_s: float) -> None:
        """Listens for this long."""
        sleep(duration_s) if self._listener is None else self._listener.look(duration_s)

    def close(self) -> None:
        """Leaves the graph."""
        if self._listener is not None:
            self._listener.close()


class Bringup(CommandProcess):
    """One bringup.py."""

    def __init__(self, plan: Plan, place: Path) -> None:
        self.out = place / "run"
        options = ["--json", "--controller", plan.controller, "--processes", plan.processes]
        options += ["--episodes", "1000000", "--seed", str(plan.number), "--out", str(self.out)]
        environment = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
        super().__init__([sys.executable, str(ROOT / "scripts" / "bringup.py"), *options], place, environment)

    @property
    def has_ended(self) -> bool:
        return self.popen.poll() is not None

    def process_of(self, target: str) -> int | None:
        """The process id of a node, of the process of all nodes, or of bringup.py itself; None while there is none."""
        if target == LAUNCHER:
            return self.popen.pid
        return self.nodes().get(target) if target in NODES else next(iter(self.ros_processes()), None)


def run_once(plan: Plan) -> dict[str, Any]:
    """Does what is planned, and returns the plan, what was seen, and `faults`: what must not be, in words."""
    with tempfile.TemporaryDirectory() as directory:
        bringup = Bringup(plan, Path(directory))
        try:
            seen = _observe(plan, bringup)
        finally:
            bringup.kill()
        return {**plan._asdict(), **seen}


def _observe(plan: Plan, bringup: Bringup) -> dict[str, Any]:
    """Sends the signal when it is time, waits for the end, and checks everything."""
    with closing(Ear()) as ear:
        process = _process_in_time(plan, bringup, ear)
        if process is None:
            return {"faults": [f"the time for the signal never came: {bringup.stderr[-300:]}"]}
        sent_s = monotonic()
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.Signals[plan.signal])
        while not bringup.has_ended and monotonic() < sent_s + HANG_S:
            ear.listen(0.01)
        ended_s = monotonic() - sent_s
        ear.listen(0.05)
    faults = [] if bringup.has_ended else [f"it hangs: after {HANG_S:g} s it has not ended"]
    faults += _left_behind(bringup)
    seen = {"exit_code": bringup.popen.poll(), "ended_s": round(ended_s, 3), "heard": len(ear.heard)}
    faults += _said(plan, bringup)
    try:
        recording = _recording(bringup.out, ear.heard, sent_s)
    except (BadInput, AssertionError, ValueError) as error:
        recording = {"recording": "unusable"}
        faults.append(f"the recording can't be used: {error}")
    faults += recording.pop("faults", [])
    return {**seen, **recording, "faults": faults}


def _process_in_time(plan: Plan, bringup: Bringup, ear: Ear) -> int | None:
    """Waits until it is time for the signal. Returns the process id of its target; None if that time never came."""
    deadline = monotonic() + START_S
    begun_s = monotonic() if plan.phase == "start" else None
    while not bringup.has_ended and monotonic() <= deadline:
        ear.join(bringup.domain_id)
        ear.listen(0.01)
        if begun_s is None and ear.heard:
            begun_s = monotonic()
        if begun_s is not None and monotonic() >= begun_s + plan.after_s:
            process = bringup.process_of(plan.target)
            if process is not None:
                return process
    return None


def _left_behind(bringup: Bringup) -> Iterator[str]:
    """Processes that are left some time after the end."""
    deadline = monotonic() + GONE_S
    while bringup.processes() and monotonic() < deadline:
        sleep(0.02)
    for pid, line in bringup.processes().items():
        yield f"process {pid} is left: {line}"


def _said(plan: Plan, bringup: Bringup) -> Iterator[str]:
    """What is wrong with the exit code and with what was printed."""
    code, stdout, stderr = bringup.popen.poll(), bringup.stdout, bringup.stderr
    if plan.target != LAUNCHER:
        right = code in (1, 3)
    elif plan.signal == "SIGKILL":
        right = code == -signal.SIGKILL
    else:
        right = code in (0, 1) or (not bringup.out.exists() and code == -signal.Signals[plan.signal])
    if not right:
        yield f"exit code {code}"
    if "Traceback" in stderr and not is_python_starting(plan, stderr):
        yield f"a traceback: {stderr[-2000:]}"
    if plan.target != LAUNCHER and plan.target in NODES and plan.target not in stderr:
        yield f"the node is not named: {stderr[-300:]}"
    try:
        if stdout and not isinstance(json.loads(stdout), dict):
            yield f"stdout is not an object: {stdout[:200]}"
    except json.JSONDecodeError:
        yield f"stdout is not JSON: {stdout[:200]}"


def is_python_starting(plan: Plan, stderr: str) -> bool:
    """Whether Python was interrupted before any of our code ran: no file of ours is in its traceback, but perhaps the
    script that was about to import it."""
    return plan.phase == "start" and "KeyboardInterrupt" in stderr and not _OUR_FRAME.search(stderr)


def _recording(out: Path, heard: Sequence[tuple[float, tuple[int, int]]], sent_s: float) -> dict[str, Any]:
    """The state of the recording afterwards."""
    if not list(out.glob("*.mcap*")):
        return {"recording": "none", "faults": ["commands were heard, but there is no recording"] if heard else []}
    summary = out / "summary.json"
    whole = (out / "metadata.yaml").exists() and summary.exists() and not json.loads(summary.read_text())["incomplete"]
    state = "finished"
    if not whole:
        try:
            state, out = "recovered", recover(out, out.with_name("recovered")).path
        except BadInput as error:  # such as: nothing was flushed yet
            return {"recording": "empty", "why": str(error), **_loss(heard, sent_s, (-1, -1))}
    run = open_run(out)
    steps = [(step.episode, step.step) for step in run.steps() if step.command is not None]
    loss = _loss(heard, sent_s, steps[-1] if steps else (-1, -1))
    parameters, _ = recorded_parameters(run)
    behaviors = RecordedBehaviors(run, recorded_trees(run), {})
    verified = verify(run, SoccerSession(parameters, recorded_policy(run)), behaviors, lambda _: None)
    if verified.difference is not None:
        loss["faults"].append(f"it differs: {verified.difference.words}")
    return {"recording": state, "steps": verified.steps, **loss}


def _loss(heard: Sequence[tuple[float, tuple[int, int]]], sent_s: float, last: tuple[int, int]) -> dict[str, Any]:
    """How much of what was heard before the signal comes after the last recorded step."""
    lost = [came_s for came_s, step in heard if step > last and came_s <= sent_s]
    lost_s = sent_s - min(lost, default=sent_s)
    faults = [f"{lost_s:.3f} s are lost"] if lost_s > FLUSH_PERIOD_S + LATE_S else []
    return {"lost_s": round(lost_s, 3), "faults": faults}


def table(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row for each kind of target and signal."""
    found: list[dict[str, Any]] = []
    for target in (LAUNCHER, *NODES, "all nodes"):
        for name in SIGNALS:
            of = [row for row in rows if (row["target"], row["signal"]) == (target, name)]
            ended = [row["ended_s"] for row in of if "ended_s" in row]
            if not ended:
                continue
            codes = Counter(str(row["exit_code"]) for row in of if "exit_code" in row)
            found.append(
                {
                    "target": target,
                    "signal": name,
                    "runs": len(of),
                    "exit codes": ", ".join(f"{code} ({count})" for code, count in sorted(codes.items())),
                    "ended after, median [s]": round(median(ended), 2),
                    "at most [s]": round(max(ended), 2),
                    "finished": sum(row.get("recording") == "finished" for row in of),
                    "recovered": sum(row.get("recording") == "recovered" for row in of),
                    "lost at most [s]": round(max((row.get("lost_s", 0.0) for row in of), default=0.0), 2),
                    "faults": sum(bool(row["faults"]) for row in of),
                }
            )
    return found


def main(argv: Sequence[str]) -> int:
    """Runs the study. Returns the exit code: 1 if there was a fault."""
    set_program(PROGRAM)
    arguments = _arguments(argv)
    return reporting(lambda: _run(arguments))


def _run(arguments: argparse.Namespace) -> int:
    rows = [row for row in read_rows(arguments.out) if row["number"] < arguments.runs]
    done = {row["number"] for row in rows}
    plans = [plan(arguments.seed, number) for number in range(arguments.runs) if number not in done]
    workers = ProcessPoolExecutor(arguments.workers, get_context("spawn"))
    with row_appender(arguments.out) as append, workers:
        for future in as_completed([workers.submit(run_once, each) for each in plans]):
            row = future.result()
            append(row)
            rows.append(row)
            words = "; ".join(row["faults"]) or "well"
            what = f"{row['signal']} to {row['target']} ({row['processes']}, {row['controller']}, {row['phase']})"
            print(f"{row['number']} ({len(rows)}/{arguments.runs}) {what}: {words}", file=sys.stderr, flush=True)
    faults = [row for row in rows if row["faults"]]
    if arguments.json:
        print_result(json.dumps({"runs": len(rows), "faults": len(faults), "table": table(rows)}))
    else:
        lines = table(rows)
        words = [f"| {' | '.join(lines[0])} |", f"|{'---|' * len(lines[0])}"] if lines else []
        words += [f"| {' | '.join(str(value) for value in line.values())} |" for line in lines]
        print_result("\n".join([*words, "", f"{len(rows)} runs, {len(faults)} with a fault"]))
    return 1 if faults else 0


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = Parser(prog=PROGRAM, description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=20, metavar="N", help="number of bring-ups (20)")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="number of bring-ups at a time (1)")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="seed of everything random (1)")
    parser.add_argument(
        "--out", type=Path, default=Path("kills.jsonl"), metavar="FILE", help="file of results (kills.jsonl)"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args(list(argv))
    for name in ("runs", "workers"):
        if getattr(arguments, name) < 1:
            parser.error(f"--{name} is {getattr(arguments, name)}; it must be 1 or more")
    if arguments.seed < 0:
        parser.error(f"--seed is {arguments.seed}; it must be 0 or more")
    return arguments
