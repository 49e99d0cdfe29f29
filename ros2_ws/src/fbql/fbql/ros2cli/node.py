"""`ros2 node list | info`."""

from __future__ import annotations

import argparse
from typing import Any

from rclpy.node import Node

from fbql.ros2cli.graph import Absent, absolute, add_graph_options, is_hidden, settle, show, until

VERBS = ("list", "info")
_ACTION = "/_action/"


def add_verbs(verbs: Any) -> None:
    """Adds the command line."""
    parser = verbs.add_parser("list", help="Output a list of available nodes")
    parser.add_argument("-a", "--all", action="store_true", help="Display all nodes even hidden ones")
    parser.add_argument("-c", "--count-nodes", action="store_true", help="Only display the number of nodes discovered")
    add_graph_options(parser)
    parser.set_defaults(work=list_nodes)
    parser = verbs.add_parser("info", help="Output information about a node")
    parser.add_argument("node_name", help="Node name to request information")
    parser.add_argument("--include-hidden", action="store_true", help="Display hidden topics and services as well")
    add_graph_options(parser)
    parser.set_defaults(work=show_info)


def names_of(node: Node) -> list[str]:
    """The full names of the other nodes, sorted."""
    own = node.get_fully_qualified_name()
    found = (f"{namespace.rstrip('/')}/{name}" for name, namespace in node.get_node_names_and_namespaces())
    return sorted(name for name in found if name != own)


def find_node(node: Node, name: str, patience_s: float) -> tuple[str, str]:
    """Name and namespace of a node, once it shows up. Raises LookupError."""
    name = absolute(name)
    if not until(node, lambda: name in names_of(node), patience_s):
        raise LookupError(name)
    namespace, _, base = name.rpartition("/")
    return base, namespace or "/"


def list_nodes(node: Node, arguments: argparse.Namespace) -> None:
    """`ros2 node list`."""
    settle(node, lambda: names_of(node), arguments.spin_time)
    names = [name for name in names_of(node) if arguments.all or not is_hidden(name)]
    show(len(names) if arguments.count_nodes else "\n".join(names))


def show_info(node: Node, arguments: argparse.Namespace) -> None:
    """`ros2 node info`."""
    try:
        place = find_node(node, arguments.node_name, arguments.spin_time)
    except LookupError:
        raise Absent(f"Unable to find node '{arguments.node_name}'") from None

    def found() -> dict[str, list[tuple[str, list[str]]]]:
        return {
            "Subscribers": node.get_subscriber_names_and_types_by_node(*place),
            "Publishers": node.get_publisher_names_and_types_by_node(*place),
            "Service Servers": node.get_service_names_and_types_by_node(*place),
            "Service Clients": node.get_client_names_and_types_by_node(*place),
        }

    settle(node, found, arguments.spin_time)
    show(absolute(arguments.node_name))
    for what, entries in {**found(), "Action Servers": [], "Action Clients": []}.items():
        show(f"  {what}:")
        for name, types in sorted(entries):
            if arguments.include_hidden or not (is_hidden(name) or _ACTION in name):
                show(f"    {name}: {', '.join(types)}")
        if what.startswith(("Service Clients", "Action")):
            show("")
