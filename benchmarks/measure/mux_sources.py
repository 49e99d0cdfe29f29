"""Sources of a mux, for benchmarks/mux.py: each sends velocity commands whose number and time of sending are their speeds.

To run it alone: python mux_sources.py --ros-args -p sources:=8 -p rate_hz:=100.0 (inside the environment)
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from time import perf_counter

from fbql_common.core.parameters import parameter
from fbql_common.core.twist import Twist
from fbql_common.declare import declare_parameters
from fbql_common.qos import COMMAND_QOS
from fbql_common.spin import GraphNode, spin
from fbql_common.watch import steady_timer
from fbql_common.wire import MESSAGES, encode_twist
from rclpy.publisher import Publisher


def topic_of(number: int) -> str:
    """The topic of a source."""
    return f"source_{number}"


@dataclass(frozen=True)
class SourcesParameters:
    """Parameters of the sources."""

    sources: int = parameter(8, "number of sources", low=1)
    rate_hz: float = parameter(100.0, "commands of each", unit="1/s", low=1.0)


class Sources(GraphNode):
    """All sources in one node."""

    def __init__(self) -> None:
        super().__init__("sources")
        parameters = declare_parameters(self, SourcesParameters)
        self._sent = [0] * parameters.sources
        publishers = [
            self.create_publisher(MESSAGES[Twist], topic_of(number), COMMAND_QOS)
            for number in range(parameters.sources)
        ]
        self._timers_of_sources = [
            steady_timer(self, 1.0 / parameters.rate_hz, partial(self._send, number, publisher))
            for number, publisher in enumerate(publishers)
        ]

    def _send(self, number: int, publisher: Publisher) -> None:
        self._sent[number] += 1
        publisher.publish(encode_twist(Twist(float(self._sent[number]), perf_counter())))


if __name__ == "__main__":
    sys.exit(spin([Sources], sys.argv))
