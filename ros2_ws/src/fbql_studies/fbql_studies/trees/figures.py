"""The figures of the study of trees."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from math import degrees, nan
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from fbql.statistics.inference import ratio_of_sums
from fbql.statistics.tables import Row
from fbql_behaviors.core.boxes import find_boxes
from fbql_behaviors.core.induction import learn, plan
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.quantizer import LEVEL_RAD_S, levels_of_classes
from fbql_behaviors.core.recipes import RECIPES
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import NullLocator

from fbql_studies.common.drawing import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILLION, draw
from fbql_studies.common.pattern_sets import OBJECTIVES, PatternSet, induced, setting
from fbql_studies.common.team_play import SETTINGS, spoken
from fbql_studies.runner.study import Result
from fbql_studies.trees.methods import BANDS, FIRST_SEED, KNOWN_SEEDS, SHIPPED, TRIALS, methods_of

COLOURS = {"weighted": BLUE, "printed": VERMILLION, "cart": GREEN, "cart by entropy": PURPLE, "optimal": BLACK}
TURNS = LinearSegmentedColormap.from_list("turns", [ORANGE, "#ffffff", BLUE])
"""Right turns are orange, left turns are blue."""
MAX_TURN = 5.0
PAPER_LEAVES = {"ball_seeking": (110, 122), "wall_avoiding": (11,), "approaching": (37,)}
DIVERGENCE_TRIALS = 200
BEHAVIORS = tuple(RECIPES)


def draw_all(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """Draws every figure for which there are results."""
    known = next((result["leaves"] for result in results.values() if "leaves" in result), None)
    sizes = [row for result in results.values() for row in result.get("sizes", [])]
    methods = methods_of(results)
    sets = {behavior: PatternSet(behavior, FIRST_SEED) for behavior in BEHAVIORS}
    drawings: dict[str, Callable[[], Figure]] = {
        "patterns": partial(patterns_figure, sets),
        "partition": partial(partition_figure, sets),
        "divergence": partial(divergence_figure, sets["ball_seeking"]),
    }
    if known and SHIPPED in methods:
        drawings["leaf_counts"] = partial(leaf_counts_figure, known, methods)
    if sizes:
        drawings["sizes"] = partial(sizes_figure, sizes)
    if SHIPPED in methods:
        drawings["trials"] = partial(trials_figure, methods)
        drawings["play"] = partial(play_figure, methods)
    return draw({name: lambda figure: figure() for name in drawings}, drawings, directory, "trees")


def patterns_figure(sets: Mapping[str, PatternSet]) -> Figure:
    """The paper's Fig. 2: the patterns of each behavior."""
    figure, axes = _panels(3, height=3.0)
    for axis, (behavior, patterns) in zip(axes, sets.items(), strict=True):
        patterns = patterns.training
        x, y = _places(patterns.features, patterns.x)
        _over_features(axis, patterns.features)
        axis.set_facecolor("#d8d8d8")
        axis.scatter(
            x, y, s=5, c=_turn(levels_of_classes(patterns.wheel_class)), cmap=TURNS, norm=_turns(), lw=0,
            rasterized=True,
        )  # fmt: skip
        axis.set_title(f"{spoken(behavior)}: {len(patterns)} patterns")
    _turn_bar(figure, axes)
    return figure


