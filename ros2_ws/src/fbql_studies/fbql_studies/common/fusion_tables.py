"""The table of methods that every study of fusion has, and how its cells are written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from fbql.cli.words import share_text
from fbql.statistics.inference import holm
from fbql.statistics.tables import Row, Table, between, number, tabulate


def control_columns(name: str, control: str) -> dict[str, str]:
    """The columns in which a method is compared with a control -> their meaning. `name` is the control's short one."""
    return {
        f"ratio_{name}": f"cost_per_goal over that of {control}, paired by run on the same episodes; below 1 is better; "
        "null where either has no goal or nothing is compared",
        f"ratio_{name}_low": f"the lower end of the 95 % interval of ratio_{name}",
        f"ratio_{name}_high": "its upper end; null where it is infinite",
        f"p_{name}": "p of the sign-flip test, paired by run, that both cost the same, as if runs on one tree set were "
        "independent; not corrected for other comparisons; null with fewer than two runs, or where nothing is compared",
        f"p_trees_{name}": "p of Student's t test that both cost the same, on one number per tree set: the mean over its runs "
        "of the logarithm of the ratio; not corrected; null with fewer than two tree sets, or where nothing is compared",
        f"improves_{name}": f"probability that a run costs less than one of {control} on the same tree set, equal ones by "
        "half (Agarwal et al. 2021); null where nothing is compared",
        f"improves_{name}_low": "the lower end of its 95 % interval, a bootstrap over tree sets and their runs",
        f"improves_{name}_high": "the upper end",
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
    "iqm_cost": "interquartile mean of cost/goal over runs: without the lowest and the highest quarter; a run without a goal "
    "costs all its steps",
    "iqm_cost_low": "the lower end of its 95 % interval, a bootstrap over tree sets and their runs; null with one run",
    "iqm_cost_high": "the upper end; null with one run",
    "steps_per_success": "steps of the episodes that ended in a goal / goals; null where they were not counted separately",
    "collisions_begun_per_goal": "how often the robot began to touch a wall / goals",
    "collision_steps_per_goal": "steps in contact with a wall / goals",
    **control_columns("paper", "Subsumption with the paper-like preset"),
    **control_columns("tuned", "Subsumption with the tuned preset"),
    **control_columns("retuned", "Subsumption with thresholds tuned for each tree set"),
    **control_columns("frozen", "the frozen twin of the literal FBQL, which never learned"),
    **control_columns(
        "untrained",
        "the frozen twin that never learned (in the ablation and the sensitivity study: the default's)",
    ),
    **control_columns(
        "guided",
        "the frozen twin that stopped learning after the guided episodes (in the ablation and the sensitivity study: the "
        "default's)",
    ),
    **control_columns("default", "fbql with its defaults, trained alike"),
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
    own = [row for row in rows if "method" in row]
    for name, label in controls.items():
        adjusted = adjusted_p_values(own, name)
        columns[f"to {label}"] = partial(_compared_in, name=name, adjusted=adjusted)
    return tabulate(own, columns)


def robust_table(rows: Sequence[Row], controls: Mapping[str, str]) -> dict[str, Table]:
    """Title -> table of the interquartile means, and of the probabilities of improvement on each control; no table where
    the data were measured before these were computed."""
    own = [row for row in rows if row.get("iqm_cost") is not None]
    if not own:
        return {}
    columns: dict[str, Callable[[Row], str]] = {
        "method": lambda row: row["method"],
        "IQM of cost/goal (95 %)": lambda row: between(row, "iqm_cost", "iqm_cost_low", "iqm_cost_high", ".0f"),
    }
    for name, label in controls.items():
        columns[f"improves on {label}"] = partial(_improvement, name=name)
    return {"interquartile means and probabilities of improvement": tabulate(own, columns)}


def _compared_in(row: Row, name: str, adjusted: Mapping[str, float | None]) -> str:
    return compared(row, name, adjusted[row["method"]])


def _improvement(row: Row, name: str) -> str:
    middle, low, high = f"improves_{name}", f"improves_{name}_low", f"improves_{name}_high"
    return "" if row.get(middle) is None else between(row, middle, low, high, ".2f")


def adjusted_p_values(rows: Sequence[Row], name: str) -> dict[str, float | None]:
    """Method -> p of the comparison with a control, adjusted by Holm for the rows of its column.

    That of the t test over tree sets; that of the sign-flip test over runs where the data have only one tree set, or were
    measured before the other was computed.
    """
    has_trees = any(row.get(f"p_trees_{name}") is not None for row in rows)
    column = f"p_trees_{name}" if has_trees else f"p_{name}"
    return dict(zip((row["method"] for row in rows), holm([row.get(column) for row in rows]), strict=True))


def cost(row: Row) -> str:
    """cost/goal with its interval."""
    return between(row, "cost_per_goal", "cost_low", "cost_high", ".0f")


def compared(row: Row, name: str, p: float | None) -> str:
    """cost/goal relative to a control, with p; empty without a control or for the control itself. One run has no p."""
    ratio, low, high = f"ratio_{name}", f"ratio_{name}_low", f"ratio_{name}_high"
    is_itself = row.get(f"p_{name}") is None and row.get(low) == row.get(high) == 1.0
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
