"""What-if as a picture: each behavior's weight as recorded and as it would have been, and by how much commands differ."""

from __future__ import annotations

from collections.abc import Sequence

from fbql_behaviors.drawing.svg import Axis, document, frame, line, number, text, ticks_between

from fbql.replay.what_if import Compared

BINS = 600
"""Points across: each stands for as many steps as it takes."""
WIDTH, LEFT, RIGHT, TOP, ABOVE, BELOW = 900.0, 70.0, 190.0, 40.0, 22.0, 46.0
HEIGHT_WEIGHT, HEIGHT_COMMAND = 90.0, 120.0
RECORDED, WHAT_IF, EPISODE = "#555555", "#d55e00", "#c8c8c8"
"""Told apart by colour-blind readers, and by the dashes."""


class Figure:
    """Collects steps, and draws them: memory does not grow with them.

    Args:
        behaviors: names, in order.
        steps: about how many steps will come.
    """

    def __init__(self, behaviors: Sequence[str], steps: int) -> None:
        self._behaviors = tuple(behaviors)
        self._per_bin = -(-max(steps, 1) // BINS)
        self._bins: list[_Bin] = []
        self._count = 0
        self._episodes: list[tuple[int, int]] = []
        self._command_max = 0.0

    def add(self, compared: Compared) -> None:
        """Takes a step."""
        if not self._episodes or self._episodes[-1][1] != compared.step.episode:
            self._episodes.append((self._count, compared.step.episode))
        if self._count % self._per_bin == 0:
            self._bins.append(_Bin(len(self._behaviors)))
        self._bins[-1].add(compared)
        self._command_max = max(self._command_max, compared.command_rad_s)
        self._count += 1

    def svg(self, title: str) -> str:
        """The picture."""
        end = max(self._count, 1)
        ticks = tuple(tick for tick in ticks_between(0.0, float(end)) if tick <= end)
        parts = [text(LEFT, 22, title, "start", 15)]
        top = TOP
        for index, name in enumerate(self._behaviors):
            top += ABOVE
            across, up = self._axes("", (), top, HEIGHT_WEIGHT, 1.0, (0.0, 0.5, 1.0))
            parts += [*self._episode_lines(across, top, HEIGHT_WEIGHT, index == 0), *frame(across, up)]
            recorded = [(place, each.recorded[index] / each.steps) for place, each in self._places()]
            what_if = [(place, each.what_if[index] / each.steps) for place, each in self._places()]
            parts += [_curve(across, up, recorded, RECORDED, ""), _curve(across, up, what_if, WHAT_IF, "5 3")]
            parts.append(text(LEFT + WIDTH + 8, top + HEIGHT_WEIGHT / 2, f"weight of {name}", "start"))
            top += HEIGHT_WEIGHT
        top += ABOVE
        high = self._command_max or 1.0
        up_ticks = ticks_between(0.0, high, 4)
        across, up = self._axes("step of the recording", ticks, top, HEIGHT_COMMAND, high, up_ticks)
        parts += [*self._episode_lines(across, top, HEIGHT_COMMAND, False), *frame(across, up)]
        largest = [(place, each.command_rad_s) for place, each in self._places()]
        parts.append(_curve(across, up, largest, WHAT_IF, ""))
        middle = top + HEIGHT_COMMAND / 2
        parts.append(text(LEFT + WIDTH + 8, middle - 7, "commands differ by", "start"))
        parts.append(text(LEFT + WIDTH + 8, middle + 9, "at most [rad/s]", "start"))
        top += HEIGHT_COMMAND
        key = LEFT + WIDTH + 8
        for y, name, colour, dashes in ((TOP - 18, "recorded", RECORDED, ""), (TOP - 2, "what if", WHAT_IF, "5 3")):
            parts.append(line(key, y, key + 28, y, colour, f'stroke-width="2" stroke-dasharray="{dashes or "none"}"'))
            parts.append(text(key + 36, y + 4, name, "start"))
        return document(LEFT + WIDTH + RIGHT, top + BELOW, title, parts)

    def _places(self) -> list[tuple[float, _Bin]]:
        return [(index * self._per_bin + each.steps / 2.0, each) for index, each in enumerate(self._bins)]

    def _axes(
        self, label: str, ticks: tuple[float, ...], top: float, height: float, high: float, up_ticks: tuple[float, ...]
    ) -> tuple[Axis, Axis]:
        end = float(max(self._count, 1))
        return Axis(label, 0.0, end, LEFT, LEFT + WIDTH, ticks), Axis("", 0.0, high, top + height, top, up_ticks)

    def _episode_lines(self, across: Axis, top: float, height: float, numbered: bool) -> list[str]:
        parts: list[str] = []
        written = float("-inf")
        for begin, episode in self._episodes:
            x = across.at(float(begin))
            parts.append(line(x, top, x, top + height, EPISODE))
            if numbered and x - written > 60.0:
                parts.append(text(x + 2, top - 5, f"episode {episode}", "start", 10))
                written = x
        return parts


class _Bin:
    """Some steps in a row."""

    def __init__(self, behaviors: int) -> None:
        self.steps = 0
        self.recorded = [0.0] * behaviors
        self.what_if = [0.0] * behaviors
        self.command_rad_s = 0.0

    def add(self, compared: Compared) -> None:
        recorded = compared.step.decision
        assert recorded is not None
        self.steps += 1
        self.recorded = [a + b for a, b in zip(self.recorded, recorded.weights, strict=True)]
        self.what_if = [a + b for a, b in zip(self.what_if, compared.decision.weights, strict=True)]
        self.command_rad_s = max(self.command_rad_s, compared.command_rad_s)


def _curve(across: Axis, up: Axis, points: Sequence[tuple[float, float]], colour: str, dashes: str) -> str:
    path = " ".join(f"{number(across.at(x))},{number(up.at(y))}" for x, y in points)
    style = f' stroke-dasharray="{dashes}"' if dashes else ""
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"{style}/>'
