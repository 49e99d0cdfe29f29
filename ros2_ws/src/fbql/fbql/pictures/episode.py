"""One episode as an SVG: the field and the trails of robot and ball, the robot's in the colour of the behavior that drove.

Where the viewer shows SVG animations, robot and ball move along their trails.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from math import degrees
from pathlib import Path

from fbql_common.core.errors import BadInput
from fbql_common.core.field import BALL_RADIUS_M, FIELD, ROBOT_SIDE_M
from fbql_common.core.types import Decision, World
from fbql_common.files import write_atomically
from fbql_recording.run import open_run
from fbql_sim.core.arena import SEGMENTS

from fbql.cli.app import reporting
from fbql.cli.exit_codes import DONE
from fbql.cli.output import set_program, writing
from fbql.cli.parser import Parser

SCALE = 360.0
"""Pixels per metre."""
MARGIN_M = 0.2
LEGEND_M = 0.22
COLORS = ("#e69f00", "#56b4e9", "#cc79a7", "#f0e442", "#d55e00", "#999999")
"""One per behavior, distinguishable for colour-blind readers (Okabe and Ito) on the field's green."""
BLEND_COLOR = "#ffffff"
FRAMES_PER_S = 12.0


def main(argv: Sequence[str]) -> int:
    """Draws the picture. Returns the exit code."""
    set_program("make_picture.py")
    parser = Parser(prog="make_picture.py", description="Draws one episode of a recorded run as an SVG.")
    parser.add_argument("run", type=Path, help="run directory")
    parser.add_argument("--episode", type=int, default=0, metavar="N", help="episode to draw (0)")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="SVG file to write")
    arguments = parser.parse_args(list(argv))
    return reporting(lambda: _draw(arguments.run, arguments.episode, arguments.out))


def _draw(run: Path, episode: int, out: Path) -> int:
    worlds, decisions = read_episode(run, episode)
    if not worlds:
        raise BadInput(f"{run}: no episode {episode} in the recording")
    with writing(out):
        write_atomically(out, picture(worlds, decisions).encode())
    return DONE


def read_episode(run: Path, episode: int) -> tuple[list[World], list[Decision]]:
    """The world states of an episode, and the decisions that answered them."""
    steps = [step for step in open_run(run).steps() if step.episode == episode]
    worlds = [step.world for step in steps if step.world is not None]
    return worlds, [step.decision for step in steps if step.decision is not None]


def picture(worlds: Sequence[World], decisions: Sequence[Decision]) -> str:
    """The SVG."""
    parts = [_field()]
    parts.append(_trail([(w.ball_x_m, w.ball_y_m) for w in worlds], "#ff7f0e", 2.5, "3 4"))
    parts += _robot_trail(worlds, decisions)
    parts.append(_robot(worlds[0], 0.45))
    parts.append(_ball(worlds[0], 0.45))
    parts.append(_moving(worlds))
    parts.append(_legend(worlds, decisions))
    width = SCALE * (FIELD.length_m + 2 * FIELD.goal_depth_m + 2 * MARGIN_M)
    height = SCALE * (FIELD.width_m + MARGIN_M + LEGEND_M)
    left, top = -width / 2, -SCALE * (FIELD.half_width_m + MARGIN_M / 2)
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:.0f} {top:.0f} {width:.0f} {height:.0f}" '
            f'width="{width:.0f}" height="{height:.0f}" font-family="sans-serif" font-size="15">',
            f'<rect x="{left:.0f}" y="{top:.0f}" width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
            *parts,
            "</svg>\n",
        ]
    )


def _point(x_m: float, y_m: float) -> tuple[float, float]:
    """Pixels; y points up in the field and down in the picture."""
    return SCALE * x_m, -SCALE * y_m


def _field() -> str:
    half_x, half_y = SCALE * FIELD.half_length_m, SCALE * FIELD.half_width_m
    pocket_x, goal_y, corner = half_x + SCALE * FIELD.goal_depth_m, SCALE * FIELD.half_goal_m, SCALE * FIELD.corner_m
    right = [(half_x, -half_y + corner), (half_x, -goal_y), (pocket_x, -goal_y)]
    quarter = [(half_x - corner, -half_y), *right]
    outline = [*quarter, *[(x, -y) for x, y in reversed(quarter)]]
    outline += [(-x, -y) for x, y in outline]
    points = " ".join(f"{x:.0f},{y:.0f}" for x, y in outline)
    lines = "".join(
        '<line x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"/>'.format(*_point(*start), *_point(*end))
        for start, end in SEGMENTS
    )
    middle = f'<path d="M0 {-half_y:.0f}V{half_y:.0f}" stroke="#ffffff" stroke-opacity=".25" stroke-width="2"/>'
    circle = f'<circle r="{0.25 * SCALE:.0f}" fill="none" stroke="#ffffff" stroke-opacity=".25" stroke-width="2"/>'
    return (
        f'<polygon points="{points}" fill="#1f5130"/>{middle}{circle}'
        f'<g stroke="#222222" stroke-width="5" stroke-linecap="round">{lines}</g>'
    )


