"""How the trees are made: the settings that the documents give (docs/deviations.md, docs/trees.md)."""

from __future__ import annotations

from fbql_behaviors.core.recipes import RECIPES, Recipe, recipe_of

SETTINGS = ("split_cost", "min_range", "min_patterns")


def test_each_behavior_has_its_cost_of_a_split_and_the_printed_objective_its_own_limits() -> None:
    ours = {name: tuple(getattr(recipe.induction, key) for key in SETTINGS) for name, recipe in RECIPES.items()}
    assert ours == {
        "ball_seeking": (-0.006, 1 / 64, 2),
        "wall_avoiding": (-0.025, 1 / 64, 2),
        "approaching": (-0.0115, 1 / 64, 2),
    }
    printed = {name: tuple(getattr(recipe.printed, key) for key in SETTINGS) for name, recipe in RECIPES.items()}
    assert printed == {
        "ball_seeking": (-0.1, 1 / 16, 2),
        "wall_avoiding": (-0.1, 1 / 16, 160),
        "approaching": (-0.2, 1 / 16, 17),
    }
    assert {recipe.printed.objective for recipe in RECIPES.values()} == {"printed"}
    assert {recipe.induction.objective for recipe in RECIPES.values()} == {"weighted"}


def test_every_behavior_is_demonstrated_100_times_for_60_steps_and_gives_1000_patterns() -> None:
    for name in (*RECIPES, "dance"):
        recipe = recipe_of(name)
        assert (recipe.demonstrations, recipe.steps, recipe.every, recipe.patterns) == (100, 60, 6, 1000)
    assert recipe_of("dance") == Recipe()
    assert recipe_of("approaching") == RECIPES["approaching"]
