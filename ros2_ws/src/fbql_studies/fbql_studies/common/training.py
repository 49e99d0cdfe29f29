"""How the studies of fusion train: seeds, options, the training itself, and the frozen twins."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Collection, Mapping, Sequence
from math import prod
from types import MappingProxyType
from typing import Any, NamedTuple

from fbql.demonstrations.make_tree import make_tree
from fbql.match.in_process import play
from fbql.match.trees import playing_trees
from fbql.statistics.tables import Row
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.observation import Law
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_fusion.core.controllers.parameters import GUIDED_EPISODES
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.methods import BEHAVIORS, FBQL
from fbql_studies.common.play import counts_of, frozen
from fbql_studies.runner.study import MOST_PLAYED, Parameters, Result, add_count, check_counts

FIRST_TREE_SEED = 1001
"""Demonstration seed of the first tree set of the paper's protocol, the ladder and the peers; no tuning saw it."""
FIRST_RUN_SEED = 1000
"""Run seeds below it are for tuning."""
MOST_TREE_SETS = 9
SEEDS_OF_A_TREE_SET = 100
MOST_FIRST_SEED = 90_000
CURVE_EPISODES = 100
"""Training episodes per point of a learning curve."""
LEARNED = ("keys", "theta", "value", "values")
"""The arrays of a policy that grow with the visited situations."""


class Seeds(NamedTuple):
    """The seeds of a study: training and evaluation never share one."""

    first_tree: int
    """Demonstration seed of the first tree set."""
    first_run: int
    """Run seed of the first training; from SEEDS_OF_A_TREE_SET above it on, run seeds are for evaluation."""

    def tree(self, tree_set: int) -> int:
        """The demonstration seed of a tree set."""
        return self.first_tree + tree_set

    def training(self, seed: int) -> int:
        """The run seed of a training."""
        return self.first_run + seed

    def judging(self, tree_set: int, seed: int) -> int:
        """The run seed of the frozen play that evaluates a training on a tree set."""
        return self.first_run + (tree_set + 1) * SEEDS_OF_A_TREE_SET + seed

    def behaviors(self, tree_set: int) -> list[Behavior]:
        """The behaviors of a tree set."""
        return behaviors_of(self.tree(tree_set))

    def row(self, method: str, tree_set: int, seed: int, counts: Result) -> Row:
        """A run as it is stored."""
        return {"method": method, "tree_seed": self.tree(tree_set), "seed": seed, **counts}


def behaviors_of(tree_seed: int, instructors: Mapping[str, Law] = MappingProxyType({})) -> list[Behavior]:
    """The behaviors whose trees are made from the demonstrations of a seed.

    Args:
        instructors: behavior -> who demonstrates it in its own instructor's place.
    """
    return [Behavior(name, make_tree(name, tree_seed, instructors.get(name)).tree) for name in BEHAVIORS]


def add_max_steps(parser: ArgumentParser) -> None:
    """Adds the option for the episodes' length."""
    add_count(parser, "--max-steps", SimulationParameters().max_steps, "steps after which an episode is truncated")


def add_first_seeds(parser: ArgumentParser, first_tree: int = FIRST_TREE_SEED, first_run: int = FIRST_RUN_SEED) -> None:
    """Adds the options, with these defaults, for tree sets and run seeds that an earlier measurement did not use."""
    add_count(parser, "--first-trees", first_tree, "demonstration seed of the first tree set")
    add_count(parser, "--first-seed", first_run, "run seed of the first run")


def check_first_seeds(options: Namespace) -> None:
    """Raises BadInput for seeds that are for tuning, or absurdly large."""
    for name, least in (("first_trees", FIRST_TREE_SEED), ("first_seed", FIRST_RUN_SEED)):
        found = getattr(options, name)
        if not least <= found <= MOST_FIRST_SEED:
            option = f"--{name.replace('_', '-')}"
            raise BadInput(f"{option} is {found}; it must be {least} to {MOST_FIRST_SEED}, those below are for tuning")


def add_training_options(parser: ArgumentParser, trees: int, seeds: int, episodes: int, evaluate: int) -> None:
    """Adds the options of a study that trains, with these defaults."""
    add_count(parser, "--trees", trees, "tree sets, each from other demonstrations")
    add_count(parser, "--seeds", seeds, "trainings on each tree set")
    add_count(parser, "--episodes", episodes, "training episodes after the guided ones")
    add_count(parser, "--evaluate", evaluate, "episodes of frozen play")
    add_max_steps(parser)


