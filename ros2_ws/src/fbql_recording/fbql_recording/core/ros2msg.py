"""The fields of a message, from the schema that a recording holds (ros2msg text), in the order they have on the wire.

Format: the message's own definition, then for each message that it contains, directly or not, a line of 80 "=", a line
`MSG: pkg/Name`, and its definition (the MCAP specification's registry, "ros2msg").
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from fbql_common.core.errors import BadInput

_SEPARATOR = re.compile(r"^={80}$", re.MULTILINE)
_FIELD = re.compile(r"([A-Za-z][\w/]*)(<=\d+)?(\[(<=)?(\d*)\])?\s+([A-Za-z]\w*)\b(?!\s*=)")
_PRIMITIVES = {
    **{name: name for name in ("bool", "float32", "float64", "string")},
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
    "byte": "uint8",
    "char": "uint8",
}
_MAX_DEPTH = 8
_MAX_FIELDS = 4096
_MAX_CHARACTERS = 2**22
"""Limit of the text that is read. A nested message counts each time it occurs: messages without fields of their own
could multiply endlessly."""
_VISIT_CHARACTERS = 80
"""The length that a nested message counts in addition to its text."""


class MessageField(NamedTuple):
    """One value on the wire."""

    name: str
    """Dotted if it is in a nested message, as "header.stamp.sec"; "x[2]" is an element of an array of fixed size."""
    kind: str
    """The kind, as `fbql_common.core.cdr.Codec` names it."""


def fields_of(type_name: str, schema: str) -> list[MessageField]:
    """The fields of a message, those of nested messages in their place.

    Args:
        type_name: pkg/msg/Name.
        schema: ros2msg text.

    Raises:
        BadInput: a definition is missing, contains itself, or has a field of a kind that can't be read.
    """
    own, *others = _SEPARATOR.split(schema)
    texts = {_two_part(type_name): own}
    for part in others:
        head, _, text = part.strip("\n").partition("\n")
        texts[_two_part(head.removeprefix("MSG:").strip())] = text
    fields: list[MessageField] = []
    for field in _Reader(texts).fields(_two_part(type_name)):
        fields.append(field)
        if len(fields) > _MAX_FIELDS:
            raise BadInput(f"the schema of {type_name} has more than {_MAX_FIELDS} fields")
    return fields


class _Reader:
    """Reads the definitions of a message and those in it, by name, within the limits."""

    def __init__(self, texts: dict[str, str]) -> None:
        self._texts = texts
        self._read = 0
        """Characters so far."""

    def fields(self, name: str, prefix: str = "", depth: int = 0) -> Iterator[MessageField]:
        """The fields of a message, those of nested messages in their place. Raises BadInput."""
        if name not in self._texts:
            raise BadInput(f"the schema has no definition of {name}")
        if depth > _MAX_DEPTH:
            raise BadInput(f"the schema nests {name} more than {_MAX_DEPTH} deep")
        text = self._texts[name]
        self._read += len(text) + _VISIT_CHARACTERS
        if self._read > _MAX_CHARACTERS:
            raise BadInput(f"the schema, nested messages included, has more than {_MAX_CHARACTERS} characters")
        for line in text.splitlines():
            match = _FIELD.match(line.split("#", 1)[0].strip())
            if match is None:
                continue  # empty, or a constant
            base, _, array, bounded, count, field = match.groups()
            places = [f"{prefix}{field}"]
            is_sequence = array is not None and (bool(bounded) or not count)
            if array is not None and not is_sequence:
                if len(count) > len(str(_MAX_FIELDS)) or int(count) > _MAX_FIELDS:
                    raise BadInput(f"field {prefix}{field} has {count:.20} values; at most {_MAX_FIELDS} are read")
                places = [f"{prefix}{field}[{index}]" for index in range(int(count))]
            kind = _PRIMITIVES.get(base)
            if kind is None and (is_sequence or base == "wstring"):
                raise BadInput(f"field {prefix}{field} is of type {base}{array or ''}, which is not supported")
            for place in places:
                if kind is None:
                    inner = base if "/" in base else f"{name.split('/')[0]}/{base}"
                    yield from self.fields(_two_part(inner), f"{place}.", depth + 1)
                else:
                    yield MessageField(place, f"sequence<{kind}>" if is_sequence else kind)


def _two_part(name: str) -> str:
    """pkg/Name of pkg/msg/Name."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}"
