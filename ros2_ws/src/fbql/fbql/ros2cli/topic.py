"""`ros2 topic list | info | echo | hz`."""

from __future__ import annotations

import argparse
import itertools
import statistics
from collections import deque
from collections.abc import Iterable, Mapping
from time import monotonic
from typing import Any

import numpy as np
import rclpy
import yaml
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data

from fbql.ros2cli.graph import Absent, absolute, add_graph_options, class_of, is_hidden, settle, show, until

VERBS = ("list", "info", "echo", "hz")
_WINDOW = 10000
_REPORT_S = 1.0
_LOOK_S = 0.1
"""How often Ctrl-C is noticed while nothing comes [s]."""
_MOST_ITEMS = 128
"""Longer arrays and strings are cut off by echo, unless --full-length is given."""


def add_verbs(verbs: Any) -> None:
    """Adds the command line."""
    parser = verbs.add_parser("list", help="Output a list of available topics")
    parser.add_argument("-t", "--show-types", action="store_true", help="Additionally show the topic type")
    parser.add_argument(
        "-c", "--count-topics", action="store_true", help="Only display the number of topics discovered"
    )
    parser.add_argument("--include-hidden-topics", action="store_true", help="Consider hidden topics as well")
    _finish(parser, list_topics)
    parser = verbs.add_parser("info", help="Print information about a topic")
    parser.add_argument("topic_name", help="Name of the ROS topic to get info (e.g. '/chatter')")
    parser.add_argument("-v", "--verbose", action="store_true", help="Prints detailed information about its endpoints")
    _finish(parser, show_info)
    parser = verbs.add_parser("echo", help="Output messages from a topic")
    parser.add_argument("topic_name", help="Name of the ROS topic to listen to (e.g. '/chatter')")
    parser.add_argument("message_type", nargs="?", help="Type of the ROS message (e.g. 'std_msgs/msg/String')")
    parser.add_argument("--once", action="store_true", help="Print the first message received and then exit")
    parser.add_argument("--field", metavar="EXPR", help="Echo a selected field of a message, such as header.stamp")
    parser.add_argument("-f", "--full-length", action="store_true", help="Output all elements of arrays and strings")
    _finish(parser, echo)
    parser = verbs.add_parser("hz", help="Print the average receiving rate to screen")
    parser.add_argument("topic_name", help="Name of the ROS topic to listen to (e.g. '/chatter')")
    parser.add_argument(
        "-w", "--window", type=int, default=_WINDOW, metavar="WINDOW", help=f"Window size, in messages ({_WINDOW})"
    )
    _finish(parser, measure_rate)


def _finish(parser: argparse.ArgumentParser, work: Any) -> None:
    add_graph_options(parser)
    parser.set_defaults(work=work)


def list_topics(node: Node, arguments: argparse.Namespace) -> None:
    """`ros2 topic list`."""
    settle(node, node.get_topic_names_and_types, arguments.spin_time)
    topics = sorted(node.get_topic_names_and_types())
    topics = [(name, types) for name, types in topics if arguments.include_hidden_topics or not is_hidden(name)]
    if arguments.count_topics:
        print(len(topics))
        return
    for name, types in topics:
        show(f"{name} [{', '.join(types)}]" if arguments.show_types else name)


def show_info(node: Node, arguments: argparse.Namespace) -> None:
    """`ros2 topic info`."""
    name = absolute(arguments.topic_name)
    if not until(node, lambda: _types(node, name), arguments.spin_time):
        raise Absent(f"Unknown topic '{name}'")

    def endpoints() -> tuple[list[Any], list[Any]]:
        return node.get_publishers_info_by_topic(name), node.get_subscriptions_info_by_topic(name)

    settle(node, lambda: [len(each) for each in endpoints()], arguments.spin_time)
    types = _types(node, name)
    show(f"Type: {types[0] if len(types) == 1 else types}")
    for what, found in zip(("Publisher", "Subscription"), endpoints(), strict=True):
        blank = "\n" if arguments.verbose else ""
        show(f"{blank}{what} count: {len(found)}")
        for endpoint in found if arguments.verbose else ():
            show(f"\n{endpoint}")


