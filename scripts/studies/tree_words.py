"""The tables of the study of trees as Markdown, for docs/trees.md; a test compares them with the committed data."""

from __future__ import annotations

from collections.abc import Sequence

from studies.study import Row
from studies.tree_play import PRESETS, SETTINGS

BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")


def tables(rows: Sequence[Row]) -> dict[str, str]:
    """Name -> table: the trees, play with each thresholds, and the leaf counts of the known seeds."""
    found = {"trees": _trees([row for row in rows if "rmse_levels" in row])}
    for name in SETTINGS:
        found[name] = _play([row for row in rows if row.get("thresholds") == name])
    found["bands"] = _bands([row for row in rows if "band" in row])
    return found


def title_of(name: str) -> str:
    """How thresholds are spoken of."""
    if name not in PRESETS:
        return f"{name} thresholds"
    return f"{name} thresholds ({PRESETS[name].wall_m:g} m, {PRESETS[name].approach_rad:g} rad)"


def _trees(rows: Sequence[Row]) -> str:
    by_method: dict[str, dict[str, Row]] = {}
    for row in rows:
        by_method.setdefault(row["method"], {})[row["behavior"]] = row
    head = ["method", *(f"{name.replace('_', ' ')}: leaves, error, value" for name in BEHAVIORS)]
    body = [
        [method, *(f"{of[name]['leaves']:.0f}, {of[name]['rmse_levels']:.2f}, {_share(of[name]['value_to_dp'])}" for name in BEHAVIORS)]
        for method, of in by_method.items()
    ]  # fmt: skip
    return _markdown(head, body)


def _play(rows: Sequence[Row]) -> str:
    head = ["method", "success [%]", "steps / goal", "against shipped", "p", "own goals [%]", "timeouts [%]", "collisions", "contact steps"]  # fmt: skip
    body = [
        [
            row["method"],
            _between(row, "success_rate", "success_low", "success_high", 100.0, ".1f"),
            _between(row, "cost_per_goal", "cost_low", "cost_high", 1.0, ".0f"),
            _between(row, "cost_to_shipped", "ratio_low", "ratio_high", 1.0, ".2f"),
            "" if row["p"] is None else f"{row['p']:.2g}",
            f"{100.0 * row['own_goals']:.1f}",
            f"{100.0 * row['timeouts']:.1f}",
            f"{row['collisions_begun']:.1f}",
            f"{row['collision_steps']:.1f}",
        ]
        for row in rows
    ]
    return _markdown(head, body)


def _bands(rows: Sequence[Row]) -> str:
    head = ["objective", "behavior", "leaves with seeds 1 to 8", "band", "inside"]
    body = [
        [
            row["objective"],
            row["behavior"].replace("_", " "),
            row["leaves_of_seeds_1_to_8"],
            row["band"],
            f"{row['inside']} of {row['n']}",
        ]
        for row in rows
    ]
    return _markdown(head, body)


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _between(row: Row, middle: str, low: str, high: str, scale: float, form: str) -> str:
    """An estimate with its interval; empty where there is none."""
    if row[middle] is None:
        return ""
    words = f"{row[middle] * scale:{form}}"
    if row[low] is not None and row[high] is not None:
        words += f" ({row[low] * scale:{form}} to {row[high] * scale:{form}})"
    return words


def _markdown(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *body]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
