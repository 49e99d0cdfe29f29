"""FBQL trained, and played frozen: what the studies of fusion that learns have in common."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from fbql.demonstrations.make_tree import make_tree
from fbql.match.in_process import play
from fbql.statistics.tables import Row
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import BehaviorOutput, Decision, Phase, WheelCommand, World
from fbql_fusion.core.parameters import GUIDED_EPISODES, FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.session import Session, episode_seed
from fbql_recording.core.metrics import EpisodeRecord
from fbql_sim.core.scripted_law import law
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.methods import BEHAVIORS, LEARNERS, add_max_steps, figures_of
from fbql_studies.runner.study import MOST_PLAYED, Result, check_counts

MOST_TREE_SETS = 9
SEEDS_OF_A_TREE_SET = 100
CURVE_EPISODES = 100
"""Training episodes of a point of the learning curve."""
LEARNED = ("keys", "theta", "value", "values")
"""What of a policy grows with what was visited."""


class Seeds(NamedTuple):
    """Which seeds a study uses: trainings and judging never share one."""

    first_tree: int
    """Demonstration seed of the first tree set."""
    first_run: int
    """Run seed of the first training; those from SEEDS_OF_A_TREE_SET above it on judge."""

    def tree(self, tree_set: int) -> int:
        """The demonstration seed of a tree set."""
        return self.first_tree + tree_set

    def training(self, seed: int) -> int:
        """The run seed of a training."""
        return self.first_run + seed

    def judging(self, tree_set: int, seed: int) -> int:
        """The run seed of the frozen play of a tree set's training."""
        return self.first_run + (tree_set + 1) * SEEDS_OF_A_TREE_SET + seed

    def behaviors(self, tree_set: int) -> list[Behavior]:
        """The behaviors of a tree set."""
        return [Behavior(name, make_tree(name, self.tree(tree_set)).tree) for name in BEHAVIORS]

    def row(self, method: str, tree_set: int, seed: int, figures: Result) -> Row:
        """A run as it is kept."""
        return {"method": method, "tree_seed": self.tree(tree_set), "seed": seed, **figures}


def add_options(parser: ArgumentParser, trees: int, seeds: int, episodes: int, evaluate: int) -> None:
    """Adds the options of a study that trains, with these defaults."""
    parser.add_argument(
        "--trees", type=int, default=trees, metavar="N", help=f"tree sets, each of other demonstrations ({trees})"
    )
    parser.add_argument("--seeds", type=int, default=seeds, metavar="N", help=f"trainings on each tree set ({seeds})")
    parser.add_argument(
        "--episodes",
        type=int,
        default=episodes,
        metavar="N",
        help=f"episodes of a training after the guided ones ({episodes})",
    )
    parser.add_argument(
        "--evaluate", type=int, default=evaluate, metavar="N", help=f"episodes of frozen play ({evaluate})"
    )
    add_max_steps(parser)


def check_options(options: Namespace) -> None:
    """Raises BadInput for a number out of range."""
    check_counts(
        options,
        trees=MOST_TREE_SETS,
        seeds=SEEDS_OF_A_TREE_SET,
        episodes=MOST_PLAYED,
        evaluate=MOST_PLAYED,
        max_steps=MOST_PLAYED,
    )


class Trained(NamedTuple):
    """What a training gave."""

    policy: Policy
    curve: list[Result]
    """For each CURVE_EPISODES episodes: their figures, and the joint states visited so far."""
    size: Result
    """Features and bytes of the policy, joint states visited, and how many the trees' leaves could make."""


def training_of(seed: int, episodes: int, learner: str = LEARNERS[0], **changes: Any) -> FusionParameters:
    """The parameters of a learner's training over so many episodes after the guided ones."""
    given = {"controller": learner, "guided": GUIDED_EPISODES, **changes}
    return FusionParameters(seed=seed, episodes=episodes, **given)


def train(fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop) -> Trained:
    """Plays a training to its end."""
    session = Session(fusion)
    visited: set[tuple[int, ...]] = set()
    curve: list[Result] = []

    def see(_world: World, _outputs: Sequence[BehaviorOutput], _command: WheelCommand, decision: Decision) -> None:
        visited.add(decision.joint_state)

    def ended() -> bool:
        done = len(session.records) - session.guided
        if done > 0 and (done % CURVE_EPISODES == 0 or done == fusion.episodes):
            block = session.records[session.guided + (done - 1) // CURVE_EPISODES * CURVE_EPISODES :]
            curve.append({**figures_of(block), "joint_states": len(visited)})
        return True

    play(session, loop, behaviors, ended, see)
    policy = session.policy()
    assert policy is not None
    return Trained(policy, curve, {**size_of(policy), "joint_states": len(visited)})


def size_of(policy: Policy) -> Result:
    """Features and bytes of a policy, and the product of the leaves."""
    joint_states = 1
    for leaves in policy.leaf_counts:
        joint_states *= leaves
    arrays = [policy.arrays[name] for name in LEARNED if name in policy.arrays]
    return {
        "features": len(policy.arrays["keys"]) if "keys" in policy.arrays else 0,
        "bytes": sum(array.nbytes for array in arrays),
        "leaf_product": joint_states,
    }


def frozen(
    fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop, seed: int, episodes: int,
    policy: Policy | None = None,
) -> Result:  # fmt: skip
    """The figures of frozen play on so many episodes of a run seed: the same ones for every method."""
    session = Session(replace(fusion, learn=False, guided=0, seed=seed, episodes=episodes, goals=0), policy)
    play(session, loop, behaviors, lambda: True)
    return figures_of(session.records)


def law_played(loop: WorldLoop, seed: int, episodes: int) -> Result:
    """The figures of the scripted law, which sees everything and has no trees, on the same episodes."""
    return driven(law, loop, seed, episodes)


def driven(drive: Callable[[World], tuple[float, float]], loop: WorldLoop, seed: int, episodes: int) -> Result:
    """The figures of what drives the wheels (left, right [rad/s]) by the world state alone, on the same episodes."""
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
    return figures_of(records)
