"""Checks arguments of the functions of `import fbql`: one of another type than declared is refused in one line."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from fbql_common.core.errors import BadInput
from fbql_common.core.text import quoted

from fbql.match.options import plain

_MOST_SHOWN = 60
"""Characters of a value that an error shows."""


def checked[**P, R](function: Callable[P, R]) -> Callable[P, R]:
    """The function, which raises BadInput for an argument that is not of its declared type.

    Scalars of NumPy, and arrays without dimensions, become Python's. The items of sequences and mappings are looked at too, but not those of iterators.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        types = get_type_hints(function)
        bound = signature.bind(*args, **kwargs)
        for name, value in bound.arguments.items():
            parameter = signature.parameters[name]
            if parameter.kind is inspect.Parameter.VAR_KEYWORD:
                continue
            bound.arguments[name] = plain(value)
            if not _is_of(bound.arguments[name], types[name]):
                shown = quoted(value)
                shown = shown if len(shown) <= _MOST_SHOWN else f"{shown[:_MOST_SHOWN]}..."
                raise BadInput(f"{name} is {shown}; expected {parameter.annotation}")
        return function(*bound.args, **bound.kwargs)

    return call


def _is_of(value: Any, kind: Any) -> bool:
    origin, inner = get_origin(kind), get_args(kind)
    if origin is UnionType:
        return any(_is_of(value, each) for each in inner)
    if origin is Sequence:
        return (
            isinstance(value, Sequence) and not isinstance(value, str) and all(_is_of(each, inner[0]) for each in value)
        )
    if origin is Mapping:
        items: Mapping[Any, Any] = value if isinstance(value, Mapping) else {None: None}
        return all(_is_of(key, inner[0]) and _is_of(each, inner[1]) for key, each in items.items())
    if kind is Any:
        return True
    return isinstance(value, kind) and (kind is not int or not isinstance(value, bool))
