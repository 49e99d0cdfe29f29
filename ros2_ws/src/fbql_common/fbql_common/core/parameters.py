"""Parameters are fields of frozen dataclasses: type, default, unit, bounds and description in one declaration.

    @dataclass(frozen=True)
    class SimulatorParameters:
        seed: int = parameter(0, "seed of the first episode", low=0)

The same declaration serves a node (`fbql_common.declare`), a command line and the run's config.yaml. Where one node has
parameters of several parts, each part declares its own, under its name (`owned_by`), and the node's declaration inherits
from all of them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar, get_type_hints

from fbql_common.core.errors import BadInput
from fbql_common.core.text import quoted

T = TypeVar("T")
_INT64 = 2**63 - 1


class Limits(NamedTuple):
    """The values that a parameter may have, and their meaning."""

    description: str
    unit: str
    low: float | None
    high: float | None
    choices: Sequence[str] | None
    owners: tuple[str, ...] = ()
    """The parts that use it; empty: all of them."""
    required: bool = False
    """Whether it must be given; its default then only determines its type."""


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: Sequence[str] | None = None,
    required: bool = False,
) -> Any:
    """A dataclass field with its limits. `low` and `high` belong to the range."""
    limits = Limits(description, unit, low, high, choices, required=required)
    if isinstance(default, list):
        values: list[Any] = list(default)  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]
        return dataclasses.field(default_factory=lambda: list(values), metadata={"limits": limits})
    return dataclasses.field(default=default, metadata={"limits": limits})


def owned_by[D](*owners: str) -> Callable[[type[D]], type[D]]:
    """A class decorator, above @dataclass: the parameters that the declaration adds are used by these parts alone."""

    def stamp(declaration: type[D]) -> type[D]:
        for field in dataclasses.fields(declaration):  # pyright: ignore[reportArgumentType]
            if field.name in declaration.__annotations__:
                limits: Limits = field.metadata["limits"]
                field.metadata = MappingProxyType({"limits": limits._replace(owners=owners)})
        return declaration

    return stamp


def limits_of(declaration: type[Any]) -> dict[str, Limits]:
    """The limits of every parameter of a declaration, in order."""
    return {field.name: field.metadata["limits"] for field in dataclasses.fields(declaration)}


def types_of(declaration: type[Any]) -> dict[str, Any]:
    """The type of every parameter of a declaration, in order."""
    hints = get_type_hints(declaration)
    return {field.name: hints[field.name] for field in dataclasses.fields(declaration)}


def defaults_of(declaration: type[Any]) -> dict[str, Any]:
    """The default of every parameter of a declaration, in order."""
    instance = declaration()
    return {field.name: getattr(instance, field.name) for field in dataclasses.fields(declaration)}


def groups_among(names: Iterable[str], prefix: str) -> list[str]:
    """The groups PREFIX.NAME that parameters PREFIX.NAME.FIELD among `names` belong to, in the order in which
    `list_parameters` of a C++ node lists its prefixes: sorted by the bytes of the parameters."""
    found = [name.rpartition(".")[0] for name in sorted(names, key=str.encode) if name.startswith(f"{prefix}.")]
    return [group for group in dict.fromkeys(found) if group != prefix]


def from_mapping[T](declaration: type[T], values: Mapping[str, Any], where: str, prefix: str = "") -> T:
    """Makes a declaration's instance from values, each checked. Errors name a parameter with its prefix.

    Raises:
        BadInput: an unknown name, a wrong type, a value that is not finite or outside of its range.
    """
    known = types_of(declaration)
    unknown = sorted(set(values) - set(known))
    if unknown:
        raise BadInput(f"{where}: unknown parameter '{unknown[0]}'; known are: {', '.join(known)}")
    instance = declaration(**values)
    check(instance, where, prefix)
    return instance


def check(instance: Any, where: str, prefix: str = "") -> None:
    """Raises BadInput naming the first parameter whose value is of a wrong type or out of range."""
    declaration: type[Any] = instance.__class__
    kinds = types_of(declaration)
    for field, limits in limits_of(declaration).items():
        value = getattr(instance, field)
        name, kind = prefix + field, kinds[field]
        if not _is_of(value, kind):
            raise BadInput(f"{where}: parameter '{name}' must be {_name_of(kind)}, not {quoted(value)}")
        if limits.choices is not None and value not in limits.choices:
            raise BadInput(
                f"{where}: parameter '{name}' is {quoted(value)}; choose one of: {', '.join(limits.choices)}"
            )
        if kind is int or kind is float:
            # A whole number travels as int64.
            unbounded = _INT64 if kind is int else math.inf
            low = -unbounded if limits.low is None else limits.low
            high = unbounded if limits.high is None else limits.high
            if not low <= value <= high or not math.isfinite(value):
                unit = f" {limits.unit}" if limits.unit else ""
                raise BadInput(f"{where}: parameter '{name}' is {quoted(value)}, outside of [{low:g}, {high:g}]{unit}")


def _is_of(value: Any, kind: Any) -> bool:
    if kind is float:
        return isinstance(value, float)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    if kind == list[str]:
        return isinstance(value, list) and all(isinstance(item, str) for item in value)  # pyright: ignore[reportUnknownVariableType]
    return isinstance(value, kind)


def _name_of(kind: Any) -> str:
    names = {float: "a decimal number", int: "a whole number", str: "a text", bool: "true or false"}
    return names.get(kind, str(kind))
