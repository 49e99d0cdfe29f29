"""Episodes as an SVG: the field and the trails of robot and ball, the robot's in the colour of the behavior that drove.

Where the viewer shows SVG animations, robot and ball move, and draw their trails; several episodes follow each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import accumulate, groupby, pairwise
from math import degrees, hypot
from pathlib import Path
from typing import NamedTuple

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
from fbql.pictures.colours import SIGNS, behavior_colour, report_colours

SCALE = 360.0
"""Pixels per metre."""
MARGIN_M = 0.2
LEGEND_M = 0.22
FRAMES_PER_S = 12.0
SIGNED_STEPS = 15
"""A stretch of at least this many steps carries the sign of the behavior that drove."""
HELD_S = 1.2
"""How long the end of an episode is shown [s]."""


class Part(NamedTuple):
    """One episode of the picture."""

    worlds: Sequence[World]
    decisions: Sequence[Decision]
    begin_s: float
    score: tuple[int, int, int]
    """Goals, own goals and episodes so far, with this one."""

    @property
    def duration_s(self) -> float:
        """How long it is played [s]."""
        return (self.worlds[-1].stamp_ns - self.worlds[0].stamp_ns) / 1e9

    @property
    def end_s(self) -> float:
        """When the next one begins [s]."""
        return self.begin_s + self.duration_s + HELD_S

    def at_s(self, step: int) -> float:
        """When a step is shown [s]."""
        return self.begin_s + (self.worlds[step].stamp_ns - self.worlds[0].stamp_ns) / 1e9


def main(argv: Sequence[str]) -> int:
    """Draws the picture. Returns the exit code."""
    set_program("make_picture.py")
    parser = Parser(prog="make_picture.py", description="Draws episodes of a recorded run as an animated SVG.")
    parser.add_argument("run", type=Path, help="run directory")
    parser.add_argument(
        "--episode", type=int, nargs="+", default=[0], metavar="N", help="episodes to draw, one after the other (0)"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="SVG file to write")
    arguments = parser.parse_args(list(argv))
    return reporting(lambda: _draw(arguments.run, arguments.episode, arguments.out))


def _draw(run: Path, episodes: Sequence[int], out: Path) -> int:
    found = read_episodes(run, episodes)
    with writing(out):
        write_atomically(out, picture(found).encode())
    return DONE


def read_episodes(run: Path, episodes: Sequence[int]) -> list[Part]:
    """The world states of episodes, and the decisions that answered them. Raises BadInput for one that is not there."""
    worlds: dict[int, list[World]] = {number: [] for number in episodes}
    decisions: dict[int, list[Decision]] = {number: [] for number in episodes}
    for step in open_run(run).steps():
        if step.episode in worlds and step.world is not None and step.decision is not None:
            worlds[step.episode].append(step.world)
            decisions[step.episode].append(step.decision)
    parts: list[Part] = []
    begin_s, goals, own_goals = 0.0, 0, 0
    for number in episodes:
        if len(worlds[number]) < 2:
            raise BadInput(f"{run}: no episode {number} in the recording")
        goals, own_goals = goals + worlds[number][-1].goal, own_goals + worlds[number][-1].own_goal
        parts.append(Part(worlds[number], decisions[number], begin_s, (goals, own_goals, len(parts) + 1)))
        begin_s = parts[-1].end_s
    return parts


def picture(parts: Sequence[Part]) -> str:
    """The SVG."""
    whole_s = parts[-1].end_s
    width = SCALE * (FIELD.length_m + 2 * FIELD.goal_depth_m + 2 * MARGIN_M)
    height = SCALE * (FIELD.width_m + MARGIN_M + LEGEND_M)
    left, top = -width / 2, -SCALE * (FIELD.half_width_m + MARGIN_M / 2)
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:.0f} {top:.0f} {width:.0f} {height:.0f}" '
            f'width="{width:.0f}" height="{height:.0f}" font-family="sans-serif" font-size="15">',
            f'<rect x="{left:.0f}" y="{top:.0f}" width="{width:.0f}" height="{height:.0f}" fill="{_colour("paper")}"/>',
            _field(),
            _legend(parts),
            *(_episode(part, whole_s, is_first=part is parts[0]) for part in parts),
            "</svg>\n",
        ]
    )


def _colour(name: str) -> str:
    return report_colours()[name]


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
    chalk = f'fill="none" stroke="{_colour("chalk")}" stroke-width="2"'
    return (
        f'<polygon points="{points}" fill="{_colour("grass")}"/>'
        f'<path d="M0 {-half_y:.0f}V{half_y:.0f}" {chalk}/><circle r="{0.25 * SCALE:.0f}" {chalk}/>'
        f'<g stroke="{_colour("wall")}" stroke-width="5" stroke-linecap="round">{lines}</g>'
    )


def _episode(part: Part, whole_s: float, is_first: bool) -> str:
    """What is shown of one episode, while it is its turn."""
    begin, end = part.begin_s / whole_s, part.end_s / whole_s
    turns = [("hidden", 0.0)] if begin > 0.0 else []
    turns += [("visible", begin)]
    turns += [("hidden", end)] if end < 1.0 else []
    shown = _animated("visibility", [value for value, _ in turns], [at for _, at in turns], whole_s, "discrete")
    content = "\n".join(
        [
            _ball_trail(part, whole_s),
            *_robot_trail(part, whole_s),
            _moving(part, whole_s),
            _caption(part),
        ]
    )
    return f'<g visibility="{"visible" if is_first else "hidden"}">{shown if len(turns) > 1 else ""}\n{content}\n</g>'


def _animated(name: str, values: Sequence[str], times: Sequence[float], whole_s: float, mode: str = "linear") -> str:
    """An attribute that has values at times, which are shares of the whole."""
    turns = name in ("translate", "rotate")
    what = f'animateTransform attributeName="transform" type="{name}"' if turns else f'animate attributeName="{name}"'
    shares = ";".join(f"{time:.4f}".rstrip("0").rstrip(".") for time in times)
    return (
        f'<{what} values="{";".join(values)}" keyTimes="{shares}" dur="{whole_s:.2f}s" calcMode="{mode}" '
        'repeatCount="indefinite"/>'
    )


def _trail(points_m: Sequence[tuple[float, float]], style: str, drawn: str) -> str:
    text = " ".join("{:.1f},{:.1f}".format(*_point(x, y)) for x, y in points_m)
    return (
        f'<polyline points="{text}" fill="none" {style} stroke-linejoin="round" pathLength="1" stroke-dasharray="1 1">'
        f"{drawn}</polyline>"
    )


def _ball_trail(part: Part, whole_s: float) -> str:
    frames = _frames(part)
    points = [(part.worlds[step].ball_x_m, part.worlds[step].ball_y_m) for step in frames]
    lengths = list(accumulate((hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(points)), initial=0.0))
    left = [f"{1.0 - length / (lengths[-1] or 1.0):.3f}" for length in lengths]
    drawn = _animated("stroke-dashoffset", *_held(part, left, frames, whole_s), whole_s)
    return _trail(points, f'stroke="{_colour("ball")}" stroke-width="2"', drawn)


def _robot_trail(part: Part, whole_s: float) -> Iterator[str]:
    """A trail for each stretch that one behavior drove, and its sign."""
    begin = 0
    for driver, group in groupby(part.decisions, lambda decision: decision.driver):
        end = min(begin + len(list(group)), len(part.worlds) - 1)
        if end == begin:
            break
        points = [(world.robot_x_m, world.robot_y_m) for world in part.worlds[begin : end + 1]]
        span = [0.0, part.at_s(begin) / whole_s, part.at_s(end) / whole_s, 1.0]
        drawn = _animated("stroke-dashoffset", ["1", "1", "0", "0"], span, whole_s)
        yield _trail(points, f'stroke="{behavior_colour(driver)}" stroke-width="3.5"', drawn)
        if driver >= 0 and end - begin >= SIGNED_STEPS:
            yield _sign(driver, points[len(points) // 2], span[2], whole_s)
        begin = end


def _sign(driver: int, at_m: tuple[float, float], from_time: float, whole_s: float) -> str:
    """A behavior's sign on its trail, once it is drawn: not everybody can tell colors apart."""
    x, y = _point(*at_m)
    # Not its visibility: that of a part is shown even where the whole is hidden.
    shown = _animated("opacity", ["0", "1"], [0.0, from_time], whole_s, "discrete")
    return (
        f'<text x="{x:.0f}" y="{y + 6:.0f}" text-anchor="middle" font-size="18" fill="{behavior_colour(driver)}" '
        f'stroke="{_colour("grass")}" stroke-width="3" paint-order="stroke">{shown}{SIGNS[driver % len(SIGNS)]}</text>'
    )


