"""A process that sends velocity commands as a source does, each with the steady clock's time as its speed.

python twist_source.py TOPIC PERIOD_S --ros-args -r __ns:=NAMESPACE
"""

from __future__ import annotations

import sys
from time import monotonic

from fbql_common.core.twist import Twist
from fbql_common.qos import COMMAND_QOS
from fbql_common.spin import GraphNode, spin
from fbql_common.watch import steady_timer
from fbql_common.wire import MESSAGES, encode_twist

OWN_MARK = 1.0


def main(topic: str, period_s: float, arguments: list[str]) -> int:
    """Sends until it is ended."""

    def make() -> GraphNode:
        node = GraphNode("twist_source")
        publisher = node.create_publisher(MESSAGES[Twist], topic, COMMAND_QOS)
        now = lambda: publisher.publish(encode_twist(Twist(monotonic(), OWN_MARK)))  # noqa: E731
        steady_timer(node, period_s, now)
        return node

    return spin([make], [sys.argv[0], *arguments])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], float(sys.argv[2]), sys.argv[3:]))
