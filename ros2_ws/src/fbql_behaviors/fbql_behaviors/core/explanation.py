"""A tree in words: where each leaf lies and what it does.

A leaf's region is a box, so its rule names each feature once, however often the path to the leaf split it; a feature that
the path never splits is not named. To explain every step, call `rules` once: the rule of a step is `rules(tree)[leaf_id]`.

The wording follows from the features' names: `NAME_distance` [m] is the distance of NAME, `NAME_bearing` and
`NAME_heading_error` [rad] are its side (left is positive). Any other angle is given in degrees, anything else in its unit.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from math import degrees, floor, log10
from typing import NamedTuple

from fbql_common.core.command_space import Axis, Command, CommandSpace
from fbql_common.core.field import MAX_WHEEL_RAD_S, WHEELS

from fbql_behaviors.core.levels import step_of
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.quantizer import LEVEL_RAD_S
from fbql_behaviors.core.tree import AnyLeaf, Region, Tree

STRAIGHT = 0.05
"""Largest turning part of the wheel velocities, as a share of the forward part, that counts as straight."""
SLOW, FAST = MAX_WHEEL_RAD_S / 3, MAX_WHEEL_RAD_S * 2 / 3
"""The motion is slow below the first and fast from the second velocity of the faster wheel on [rad/s]."""
SUBJECTS = {"approach_angle": "ball-to-goal line"}
"""The subject of an angle whose name does not contain it."""

_MOST_DIGITS = 17
"""Digits that distinguish any two floats."""


class Motion(Enum):
    """The motion that a command causes. Turning left is counter-clockwise, also when driving backwards."""

    STAND = "standing still"
    FORWARDS = "forwards"
    FORWARDS_LEFT = "forwards, turning left"
    SPIN_LEFT = "turning left on the spot"
    BACKWARDS_LEFT = "backwards, turning left"
    BACKWARDS = "backwards"
    BACKWARDS_RIGHT = "backwards, turning right"
    SPIN_RIGHT = "turning right on the spot"
    FORWARDS_RIGHT = "forwards, turning right"
    SIDEWAYS_LEFT = "sideways to the left"
    SIDEWAYS_RIGHT = "sideways to the right"


_TWIST_MOTIONS = {
    (0, 0): Motion.STAND,
    (1, 0): Motion.FORWARDS,
    (1, 1): Motion.FORWARDS_LEFT,
    (1, -1): Motion.FORWARDS_RIGHT,
    (-1, 0): Motion.BACKWARDS,
    (-1, 1): Motion.BACKWARDS_LEFT,
    (-1, -1): Motion.BACKWARDS_RIGHT,
    (0, 1): Motion.SPIN_LEFT,
    (0, -1): Motion.SPIN_RIGHT,
}
"""By the signs of the velocities forwards and to the left about z."""


class Rule(NamedTuple):
    """A leaf in words."""

    leaf_id: int
    conditions: tuple[str, ...]
    """One text for each restricted feature, in their order; none when the leaf is the whole tree."""
    motion: Motion
    speed: str
    """slow, fast, or empty."""
    leaf: AnyLeaf
    commands: CommandSpace = WHEELS

    @property
    def where(self) -> str:
        """The conditions as one text."""
        return ", ".join(self.conditions) or "always"

    @property
    def what(self) -> str:
        """Speed and motion as one text."""
        return f"{self.speed} {self.motion.value}".strip()

    @property
    def sentence(self) -> str:
        """The rule as one text, with the command and the number of patterns behind it."""
        noun = "pattern" if self.leaf.patterns == 1 else "patterns"
        command = command_text(self.commands, self.leaf.command)
        return f"{self.where} -> {self.what} ({command}; {self.leaf.patterns} {noun})"


def rules(tree: Tree) -> tuple[Rule, ...]:
    """The rule of every leaf, indexed by leaf_id."""
    return tuple(
        Rule(leaf_id, conditions(tree.features, region), *_what(tree.commands, leaf.command), leaf, tree.commands)
        for leaf_id, (leaf, region) in enumerate(zip(tree.leaves, tree.regions(), strict=True))
    )


def command_text(space: CommandSpace, command: Command) -> str:
    """A command with its units: "left 20, right 45 rad/s", "linear.x 0.4 m/s, angular.z -0.75 rad/s"."""
    if space == WHEELS:
        return f"left {command[0]:.0f}, right {command[1]:.0f} rad/s"
    return ", ".join(axis_text(axis, value) for axis, value in zip(space.axes, command, strict=True))


def axis_text(axis: Axis, value: float) -> str:
    """The value of one axis, with a digit more than its levels need, and its unit."""
    return f"{axis.name} {rounded([value], step_of(axis))[0]} {axis.unit}".rstrip()


def _what(space: CommandSpace, command: Command) -> tuple[Motion, str]:
    """The motion that a command causes, and how fast it is."""
    if space == WHEELS:
        return motion_of(*command), speed_of(*command)
    return twist_motion_of(space, command), _share_of_full(space, command)


def describe_tree(tree: Tree) -> str:
    """The whole tree: one line per leaf, with its leaf_id and rule."""
    width = len(str(tree.leaf_count - 1))
    return "\n".join(f"leaf {rule.leaf_id:>{width}}: {rule.sentence}" for rule in rules(tree))


def conditions(features: tuple[Feature, ...], region: Region) -> tuple[str, ...]:
    """A region in words: one text for each feature that it restricts."""
    texts: list[str] = []
    last = ""
    for feature, (low, high) in zip(features, region, strict=True):
        if (low, high) == (feature.low, feature.high):
            continue
        subject, words = condition(feature, low, high)
        texts.append(words if subject and subject == last else f"{subject} {words}".strip())
        last = subject
    return tuple(texts)


def condition(feature: Feature, low: float, high: float) -> tuple[str, str]:
    """A part [low, high) of a feature's range in words: the subject, and where it is."""
    subject, kind = _subject_and_kind(feature)
    if kind == "distance":
        return subject, _distance(feature, low, high)
    if kind == "direction":
        return subject, _direction(feature, degrees(low), degrees(high))
    if feature.unit == "rad":
        return subject, _interval("degrees", degrees(low), degrees(high), low == feature.low, high == feature.high)
    return subject, _interval(feature.unit, low, high, low == feature.low, high == feature.high)