def _frames(part: Part) -> list[int]:
    """The steps that are shown, evenly taken."""
    count = max(2, round(part.duration_s * FRAMES_PER_S))
    return [round(i * (len(part.worlds) - 1) / (count - 1)) for i in range(count)]


def _held(part: Part, values: Sequence[str], frames: Sequence[int], whole_s: float) -> tuple[list[str], list[float]]:
    """The values of frames and their times, from the beginning of the whole to its end."""
    times = [part.at_s(step) / whole_s for step in frames]
    before, after = times[0] > 0.0, times[-1] < 1.0
    held = [*([values[0]] if before else []), *values, *([values[-1]] if after else [])]
    return held, [*([0.0] if before else []), *times, *([1.0] if after else [])]


def _moving(part: Part, whole_s: float) -> str:
    """Robot and ball moving along their trails in real time."""
    frames = _frames(part)
    worlds = [part.worlds[step] for step in frames]
    turns = [-degrees(world.robot_yaw_rad) for world in worlds]
    for i in range(1, len(turns)):
        turns[i] += 360 * round((turns[i - 1] - turns[i]) / 360)

    def moved(kind: str, values: Sequence[str]) -> str:
        return f'transform="{kind}({values[-1]})">' + _animated(kind, *_held(part, values, frames, whole_s), whole_s)

    robot = ["{:.1f} {:.1f}".format(*_point(world.robot_x_m, world.robot_y_m)) for world in worlds]
    ball = ["{:.1f} {:.1f}".format(*_point(world.ball_x_m, world.ball_y_m)) for world in worlds]
    turn = [f"{angle:.0f}" for angle in turns]
    return (
        f"<g {moved('translate', robot)}<g {moved('rotate', turn)}{_robot_shape()}</g></g>"
        f"<g {moved('translate', ball)}{_ball_shape()}</g>"
    )


