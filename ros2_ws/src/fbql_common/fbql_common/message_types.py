"""Message classes by the name of their type: a name comes from a file, or from another node."""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

from ament_index_python import get_resource

_INTERFACES = "rosidl_interfaces"
"""The resource of the ament index that lists a package's messages."""
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)")


def is_message_type(name: str) -> bool:
    """Whether this can be the name of a message type: PACKAGE/msg/NAME."""
    return _TYPE.fullmatch(name) is not None


def message_class(type_name: str) -> type[Any] | None:
    """The class of a message type, as sensor_msgs/msg/LaserScan; None where there is none.

    Nothing is imported but a package whose messages, by the ament index, include this one: whoever writes a file or
    advertises a topic must not choose what code runs here.
    """
    match = _TYPE.fullmatch(type_name)
    if match is None:
        return None
    package, name = match.groups()
    try:
        if not {f"msg/{name}.msg", f"msg/{name}.idl"} & set(get_resource(_INTERFACES, package)[0].split()):
            return None
        found: type[Any] = getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, LookupError, OSError):
        return None
    return found