def check_training_options(options: Namespace) -> None:
    """Raises BadInput for a number out of range."""
    played = dict.fromkeys(("episodes", "evaluate", "max_steps"), MOST_PLAYED)
    check_counts(options, trees=MOST_TREE_SETS, seeds=SEEDS_OF_A_TREE_SET, **played)


class Checkpoint(NamedTuple):
    """What had been learned at a point of a training."""

    policy: Policy
    steps: int
    """Steps that the robot had driven by then, guided ones included."""


class Trained(NamedTuple):
    """The outcome of a training."""

    policy: Policy | None
    """None for a controller that does not learn."""
    curve: list[Result]
    """For each CURVE_EPISODES episodes: their counts, and the joint states visited so far."""
    size: Result
    """Features and bytes of the policy, joint states visited, and the product of the trees' leaf counts."""
    checkpoints: dict[int, Checkpoint]
    """Training episodes -> what had been learned after them."""


def training_of(seed: int, episodes: int, learner: str = FBQL, **changes: Any) -> FusionParameters:
    """The parameters of a learner's training; `episodes` come after the guided ones."""
    return FusionParameters(
        seed=seed, episodes=episodes, **{"controller": learner, "guided": GUIDED_EPISODES, **changes}
    )


def as_it_learns(learner: str) -> dict[str, Any]:
    """Parameters with which a learner plays frozen as it does while learning: behaviors are drawn, and held as long."""
    held = getattr(FusionParameters(), f"{learner}_hold_s")
    return {f"{learner}_play": "drawn", f"{learner}_play_s": held}


def train(
    fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop, checkpoints: Collection[int] = ()
) -> Trained:
    """Plays a training to its end.

    Args:
        checkpoints: training episodes after which the policy is kept.
    """
    session = SoccerSession(fusion, trees=playing_trees(behavior.tree for behavior in behaviors))
    visited: set[tuple[int, ...]] = set()
    curve: list[Result] = []
    kept: dict[int, Checkpoint] = {}
    due: list[int] = []
    driven = 0

    def keep_due() -> None:
        """Keeps the policy once the next episode has begun: what is learned between two of them is part of it."""
        policy = session.policy()
        while due and policy is not None:
            kept[due.pop()] = Checkpoint(policy, driven)

    def see(_world: World, _outputs: Sequence[BehaviorOutput], _command: WheelCommand, decision: Decision) -> None:
        visited.add(decision.joint_state)
        if due:
            keep_due()

    def episode_ended() -> bool:
        nonlocal driven
        done = len(session.records) - session.guided
        if done in checkpoints:
            due.append(done)
            driven = session.steps
        if done > 0 and (done % CURVE_EPISODES == 0 or done == fusion.episodes):
            block = session.records[session.guided + (done - 1) // CURVE_EPISODES * CURVE_EPISODES :]
            curve.append({**counts_of(block), "joint_states": len(visited)})
        return True

    play(session, loop, behaviors, episode_ended, see)
    keep_due()
    policy = session.policy()
    size = {"features": 0, "bytes": 0} if policy is None else size_of(policy)
    leaves = prod(behavior.tree.leaf_count for behavior in behaviors)
    return Trained(policy, curve, {**size, "leaf_product": leaves, "joint_states": len(visited)}, kept)


Played = dict[str, tuple[FusionParameters, Policy | None]]
"""Method -> its parameters, and the policy that it plays."""


def judge(
    seeds: Seeds, parameters: Parameters, played: Played, behaviors: Sequence[Behavior], loop: WorldLoop
) -> list[Row]:
    """The runs of frozen play of each method, on the episodes that evaluate a task's training."""
    tree_set, seed, episodes = parameters["set"], parameters["seed"], parameters["evaluate"]
    run_seed = seeds.judging(tree_set, seed)
    return [
        seeds.row(method, tree_set, seed, frozen(fusion, behaviors, loop, run_seed, episodes, policy))
        for method, (fusion, policy) in played.items()
    ]


def size_of(policy: Policy) -> Result:
    """Features and bytes of a policy."""
    arrays = policy.arrays
    return {
        "features": len(arrays["keys"]) if "keys" in arrays else 0,
        "bytes": sum(arrays[name].nbytes for name in LEARNED if name in arrays),
    }


def after_guidance(fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop) -> Policy:
    """The policy after the guided episodes, before anything else is learned."""
    session = SoccerSession(fusion, trees=playing_trees(behavior.tree for behavior in behaviors))
    play(session, loop, behaviors, lambda: len(session.records) < session.guided)
    session.next_episode()  # only now are the guided episodes learned from
    policy = session.policy()
    assert policy is not None
    return policy
