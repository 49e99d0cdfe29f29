"""Declares a parameter dataclass (fbql_common.core.parameters) on a node and reads it back, once, before the first step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import Limits, defaults_of, from_mapping, groups_among, limits_of, types_of

T = TypeVar("T")

_TYPES = {
    bool: Parameter.Type.BOOL,
    int: Parameter.Type.INTEGER,
    float: Parameter.Type.DOUBLE,
    str: Parameter.Type.STRING,
    list[str]: Parameter.Type.STRING_ARRAY,
}
_INT64 = 2**63 - 1
_ALWAYS_THERE = ("use_sim_time", "start_type_description_service")


def _descriptor(kind: Any, limits: Limits) -> ParameterDescriptor:
    unit = f" [{limits.unit}]" if limits.unit else ""
    descriptor = ParameterDescriptor(description=f"{limits.description}{unit}", read_only=True)
    if limits.choices is not None:
        descriptor.additional_constraints = f"one of: {', '.join(limits.choices)}"
    if kind is int:
        low = -_INT64 if limits.low is None else int(limits.low)
        high = _INT64 if limits.high is None else int(limits.high)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=0)]
    if kind is float:
        low = -1e308 if limits.low is None else float(limits.low)
        high = 1e308 if limits.high is None else float(limits.high)
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
    return descriptor


def given_text(node: Node, name: str) -> str:
    """The text that a node is given for a parameter, before it is declared; "" where it is given none."""
    given = node._parameter_overrides.get(name)
    return given.value if given is not None and isinstance(given.value, str) else ""


def declare_parameters[T](node: Node, declaration: type[T]) -> T:
    """Declares every field as a read-only parameter with type, range and description; returns the typed values.

    Raises:
        BadInput: a parameter that the node does not know (a misspelt name in a YAML file would otherwise be
            ignored silently), one of a wrong type, or one out of its range.
    """
    return declare_all(node, declaration)[0]


def is_given(node: Node, name: str) -> bool:
    """Whether a node is given a parameter, before it is declared."""
    return name in node._parameter_overrides


def declare_all(
    node: Node,
    *declarations: type[Any],
    groups: Mapping[str, type[Any]] | None = None,
    defaults: Mapping[str, Any] | None = None,
) -> tuple[Any, ...]:
    """declare_parameters for several declarations that share one node.

    Args:
        defaults: of fields, in the place of their declarations'.
        groups: the declaration of the parameters PREFIX.NAME.FIELD for each prefix; `declare_group` declares those.
    """
    where = node.get_fully_qualified_name()
    known = [name for declaration in declarations for name in types_of(declaration)]
    for name in known:
        if known.count(name) > 1:
            raise BadInput(f"{where}: parameter '{name}' is declared by two parts; rename your own")
    groups = groups or {}
    for name in node._parameter_overrides:
        if name in known or name in _ALWAYS_THERE or name.startswith("qos_overrides."):
            continue
        prefix, _, rest = name.partition(".")
        if prefix not in groups or rest.rpartition(".")[2] not in types_of(groups[prefix]) or "." not in rest:
            of_groups = [f"{prefix}.NAME.{field}" for prefix, group in groups.items() for field in types_of(group)]
            raise BadInput(f"{where}: unknown parameter '{name}'; known are: {', '.join([*known, *of_groups])}")
    return tuple(
        _declare(
            node,
            declaration,
            where,
            defaults={name: value for name, value in (defaults or {}).items() if name in types_of(declaration)},
        )
        for declaration in declarations
    )


def declare_group[T](node: Node, prefix: str, declaration: type[T], **defaults: Any) -> dict[str, T]:
    """Declares PREFIX.NAME.FIELD for every NAME that the node is given some for, as `declare_parameters` does.

    Call it after `declare_all`, which refuses unknown fields. The order is that of `groups_among`.

    Args:
        defaults: of fields, in the place of the declaration's.

    Raises:
        BadInput: as declare_parameters, and a required field that is not given.
    """
    where = node.get_fully_qualified_name()
    groups = groups_among(node._parameter_overrides, prefix)
    return {
        group.removeprefix(f"{prefix}."): _declare(node, declaration, where, f"{group}.", defaults) for group in groups
    }


def _declare[T](
    node: Node, declaration: type[T], where: str, prefix: str = "", defaults: Mapping[str, Any] | None = None
) -> T:
    kinds, limits, values = types_of(declaration), limits_of(declaration), {}
    for field, default in {**defaults_of(declaration), **(defaults or {})}.items():
        name, kind = prefix + field, kinds[field]
        given = node._parameter_overrides.get(name)
        if given is not None and given.type_ == Parameter.Type.NOT_SET and default == []:
            given = None  # that is how rcl reads an empty list
        if given is None and limits[field].required:
            raise BadInput(f"{where}: parameter '{name}' is missing")
        if given is not None:
            from_mapping(declaration, {field: _value_of(given, kind, where)}, where, prefix)
        # The type of an empty list can't be inferred from its value.
        declared = _TYPES[kind] if default == [] else default
        descriptor = _descriptor(kind, limits[field])
        try:
            values[field] = node.declare_parameter(name, declared, descriptor, ignore_override=given is None).value
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise BadInput(f"{where}: {error}") from None
        if kind == list[str]:
            values[field] = list(values[field] or [])
    return from_mapping(declaration, values, where, prefix)


def _value_of(given: Parameter, kind: Any, where: str) -> Any:
    if given.type_ != _TYPES[kind]:
        hint = f"; write {given.value}.0" if kind is float and type(given.value) is int else ""
        if kind is str and type(given.value) in (bool, int, float):
            hint = "; put it in quotes"
            if type(given.value) is bool:
                hint += ", without which YAML takes y, n, yes, no, on and off for bools"
        what = "empty" if given.value is None else f"{given.type_.name.lower()} {given.value!r}"
        raise BadInput(f"{where}: parameter '{given.name}' must be {_TYPES[kind].name.lower()}, not {what}{hint}")
    return list(given.value) if kind == list[str] else given.value
