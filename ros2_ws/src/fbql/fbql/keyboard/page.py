"""The contents of the screen, as lines of characters: the field on the left, the status beside it, a message below."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

from fbql_behaviors.core.observation import Observation
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_common.core.field import WHEEL_RADIUS_M
from fbql_common.core.types import WheelCommand, World
from fbql_common.terminal.screen import Line

from fbql.keyboard.picture import field_picture
from fbql.keyboard.sitting import Sitting
from fbql.keyboard.steering import FASTEST_LEVEL, Steering

PICTURE_S = 1 / 20
"""Time between two pages [s]."""
SIDE_COLUMNS = 32
LEAST_COLUMNS, LEAST_ROWS = 66, 23
"""Smaller than this there is no room for the picture beside the text."""
STRONG, QUIET = "1", "2"
_DRIVING_KEYS = (
    ("↑ w", "up w", "faster by a level"),
    ("↓ s", "dn s", "slower, then backwards"),
    ("← a", "lf a", "turn left: tap or hold"),
    ("→ d", "rt d", "turn right"),
    ("space", "space", "stop"),
    ("n", "n", "keep it, next start"),
    ("u", "u", "undo: drop the last one"),
    ("q", "q", "keep it and finish"),
)


def page(
    world: World | None, side: Sequence[Line], message: str, columns: int, rows: int, ascii_only: bool
) -> list[Line]:
    """The lines of a screen of `columns` x `rows` characters, none of them longer; `world` is None before the first."""
    if columns < LEAST_COLUMNS or rows < LEAST_ROWS:
        text = f"This terminal is {columns} x {rows}; at least {LEAST_COLUMNS} x {LEAST_ROWS} is needed."
        return [[(text[:columns], "")]]
    width = columns - SIDE_COLUMNS - 1
    picture = [] if world is None else field_picture(world, width, rows - 1, ascii_only)
    lines: list[Line] = []
    for row in range(rows - 1):
        left: Line = picture[row] if row < len(picture) else []
        right: Line = list(side[row]) if row < len(side) else []
        gap = width + 1 - sum(len(text) for text, _ in left)
        lines.append([*left, (" " * gap, ""), *_cut(right, SIDE_COLUMNS)] if right else list(left))
    return [*lines, [(message[: columns - 1], STRONG)]]


def driving_side(
    behavior: str,
    observation: Observation,
    sitting: Sitting,
    steering: Steering,
    world: World | None,
    now_s: float,
    dt_s: float,
    ascii_only: bool,
) -> list[Line]:
    """The status beside the field while a person drives."""
    number = len(sitting.kept) + 1
    if world is None:
        state = "..."
    elif world.ended:
        state = "goal: press n" if world.goal else "own goal: press n" if world.own_goal else "time is up: press n"
    elif sitting.begun:
        state = f"{sitting.steps * dt_s:.1f} s, {sitting.steps} steps"
    else:
        state = "begins with your first key"
    turn = steering.turn(now_s)
    way = "straight on" if turn == 0 else f"{'left' if turn > 0 else 'right'} {abs(turn)}"
    keys = [((ascii_key if ascii_only else key).ljust(6), text) for key, ascii_key, text in _DRIVING_KEYS]
    return [
        [(behavior, STRONG)],
        [(f"demonstration {number}, {len(sitting.kept)} kept", "")],
        [(f"{sitting.patterns} of {sitting.wanted} patterns", "")],
        [],
        [(state, STRONG)],
        [],
        *senses(observation, world),
        [],
        [_field("speed", f"{_metres_per_second(steering.speed):+.2f} m/s ({steering.speed:+d} of {FASTEST_LEVEL})")],
        [_field("turn", way)],
        [],
        *([(key, STRONG), (text, "")] for key, text in keys),
    ]


def replay_side(
    behavior: str,
    observation: Observation,
    number: int,
    count: int,
    world: World,
    command: WheelCommand,
) -> list[Line]:
    """The status beside the field while demonstrations are replayed."""
    keys = (("n", "next one"), ("u", "the one before"), ("q", "quit"))
    return [
        [(behavior, STRONG)],
        [(f"demonstration {number} of {count}", "")],
        [(f"step {world.step}", "")],
        [],
        *senses(observation, world),
        [],
        [_field("left wheel", f"{command.left_rad_s:+.1f} rad/s")],
        [_field("right wheel", f"{command.right_rad_s:+.1f} rad/s")],
        [],
        *([(key.ljust(6), STRONG), (text, "")] for key, text in keys),
    ]


def senses(observation: Observation, world: World | None) -> list[Line]:
    """What the behavior senses, one line per feature, with units; angles also in degrees where there is room."""
    values = [None] * len(observation.features) if world is None else observation.sense(world)
    lines: list[Line] = []
    for feature, value in zip(observation.features, values, strict=True):
        name = feature.name.replace("_", " ")
        forms = ["-"]
        if value is not None:
            forms = [f"{value:+.2f} {feature.unit}" if feature.low < 0.0 else f"{value:.2f} {feature.unit}"]
            if feature.unit == "rad":
                forms.insert(0, f"{forms[0]} {degrees(value):+4.0f} deg")
        text = next((form for form in forms if len(name) + 1 + len(form) <= SIDE_COLUMNS), forms[-1])
        lines.append([_field(name, text)])
    return lines


def _field(name: str, text: str) -> tuple[str, str]:
    return name + " " + text.rjust(SIDE_COLUMNS - len(name) - 1), ""


def _metres_per_second(level: int) -> float:
    return rad_s_of(level) * WHEEL_RADIUS_M


def _cut(line: Line, columns: int) -> Line:
    """A line without what is beyond the last column."""
    kept: Line = []
    for text, style in line:
        kept.append((text[:columns], style))
        columns -= len(text)
        if columns <= 0:
            break
    return kept
