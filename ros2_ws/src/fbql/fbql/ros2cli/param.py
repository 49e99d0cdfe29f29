"""`ros2 param list | get`."""

from __future__ import annotations

import argparse
from typing import Any

from fbql_common.core.text import one_line
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node

from fbql.ros2cli.graph import PATIENCE_S, Absent, add_graph_options, is_hidden, settle, show, until
from fbql.ros2cli.node import find_node, names_of

VERBS = ("list", "get")
_KINDS = {
    ParameterType.PARAMETER_BOOL: ("Boolean value is:", "bool_value"),
    ParameterType.PARAMETER_INTEGER: ("Integer value is:", "integer_value"),
    ParameterType.PARAMETER_DOUBLE: ("Double value is:", "double_value"),
    ParameterType.PARAMETER_STRING: ("String value is:", "string_value"),
    ParameterType.PARAMETER_BYTE_ARRAY: ("Byte values are:", "byte_array_value"),
    ParameterType.PARAMETER_BOOL_ARRAY: ("Boolean values are:", "bool_array_value"),
    ParameterType.PARAMETER_INTEGER_ARRAY: ("Integer values are:", "integer_array_value"),
    ParameterType.PARAMETER_DOUBLE_ARRAY: ("Double values are:", "double_array_value"),
    ParameterType.PARAMETER_STRING_ARRAY: ("String values are:", "string_array_value"),
}


def add_verbs(verbs: Any) -> None:
    """Adds the command line."""
    parser = verbs.add_parser("list", help="Output a list of available parameters")
    parser.add_argument("node_name", nargs="?", help="Name of the ROS node")
    parser.add_argument("--include-hidden-nodes", action="store_true", help="Consider hidden nodes as well")
    add_graph_options(parser)
    parser.set_defaults(work=list_parameters)
    parser = verbs.add_parser("get", help="Get parameter")
    parser.add_argument("node_name", help="Name of the ROS node")
    parser.add_argument("parameter_name", help="Name of the parameter")
    parser.add_argument("--hide-type", action="store_true", help="Hide the type information")
    add_graph_options(parser)
    parser.set_defaults(work=get_parameter)


def list_parameters(node: Node, arguments: argparse.Namespace) -> None:
    """`ros2 param list`."""
    if arguments.node_name is not None:
        for name in _names(node, _full_name(node, arguments.node_name, arguments.spin_time)):
            show(f"  {name}")
        return
    settle(node, lambda: names_of(node), arguments.spin_time)
    services = {name for name, _ in node.get_service_names_and_types()}
    for each in names_of(node):
        if f"{each}/list_parameters" in services and (arguments.include_hidden_nodes or not is_hidden(each)):
            show(f"{each}:")
            for name in _names(node, each):
                show(f"  {name}")


def get_parameter(node: Node, arguments: argparse.Namespace) -> None:
    """`ros2 param get`."""
    full_name = _full_name(node, arguments.node_name, arguments.spin_time)
    request = GetParameters.Request(names=[arguments.parameter_name])
    values = _ask(node, GetParameters, f"{full_name}/get_parameters", request).values
    if not values or values[0].type == ParameterType.PARAMETER_NOT_SET:
        raise Absent("Parameter not set")
    words, value = _in_words(values[0])
    show(one_line(value if arguments.hide_type else f"{words} {value}"))


def _in_words(value: ParameterValue) -> tuple[str, Any]:
    if value.type not in _KINDS:
        raise Absent(f"Unknown parameter type '{value.type}'")
    words, field = _KINDS[value.type]
    held = getattr(value, field)
    return words, held if isinstance(held, bool | int | float | str) else list(held)


def _full_name(node: Node, name: str, patience_s: float) -> str:
    try:
        base, namespace = find_node(node, name, patience_s)
    except LookupError:
        raise Absent("Node not found") from None
    return f"{namespace.rstrip('/')}/{base}"


def _names(node: Node, full_name: str) -> list[str]:
    answer = _ask(node, ListParameters, f"{full_name}/list_parameters", ListParameters.Request())
    return sorted(answer.result.names)


def _ask(node: Node, kind: Any, service: str, request: Any) -> Any:
    """The answer of a service. Raises Absent when none comes."""
    client = node.create_client(kind, service)
    try:
        if client.wait_for_service(timeout_sec=PATIENCE_S):
            answer = client.call_async(request)
            if until(node, answer.done, PATIENCE_S) and answer.result() is not None:
                return answer.result()
        raise Absent(f"{service} does not answer")
    finally:
        node.destroy_client(client)
