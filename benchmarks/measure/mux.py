"""The latency that the mux adds to velocity commands: 8 sources at 100 Hz, through real ROS on this machine's loopback.

Three processes: the sources, the mux, and this one, which receives each command of the driving source twice: directly,
and through the mux. The difference between the two receptions is what the mux adds (`latency`). `through` is the
time from sending to the reception through the mux. `decision_us` is the processor time that the rules take for one command.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from statistics import median, quantiles
from time import perf_counter, process_time

import domain_coordinator
from ament_index_python.packages import get_package_prefix
from fbql.cli.parser import Parser
from fbql_common.core.topic_names import MUX_OUTPUT
from fbql_common.core.twist import Twist
from fbql_common.spin import FAILED, GraphNode, spin
from fbql_common.watch import steady_timer
from fbql_common.wire import MESSAGES, decode_twist
from fbql_fusion.core.mux.config import Lock, MuxConfig, Source
from fbql_fusion.core.mux.mux import Mux
from rclpy.qos import QoSProfile

from measure.mux_sources import topic_of

SOURCES = Path(__file__).with_name("mux_sources.py")
COUNT = 8
RATE_HZ = 100.0
WARM_UP = 100
"""Number of commands at the beginning that do not count."""
PATIENCE_S = 60.0
LOCKS = (Lock("pause", "pause", 0.0, 1), Lock("stop", "stop", 0.0, 255))


class Sink(GraphNode):
    """Receives commands twice, until `commands` of them have arrived both ways."""

    def __init__(self, commands: int) -> None:
        super().__init__("sink")
        self._commands = commands
        self._direct_s: dict[float, float] = {}
        self._through_s: dict[float, tuple[float, float]] = {}
        """Sent and received."""
        everything = QoSProfile(depth=1000)
        self._subscriptions_of_both = [
            self.create_subscription(MESSAGES[Twist], topic, callback, everything, raw=True)
            for topic, callback in ((topic_of(COUNT - 1), self._on_direct), (MUX_OUTPUT, self._on_through))
        ]
        self._began_s = perf_counter()
        self._watch = steady_timer(self, 0.5, self._check)

    def _on_direct(self, data: bytes) -> None:
        now_s = perf_counter()
        self._direct_s[decode_twist(data).linear_x_m_s] = now_s

    def _on_through(self, data: bytes) -> None:
        now_s = perf_counter()
        command = decode_twist(data)
        self._through_s[command.linear_x_m_s] = (command.linear_y_m_s, now_s)

    def _check(self) -> None:
        if len(self._both()) >= self._commands + WARM_UP:
            self.finish()
        elif perf_counter() - self._began_s > PATIENCE_S + self._commands / RATE_HZ:
            self.get_logger().error(f"only {len(self._both())} commands came through the mux")
            self.finish(FAILED)

    def _both(self) -> list[float]:
        return sorted(self._direct_s.keys() & self._through_s.keys())

    def figures(self) -> dict[str, float]:
        """The measured latencies [ms]."""
        numbers = self._both()[WARM_UP:]
        added = sorted(1e3 * (self._through_s[number][1] - self._direct_s[number]) for number in numbers)
        through = sorted(1e3 * (received_s - sent_s) for sent_s, received_s in (self._through_s[n] for n in numbers))
        return {
            "latency_ms_p50": median(added),
            "latency_ms_p99": quantiles(added, n=100)[98],
            "latency_ms_max": added[-1],
            "through_ms_p50": median(through),
            "through_ms_p99": quantiles(through, n=100)[98],
            "commands": len(numbers),
        }


def main(argv: Sequence[str]) -> int:
    """Runs the benchmark. Returns the exit code."""
    arguments = _parse(argv)
    figures = _latency(int(arguments.seconds * RATE_HZ))
    if figures is None:
        return FAILED
    figures["decision_us"] = _decision_us()
    if arguments.json:
        print(json.dumps(figures))
    else:
        for name, value in figures.items():
            print(f"{name:15} {value:.3f}" if isinstance(value, float) else f"{name:15} {value}")
    return 0


def _parse(argv: Sequence[str]) -> argparse.Namespace:
    parser = Parser(prog="mux.py", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, metavar="S", help="how long to measure (20)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args(list(argv))
    if not 1.0 <= arguments.seconds <= 3600.0:
        parser.error(f"--seconds is {arguments.seconds:g}; it must be 1 to 3600")
    return arguments


def _latency(commands: int) -> dict[str, float] | None:
    """Figures of the latency; None if commands did not come through."""
    mux = Path(get_package_prefix("fbql_fusion")) / "lib" / "fbql_fusion" / "twist_mux"
    sinks: list[Sink] = []

    def make() -> Sink:
        sinks.append(Sink(commands))
        return sinks[0]

    with tempfile.TemporaryDirectory() as directory, domain_coordinator.domain_id() as domain:
        file = Path(directory) / "twist_mux.yaml"
        file.write_text(_parameters())
        own = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_LOG_DIR": directory}
        os.environ.update(own)
        start = partial(subprocess.Popen, stdout=sys.stderr)
        ros = ["--ros-args", "-p", f"sources:={COUNT}", "-p", f"rate_hz:={RATE_HZ}"]
        processes = [
            start([str(mux), "--ros-args", "--params-file", str(file)]),
            start([sys.executable, str(SOURCES), *ros]),
        ]
        try:
            code = spin([make], [sys.argv[0]])
        finally:
            for process in processes:
                process.terminate()
            for process in processes:
                process.wait()
    return sinks[0].figures() if code == 0 else None


def _parameters() -> str:
    sources = [Source(f"s{number}", topic_of(number), 0.5, 10 * (number + 1)) for number in range(COUNT)]
    lines = ["twist_mux:", "  ros__parameters:"]
    for kind, entries in (("topics", sources), ("locks", LOCKS)):
        lines += [
            f"    {kind}.{entry.name}: {{topic: {entry.topic}, timeout: {entry.timeout_s}, priority: {entry.priority}}}"
            for entry in entries
        ]
    return "\n".join(lines)


def _decision_us(rounds: int = 7, commands: int = 20_000) -> float:
    """Median time of a command [µs], of eight sources in turn with two locks."""
    sources = tuple(Source(str(number), str(number), 0.5, 10 * number) for number in range(1, COUNT + 1))
    command, times_us = Twist(1.0), list[float]()
    for _ in range(rounds):
        mux = Mux(MuxConfig(sources, LOCKS))
        began_s = process_time()
        for number in range(commands):
            mux.hear(number % COUNT, command, number * 1_250_000)
        times_us.append(1e6 * (process_time() - began_s) / commands)
    return median(times_us)
