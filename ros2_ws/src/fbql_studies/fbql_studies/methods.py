"""What the studies of fusion have in common: the names of methods, the behaviors, and what is counted."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from fbql_recording.core.metrics import EpisodeRecord
from fbql_sim.core.parameters import SimulationParameters

BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")
LEARNERS = ("fbql", "fbql_value")
"""The two that learn otherwise than printed, by the names of their controllers; each stands in every table."""
SENSED = "fbql, sensed critic"
"""fbql whose critic, too, knows only what the behaviors sense."""
SENSED_CRITIC: Mapping[str, Any] = {"fbql_world_tilings": 0}
"""The parameters that make it."""


def untrained(learner: str) -> str:
    """The method that plays like the learner and never learns."""
    return f"{learner}, never learned"


def papers_guide(learner: str) -> str:
    """The method that is the same with the paper-like Subsumption as its guide."""
    return f"{learner}, paper's guide"


def guided(method: str) -> str:
    """The method that is the same, frozen when the guided episodes were over."""
    return f"{method}, only guided"


def add_max_steps(parser: argparse.ArgumentParser) -> None:
    """Adds the option of the simulator."""
    most = SimulationParameters().max_steps
    parser.add_argument(
        "--max-steps", type=int, default=most, metavar="N", help=f"steps after which an episode is truncated ({most})"
    )


def figures_of(records: Sequence[EpisodeRecord]) -> dict[str, int]:
    """What is counted over episodes."""
    successes = [record for record in records if record.outcome == "goal"]
    return {
        "goals": len(successes),
        "own_goals": sum(record.outcome == "own_goal" for record in records),
        "timeouts": sum(record.outcome == "timeout" for record in records),
        "episodes": len(records),
        "steps": sum(record.steps for record in records),
        "collisions_begun": sum(record.collisions_begun for record in records),
        "collision_steps": sum(record.collision_steps for record in records),
        "steps_to_goals": sum(record.steps for record in successes),
    }
