"""A recording's description of its message types: the ros2msg schema text and the type hash.

Those of the messages of a step are kept in messages.json, so that recordings can be written without ROS. After a
change to a .msg file regenerate it, in a shell of the built workspace: `python -m fbql_recording.message_definitions`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.files import write_atomically

from fbql_recording.core.decoding import TYPES, MessageCodec

_MESSAGES = Path(__file__).with_name("messages.json")
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_PRIMITIVES = frozenset((*_INTEGERS, "bool", "byte", "char", "float32", "float64", "string", "wstring"))
_SEPARATOR = "=" * 80

FindShare = Callable[[str], Path]
"""A package's share directory, from its name."""


class MessageDefinition(NamedTuple):
    """A recording's description of one message type."""

    type_name: str
    """pkg/msg/Name"""
    schema_text: str
    type_hash: str

    @property
    def codec(self) -> MessageCodec[Any]:
        """Encodes the domain type as the bytes that a node publishes, and decodes them."""
        return MessageCodec(self.type_name, self.schema_text)


@cache
def step_messages() -> dict[type[Any], MessageDefinition]:
    """The definitions of the messages of a step, by domain type (World, BehaviorOutput, WheelCommand, Decision)."""
    entries = json.loads(_MESSAGES.read_bytes())
    return {kind: MessageDefinition(name, **entries[name]) for name, kind in TYPES.items()}


def definitions_in(find_share: FindShare) -> dict[str, dict[str, str]]:
    """The content that messages.json should have, from the installed definitions. Raises BadInput."""
    return {
        name: {"schema_text": schema_text(name, find_share), "type_hash": type_hash(name, find_share)} for name in TYPES
    }


def schema_text(type_name: str, find_share: FindShare) -> str:
    """The ros2msg schema of a message type, as rosbag2 writes it.

    The message's own text, then for each message that it contains, directly or not, once: a line of 80 "=", a line
    `MSG: pkg/Name` and its text. The two-part name is what JavaScript readers expect.

    Args:
        type_name: pkg/msg/Name.
        find_share: where packages are.

    Raises:
        BadInput: a definition is missing.
    """
    text = _text_of(type_name, find_share)
    parts = [text]
    known = {type_name}
    waiting = _contained(type_name, text)
    while waiting:
        name = waiting.pop(0)
        if name in known:
            continue
        known.add(name)
        text = _text_of(name, find_share)
        package, _, short = name.split("/")
        parts.append(f"{_SEPARATOR}\nMSG: {package}/{short}\n{text}")
        waiting += _contained(name, text)
    return "\n".join(parts)


def type_hash(type_name: str, find_share: FindShare) -> str:
    """The RIHS01 hash of a message type, as the middleware announces it.

    Raises:
        BadInput: the type's description is missing or does not hold the hash.
    """
    package, _, short = type_name.split("/")
    path = find_share(package) / "msg" / f"{short}.json"
    try:
        description = json.loads(path.read_bytes())
        hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
        return str(hashes[type_name])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadInput(f"{path}: no type hash of {type_name} ({error!r}); build the workspace again") from None


def essence(schema: str) -> set[str]:
    """The definitions in a schema without comments and spaces, regardless of their order."""
    lines = (" ".join(line.split("#", 1)[0].split()) for line in schema.splitlines())
    return set("\n".join(line for line in lines if line).split(_SEPARATOR))


def _text_of(type_name: str, find_share: FindShare) -> str:
    package, _, short = type_name.split("/")
    path = find_share(package) / "msg" / f"{short}.msg"
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{path}: no definition of {type_name} ({error.strerror}); build the workspace again") from None


def _contained(type_name: str, text: str) -> list[str]:
    """The message types of a definition's fields, in order, as pkg/msg/Name."""
    names: list[str] = []
    for line in text.splitlines():
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        # string<=10 and Name[<=5]: the bounds are no part of the name.
        kind = words[0].split("[", 1)[0].split("<", 1)[0]
        if kind in _PRIMITIVES:
            continue
        parts = kind.split("/")
        package = parts[0] if len(parts) > 1 else type_name.split("/")[0]
        names.append(f"{package}/msg/{parts[-1]}")
    return names


def _installed(package: str) -> Path:
    """The share directory of a package of a sourced workspace."""
    prefixes = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    shares = [prefix / "share" / package for prefix in prefixes]
    return next((share for share in shares if share.is_dir()), Path(package))


if __name__ == "__main__":
    write_atomically(_MESSAGES, (json.dumps(definitions_in(_installed), indent=1) + "\n").encode())