def _trail(points_m: Sequence[tuple[float, float]], color: str, width: float, dashes: str = "") -> str:
    text = " ".join("{:.1f},{:.1f}".format(*_point(x, y)) for x, y in points_m)
    dash = f' stroke-dasharray="{dashes}"' if dashes else ""
    return (
        f'<polyline points="{text}" fill="none" stroke="{color}" stroke-width="{width}" stroke-linejoin="round"{dash}/>'
    )


def _color(decision: Decision) -> str:
    return BLEND_COLOR if decision.driver < 0 else COLORS[decision.driver % len(COLORS)]


def _robot_trail(worlds: Sequence[World], decisions: Sequence[Decision]) -> list[str]:
    trails: list[str] = []
    start = 0
    for color, group in groupby(decisions, _color):
        end = start + len(list(group))
        part = worlds[start : end + 1]
        trails.append(_trail([(w.robot_x_m, w.robot_y_m) for w in part], color, 3.5))
        start = end
    return trails


def _robot_shape() -> str:
    side = SCALE * ROBOT_SIDE_M
    return (
        f'<rect x="{-side / 2:.1f}" y="{-side / 2:.1f}" width="{side:.1f}" height="{side:.1f}" rx="3" fill="#2a5bd7" stroke="#ffffff"/>'
        f'<path d="M{side / 2 - 3:.1f} 0l-9 -6v12z" fill="#ffffff"/>'
    )


def _ball_shape() -> str:
    return f'<circle r="{SCALE * BALL_RADIUS_M:.1f}" fill="#ff7f0e" stroke="#ffffff"/>'


def _robot(world: World, opacity: float) -> str:
    x, y = _point(world.robot_x_m, world.robot_y_m)
    turn = -degrees(world.robot_yaw_rad)
    return f'<g opacity="{opacity}" transform="translate({x:.1f} {y:.1f}) rotate({turn:.1f})">{_robot_shape()}</g>'


def _ball(world: World, opacity: float) -> str:
    x, y = _point(world.ball_x_m, world.ball_y_m)
    return f'<g opacity="{opacity}" transform="translate({x:.1f} {y:.1f})">{_ball_shape()}</g>'


def _moving(worlds: Sequence[World]) -> str:
    """Robot and ball moving along their trails in real time, repeated forever."""
    duration_s = (worlds[-1].stamp_ns - worlds[0].stamp_ns) / 1e9
    count = max(2, round(duration_s * FRAMES_PER_S))
    frames = [worlds[round(i * (len(worlds) - 1) / (count - 1))] for i in range(count)]
    turns = [-degrees(w.robot_yaw_rad) for w in frames]
    for i in range(1, count):
        turns[i] += 360 * round((turns[i - 1] - turns[i]) / 360)
    robot = ";".join("{:.1f} {:.1f}".format(*_point(w.robot_x_m, w.robot_y_m)) for w in frames)
    ball = ";".join("{:.1f} {:.1f}".format(*_point(w.ball_x_m, w.ball_y_m)) for w in frames)
    turn = ";".join(f"{angle:.0f}" for angle in turns)
    last = frames[-1]
    robot_end, ball_end = _point(last.robot_x_m, last.robot_y_m), _point(last.ball_x_m, last.ball_y_m)

    def animate(kind: str, values: str) -> str:
        return (
            f'<animateTransform attributeName="transform" type="{kind}" values="{values}" dur="{duration_s:.2f}s" '
            'repeatCount="indefinite"/>'
        )

    return (
        '<g transform="translate({:.1f} {:.1f})">'.format(*robot_end)
        + animate("translate", robot)
        + f'<g transform="rotate({turns[-1]:.0f})">{animate("rotate", turn)}{_robot_shape()}</g></g>'
        + '<g transform="translate({:.1f} {:.1f})">'.format(*ball_end)
        + f"{animate('translate', ball)}{_ball_shape()}</g>"
    )


def _legend(worlds: Sequence[World], decisions: Sequence[Decision]) -> str:
    end = worlds[-1]
    outcome = "goal" if end.goal else "own goal" if end.own_goal else "timeout"
    seconds = (end.stamp_ns - worlds[0].stamp_ns) / 1e9
    y = SCALE * (FIELD.half_width_m + 0.09)
    x = -SCALE * FIELD.half_length_m
    drivers = {decision.driver for decision in decisions}
    names = [(COLORS[i % len(COLORS)], name) for i, name in enumerate(decisions[0].behaviors) if i in drivers]
    if -1 in drivers:
        names.append(("#888888", "weighted sum"))
    parts: list[str] = []
    for color, name in names:
        parts.append(f'<path d="M{x:.0f} {y:.0f}h26" stroke="{color}" stroke-width="5"/>')
        parts.append(f'<text x="{x + 32:.0f}" y="{y + 5:.0f}">{name}</text>')
        x += 50 + 9 * len(name)
    parts.append(f'<path d="M{x:.0f} {y:.0f}h26" stroke="#ff7f0e" stroke-width="2.5" stroke-dasharray="3 4"/>')
    parts.append(f'<text x="{x + 32:.0f}" y="{y + 5:.0f}">ball</text>')
    caption = f"{decisions[0].controller}, episode {end.episode}: {outcome} after {end.step} steps ({seconds:.1f} s)"
    parts.append(f'<text x="{-SCALE * FIELD.half_length_m:.0f}" y="{y + 34:.0f}">{caption}</text>')
    return "".join(parts)
