"""The table of methods that every study of fusion has, and how its cells are written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from fbql.cli.words import share_text
from fbql.statistics.tables import Row, Table, between, number, tabulate


def _control_columns(name: str, control: str) -> dict[str, str]:
    return {
        f"ratio_{name}": f"cost_per_goal over that of {control}, paired by run on the same episodes; below 1 is better; "
        "null where either has no goal or nothing is compared",
        f"ratio_{name}_low": f"the lower end of the 95 % interval of ratio_{name}",
        f"ratio_{name}_high": "its upper end; null where it is infinite",
        f"p_{name}": "p of the sign-flip test, paired by run, that both cost the same; null with fewer than two runs, or "
        "where nothing is compared",
    }


METHOD_COLUMNS = {
    "method": "what played",
    "runs": "number of runs, each on a tree set with a run seed",
    "episodes": "all their episodes, without the guided ones",
    "goals": "episodes that ended in a goal",
    "own_goals": "episodes that ended in an own goal",
    "timeouts": "episodes that reached the time limit",
    "success_rate": "goals / episodes",
    "cost_per_goal": "steps of all episodes / goals; null without a goal",
    "cost_low": "the lower end of its 95 % interval, a bootstrap over tree sets and their runs; null with one run",
    "cost_high": "the upper end; null where it is infinite, or with one run",
    "steps_per_success": "steps of the episodes that ended in a goal / goals; null where they were not counted separately",
    "collisions_begun_per_goal": "how often the robot began to touch a wall / goals",
    "collision_steps_per_goal": "steps in contact with a wall / goals",
    **_control_columns("paper", "Subsumption with the paper-like preset"),
    **_control_columns("tuned", "Subsumption with the tuned preset"),
    **_control_columns("retuned", "Subsumption with thresholds tuned for each tree set"),
    **_control_columns("frozen", "the frozen twin of the literal FBQL, which never learned"),
    **_control_columns(
        "untrained",
        "the frozen twin that never learned (in the ablation and the sensitivity study: the default's)",
    ),
    **_control_columns(
        "guided",
        "the frozen twin that stopped learning after the guided episodes (in the ablation and the sensitivity study: the "
        "default's)",
    ),
    **_control_columns("default", "fbql with its defaults, trained alike"),
}
"""Column of a method's row -> its meaning."""
SIZE_COLUMNS = {
    "joint_states": "joint states met, mean over runs",
    "features": "features met, mean over trainings",
    "bytes": "bytes of the arrays of a policy that grow with them, mean over trainings",
    "leaf_product": "the product of the leaf counts, mean over trainings",
    "training_steps": "simulated steps of a training, mean; without guided episodes in the ladder, with them among the peers",
    "training_s": "seconds of a training, mean",
}


def methods_table(rows: Sequence[Row], controls: Mapping[str, str]) -> Table:
    """A row for each method; for each control cost/goal relative to it, its interval, and p.

    Args:
        controls: short name of a control in the rows' columns -> its name in the table head.
    """
    columns: dict[str, Callable[[Row], str]] = {
        "method": lambda row: row["method"],
        "runs": lambda row: str(row["runs"]),
        "goals / episodes": lambda row: f"{row['goals']} / {row['episodes']}",
        "own goals": lambda row: str(row["own_goals"]),
        "timeouts": lambda row: str(row["timeouts"]),
        "success rate": lambda row: share(row["success_rate"]),
        "cost/goal (95 %)": cost,
        "steps of a success": lambda row: number(row["steps_per_success"], ".0f"),
        "collisions, contact steps / goal": lambda row: (
            f"{number(row['collisions_begun_per_goal'], '.1f')}, {number(row['collision_steps_per_goal'], '.0f')}"
        ),
    }
    columns |= {f"to {label}": partial(compared, name=name) for name, label in controls.items()}
    return tabulate((row for row in rows if "method" in row), columns)


def cost(row: Row) -> str:
    """cost/goal with its interval."""
    return between(row, "cost_per_goal", "cost_low", "cost_high", ".0f")


def compared(row: Row, name: str) -> str:
    """cost/goal relative to a control, with p; empty without a control or for the control itself. One run has no p."""
    ratio, low, high = f"ratio_{name}", f"ratio_{name}_low", f"ratio_{name}_high"
    p = row.get(f"p_{name}")
    is_itself = p is None and row.get(low) == row.get(high) == 1.0
    if row.get(ratio) is None or is_itself:
        return ""
    return between(row, ratio, low, high, ".2f") + ("" if p is None else f", p {_p(p)}")


def _p(value: float) -> str:
    return f"{value:.2g}".removeprefix("0") if value < 1.0 else "1"


def share(value: float | None) -> str:
    """A share with three decimals; empty where there is none."""
    return "" if value is None else share_text(value, 3)


def byte_text(count: float) -> str:
    """A number of bytes with its unit."""
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count:.0f} B"
