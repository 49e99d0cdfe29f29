"""The tables of the studies of fusion for docs/fusion.md; a test compares them with the committed data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fbql.cli.words import share_text
from fbql.statistics.tables import Row, Table, between, number

_CONTROLS = {
    "paper": "Subsumption with the paper-like preset",
    "tuned": "Subsumption with the tuned preset",
    "retuned": "Subsumption with thresholds tuned for each tree set",
    "frozen": "the literal FBQL's frozen twin, which never learned",
    "untrained": "the same execution that never learned, a frozen twin (in the ablation and the sensitivity study: the default's)",
    "guided": "the same learner, frozen when the guided episodes were over, a frozen twin (in the ablation and the sensitivity study: the default's)",
    "default": "fbql with its defaults, trained alike",
}
"""Control, as columns name it -> what it is."""


def _compared_columns(name: str, control: str) -> dict[str, str]:
    """The columns in which a method is compared with a control."""
    return {
        f"ratio_{name}": f"cost_per_goal over that of {control}, paired by run on the same episodes; below 1 is better "
        "than it; null where either has no goal, or is not compared",
        f"ratio_{name}_low": f"the lower end of ratio_{name}'s 95 % interval",
        f"ratio_{name}_high": "its upper end; null where it is infinite",
        f"p_{name}": "p of the sign-flip test, paired by run, that both cost the same; null with fewer than two runs, or "
        "where nothing is compared",
    }


COLUMNS = {
    "method": "what played",
    "runs": "how many runs are put together, each on a tree set with a run seed",
    "episodes": "all their episodes, but for guided ones",
    "goals": "those that ended in a goal",
    "own_goals": "those that ended in an own goal",
    "timeouts": "those that ended by the time limit",
    "success_rate": "goals / episodes",
    "cost_per_goal": "steps of all episodes / goals; null without a goal",
    "cost_low": "the lower end of its 95 % interval, a bootstrap over tree sets and their runs; null with one run",
    "cost_high": "the upper end; null where it is infinite, or with one run",
    "steps_per_success": "steps of the episodes that ended in a goal / goals; null where they were not counted apart",
    "collisions_begun_per_goal": "how often the robot began to touch a wall / goals",
    "collision_steps_per_goal": "steps in which it touched one / goals",
    **{column: words for each in _CONTROLS.items() for column, words in _compared_columns(*each).items()},
    "changes": "what is changed of fbql's defaults, as options of a command",
    "joint_states": "joint states met, mean over runs",
    "tied_share": "share of them in which all Q were equal in the end",
    "features": "features met, mean over trainings",
    "bytes": "bytes of what grows with them in a policy, mean over trainings",
    "leaf_product": "how many joint states the leaves could make, mean over trainings",
    "rung": "rung of the ladder, and whose",
    "measure": "what is asked of it",
    "bound": "whether `wanted` is the most or the least",
    "wanted": "what was set beforehand; of collisions, the control's",
    "found": "what was found",
    "reached": "whether that is enough",
    "learner": "the method that was trained",
    "trees": "demonstration seed of the tree set",
    "leaves": "leaves of its trees",
    "wall_m": "re-tuned Subsumption's threshold of the wall's distance [m]",
    "approach_rad": "its threshold of the approach angle [rad]",
    "retuned_cost": "its cost_per_goal on these trees",
    "learner_cost": "the learner's",
    "ratio": "learner_cost / retuned_cost",
    "worst_run": "the same of the worst of the trainings on these trees",
    "own_goal_rate": "own goals / episodes",
    "trainings": "trainings that the means are over",
    "training_steps": "simulated steps of a training, mean; without guided episodes in the ladder, with them among the peers",
    "training_s": "seconds of a training, mean",
    "behaviors": "how many behaviors are fused",
    "table_bytes": "bytes that a table of Q and w over leaf_product would take",
    "note": "how what was learned is played, or why it was not",
}
"""Column of a study of fusion -> what it says."""


def paper_tables(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table of the paper's protocol."""
    controls = {"paper": "paper", "retuned": "re-tuned", "frozen": "literal twin", "guided": "only guided",
                "untrained": "never learned"}  # fmt: skip
    tied = [row for row in rows if row.get("tied_share") is not None]
    return {
        "fifty goals": _methods(rows, controls),
        "ties": Table(
            ["method", "joint states met", "all Q equal"],
            [[row["method"], f"{row['joint_states']:.0f}", f"{row['tied_share']:.1%}"] for row in tied],
        ),
        "rung a": _rungs(rows),
    }


