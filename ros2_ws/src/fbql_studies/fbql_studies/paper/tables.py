"""The tables of the paper's protocol: methods, ties, and rung a."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import nan

from fbql.statistics.runs import Runs, cost_p_value, cost_ratio
from fbql.statistics.tables import Row, Table, finite

from fbql_studies.common.fusion_tables import METHOD_COLUMNS, SIZE_COLUMNS, control_columns, methods_table, robust_table
from fbql_studies.common.rungs import RUNG_COLUMNS, rung_row, rungs_table

OWN_GOALS, COST, P_VALUE, TWIN_COST = 0.35, 0.85, 0.01, 1.0
"""The most that rung a allows: own goals and cost/goal relative to Subsumption, its p, and cost/goal relative to a twin."""
LEARNING, FROZEN = "while learning", "frozen"
CONTROLS = {"paper": "paper", "retuned": "re-tuned", "frozen": "literal twin", "guided": "only guided",
            "untrained": "never learned"}  # fmt: skip
TWINS = {"imagined": "imagined once", "guided_data": "only guided data", "learner": "fbql, same guide"}
"""Short name of a control that only fbql_model has -> its name in the table head."""
COLUMNS = {
    **METHOD_COLUMNS,
    **control_columns("imagined", "the frozen twin that imagined after the guided episodes, and then stopped learning"),
    **control_columns(
        "guided_data", "the twin whose model is fitted to the guided episodes alone, however often it imagines"
    ),
    **control_columns("learner", "fbql with the same guide"),
    "when": "while learning: the episodes until the goals were scored; frozen: others afterwards, by what was learned until then",
    **RUNG_COLUMNS,
    "joint_states": SIZE_COLUMNS["joint_states"],
    "tied_share": "share of them in which all Q were equal in the end",
}


def rung_a_rows(method: str, by_method: Mapping[str, Runs], paper: str, *twins: str) -> list[Row]:
    """Rung a: while learning, within the paper's 50 goals, against the paper-like Subsumption and its frozen twins."""
    ours, theirs = by_method[method], by_method[paper]
    own_goals = [sum(run["own_goals"] for run in runs.values()) for runs in (ours, theirs)]
    p = cost_p_value(ours, theirs)
    rows = [
        rung_row(method, "own goals to Subsumption's", own_goals[0] / own_goals[1] if own_goals[1] else nan, OWN_GOALS),
        rung_row(method, "cost/goal to Subsumption's", cost_ratio(ours, theirs).estimate, COST),
        rung_row(method, "p of the cost", nan if p is None else p, P_VALUE),
    ]
    rows += [
        rung_row(method, f"cost/goal to '{twin}'", cost_ratio(ours, by_method[twin]).estimate, TWIN_COST)
        for twin in twins
    ]
    return [finite({**row, "rung": f"a, {method}"}) for row in rows]


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    learning = [row for row in rows if row.get("when", LEARNING) == LEARNING]
    afterwards = [row for row in rows if row.get("when") == FROZEN]
    tied = [row for row in learning if row.get("tied_share") is not None]
    # data from before there were such twins lack their columns
    controls = CONTROLS | {name: label for name, label in TWINS.items() if any(f"ratio_{name}" in row for row in rows)}
    parts = {
        "fifty goals": methods_table(learning, controls),
        **robust_table(learning, controls),
    }
    if afterwards:
        parts["frozen after fifty goals"] = methods_table(afterwards, controls)
        parts |= {f"frozen, {title}": each for title, each in robust_table(afterwards, controls).items()}
    return {
        **parts,
        "ties": Table(
            ["method", "joint states met", "all Q equal"],
            [[row["method"], f"{row['joint_states']:.0f}", f"{row['tied_share']:.1%}"] for row in tied],
        ),
        "rung a": rungs_table(rows),
    }
