"""A robot that sees all scores: the simulator is playable, and not trivially so."""

from __future__ import annotations

from statistics import mean

from fbql_common.core.types import World
from fbql_sim.core.scripted_law import law
from fbql_sim.core.world_loop import WorldLoop

EPISODES = 50


def test_a_scripted_law_without_trees_scores_in_about_300_steps() -> None:
    loop = WorldLoop()
    ends = list[World]()
    for episode in range(EPISODES):
        world = loop.reset(episode, seed=episode)
        while not world.ended:
            world = loop.step(*law(world))
        ends.append(world)
    assert len(ends) == EPISODES
    assert sum(world.goal for world in ends) >= EPISODES - 1
    assert 250 <= mean(world.step for world in ends) <= 500
    assert len({world.step for world in ends}) > EPISODES / 2, "the episodes are hardly different"


def test_a_robot_at_rest_never_scores() -> None:
    loop = WorldLoop()
    world = loop.reset(0, seed=0)
    while not world.ended:
        world = loop.step(0.0, 0.0)
    assert world.truncated
    assert not world.terminated