def ladder_tables(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table of the ladder."""
    controls = {"retuned": "re-tuned", "paper": "paper", "untrained": "never learned", "guided": "only guided"}
    sets = [row for row in rows if "trees" in row]
    return {
        "frozen play": _methods(rows, controls),
        "tree sets": Table(
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
                    _share(row["success_rate"]),
                    f"{row['own_goal_rate']:.2%}",
                ]
                for row in sets
            ],
        ),
        "rungs b and c": _rungs(rows),
        "size": _sizes([row for row in rows if "trainings" in row]),
    }


def variant_tables(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table of a study of variants."""
    controls = {"default": "default", "retuned": "re-tuned", "paper": "paper", "untrained": "never learned",
                "guided": "only guided"}  # fmt: skip
    return {"one change each": _methods(rows, controls), **changes_told(rows)}


def changes_told(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table of what rows change; none where the data do not say it."""
    changed = [[row["method"], f"`{row['changes']}`"] for row in rows if row.get("changes")]
    return {"what is changed": Table(["method", "changes"], changed)} if changed else {}


def scaling_tables(rows: Sequence[Row]) -> dict[str, Table]:
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
            _share(row["success_rate"]),
            between(row, "cost_per_goal", "cost_low", "cost_high", ".0f"),
            number(row["training_s"], ".0f"),
        ]
        for row in rows
    ]
    return {"behaviors": Table(head, body)}


def peers_tables(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table of the peers."""
    head = ["method", "runs", "goals / episodes", "own goals", "success rate", "cost/goal (95 %)", "contact steps / goal",
            "to re-tuned", "training [s]", "played"]  # fmt: skip
    body = [
        [
            row["method"],
            str(row["runs"]),
            f"{row['goals']} / {row['episodes']}",
            str(row["own_goals"]),
            _share(row["success_rate"]),
            between(row, "cost_per_goal", "cost_low", "cost_high", ".0f"),
            number(row["collision_steps_per_goal"], ".0f"),
            _compared(row, "retuned"),
            number(row["training_s"], ".0f"),
            row["note"],
        ]
        if row["runs"]
        else [row["method"], "0", *[""] * (len(head) - 3), row["note"]]
        for row in rows
    ]
    return {"the same budget": Table(head, body)}


def _methods(rows: Sequence[Row], controls: Mapping[str, str]) -> Table:
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
            _share(row["success_rate"]),
            between(row, "cost_per_goal", "cost_low", "cost_high", ".0f"),
            number(row["steps_per_success"], ".0f"),
            f"{number(row['collisions_begun_per_goal'], '.1f')}, {number(row['collision_steps_per_goal'], '.0f')}",
            *(_compared(row, name) for name in controls),
        ]
        for row in methods
    ]
    return Table([*head, *(f"to {label}" for label in controls.values())], body)


def _compared(row: Row, name: str) -> str:
    """cost/goal relative to a control; empty where there is none, or it is the control itself. Of one run there is no p."""
    ratio, low, high = f"ratio_{name}", f"ratio_{name}_low", f"ratio_{name}_high"
    p = row.get(f"p_{name}")
    is_itself = p is None and row.get(low) == row.get(high) == 1.0
    if row.get(ratio) is None or is_itself:
        return ""
    return between(row, ratio, low, high, ".2f") + ("" if p is None else f", p {_p(p)}")


def _share(value: float | None) -> str:
    return "" if value is None else share_text(value, 3)


def _p(value: float) -> str:
    return f"{value:.2g}".removeprefix("0") if value < 1.0 else "1"


def _rungs(rows: Sequence[Row]) -> Table:
    body = [
        [
            row["rung"],
            row["measure"],
            f"{row['bound']} {number(row['wanted'], '.3g')}",
            number(row["found"], ".3g"),
            "yes" if row["reached"] else "**no**",
        ]
        for row in rows
        if "rung" in row
    ]
    return Table(["rung", "measure", "wanted", "found", "reached"], body)


def _sizes(rows: Sequence[Row]) -> Table:
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
    return Table(
        ["learner", "trainings", "features", "policy", "joint states met", "steps of a training", "seconds"], body
    )


def _bytes(count: float) -> str:
    """A number of bytes in words."""
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count:.0f} B"
