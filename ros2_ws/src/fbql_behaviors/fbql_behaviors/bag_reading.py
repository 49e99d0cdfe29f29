"""Bags recorded elsewhere: rosbag2 in MCAP or SQLite 3, read by the library `rosbags`, without ROS.

Only this module and `bag_limits` need `rosbags`. Of each message only the values that a specification asks for are kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from fbql_common.checkout import how_to_install
from fbql_common.core.errors import BadInput, in_one_line
from fbql_common.core.field_path import parse_path
from fbql_common.files import read_file
from fbql_recording.plain_yaml import from_yaml

from fbql_behaviors.bag_limits import check_mcap, check_type, set_limits
from fbql_behaviors.core.bag_patterns import Event
from fbql_behaviors.core.bag_spec import TWIST, TWIST_STAMPED, Spec, spec_of
from fbql_behaviors.core.senses import Senses

MAX_SPEC_BYTES = 2**20


class Bag(NamedTuple):
    """The parts of a bag that a specification needs."""

    events: list[Event]
    types: dict[str, str]
    """The message type of each topic of the specification."""


def load_spec(path: Path) -> Spec:
    """The specification in a YAML file. Raises BadInput, with file and reason."""
    data = read_file(path, MAX_SPEC_BYTES)
    try:
        return spec_of(from_yaml(data, "specification"))
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None


def read_bag(path: Path, spec: Spec) -> Bag:
    """The messages of a bag (a directory, an .mcap or a .db3 file) on a specification's topics.

    Raises BadInput, with bag and reason: it is damaged, lacks a topic or field, or a topic has a type that does not serve.
    """
    library = _rosbags()
    if not path.exists():
        raise BadInput(f"{path}: there is no such bag")
    try:
        _check_mcap(path)
        reader = library.highlevel.AnyReader(
            [path], default_typestore=library.typesys.get_typestore(library.typesys.Stores.ROS2_JAZZY)
        )
        with reader:
            return _read(reader, spec)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
    except FileNotFoundError:
        raise BadInput(f"{path}: not a bag: it lacks metadata.yaml, or is not an .mcap or .db3 file") from None
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}") from None
    except Exception as error:  # a damaged bag fails in the middle of whatever decodes it
        raise BadInput(f"{path}: this bag is damaged, or not a ROS 2 bag ({in_one_line(error)})") from None


def _rosbags() -> Any:
    try:
        import_module("rosbags.highlevel")
        import_module("rosbags.typesys")
        library = import_module("rosbags")
    except ModuleNotFoundError:
        raise BadInput(f"bags need the package rosbags, which is not installed: {how_to_install('bags')}") from None
    set_limits()
    return library


def _check_mcap(path: Path) -> None:
    """Reads the MCAP files with their checksums. Raises what `check_mcap` raises."""
    for file in sorted(path.glob("*.mcap")) if path.is_dir() else [path] if path.suffix == ".mcap" else []:
        with file.open("rb") as stream:
            check_mcap(stream)


def _read(reader: Any, spec: Spec) -> Bag:
    types = _types(reader.connections, spec)
    for name in types.values():
        check_type(reader.typestore.fielddefs, name)
    senses = Senses(spec)
    inside = "twist." if types[spec.command_topic] == TWIST_STAMPED else ""
    axes = [parse_path(f"{inside}{axis.name}") for axis in spec.commands.axes]
    wanted = [connection for connection in reader.connections if connection.topic in types]
    events: list[Event] = []
    for topic, stamp_ns, message in _messages(reader, wanted):
        is_command = topic == spec.command_topic
        numbers = tuple([axis.read(message) for axis in axes]) if is_command else senses.read(topic, message)
        events.append(Event(stamp_ns, topic, numbers))
    return Bag(events, types)


def _messages(reader: Any, wanted: list[Any]) -> Iterator[tuple[str, int, Any]]:
    for connection, stamp_ns, data in reader.messages(wanted):
        yield connection.topic, stamp_ns, reader.deserialize(data, connection.msgtype)


def _types(connections: list[Any], spec: Spec) -> dict[str, str]:
    there: dict[str, set[str]] = {}
    for connection in connections:
        there.setdefault(connection.topic, set()).add(connection.msgtype)
    types: dict[str, str] = {}
    for topic in (spec.command_topic, *spec.topics):
        if topic not in there:
            listed = ", ".join(sorted(there)) or "none"
            raise BadInput(f"there is no topic {topic} in this bag; it has: {listed}")
        if len(there[topic]) > 1:
            raise BadInput(f"topic {topic} has messages of two types: {', '.join(sorted(there[topic]))}")
        (types[topic],) = there[topic]
    if types[spec.command_topic] not in (TWIST, TWIST_STAMPED):
        raise BadInput(
            f"the command's topic {spec.command_topic} is of type {types[spec.command_topic]}; expected {TWIST} or "
            f"{TWIST_STAMPED}"
        )
    return types