def partition_figure(sets: Mapping[str, PatternSet]) -> Figure:
    """The paper's Fig. 3: the leaves, their references, and the patterns that they were made from."""
    figure, axes = _panels(3, rows=2, height=5.6)
    for row, objective in zip(axes.reshape(2, 3), OBJECTIVES, strict=True):
        for axis, (behavior, patterns) in zip(row, sets.items(), strict=True):
            tree = induced(patterns, objective, trials=50).tree
            for leaf, region in zip(tree.leaves, tree.regions(), strict=True):
                (left, right), (bottom, top) = (
                    _drawn(feature, edges) for feature, edges in zip(tree.features, region, strict=True)
                )
                levels = np.array([[leaf.left_rad_s, leaf.right_rad_s]]) / LEVEL_RAD_S
                axis.add_patch(
                    Rectangle(
                        (left, bottom), right - left, top - bottom, fc=TURNS(_turns()(_turn(levels)[0])), ec="#777777",
                        lw=0.4, hatch="////" if levels.sum() < 0.0 else None, clip_on=False,
                    )
                )  # fmt: skip
            x, y = _places(tree.features, patterns.training.x)
            axis.scatter(x, y, s=1.2, c=BLACK, lw=0, rasterized=True)
            _over_features(axis, tree.features)
            axis.set_title(f"{spoken(behavior)}, {objective}: {tree.leaf_count} leaves")
    _turn_bar(figure, axes)
    return figure


def leaf_counts_figure(
    known: Mapping[str, Mapping[str, Sequence[int]]], methods: Mapping[str, Mapping[int, Any]]
) -> Figure:
    """Leaves over demonstration seeds beside the paper's."""
    figure, axes = _panels(3, height=2.8)
    for axis, behavior in zip(axes, BEHAVIORS, strict=True):
        low, high = BANDS[behavior]
        axis.axhspan(low, high, color="#eeeeee", label="accepted band")
        for paper in PAPER_LEAVES[behavior]:
            axis.axhline(paper, color=BLACK, lw=1, ls="--", label="the paper's" if paper > 110 or low < 95 else None)
        for objective, offset, marker in zip(OBJECTIVES, (-0.15, 0.15), "os", strict=True):
            counts = [*known[objective][behavior]]
            fresh = [each["trees"][behavior]["leaves"] for each in methods[f"{objective} rl 50"].values()]
            places = np.arange(len(counts) + len(fresh)) + offset
            axis.plot(places, [*counts, *fresh], marker, ms=4, color=COLOURS[objective], label=objective)
        axis.axvline(len(KNOWN_SEEDS) - 0.5, color=GREY, lw=0.6)
        count = len(methods[SHIPPED])
        axis.set_xticks([3.5, len(KNOWN_SEEDS) + (count - 1) / 2], ["seeds 1-8", f"{count} seeds from {FIRST_SEED}"])
        axis.tick_params(axis="x", length=0)
        axis.set_ylim(0)
        axis.set_title(spoken(behavior))
    axes[0].set_ylabel("leaves")
    axes[0].legend(loc="lower right", frameon=False)
    return figure


def sizes_figure(sizes: Sequence[Row]) -> Figure:
    """Held-out error against the number of leaves: exact trees of either objective, CART beside them."""
    figure, axes = _panels(3, height=3.2)
    styles: dict[str, dict[str, Any]] = {
        "weighted": {"color": BLUE, "marker": "o"},
        "printed": {"color": VERMILLION, "marker": "x"},
        "printed, its recipe's limits": {"color": ORANGE, "marker": "s"},
        "cart": {"color": GREEN, "ls": "--"},
        "cart by entropy": {"color": PURPLE, "ls": ":"},
    }
    for axis, behavior in zip(axes, BEHAVIORS, strict=True):
        for name, style in styles.items():
            rows = [row for row in sizes if row["behavior"] == behavior and row["method"] == name]
            key = "leaves" if name.startswith("cart") else "split_cost"
            points: list[tuple[float, float]] = []
            for _, group in groupby(sorted(rows, key=lambda row: row[key]), key=lambda row: row[key]):
                seeds = list(group)
                points.append((median(row["leaves"] for row in seeds), median(row["rmse_levels"] for row in seeds)))
            axis.plot(*zip(*sorted(points), strict=True), lw=1.2, ms=3.5, label=name, **style)
        axis.set_xscale("log")
        axis.set_xticks((1, 10, 100), ("1", "10", "100"))
        axis.set_xlabel("leaves")
        axis.set_title(spoken(behavior))
        axis.set_ylim(0)
    axes[0].set_ylabel("held-out error [levels]")
    axes[0].legend(loc="lower left", frameon=False, fontsize=8)
    return figure


