"""Numbers out of messages by the path of a field."""

from __future__ import annotations

from dataclasses import dataclass, field, make_dataclass
from math import cos, inf, isnan, nan, pi, sin
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.field_path import parse_path


@dataclass
class Quaternion:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


@dataclass
class Limits:
    """A field with the name of a reduction."""

    max: float = 6.0


@dataclass
class Message:
    """Fields as a ROS message has them."""

    ranges: Any = field(default_factory=lambda: np.array([3.0, 1.0, 2.0, 5.0, 4.0], np.float32))
    orientation: Quaternion = field(default_factory=Quaternion)
    name: str = "base"
    on: bool = True
    speed: float = 0.25
    parts: Any = field(default_factory=lambda: [Quaternion(x=7.0)])
    min: float = 9.0
    limits: Limits = field(default_factory=Limits)


def read(text: str, message: Any = None, **options: Any) -> float:
    return parse_path(text).read(Message() if message is None else message, **options)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("speed", 0.25),
        ("on", 1.0),
        ("ranges[1]", 1.0),
        ("ranges[-1]", 4.0),
        ("parts[0].x", 7.0),
        ("ranges[0:3].min", 1.0),
        ("ranges[0:3].mean", 2.0),
        ("ranges[0:3].max", 3.0),
        ("ranges[:].max", 5.0),
        ("ranges[-2:].min", 4.0),
        ("ranges[3:5,0:1].mean", 4.0),
        ("ranges[-5]", 3.0),
        ("ranges[-5:1].max", 3.0),
        ("ranges[4:5].min", 4.0),
        ("ranges[1:-1].max", 5.0),
        ("min", 9.0),
        ("limits.max", 6.0),
    ],
)
def test_a_path_leads_to_a_number(text: str, value: float) -> None:
    assert read(text) == value


@pytest.mark.parametrize("yaw", [-3.0, -pi / 2, 0.0, 0.3, pi / 2, 3.1])
def test_yaw_is_the_heading_of_a_quaternion(yaw: float) -> None:
    message = Message(orientation=Quaternion(z=sin(yaw / 2), w=cos(yaw / 2)))
    assert read("orientation.yaw", message) == pytest.approx(yaw)


def test_yaw_does_not_depend_on_the_quaternion_s_length_and_roll() -> None:
    roll, yaw = 0.4, 1.1
    z_then_x = Quaternion(
        x=cos(yaw / 2) * sin(roll / 2), y=sin(yaw / 2) * sin(roll / 2), z=sin(yaw / 2) * cos(roll / 2), w=cos(yaw / 2) * cos(roll / 2)
    )  # fmt: skip
    longer = Quaternion(*(2.0 * getattr(z_then_x, name) for name in "xyzw"))
    assert read("orientation.yaw", Message(orientation=z_then_x)) == pytest.approx(yaw)
    assert read("orientation.yaw", Message(orientation=longer)) == pytest.approx(yaw)


def test_a_quaternion_of_zeros_has_no_yaw() -> None:
    assert isnan(read("orientation.yaw", Message(orientation=Quaternion(w=0.0))))


def test_elements_that_are_no_number_are_left_out() -> None:
    message = Message(ranges=np.array([nan, 2.0, 4.0, nan]))
    assert read("ranges[:].mean", message) == 3.0
    assert isnan(read("ranges[3:].min", message))


def test_the_mean_of_both_infinities_is_no_number_and_that_of_the_largest_numbers_is_one() -> None:
    message = Message(ranges=np.array([inf, -inf, 1.0, 1.5e308, 1.7e308]))
    assert isnan(read("ranges[0:3].mean", message))
    assert (read("ranges[1:3].mean", message), read("ranges[0:1,2:3].mean", message)) == (-inf, inf)
    assert read("ranges[3:5].mean", message) == 1.6e308


def test_inf_stays_unless_it_counts_as_something() -> None:
    message = Message(ranges=np.array([inf, inf, 2.0]), speed=inf)
    assert (read("ranges[0:2].min", message), read("ranges[:].min", message)) == (inf, 2.0)
    assert read("ranges[:].mean", message, inf_as=5.0) == 4.0
    assert read("speed", message, inf_as=5.0) == 5.0


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("height", "there is no 'height'; it has ranges, orientation, name"),
        ("speed.x", "there is no 'x'; that is a float"),
        ("name", "'name' is a text, not a number"),
        ("orientation", "not a number; it has x, y, z, w"),
        ("ranges", r"not a number; take an element, such as \[0\]"),
        ("ranges[5]", r"\[5\] is out of range, the array has 5 elements"),
        ("ranges[0:6].min", r"slice \[0:6\] is empty or out of range, the array has 5 elements"),
        ("ranges[-6]", r"\[-6\] is out of range, the array has 5 elements"),
        ("ranges[-6:2].min", r"slice \[-6:2\] is empty or out of range, the array has 5 elements"),
        ("ranges[3:3].min", "empty or out of range"),
        ("name[0:2].min", "is a text, not an array"),
        ("speed[0]", "not an array"),
        ("parts[0:1].min", "does not hold numbers"),
        ("ranges.yaw", "yaw needs a quaternion, but that is an array"),
    ],
)
def test_what_a_message_does_not_have_is_refused_with_what_it_has(text: str, problem: str) -> None:
    with pytest.raises(BadInput, match=problem):
        read(text)


@pytest.mark.parametrize(
    "text", ["", ".", "a..b", "a b", "a[", "a[x]", "a[1:2", "a[1:2]", "a[1:2].sum", "a[0:1].min.x", "a[]", "_a"]
)
def test_what_is_no_path_is_refused(text: str) -> None:
    with pytest.raises(BadInput):
        parse_path(text)


def test_fields_are_those_of_the_message_alone() -> None:
    made = make_dataclass("Made", ["a"])(1.0)
    with pytest.raises(BadInput, match="it has a"):
        read("real", made)
