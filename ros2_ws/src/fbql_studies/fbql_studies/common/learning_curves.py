"""Learning curves, with intervals over tree sets and their runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from fbql.statistics.inference import Resamples
from fbql.statistics.runs import Runs, ratio
from numpy.typing import NDArray

from fbql_studies.runner.study import MEASURED, Result

Trainings = Mapping[tuple[int, int], Mapping[str, Any]]
"""(tree seed, seed) -> result with `curve` and `size`, as `training.train` returns them."""
_DIGITS = 4


def trainings_by(
    results: Mapping[str, Result], name_of: Callable[[Result], str | None], names: Iterable[str]
) -> dict[str, Trainings]:
    """Name -> its trainings in the order of tree sets and seeds; a name without one is left out."""
    found: dict[str, dict[tuple[int, int], Result]] = {name: {} for name in names}
    for result in results.values():
        if (name := name_of(result)) in found:
            run = result["runs"][0]
            found[name][run["tree_seed"], run["seed"]] = result
    return {name: dict(sorted(trained.items())) for name, trained in found.items() if trained}


def mean_sizes(trained: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Means over trainings: sizes, and the seconds that a training took."""
    names = ("features", "bytes", "joint_states", "leaf_product")
    means = {name: sum(each["size"][name] for each in trained) / len(trained) for name in names}
    return {**means, "training_s": sum(each[MEASURED]["training_s"] for each in trained) / len(trained)}


def learning(by_name: Mapping[str, Trainings], controls: Mapping[str, Runs]) -> dict[str, Any]:
    """cost/goal and success rate during training, and those of the frozen controls.

    Returns:
        trained: name -> {episodes [points], cost and success [3][points]: estimate, low, high};
        controls: name -> {cost, success: [estimate, low, high]}.
    """
    trained = {
        name: {
            "episodes": _episodes(runs),
            "cost": _band(runs, "steps", "goals"),
            "success": _band(runs, "goals", "episodes"),
        }
        for name, runs in by_name.items()
    }
    reached = {
        name: {
            "cost": short(ratio(runs, "steps", "goals")),
            "success": short(ratio(runs, "goals", "episodes")),
        }
        for name, runs in controls.items()
    }
    return {"trained": trained, "controls": reached}


def growth(by_name: Mapping[str, Trainings]) -> dict[str, Any]:
    """Name -> joint states met so far [3][points], and the least and largest product of the leaf counts."""
    return {
        name: {
            "episodes": _episodes(runs),
            "joint_states": _band(runs, "joint_states"),
            "leaf_product": [
                min(each["size"]["leaf_product"] for each in runs.values()),
                max(each["size"]["leaf_product"] for each in runs.values()),
            ],
        }
        for name, runs in by_name.items()
    }


def _episodes(runs: Trainings) -> list[int]:
    """Number of episodes at the end of each point."""
    curve = next(iter(runs.values()))["curve"]
    return np.cumsum([part["episodes"] for part in curve]).tolist()


def _band(runs: Trainings, numerator: str, denominator: str = "") -> list[list[float | None]]:
    """A count, or the ratio of two, at each point: estimate, low, high."""
    above = _table(runs, numerator)
    below = _table(runs, denominator) if denominator else np.ones_like(above)
    band = Resamples([tree for tree, _ in runs]).ratio_band(above, below)
    return [short(line) for line in band.tolist()]


def _table(runs: Trainings, name: str) -> NDArray[np.float64]:
    return np.array([[part[name] for part in each["curve"]] for each in runs.values()], dtype=np.float64)


def short(values: Sequence[float]) -> list[float | None]:
    """The numbers with few digits; None for one that is not finite."""
    return [float(f"{x:.{_DIGITS}g}") if np.isfinite(x) else None for x in values]