def divergence_figure(patterns: PatternSet) -> Figure:
    """max Q of the root after each trial: eq. 4 as printed, and with -Q."""
    figure, (axis,) = _panels(1, height=3.2, width=5.2)
    parameters = replace(
        setting(patterns, "printed"), trials=DIVERGENCE_TRIALS, optimism=0.0, epsilon_start=1.0, epsilon_end=0.0
    )
    boxes = find_boxes(patterns.training, (4, 4))
    trials = range(1, DIVERGENCE_TRIALS + 1)
    for update, colour in (("printed", VERMILLION), ("converging", BLUE)):
        for alpha, line in ((0.1, "--"), (0.5, "-")):
            changed = replace(parameters, update=update, learning_rate=alpha)
            curve = learn(boxes, changed, np.random.default_rng(patterns.seed)).curve
            name = "as printed" if update == "printed" else "with $-Q$"
            axis.plot(
                trials, [value or np.nan for value in curve], line, color=colour, label=rf"{name}, $\alpha$={alpha}"
            )
    axis.axhline(plan(boxes, parameters).value, color=BLACK, lw=1, ls=":", label="dynamic programming")
    axis.set_yscale("log")
    axis.set_xlabel("trial")
    axis.set_ylabel(r"$\max_a Q$ of the root [nat]")
    axis.legend(frameon=False)
    return figure


def trials_figure(methods: Mapping[str, Mapping[int, Any]]) -> Figure:
    """Value, held-out error and play against trials, with optimism and from Q = 0, and the exact optimum."""
    figure, axes = _panels(4, rows=2, height=5.2, width=11.0)
    places = [*TRIALS, 4 * max(TRIALS)]
    for row, key, label in zip(axes.reshape(2, 4), ("value", "rmse_levels"), ("value / optimum", "held-out error [levels]"), strict=True):  # fmt: skip
        for axis, behavior in zip(row, BEHAVIORS, strict=False):
            for objective, ending, style in _lines():
                values = [
                    [value for each in methods[name].values() if (value := each["trees"][behavior][key]) is not None]
                    or [nan]
                    for name in _names(objective, ending)
                ]
                _band(axis, places, [median(each) for each in values], values, style, objective, ending)
            if key == "value":
                axis.set_ylim(-0.5, 1.05)
                axis.set_title(spoken(behavior))
            else:
                axis.set_ylim(0)
        row[0].set_ylabel(label)
    for axis, name, label in ((axes[3], "fixed", "success rate"), (axes[7], "fixed", "steps / goal")):
        numerator, denominator = ("goals", "episodes") if label == "success rate" else ("steps", "goals")
        for objective, ending, style in _lines():
            found = [
                ratio_of_sums(
                    [each["play"][name][numerator] for each in methods[method].values()],
                    [each["play"][name][denominator] for each in methods[method].values()],
                )
                for method in _names(objective, ending)
            ]
            _band(
                axis, places, [each.estimate for each in found], [each[1:] for each in found], style, objective, ending
            )
        axis.set_ylabel(label)
    axes[3].set_title("the team (0.07 m, 0.15 rad)")
    axes[7].set_yscale("log")
    for axis in axes:
        axis.set_xscale("log")
        axis.set_xticks(places, [*map(str, TRIALS), "DP"])
        axis.minorticks_off() if axis is not axes[7] else axis.xaxis.set_minor_locator(NullLocator())
    for axis in axes[4:]:
        axis.set_xlabel("trials")
    axes[0].legend(loc="lower right", frameon=False, fontsize=8)
    return figure


def _lines() -> list[tuple[str, str, str]]:
    return [
        (objective, ending, style) for objective in OBJECTIVES for ending, style in (("", "-"), (", Q from 0", ":"))
    ]


def _names(objective: str, ending: str) -> list[str]:
    return [*(f"{objective} rl {n}{ending}" for n in TRIALS), f"{objective} dp"]


