"""YAML from outside, read as plain data: mappings, lists, texts, numbers, true, false and null, bounded in time and memory.

We, rosbag2 and people write no more than that. Tags and merge keys are refused: they run constructors of their own, or make
a small file endless. Aliases, which rosbag2 wrote before Jazzy, count as what they stand for. The names of a mapping are
texts, whatever they look like.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import yaml
from fbql_common.core.errors import BadInput

MAX_DEPTH = 32
"""Deepest nesting that is read."""
MAX_VALUES = 500_000
"""Most values that are read; those of a bag of ten thousand files are fewer."""
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
# What PyYAML's dumper leaves unquoted has these types in YAML 1.1; what it quotes is a text here too.
_INT = re.compile(r"[-+]?(?:0b[01_]+|0x[0-9a-fA-F_]+|0[0-7_]+|0|[1-9][0-9_]*)\Z")
_FLOAT = re.compile(
    r"(?:[-+]?[0-9][0-9_]*\.[0-9_]*(?:[eE][-+][0-9]+)?|[-+]?\.[0-9][0-9_]*(?:[eE][-+][0-9]+)?"
    r"|(?P<inf>[-+]?\.(?:inf|Inf|INF))|(?P<nan>\.(?:nan|NaN|NAN)))\Z"
)
_WORDS: dict[str, Any] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"), True),
    **dict.fromkeys(("no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"), False),
}
_BITS = 64
_TOO_LARGE = 2**_BITS


def from_yaml(text: bytes | str, where: str) -> Any:
    """The value in a YAML text (UTF-8). Raises BadInput with `where` and the reason."""
    try:
        return _Reader(text if isinstance(text, str) else text.decode("utf-8-sig")).document()
    except UnicodeDecodeError:
        raise BadInput(f"{where}: not YAML (not UTF-8)") from None
    except (yaml.YAMLError, UnicodeEncodeError) as error:
        raise BadInput(f"{where}: not YAML ({str(error).partition(chr(10))[0]})") from None
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None


def mapping_from_yaml(text: bytes | str, where: str) -> dict[str, Any]:
    """The mapping in a YAML text. Raises BadInput."""
    found = from_yaml(text, where)
    if not isinstance(found, dict):
        raise BadInput(f"{where}: not a mapping of names to values")
    return found


class _Reader:
    """Makes values of a parser's events; unlike a loader, it knows how deep it is before it goes there."""

    def __init__(self, text: str) -> None:
        self._events: Iterator[Any] = iter(yaml.parse(text, Loader=_LOADER))
        self._values = 0
        self._deepest = 0
        """Of the value that is being read."""
        self._anchored: dict[str, tuple[Any, int, int]] = {}
        """By anchor: a value, how many values are in it, how many levels it has below its own."""

    def document(self) -> Any:
        next(self._events)  # the stream's start
        event = next(self._events)
        if isinstance(event, yaml.StreamEndEvent):
            return None
        value = self._value(next(self._events), 0)
        next(self._events)  # the document's end
        if not isinstance(next(self._events), yaml.StreamEndEvent):
            raise BadInput("more than one YAML document")
        return value

    def _value(self, event: Any, depth: int) -> Any:
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, depth)
        self._check(event, depth)
        before, outer, self._deepest = self._values, self._deepest, depth
        if isinstance(event, yaml.ScalarEvent):
            value = event.value if event.style else _plain(event)
        elif isinstance(event, yaml.SequenceStartEvent):
            value = self._list(depth + 1)
        else:
            value = self._mapping(depth + 1)
        if event.anchor is not None:
            self._anchored[event.anchor] = value, self._values - before + 1, self._deepest - depth
        self._deepest = max(outer, self._deepest)
        return value

    def _alias(self, event: Any, depth: int) -> Any:
        if event.anchor not in self._anchored:
            raise BadInput(f"{_place(event)}: an alias of nothing, or of itself")
        value, values, levels = self._anchored[event.anchor]
        self._count(event, values, depth + levels)
        self._deepest = max(self._deepest, depth + levels)
        return value

    def _list(self, depth: int) -> list[Any]:
        values: list[Any] = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            values.append(self._value(event, depth))
        return values

    def _mapping(self, depth: int) -> dict[str, Any]:
        found: dict[str, Any] = {}
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent) or (event.value == "<<" and not event.style):
                raise BadInput(f"{_place(event)}: a name that is not a text")
            self._check(event, depth)
            if event.value in found:
                raise BadInput(f"{_place(event)}: '{event.value[:100]}' is there twice")
            found[event.value] = self._value(next(self._events), depth)
        return found

    def _check(self, event: Any, depth: int) -> None:
        """Raises BadInput for what plain data does not have, or too much of it."""
        self._count(event, 1, depth)
        if event.tag is not None:
            raise BadInput(f"{_place(event)}: tags are not read")

    def _count(self, event: Any, values: int, depth: int) -> None:
        self._values += values
        if self._values > MAX_VALUES:
            raise BadInput(f"{_place(event)}: more than {MAX_VALUES} values")
        if depth > MAX_DEPTH:
            raise BadInput(f"{_place(event)}: nested more than {MAX_DEPTH} deep")


def _plain(event: Any) -> Any:
    """The value of a text without quotes."""
    text = event.value
    if text in _WORDS:
        return _WORDS[text]
    if _INT.match(text):
        return _whole_number(event)
    if match := _FLOAT.match(text):
        if match["nan"]:
            return math.nan
        if match["inf"]:
            return -math.inf if text[0] == "-" else math.inf
        return float(text.replace("_", ""))
    return text


def _whole_number(event: Any) -> int:
    digits = event.value.replace("_", "").lower()
    unsigned = digits.lstrip("+-")
    base = {"0b": 2, "0x": 16}.get(unsigned[:2], 8 if unsigned[0] == "0" else 10)
    try:
        number = int(digits, base) if len(digits) <= _BITS + len("-0b") else _TOO_LARGE
    except ValueError:  # 0x_
        number = _TOO_LARGE
    if not -(2 ** (_BITS - 1)) <= number < _TOO_LARGE:
        raise BadInput(f"{_place(event)}: a whole number of more than {_BITS} bits, or not a number")
    return number


def _place(event: Any) -> str:
    return f"line {event.start_mark.line + 1}"