def _robot_shape() -> str:
    side, paper = SCALE * ROBOT_SIDE_M, _colour("paper")
    return (
        f'<rect x="{-side / 2:.1f}" y="{-side / 2:.1f}" width="{side:.1f}" height="{side:.1f}" fill="{_colour("robot")}" '
        f'stroke="{paper}"/><path d="M{side / 2 - 3:.1f} 0l-11 -7v14z" fill="{paper}"/>'
    )


def _ball_shape() -> str:
    return f'<circle r="{SCALE * BALL_RADIUS_M:.1f}" fill="{_colour("ball")}" stroke="{_colour("ink")}"/>'


def _legend(parts: Sequence[Part]) -> str:
    y, x = SCALE * (FIELD.half_width_m + 0.09), -SCALE * FIELD.half_length_m
    decisions = [decision for part in parts for decision in part.decisions]
    drivers = {decision.driver for decision in decisions}
    names = [
        (behavior_colour(k), f"{SIGNS[k % len(SIGNS)]} {name}")
        for k, name in enumerate(decisions[0].behaviors)
        if k in drivers
    ]
    names += [(behavior_colour(-1), "all together")] if -1 in drivers else []
    ink = _colour("ink")
    shown: list[str] = []
    for colour, name, width in (*((*each, 5) for each in names), (_colour("ball"), "ball", 2)):
        shown.append(f'<path d="M{x:.0f} {y:.0f}h26" stroke="{colour}" stroke-width="{width}"/>')
        shown.append(f'<text x="{x + 32:.0f}" y="{y + 5:.0f}" fill="{ink}">{name}</text>')
        x += 50 + 9 * len(name)
    return "".join(shown)


def _caption(part: Part) -> str:
    end = part.worlds[-1]
    outcome = "goal" if end.goal else "own goal" if end.own_goal else "timeout"
    goals, own_goals, episodes = part.score
    score = f"; goals {goals}, own goals {own_goals}" if episodes > 1 or part.begin_s else ""
    words = f"{part.decisions[0].controller}, episode {end.episode}: {outcome} after {part.duration_s:.1f} s{score}"
    x, y = -SCALE * FIELD.half_length_m, SCALE * (FIELD.half_width_m + 0.09) + 34
    return f'<text x="{x:.0f}" y="{y:.0f}" fill="{_colour("ink")}">{words}</text>'
