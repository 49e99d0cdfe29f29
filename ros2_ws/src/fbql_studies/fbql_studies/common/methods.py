"""The names of the methods that tables and figures show, each defined once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")

LAW, TUNED_LAW = "scripted law, sees all", "scripted law, tuned"
UNIFORM, CONSTANT = "uniform weights", "constant blend"
PAPER, TUNED, RETUNED = "subsumption, paper", "subsumption, tuned", "subsumption, re-tuned"
CONTROLS = (LAW, TUNED_LAW, PAPER, TUNED, RETUNED, UNIFORM, CONSTANT)
"""Methods that learn nothing, or only a few numbers."""

FBQL, FBQL_VALUE = LEARNERS = ("fbql", "fbql_value")
"""The learners that depart from the printed equations, by the names of their controllers."""
FBQL_MODEL = "fbql_model"
"""The learner that imagines, by the name of its controller."""
SENSED = "fbql, sensed critic"
"""fbql whose critic, too, sees only what the behaviors sense."""
SENSED_CRITIC: Mapping[str, Any] = {"fbql_world_tilings": 0}
"""The parameters of SENSED."""
TIES_NONE, TIES_FIRST = "fbql literal, ties: none", "fbql literal, ties: first"
LITERAL_TWIN = "fbql literal, frozen twin"


def untrained(learner: str) -> str:
    """The frozen twin that plays like the learner and never learned."""
    return f"{learner}, never learned"


def papers_guide(learner: str) -> str:
    """The learner guided by the paper-like Subsumption."""
    return f"{learner}, paper's guide"


def guided(method: str) -> str:
    """The frozen twin that stopped learning after the guided episodes."""
    return f"{method}, only guided"


def drawn(method: str) -> str:
    """The method that plays as it does while learning: behaviors are drawn by weight and held as long."""
    return f"{method}, drawn"


def greedy(method: str) -> str:
    """The method that does not explore after the guided episodes: the largest weight drives while it learns, too."""
    return f"{method}, greedy"


def imagined_once(method: str) -> str:
    """The frozen twin that imagined after the guided episodes, and then stopped learning."""
    return f"{method}, imagined once"


def guided_data(method: str) -> str:
    """The twin that goes on imagining as often, with a model of the guided episodes alone: it learns nothing real."""
    return f"{method}, only guided data"
