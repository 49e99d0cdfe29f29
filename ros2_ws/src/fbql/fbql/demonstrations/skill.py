"""How well a tree plays: the same starts driven by it, by the scripted instructor, and by the shipped tree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from fbql_behaviors.core.coverage import Coverage, coverage_of
from fbql_behaviors.core.exercises import EXERCISES, Attempt, drive_by
from fbql_behaviors.core.instructors import instructor_of
from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.types import World

from fbql.demonstrations.practice import PracticeGround, measuring_seeds
from fbql.statistics.inference import Interval, mean_interval
from fbql.statistics.tables import finite

STARTS = 50
SEED = 1
TREE, INSTRUCTOR, SHIPPED = "this tree", "the scripted instructor", "the shipped tree"


@dataclass(frozen=True)
class Skill:
    """How well one driver does."""

    driver: str
    cost: Interval
    """The measure of the exercise: lower is better."""
    arrived: float | None
    """Share of the attempts that arrived; None where there is nowhere to arrive."""
    contact_per_1000: float
    """Steps in contact with a wall per 1000 steps."""

    @property
    def row(self) -> dict[str, Any]:
        """As JSON values."""
        return finite(
            {
                "driver": self.driver,
                "cost": self.cost.estimate,
                "cost_low": self.cost.low,
                "cost_high": self.cost.high,
                "arrived": self.arrived,
                "contact_steps_per_1000": self.contact_per_1000,
            }
        )


@dataclass(frozen=True)
class SkillReport:
    """A tree beside other drivers, and what it was not taught."""

    measure: str
    starts: int
    skills: Sequence[Skill]
    coverage: Coverage

    @property
    def values(self) -> dict[str, Any]:
        """As JSON values."""
        return {
            "measure": self.measure,
            "starts": self.starts,
            "drivers": [each.row for each in self.skills],
            "share_shown": self.coverage.share_shown,
            "show_more_of": [gap._asdict() for gap in self.coverage.gaps()],
        }


def skill_of(tree: Tree, patterns: Patterns, starts: int = STARTS) -> SkillReport | None:
    """Measures a tree in its behavior's exercise. None for a behavior that has no exercise.

    Args:
        patterns: what it was induced from.
        starts: the same for every driver.
    """
    exercise = EXERCISES.get(tree.behavior)
    if exercise is None:
        return None
    ground = PracticeGround(tree.behavior)
    seeds = measuring_seeds(SEED, starts)
    sense, law = observation_of(tree.behavior).sense, instructor_of(tree.behavior)
    shipped = load_tree(shipped_trees() / f"{tree.behavior}.json")
    driven: list[Sequence[float]] = []

    def by_tree(world: World) -> Sequence[float]:
        observed = sense(world)
        driven.append(observed)
        return tree.answer(observed)[1:]

    def skill(driver: str, command_of: Callable[[World], Sequence[float]]) -> Skill:
        attempts = [drive_by(command_of, exercise, ground, seed) for seed in seeds]
        cost = mean_interval([exercise.cost(attempt) for attempt in attempts])
        return Skill(driver, cost, _arrived(attempts) if arrives else None, _contact(attempts))

    arrives = exercise.measure.startswith("steps")
    skills = [
        skill(TREE, by_tree),
        skill(INSTRUCTOR, lambda world: law(sense(world))),
        skill(SHIPPED, lambda world: shipped.answer(sense(world))[1:]),
    ]
    observed = np.array(driven, np.float64).reshape(len(driven), len(tree.features))
    return SkillReport(exercise.measure, starts, skills, coverage_of(tree.features, patterns.x, observed))


def _arrived(attempts: Sequence[Attempt]) -> float:
    return sum(attempt.arrived for attempt in attempts) / len(attempts)


def _contact(attempts: Sequence[Attempt]) -> float:
    return 1000.0 * sum(each.collision_steps for each in attempts) / max(sum(each.steps for each in attempts), 1)
