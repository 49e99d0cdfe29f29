"""Frozen play: the score of a method on the episodes of a run seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from fbql.match.in_process import play
from fbql.match.trees import playing_trees
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import Phase, World
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.session import episode_seed
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_recording.core.metrics import EpisodeRecord
from fbql_sim.core.kinematic_bound import TOP_SPEED_M_S, least_steps
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.scripted_law import TUNED, UNTUNED, LawConstants, law
from fbql_sim.core.task import Task
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.methods import LAW, TUNED_LAW
from fbql_studies.runner.study import Result


class Score(NamedTuple):
    """Counts over the episodes of a run."""

    episodes: int
    goals: int
    own_goals: int
    timeouts: int
    steps: int
    collisions_begun: int
    collision_steps: int

    @classmethod
    def of(cls, counts: Mapping[str, Any]) -> Score:
        """The score taken from counts by name."""
        return cls(*(counts[name] for name in cls._fields))

    @property
    def cost(self) -> float:
        """Steps of all episodes per goal; infinite without a goal."""
        return self.steps / self.goals if self.goals else float("inf")


def counts_of(records: Sequence[EpisodeRecord]) -> dict[str, int]:
    """Counts over episodes: those of a Score, and `steps_to_goals`, the steps of the episodes that ended in a goal."""
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


def frozen(
    fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop, seed: int, episodes: int,
    policy: Policy | None = None,
) -> Result:  # fmt: skip
    """Counts of frozen play on the first episodes of a run seed, which are the same for every method."""
    session = SoccerSession(replace(fusion, learn=False, guided=0, seed=seed, episodes=episodes, goals=0), policy)
    play(session, loop, behaviors, lambda: True)
    return counts_of(session.records)


def score_of(
    fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop, policy: Policy | None = None
) -> Score:
    """The score of a session played to its end; guided episodes don't count."""
    session = SoccerSession(fusion, policy, playing_trees(behavior.tree for behavior in behaviors))
    play(session, loop, behaviors, lambda: True)
    summary = session.summary()
    return Score(*(getattr(summary, name) for name in Score._fields))


LAWS: Mapping[str, LawConstants] = {LAW: UNTUNED, TUNED_LAW: TUNED}
"""Method -> the constants of the scripted law that it is."""
KICKED, PUSHED = "kicked or pushed", "no faster than the robot"
"""What a kinematic bound assumes of the ball."""


def laws_played(loop: WorldLoop, seed: int, episodes: int) -> dict[str, Result]:
    """Method -> counts of the scripted law, which sees everything and has no trees, on the same episodes."""
    return {
        method: driven(partial(law, constants=constants), loop, seed, episodes) for method, constants in LAWS.items()
    }


def bound_steps(seed: int, episodes: int) -> dict[str, int]:
    """What a bound assumes of the ball -> the kinematic bound, summed over the same episodes."""
    parameters = SimulationParameters()
    task = Task(parameters)
    starts = [task.begin(episode_seed(seed, index)) for index in range(episodes)]
    return {
        ball: sum(least_steps(start, parameters, ball_m_s) for start in starts)
        for ball, ball_m_s in ((KICKED, None), (PUSHED, TOP_SPEED_M_S))
    }


def driven(drive: Callable[[World], tuple[float, float]], loop: WorldLoop, seed: int, episodes: int) -> Result:
    """Counts of a law that maps the world state to wheel velocities (left, right [rad/s]), on the same episodes."""
    records: list[EpisodeRecord] = []
    for index in range(episodes):
        world = loop.reset(index, episode_seed(seed, index))
        begun = contact = 0
        while not world.ended:
            world = loop.step(*drive(world))
            begun += world.collision_begun
            contact += world.collision
        outcome = "goal" if world.goal else "own_goal" if world.own_goal else "timeout"
        records.append(EpisodeRecord(index, Phase.EVALUATION, 0, outcome, world.step, begun, contact, 0.0, False))
    return counts_of(records)
