"""Message classes by name: only message types that are installed are imported."""

from __future__ import annotations

import sys

import pytest
from fbql_common.message_types import is_message_type, message_class
from geometry_msgs.msg import Twist


def test_the_class_of_an_installed_type_is_found() -> None:
    assert message_class("geometry_msgs/msg/Twist") is Twist


@pytest.mark.parametrize(
    "name",
    [
        "this/msg/Zen",
        "os/msg/Path",
        "sensor_msgs/msg/Image3",
        "sensor_msgs/Image",
        "yaml/msg/x",
        "../msg/X",
        "a/msg/B/msg/C",
        "",
    ],
)
def test_nothing_else_is_imported(name: str) -> None:
    sys.modules.pop("this", None)
    assert message_class(name) is None
    assert "this" not in sys.modules


@pytest.mark.parametrize(
    ("name", "is_one"),
    [
        ("this/msg/Zen", True),
        ("a/msg/B2", True),
        ("a/srv/B", False),
        ("a/B", False),
        ("A/msg/B", False),
        ("a/msg/b", False),
    ],
)
def test_a_type_is_a_package_msg_and_a_name(name: str, is_one: bool) -> None:
    assert is_message_type(name) is is_one
