"""The tables of the study of the mux: each method on the test rooms, compared with the tuned priorities on the same rooms.

Intervals cover the randomness of both trainings and rooms: each resample draws trainings and, independently, rooms, the same for
both methods of a comparison (the pigeonhole bootstrap; Owen 2007, The Pigeonhole Bootstrap, Annals of Applied Statistics 1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from fbql.statistics.inference import RESAMPLES, SEED
from fbql.statistics.tables import Row, Table, between, finite, number, tabulate
from numpy.typing import NDArray

from fbql_studies.runner.study import Result

TUNED, BEST_BLEND = "priorities, tuned", "best constant blend"
COLUMNS = {
    "method": "what drives",
    "family": "family of rooms",
    "noise_m": "standard deviation of the scan's noise [m]",
    "trained": "training episodes before the policy was tested; none for what does not learn",
    "runs": "trainings, or 1",
    "rooms": "test rooms, each played once by each run",
    "success": "share of the rooms in which the goal was reached",
    "success_low": "low end of its 95 % interval, over trainings and rooms",
    "success_high": "high end",
    "collisions": "share of the rooms that ended in a collision",
    "cost": "steps per goal reached, where a failure counts 400 however early it came",
    "ratio": "cost relative to the tuned priorities' on the same rooms",
    "ratio_low": "low end of its 95 % interval",
    "ratio_high": "high end",
    "ratio_worst": "that of the worst training",
    "gain": "success minus that of the tuned priorities",
    "gain_low": "low end of its 95 % interval",
    "gain_high": "high end",
    "training_collisions": "collisions of a training, mean",
    "training_steps": "steps of a training, mean",
    "what": "what was chosen on the rooms of tuning",
    "candidates": "among how many it was chosen",
}
Floats = NDArray[np.float64]
Condition = tuple[str, float]


class Played(NamedTuple):
    """A method on the test rooms of a condition."""

    costs: Floats
    """[runs, rooms]"""
    outcomes: NDArray[np.str_]
    """One letter each, [runs, rooms]."""

    @classmethod
    def of(cls, runs: Sequence[Result]) -> Played:
        """The runs of a method."""
        return cls(
            np.array([run["costs"] for run in runs], dtype=np.float64),
            np.array([list(run["outcomes"]) for run in runs]),
        )

    @property
    def reached(self) -> Floats:
        """1 where the goal was reached, else 0, [runs, rooms]."""
        return (self.outcomes == "s").astype(np.float64)

    def resampled(self, rooms: Floats, generator: np.random.Generator) -> tuple[Floats, Floats]:
        """Cost and reached goals, summed over resampled runs and rooms, [resamples] each.

        Args:
            rooms: how often each room was drawn, [resamples, rooms].
        """
        n = len(self.costs)
        drawn = generator.multinomial(n, [1.0 / n] * n, size=len(rooms)) / n
        return (drawn @ self.costs * rooms).sum(axis=1), (drawn @ self.reached * rooms).sum(axis=1)


def table(results: Mapping[str, Result]) -> list[Row]:
    """A row for each method, condition and number of training episodes."""
    runs: dict[tuple[str, Condition, int | None], list[Result]] = {}
    for result in results.values():
        for run in result.get("runs", ()):
            key = (run["method"], (run["family"], run["noise_m"]), run.get("trained"))
            runs.setdefault(key, []).append(run)
    chosen = _chosen(results)
    for (method, family), best in chosen.items():
        runs[method, (family, 0.0), None] = [best["test"]]
    played = {key: Played.of(found) for key, found in runs.items()}
    rows: list[Row] = []
    for key in sorted(played, key=_order):
        method, condition, trained = key
        family, noise_m = condition
        reference = played.get((TUNED, condition, None)) or played.get((GUIDE, condition, None))
        row: Row = {"method": method, "family": family, "noise_m": noise_m, "trained": trained}
        row |= _compared(played[key], reference)
        curves = [result["curve"] for result in results.values() if trained and _is_of(result, method, trained)]
        for name in ("collisions", "steps"):
            sums = [sum(point[name] for point in curve) for curve in curves]
            row[f"training_{name}"] = sum(sums) / len(sums) if sums else None
        best = chosen.get((method, family))
        row |= {"what": best and str(best["what"]), "candidates": best and best["candidates"]}
        rows.append(finite(row))
    return rows


GUIDE = "priorities, the guide"
"""The setting committed as `TUNED` of `rooms.priorities`. With noise it is the reference: nothing is tuned there again."""


def _is_of(result: Result, method: str, trained: int) -> bool:
    """Whether a result is a training that ended after so many episodes."""
    runs = result.get("runs", ())
    return "curve" in result and runs[0]["method"] == method and runs[-1]["trained"] == trained


def _order(key: tuple[str, Condition, int | None]) -> tuple[Any, ...]:
    method, condition, trained = key
    return (condition[1], condition[0] != "traps", method.startswith("learned"), method, trained or 0)


def _chosen(results: Mapping[str, Result]) -> dict[tuple[str, str], Result]:
    """(method, family) -> the candidate that cost least on the tuning rooms; of equals, the first."""
    names = {"settings": TUNED, "blends": BEST_BLEND}
    found: dict[tuple[str, str], list[Result]] = {}
    for result in results.values():
        if "candidates" in result:
            found.setdefault((names[result["part"]], result["family"]), []).extend(result["candidates"])
    return {key: {**min(each, key=_tuning_cost), "candidates": len(each)} for key, each in found.items()}


def _tuning_cost(candidate: Result) -> float:
    counts = candidate["tuning"]
    return counts["cost"] / counts["successes"] if counts["successes"] else float("inf")


def _compared(ours: Played, theirs: Played | None) -> Row:
    """Success, collisions and cost, and how they compare."""
    runs, rooms = ours.costs.shape
    generator = np.random.default_rng(SEED)
    counts = generator.multinomial(rooms, [1.0 / rooms] * rooms, size=RESAMPLES).astype(np.float64)
    cost, reached = ours.resampled(counts, generator)
    row: Row = {
        "runs": runs,
        "rooms": rooms,
        "success": float(ours.reached.mean()),
        **_ends("success", reached / rooms),
        "collisions": float((ours.outcomes == "c").mean()),
        "cost": _ratio(ours.costs.sum(), ours.reached.sum()),
    }
    if theirs is None or theirs.costs.shape[1] != rooms:
        return row
    their_cost, their_reached = theirs.resampled(counts, generator)
    own = _ratio(theirs.costs.sum(), theirs.reached.sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = (cost / reached) / (their_cost / their_reached)
        worst = float(np.max(ours.costs.sum(axis=1) / ours.reached.sum(axis=1))) / own
    row |= {"ratio": row["cost"] / own, **_ends("ratio", ratios), "ratio_worst": worst}
    row |= {"gain": row["success"] - float(theirs.reached.mean()), **_ends("gain", (reached - their_reached) / rooms)}
    return row


def _ratio(numerator: float, denominator: float) -> float:
    return float(numerator / denominator) if denominator else float("inf")


def _ends(name: str, values: Floats) -> Row:
    """The 95 % percentile interval."""
    if np.isnan(values).any() or np.isinf(values).any():
        return {f"{name}_low": None, f"{name}_high": None}
    low, high = np.percentile(values, [2.5, 97.5])
    return {f"{name}_low": float(low), f"{name}_high": float(high)}


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table, one for each family and noise."""
    found: dict[str, Table] = {}
    for family, noise_m in dict.fromkeys((row["family"], row["noise_m"]) for row in rows):
        own = [row for row in rows if (row["family"], row["noise_m"]) == (family, noise_m)]
        title = f"{family}, scan noise {noise_m:g} m" if noise_m else family
        found[title] = tabulate(
            own,
            {
                "method": lambda row: row["method"],
                "episodes": lambda row: number(row["trained"], ".0f"),
                "runs": lambda row: str(row["runs"]),
                "success (95 %)": lambda row: between(row, "success", "success_low", "success_high", ".3f"),
                "collisions": lambda row: number(row["collisions"], ".3f"),
                "cost": lambda row: number(row["cost"], ".0f"),
                "cost / tuned priorities' (95 %)": lambda row: (
                    between(row, "ratio", "ratio_low", "ratio_high", ".3f") if row.get("ratio") is not None else ""
                ),
                "worst": lambda row: number(row.get("ratio_worst"), ".3f") if row["runs"] > 1 else "",
                "success gained (95 %)": lambda row: (
                    between(row, "gain", "gain_low", "gain_high", "+.3f") if row.get("gain") is not None else ""
                ),
                "collisions in training": lambda row: number(row["training_collisions"], ".0f"),
            },
        )
    chosen = [row for row in rows if row["what"]]
    if chosen:
        found["chosen"] = tabulate(
            chosen,
            {
                "method": lambda row: row["method"],
                "family": lambda row: row["family"],
                "of": lambda row: str(row["candidates"]),
                "what": lambda row: f"`{row['what']}`",
            },
        )
    return found
