"""The tables of the studies of fusion as Markdown, for docs/fusion.md; a test compares them with the committed data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from studies.study import Row
from studies.tree_words import markdown, number

Data = Mapping[str, Any]
"""A study's table.json."""


def paper_tables(data: Data) -> dict[str, str]:
    """Title -> table of the paper's protocol."""
    rows = data["table"]
    controls = {"paper": "paper", "retuned": "re-tuned", "frozen": "literal twin", "guided": "only guided"}
    tied = [row for row in rows if row.get("tied_share") is not None]
    return {
        "fifty goals": _methods(rows, controls),
        "ties": markdown(
            ["method", "joint states met", "all Q equal"],
            [[row["method"], f"{row['joint_states']:.0f}", f"{row['tied_share']:.1%}"] for row in tied],
        ),
        "rung a": _rungs(rows),
    }


def ladder_tables(data: Data) -> dict[str, str]:
    """Title -> table of the ladder."""
    rows = data["table"]
    controls = {"retuned": "re-tuned", "paper": "paper", "untrained": "never learned", "guided": "only guided"}
    sets = [row for row in rows if "trees" in row]
    return {
        "frozen play": _methods(rows, controls),
        "tree sets": markdown(
            [
                "learner",
                "trees",
                "leaves",
                "thresholds",
                "re-tuned",
                "learned",
                "ratio",
                "worst run",
                "success rate",
                "own goals",
            ],
            [
                [
                    row["learner"],
                    str(row["trees"]),
                    row["leaves"],
                    f"{row['wall_m']:g} m, {row['approach_rad']:g} rad",
                    number(row["retuned_cost"], ".0f"),
                    number(row["learner_cost"], ".0f"),
                    number(row["ratio"], ".2f"),
                    number(row["worst_run"], ".2f"),
                    number(row["success_rate"], ".3f"),
                    f"{row['own_goal_rate']:.2%}",
                ]
                for row in sets
            ],
        ),
        "rungs b and c": _rungs(rows),
        "size": _sizes([row for row in rows if "trainings" in row]),
    }


def ablation_tables(data: Data) -> dict[str, str]:
    """Title -> table of the ablation."""
    controls = {"default": "default", "retuned": "re-tuned", "paper": "paper", "untrained": "never learned"}
    return {"one change each": _methods(data["table"], controls)}


def scaling_tables(data: Data) -> dict[str, str]:
    """Title -> table of the numbers of behaviors."""
    head = ["behaviors", "runs", "product of leaves", "its table", "joint states met", "features", "policy",
            "success rate", "cost/goal (95 %)", "training [s]"]  # fmt: skip
    body = [
        [
            str(row["behaviors"]),
            str(row["runs"]),
            f"{row['leaf_product']:.3g}",
            _bytes(row["table_bytes"]),
            f"{row['joint_states']:.0f}",
            f"{row['features']:.0f}",
            _bytes(row["bytes"]),
            number(row["success_rate"], ".3f"),
            _spread(row, "cost_per_goal", "cost", ".0f"),
            number(row["training_s"], ".0f"),
        ]
        for row in data["table"]
    ]
    return {"behaviors": markdown(head, body)}


def peers_tables(data: Data) -> dict[str, str]:
    """Title -> table of the peers."""
    head = ["method", "runs", "goals / episodes", "own goals", "success rate", "cost/goal (95 %)", "contact steps / goal",
            "to re-tuned", "training [s]", "played"]  # fmt: skip
    body = [
        [
            row["method"],
            str(row["runs"]),
            f"{row['goals']} / {row['episodes']}",
            str(row["own_goals"]),
            number(row["success_rate"], ".3f"),
            _spread(row, "cost_per_goal", "cost", ".0f"),
            number(row["collision_steps_per_goal"], ".0f"),
            _compared(row, "retuned"),
            number(row["training_seconds"], ".0f"),
            row["note"],
        ]
        for row in data["table"]
        if row["runs"]
    ]
    return {"the same budget": markdown(head, body)}


TABLES = {
    "paper": paper_tables,
    "ladder": ladder_tables,
    "ablation": ablation_tables,
    "peers": peers_tables,
    "scaling": scaling_tables,
}
"""Study -> its tables."""


def _methods(rows: Sequence[Row], controls: Mapping[str, str]) -> str:
    """A row for each method; of each control cost/goal relative to it, its interval, and p."""
    head = ["method", "runs", "goals / episodes", "own goals", "timeouts", "success rate", "cost/goal (95 %)",
            "steps of a success", "collisions, contact steps / goal"]  # fmt: skip
    methods = [row for row in rows if "method" in row]
    body = [
        [
            row["method"],
            str(row["runs"]),
            f"{row['goals']} / {row['episodes']}" if "episodes" in row else str(row["goals"]),
            str(row["own_goals"]),
            str(row["timeouts"]),
            number(row["success_rate"], ".3f"),
            _spread(row, "cost_per_goal", "cost", ".0f"),
            number(row["steps_per_success"], ".0f"),
            f"{number(row['collisions_begun_per_goal'], '.1f')}, {number(row['collision_steps_per_goal'], '.0f')}",
            *(_compared(row, name) for name in controls),
        ]
        for row in methods
    ]
    return markdown([*head, *(f"to {label}" for label in controls.values())], body)


def _compared(row: Row, name: str) -> str:
    """cost/goal relative to a control; empty where there is none, or it is the control itself."""
    if row.get(f"ratio_{name}") is None or row.get(f"p_{name}") is None:
        return ""
    return f"{_spread(row, f'ratio_{name}', f'ratio_{name}', '.2f')}, p {_p(row[f'p_{name}'])}"


def _p(value: float) -> str:
    return f"{value:.2g}".removeprefix("0") if value < 1.0 else "1"


def _spread(row: Row, name: str, ends: str, form: str) -> str:
    """An estimate with its interval, where it has one."""
    if row.get(name) is None:
        return ""
    low, high = row.get(f"{ends}_low"), row.get(f"{ends}_high")
    if low is None:
        return number(row[name], form)
    return f"{number(row[name], form)} ({number(low, form)} to {'∞' if high is None else number(high, form)})"


def _rungs(rows: Sequence[Row]) -> str:
    body = [
        [
            row["rung"],
            row["measure"],
            f"{row['bound']} {row['wanted']:.3g}",
            number(row["found"], ".3g"),
            "yes" if row["reached"] else "**no**",
        ]
        for row in rows
        if "rung" in row
    ]
    return markdown(["rung", "measure", "wanted", "found", "reached"], body)


def _sizes(rows: Sequence[Row]) -> str:
    body = [
        [
            row["learner"],
            str(row["trainings"]),
            f"{row['features']:.0f}",
            _bytes(row["bytes"]),
            f"{row['joint_states']:.0f} of {row['leaf_product']:.0f}",
            f"{row['training_steps']:.3g}",
            f"{row['training_s']:.0f}",
        ]
        for row in rows
    ]
    return markdown(
        ["learner", "trainings", "features", "policy", "joint states met", "steps of a training", "seconds"], body
    )


def _bytes(count: float) -> str:
    """A number of bytes in words."""
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count:.0f} B"
