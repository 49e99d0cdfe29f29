"""What-if as a figure: each behavior's weight as recorded and recomputed, and by how much the commands differ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from fbql.pictures.style import GREY, ORANGE, STYLE, svg_bytes, text
from fbql.replay.what_if import Compared

BINS = 600
"""Points of a curve at most: each stands for several steps in a long run."""
_MOST_NUMBERED = 12
"""Episodes whose number is written."""


class WhatIfFigure:
    """Collects steps and draws them. Memory does not grow with the number of steps.

    Args:
        behaviors: names, in order.
        steps: roughly how many steps will come.
    """

    def __init__(self, behaviors: Sequence[str], steps: int) -> None:
        self._behaviors = tuple(behaviors)
        self._per_bin = -(-max(steps, 1) // BINS)
        self._bins: list[_Bin] = []
        self._count = 0
        self._episodes: list[tuple[int, int]] = []
        """First step and number of each episode."""

    def add(self, compared: Compared) -> None:
        """Adds a step."""
        if not self._episodes or self._episodes[-1][1] != compared.step.episode:
            self._episodes.append((self._count, compared.step.episode))
        if self._count % self._per_bin == 0:
            self._bins.append(_Bin(len(self._behaviors)))
        self._bins[-1].add(compared)
        self._count += 1

    def svg(self, title: str) -> bytes:
        """The figure as SVG."""
        at = [index * self._per_bin + each.steps / 2.0 for index, each in enumerate(self._bins)]
        with rc_context(STYLE):
            rows = len(self._behaviors) + 1
            figure = Figure((10.0, 1.0 + 1.3 * rows), layout="constrained")
            axes = figure.subplots(rows, 1, sharex=True)
            for index, name in enumerate(self._behaviors):
                recorded = [each.recorded[index] / each.steps for each in self._bins]
                what_if = [each.what_if[index] / each.steps for each in self._bins]
                axes[index].plot(at, recorded, "-", color=GREY, label="recorded", gid=f"recorded_{index}")
                axes[index].plot(at, what_if, "--", color=ORANGE, label="what if", gid=f"what_if_{index}")
                axes[index].set_ylim(-0.05, 1.05)
                axes[index].set_ylabel(text(f"weight of\n{name}"))
            axes[-1].plot(at, [each.command_rad_s for each in self._bins], "-", color=ORANGE, gid="commands")
            axes[-1].set_ylim(bottom=0.0)
            axes[-1].set_ylabel("largest difference\nof commands [rad/s]")
            axes[-1].set_xlabel("step of the recording")
            self._mark_episodes(axes)
            axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.12), ncols=2, frameon=False)
            figure.suptitle(text(title), x=0.01, ha="left", fontsize=9)
            return svg_bytes(figure)

    def _mark_episodes(self, axes: np.ndarray) -> None:
        every = -(-len(self._episodes) // _MOST_NUMBERED)
        for place, (begin, episode) in enumerate(self._episodes):
            for each in axes:
                each.axvline(begin, color=GREY, lw=0.5, alpha=0.5)
            if place % every == 0:
                axes[0].annotate(
                    f"episode {episode}", (begin, 1.0), xycoords=("data", "axes fraction"), fontsize=7, va="bottom"
                )


class _Bin:
    """Sums over consecutive steps."""

    def __init__(self, behaviors: int) -> None:
        self.steps = 0
        self.recorded = np.zeros(behaviors)
        self.what_if = np.zeros(behaviors)
        self.command_rad_s = 0.0

    def add(self, compared: Compared) -> None:
        recorded = compared.step.decision
        assert recorded is not None
        self.steps += 1
        self.recorded += recorded.weights
        self.what_if += compared.decision.weights
        self.command_rad_s = max(self.command_rad_s, compared.command_rad_s)