def is_direction(feature: Feature) -> bool:
    """Whether a feature is worded as a direction: degrees to the left or to the right."""
    return _subject_and_kind(feature)[1] == "direction"


def motion_of(left_rad_s: float, right_rad_s: float) -> Motion:
    """The motion that a pair of wheel velocities causes.

    On the spot: the wheels turn against each other, so the robot turns about a point between them. Straight: the turning
    part is at most a twentieth of the forward part, a circle of at least 70 cm radius.
    """
    if max(abs(left_rad_s), abs(right_rad_s)) < LEVEL_RAD_S / 2:
        return Motion.STAND
    forward, turn = left_rad_s + right_rad_s, right_rad_s - left_rad_s
    if abs(turn) > abs(forward):
        return Motion.SPIN_LEFT if turn > 0.0 else Motion.SPIN_RIGHT
    if abs(turn) <= STRAIGHT * abs(forward):
        return Motion.FORWARDS if forward > 0.0 else Motion.BACKWARDS
    if forward > 0.0:
        return Motion.FORWARDS_LEFT if turn > 0.0 else Motion.FORWARDS_RIGHT
    return Motion.BACKWARDS_LEFT if turn > 0.0 else Motion.BACKWARDS_RIGHT


def speed_of(left_rad_s: float, right_rad_s: float) -> str:
    """slow, fast, or empty for a speed between them and for standing still: by the faster wheel."""
    fastest = max(abs(left_rad_s), abs(right_rad_s))
    if fastest >= FAST:
        return "fast"
    return "slow" if LEVEL_RAD_S / 2 <= fastest < SLOW else ""