def echo(node: Node, arguments: argparse.Namespace) -> None:
    """`ros2 topic echo`."""
    name = absolute(arguments.topic_name)
    kind = class_of(arguments.message_type or _type(node, name, arguments.spin_time))
    until(node, lambda: node.count_publishers(name), 0.0 if arguments.message_type else arguments.spin_time)
    printed = False

    def hear(message: Any) -> None:
        nonlocal printed
        if printed and arguments.once:
            return
        printed = True
        show(f"{_text(message, arguments.field, arguments.full_length)}---")

    node.create_subscription(kind, name, hear, _matching_qos(node, name))
    while not (printed and arguments.once):
        rclpy.spin_once(node, timeout_sec=_LOOK_S)


def measure_rate(node: Node, arguments: argparse.Namespace) -> None:
    """`ros2 topic hz`."""
    name = absolute(arguments.topic_name)
    if arguments.window < 1:
        raise Absent("window size must be 1 or more")
    kind = class_of(_type(node, name, arguments.spin_time))
    came_s: deque[float] = deque(maxlen=arguments.window + 1)
    node.create_subscription(kind, name, lambda _: came_s.append(monotonic()), qos_profile_sensor_data, raw=True)
    reported_s, reported = monotonic(), -1.0
    while True:
        rclpy.spin_once(node, timeout_sec=_LOOK_S)
        now = monotonic()
        if now - reported_s >= _REPORT_S and len(came_s) > 1 and came_s[-1] != reported:
            reported_s, reported = now, came_s[-1]
            print(rate_text(list(came_s)), flush=True)


def rate_text(came_s: list[float]) -> str:
    """The rate of messages that came at these times [s], two or more, as `ros2 topic hz` prints it."""
    apart = [after - before for before, after in itertools.pairwise(came_s)]
    mean = statistics.fmean(apart)
    deviation = statistics.pstdev(apart, mean)
    rate = 1.0 / mean if mean > 0.0 else 0.0
    return (
        f"average rate: {rate:.3f}\n"
        f"\tmin: {min(apart):.3f}s max: {max(apart):.3f}s std dev: {deviation:.5f}s window: {len(apart)}"
    )


def _types(node: Node, name: str) -> list[str]:
    return dict(node.get_topic_names_and_types()).get(name, [])


def _type(node: Node, name: str, patience_s: float) -> str:
    """The type of a topic, once it shows up. Raises Absent."""
    if not until(node, lambda: _types(node, name), patience_s):
        raise Absent(
            f"WARNING: topic [{name}] does not appear to be published yet",
            "Could not determine the type for the passed topic",
        )
    types = _types(node, name)
    if len(types) > 1:
        raise Absent(f"Cannot echo topic '{name}', as it contains more than one type: [{', '.join(types)}]")
    return types[0]


def _matching_qos(node: Node, name: str) -> QoSProfile:
    """A quality of service that every publisher of a topic satisfies."""
    offered = [each.qos_profile for each in node.get_publishers_info_by_topic(name)]
    qos = QoSProfile(depth=10)
    if any(each.reliability is not ReliabilityPolicy.RELIABLE for each in offered):
        qos.reliability = ReliabilityPolicy.BEST_EFFORT
    if offered and all(each.durability is DurabilityPolicy.TRANSIENT_LOCAL for each in offered):
        qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return qos


def _text(message: Any, field: str | None, full_length: bool) -> str:
    """A message, or a field of it, as YAML."""
    for part in (field or "").split("."):
        if part and part not in message.get_fields_and_field_types():
            raise Absent(f"Invalid field '{field}': '{type(message).__name__}' has no field '{part}'")
        message = getattr(message, part) if part else message
    value = _plain(message, full_length)
    text = yaml.dump(value, sort_keys=False, allow_unicode=True, width=float("inf"))
    if not all(line.isprintable() for line in text.split("\n")):
        text = yaml.dump(
            value, sort_keys=False, width=float("inf")
        )  # YAML leaves marks that turn the direction of writing
    return text.removesuffix("...\n")


def _plain(value: Any, full_length: bool) -> Any:
    """A value of a message in types that YAML has."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _plain(getattr(value, name), full_length) for name in value.get_fields_and_field_types()}
    if isinstance(value, str):
        return value if full_length or len(value) <= _MOST_ITEMS else f"{value[:_MOST_ITEMS]}..."
    if isinstance(value, bytes | bytearray):
        value = list(value)
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Iterable) and not isinstance(value, Mapping):
        items = list(value)
        kept = [_plain(item, full_length) for item in (items if full_length else items[:_MOST_ITEMS])]
        return kept if len(kept) == len(items) else [*kept, "..."]
    return value