def _band(
    axis: Axes,
    places: Sequence[int],
    middle: Sequence[float],
    spread: Sequence[Sequence[float]],
    style: str,
    objective: str,
    ending: str,
) -> None:
    colour = COLOURS[objective]
    axis.plot(places, middle, style, marker="o", ms=3, color=colour, label=f"{objective}{ending}")
    axis.fill_between(places, [min(s) for s in spread], [max(s) for s in spread], color=colour, alpha=0.12, lw=0)


def play_figure(methods: Mapping[str, Mapping[int, Any]]) -> Figure:
    """Cost of a goal and success rate of each method's trees, with confidence intervals over the seeds."""
    shown = [method for method, by_seed in methods.items() if _is_played_in_full(method, by_seed)]
    figure, axes = _panels(len(SETTINGS), rows=2, height=0.36 * len(shown) + 1.6)
    kinds = (("steps / goal", "steps", "goals"), ("success rate", "goals", "episodes"))
    for row, (label, numerator, denominator) in zip(axes.reshape(2, -1), kinds, strict=True):
        for axis, name in zip(row, SETTINGS, strict=True):
            for place, method in enumerate(shown):
                scores = [each["play"][name] for each in methods[method].values()]
                found = ratio_of_sums([s[numerator] for s in scores], [s[denominator] for s in scores])
                colour = next((c for start, c in reversed(COLOURS.items()) if method.startswith(start)), GREY)
                axis.plot([found.low, found.high], [place, place], color=colour, lw=2)
                axis.plot(found.estimate, place, "o", color=colour, ms=4)
            axis.set_yticks(range(len(shown)), shown if axis is row[0] else [""] * len(shown))
            axis.invert_yaxis()
            axis.grid(axis="x", lw=0.4)
            axis.set_title(f"{name} thresholds")
            axis.set_xlabel(label)
    return figure


def _is_played_in_full(method: str, by_seed: Mapping[int, Any]) -> bool:
    """Whether a method's trees were played with all thresholds; of methods with the same name, only those with 50
    trials."""
    in_full = all(len(each["play"]) == len(SETTINGS) for each in by_seed.values())
    return in_full and not method.endswith((" rl 200", " rl 1000"))


def _panels(columns: int, rows: int = 1, height: float = 3.0, width: float = 9.5) -> tuple[Figure, Any]:
    figure = Figure((width, height), layout="constrained")
    return figure, np.ravel(figure.subplots(rows, columns, squeeze=False))


def _drawn(feature: Feature, values: Any) -> Any:
    """Values in the unit of the axis: angles are drawn in degrees."""
    return np.degrees(values) if feature.unit == "rad" else np.asarray(values)


def _places(features: Sequence[Feature], x: np.ndarray[Any, Any]) -> list[Any]:
    return [_drawn(feature, x[:, column]) for column, feature in enumerate(features)]


def _over_features(axis: Axes, features: Sequence[Feature]) -> None:
    for feature, limit, label in (
        (features[0], axis.set_xlim, axis.set_xlabel),
        (features[1], axis.set_ylim, axis.set_ylabel),
    ):
        limit(*_drawn(feature, (feature.low, feature.high)))
        label(f"{spoken(feature.name)} [{'°' if feature.unit == 'rad' else feature.unit}]")
    for feature, ticks in ((features[0], axis.set_xticks), (features[1], axis.set_yticks)):
        if feature.unit == "rad":
            ticks([degrees(k * np.pi / 2) for k in range(-2, 3)])


def _turn(levels: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Half of the difference of the wheels [levels]: how sharply a command turns to the left."""
    return (levels[:, 1] - levels[:, 0]) / 2


def _turns() -> Normalize:
    return Normalize(-MAX_TURN, MAX_TURN)


def _turn_bar(figure: Figure, axes: Any) -> None:
    bar = figure.colorbar(ScalarMappable(_turns(), TURNS), ax=list(axes), extend="both", aspect=30, pad=0.01)
    bar.set_label("right wheel - left wheel, halved [levels]")
