"""The tables of the study: what is built in, other worlds, and the changes."""

from __future__ import annotations

from collections.abc import Sequence

from fbql.statistics.tables import Row, Table, number

from fbql_studies.common.fusion_tables import METHOD_COLUMNS, methods_table
from fbql_studies.common.variants import changes_table

BUILT_IN, WORLDS = "what is built in", "other worlds"
"""The parts of the table, and the titles under which people read them."""
COLUMNS = {
    **METHOD_COLUMNS,
    "part": "the table that the row belongs to",
    "changes": "what differs from the defaults of fbql_model or of the world, as options of a command",
    "is_twin": "whether it is the twin of another row: the policy of the same training before anything was learned from an "
    "episode that the guide did not drive, for fbql_model after the first imagination",
    "learning_cost": "steps of all episodes / goals while the method learned, without the guided episodes",
    "processor_s": "processor time of a training and its frozen play, mean [s]",
    "ratio_retuned": "cost_per_goal over that of the Subsumption that is tuned for each tree set in the same world, paired "
    "by run on the same episodes; below 1 is better; null where either has no goal",
    "ratio_guided": "cost_per_goal over that of its twin, paired likewise",
    "ratio_default": "cost_per_goal over that of fbql_model with its defaults, paired likewise; null in other worlds",
}


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table. Of the twins only the ratios to them are shown."""
    shown = [row for row in rows if not row["is_twin"]]
    controls = {"retuned": "re-tuned, same world", "guided": "its twin", "default": "fbql_model"}
    tables = {
        BUILT_IN: _methods([row for row in shown if row["part"] == BUILT_IN], controls),
        WORLDS: _methods([row for row in shown if row["part"] == WORLDS], dict(list(controls.items())[:2])),
    }
    return tables | changes_table(shown)


def _methods(rows: Sequence[Row], controls: dict[str, str]) -> Table:
    table = methods_table(rows, controls)
    learned = [number(row["learning_cost"], ".0f") for row in rows]
    return Table(
        [*table.head, "while learning"], [[*line, cost] for line, cost in zip(table.body, learned, strict=True)]
    )
