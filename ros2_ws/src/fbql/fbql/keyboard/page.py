"""The status beside the field while a person drives, and while demonstrations are replayed."""

from __future__ import annotations

from math import degrees

from fbql_behaviors.core.observation import Observation
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_common.core.field import WHEEL_RADIUS_M
from fbql_common.core.types import WheelCommand, World
from fbql_common.terminal.screen import Line

from fbql.keyboard.sitting import Sitting
from fbql.keyboard.steering import FASTEST_LEVEL, Steering
from fbql.watch.page import SIDE_COLUMNS, STRONG, named

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
_REPLAY_KEYS = (
    ("space", "pause, continue"),
    ("s", "one step"),
    ("+ -", "faster, slower"),
    ("n", "next one"),
    ("u", "the one before"),
    ("q", "quit"),
)


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
        [(f"{sitting.patterns} patterns, at most {sitting.wanted}", "")],
        [],
        [(state, STRONG)],
        [],
        *senses(observation, world),
        [],
        named("speed", f"{_metres_per_second(steering.speed):+.2f} m/s ({steering.speed:+d} of {FASTEST_LEVEL})"),
        named("turn", way),
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
    pace: str,
) -> list[Line]:
    """The status beside the field while demonstrations are replayed."""
    return [
        [(behavior, STRONG)],
        [(f"demonstration {number} of {count}", "")],
        [(f"step {world.step}", "")],
        [],
        *senses(observation, world),
        [],
        named("left wheel", f"{command.left_rad_s:+.1f} rad/s"),
        named("right wheel", f"{command.right_rad_s:+.1f} rad/s"),
        [],
        [(pace, STRONG)],
        *([(key.ljust(6), STRONG), (text, "")] for key, text in _REPLAY_KEYS),
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
        lines.append(named(name, text))
    return lines


def _metres_per_second(level: int) -> float:
    return rad_s_of(level) * WHEEL_RADIUS_M
