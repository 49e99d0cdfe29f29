"""The trees that ship: made again bit for bit, of the paper's size, and good enough to play."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import make_trees
from fbql.demonstrations.instruct import instruct
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.evaluation import cross_validated_rmse, wheel_rmse
from fbql_behaviors.core.induction import InductionParameters, induce
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import Patterns, patterns_of
from fbql_behaviors.core.recipes import RECIPES, Recipe, recipe_of
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.geometry import approach_angle, wall_distance_and_bearing
from fbql_sim.core.world_loop import WorldLoop

BANDS = {"ball_seeking": (95, 135), "wall_avoiding": (7, 15), "approaching": (30, 42)}
"""Leaf counts round the paper's 122, 11 and 37."""
EVERY_BEHAVIOR = pytest.mark.parametrize("behavior", sorted(RECIPES))
WALL_M, APPROACH_RAD = 0.07, 0.15


def shipped(behavior: str) -> Path:
    return shipped_trees() / f"{behavior}.json"


def demonstrated(behavior: str, seed: int) -> Patterns:
    recipe = RECIPES[behavior]
    demonstrations = instruct(behavior, seed, recipe.demonstrations, recipe.steps)
    return patterns_of(demonstrations, OBSERVATIONS[behavior], recipe.every, recipe.patterns)


def test_the_command_makes_every_shipped_tree_again_from_the_committed_seeds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert make_trees(["--out", str(tmp_path), "--json"]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in shipped_trees().iterdir())
    assert all((tmp_path / path.name).read_bytes() == path.read_bytes() for path in shipped_trees().iterdir())
    assert capsys.readouterr().out.count("\n") == 1


@EVERY_BEHAVIOR
def test_over_eight_demonstration_seeds_the_leaf_counts_lie_in_the_papers_bands(behavior: str) -> None:
    low, high = BANDS[behavior]
    recipe = RECIPES[behavior]
    patterns = [demonstrated(behavior, seed) for seed in range(1, 9)]
    for parameters in (recipe.induction, recipe.printed):
        counts = [induce(behavior, each, parameters, seed).tree.leaf_count for seed, each in enumerate(patterns)]
        assert sum(low <= count <= high for count in counts) >= 6, (parameters.objective, counts)


@EVERY_BEHAVIOR
def test_a_shipped_tree_drives_like_its_instructor_on_demonstrations_it_has_not_seen(behavior: str) -> None:
    unseen = demonstrated(behavior, 2)
    tree = load_tree(shipped(behavior))
    one_leaf = induce(behavior, demonstrated(behavior, 1), InductionParameters(max_entropy=9.0), 1)
    assert one_leaf.tree.leaf_count == 1
    assert wheel_rmse(tree, unseen) < 0.7 * wheel_rmse(one_leaf.tree, unseen)


def test_the_held_out_error_is_larger_than_the_error_on_the_training_patterns() -> None:
    patterns = demonstrated("ball_seeking", 1)
    parameters = RECIPES["ball_seeking"].induction

    def made(part: Patterns) -> Tree:
        return induce("ball_seeking", part, parameters, 1).tree

    held_out = cross_validated_rmse(patterns, made)
    assert held_out is not None
    assert held_out > wheel_rmse(made(patterns), patterns)
    one = patterns.select(patterns.demonstration == 0)
    assert cross_validated_rmse(one, made) is None


def test_the_shipped_trees_score_under_subsumption() -> None:
    trees = {name: load_tree(shipped(name)) for name in RECIPES}
    seek, avoid, approach = (
        Behavior(name, trees[name]).answer for name in ("ball_seeking", "wall_avoiding", "approaching")
    )
    loop = WorldLoop()
    goals = own_goals = 0
    for seed in range(30):
        world = loop.reset(seed, seed)
        while not world.ended:
            if wall_distance_and_bearing(world)[0] < WALL_M:
                output = avoid(world)
            elif abs(approach_angle(world)) > APPROACH_RAD:
                output = approach(world)
            else:
                output = seek(world)
            world = loop.step(output.left_rad_s, output.right_rad_s)
        goals += world.goal
        own_goals += world.own_goal
    assert goals >= 27
    assert own_goals <= 1


def test_no_observation_of_a_match_lies_outside_of_a_root_region() -> None:
    behaviors = [Behavior(name, load_tree(shipped(name))) for name in RECIPES]
    loop = WorldLoop()
    for seed in range(3):
        world = loop.reset(seed, seed)
        while not world.ended:
            outputs = [behavior.answer(world) for behavior in behaviors]
            world = loop.step(outputs[seed].left_rad_s, outputs[seed].right_rad_s)
            if world.step > 600:
                break
    assert [behavior.clamped_count for behavior in behaviors] == [0, 0, 0]


def test_the_same_seed_gives_the_same_demonstrations_and_another_gives_others() -> None:
    first, again, other = (instruct("wall_avoiding", seed, 3, 20) for seed in (5, 5, 6))
    assert first == again
    assert first != other
    assert [len(demonstration.worlds) for demonstration in first] == [20, 20, 20]


def test_demonstrations_show_the_ball_in_every_direction() -> None:
    bearings = demonstrated("ball_seeking", 1).x[:, 1]
    counts = [int(((bearings >= low) & (bearings < low + 0.785)).sum()) for low in (-3.14, -2.355, 1.57, 2.355)]
    assert min(counts) >= 10, counts


@pytest.mark.parametrize(
    ("seed", "count", "steps", "name"), [(-1, 1, 1, "seed"), (0, 0, 1, "demonstrations"), (0, 1, 0, "steps")]
)
def test_a_number_out_of_range_is_refused_with_its_value(seed: int, count: int, steps: int, name: str) -> None:
    with pytest.raises(BadInput, match=f"{name} is "):
        instruct("ball_seeking", seed, count, steps)


def test_a_behavior_without_a_recipe_of_its_own_gets_the_general_one() -> None:
    assert recipe_of("dance") == Recipe()