def twist_motion_of(space: CommandSpace, command: Command) -> Motion:
    """The motion that velocities along x (forwards) and y (to the left) and about z (to the left) cause.

    Less than half a level of an axis counts as none. Axes of other names are not looked at.
    """
    levels = {axis.name: value / step_of(axis) for axis, value in zip(space.axes, command, strict=True)}
    signs = {name: 0 if abs(level) < 0.5 else 1 if level > 0.0 else -1 for name, level in levels.items()}
    forward, sideways, turn = (signs.get(name, 0) for name in ("linear.x", "linear.y", "angular.z"))
    if sideways and not forward:
        return Motion.SIDEWAYS_LEFT if sideways > 0 else Motion.SIDEWAYS_RIGHT
    return _TWIST_MOTIONS[forward, turn]


def _share_of_full(space: CommandSpace, command: Command) -> str:
    """slow below a third, fast from two thirds of full velocity on: of the linear ones, or where none moves, the others."""
    shares = {
        axis.name: abs(value) / max(abs(axis.low), abs(axis.high))
        for axis, value in zip(space.axes, command, strict=True)
        if abs(value) >= step_of(axis) / 2
    }
    linear = [share for name, share in shares.items() if name.startswith("linear")]
    share = max(linear or shares.values(), default=None)
    if share is None:
        return ""
    return "fast" if share >= 2 / 3 else "slow" if share < 1 / 3 else ""


def rounded(values: Iterable[float], width: float) -> list[str]:
    """Numbers with just enough digits, or one more, to tell the ends of an interval of this width apart."""
    digits = min(max(1, 1 - floor(log10(width))), _MOST_DIGITS) if width > 0.0 else _MOST_DIGITS
    # moved off a tie, so that 11.25 and 33.75, which are rarely exact, are both rounded up
    texts = [f"{value * (1.0 + 1e-12):.{digits}f}".rstrip("0").rstrip(".") for value in values]
    return ["0" if text == "-0" else text for text in texts]


def _subject_and_kind(feature: Feature) -> tuple[str, str]:
    name = feature.name
    if feature.unit == "m" and name.endswith("_distance"):
        return _spaced(name.removesuffix("_distance")), "distance"
    if feature.unit == "rad" and (feature.low, feature.high) == (-feature.high, feature.high):
        for ending in ("_bearing", "_heading_error"):
            if name.endswith(ending):
                return _spaced(name.removesuffix(ending)), "direction"
        if name in SUBJECTS:
            return SUBJECTS[name], "direction"
    return _spaced(name), "number"


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def _distance(feature: Feature, low: float, high: float) -> str:
    near, far = rounded((low, high), high - low)
    if low == feature.low:
        return f"nearer than {far} m"
    return f"{near} m away or farther" if high == feature.high else f"{near}-{far} m away"


def _interval(unit: str, low: float, high: float, low_open: bool, high_open: bool) -> str:
    first, last = rounded((low, high), high - low)
    text = f"below {last}" if low_open else f"{first} or more" if high_open else f"{first} to {last}"
    return f"{text} {unit}".strip()


def _direction(feature: Feature, low: float, high: float) -> str:
    """Degrees, left positive, in words; the feature's range is symmetric."""
    if high <= 0.0:
        return _side(-high, -low, degrees(-feature.low), "right")
    if low >= 0.0:
        return _side(low, high, degrees(feature.high), "left")
    to_right, to_left = rounded((-low, high), high - low)
    if low == degrees(feature.low):
        return f"anywhere to the right or up to {to_left} degrees to the left"
    if high == degrees(feature.high):
        return f"anywhere to the left or up to {to_right} degrees to the right"
    if to_left == to_right:
        return f"within {to_left} degrees of straight ahead"
    return f"between {to_right} degrees to the right and {to_left} to the left"


def _side(near: float, far: float, farthest: float, side: str) -> str:
    """An interval of degrees to one side, counted from straight ahead."""
    if near == 0.0 and far == farthest:
        return f"to the {side}"
    first, last = rounded((near, far), far - near)
    return f"{first}-{last} degrees to the {side}{', behind' if near >= 90.0 else ''}"
