"""Compiled and interpreted, fit and imagination have the same bits."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

IMAGINE = """
import hashlib, json, sys
import numpy as np
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.kernels import prepare
from fbql_fusion.core.learners.features import Features, Resolution, Scales, Situation
from fbql_fusion.core.learners.tilings import critic_tilings
from fbql_fusion.core.tasks.soccer.critic import WIDTHS, critic_inputs
from fbql_fusion.core.tasks.soccer.world_model.fitting import fit
from fbql_fusion.core.tasks.soccer.world_model.forest import grow_forest
from fbql_fusion.core.tasks.soccer.world_model.imagination import ImaginedWorld, Rewards
from fbql_fusion.core.tasks.soccer.world_model.parameters import FAMILIES, WorldModelParameters
from fbql_fusion.core.tasks.soccer.world_model.real_steps import RealSteps
from fbql_fusion.core.tasks.soccer.world_model.team import SENSES, Team, TreeParts
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.scripted_law import law
from fbql_sim.core.world_loop import WorldLoop

prepare()
behaviors = [Behavior(name, load_tree(shipped_trees() / f"{name}.json")) for name in SENSES]
team = Team([TreeParts(b.tree.nodes, b.tree.leaves, b.tree.hash) for b in behaviors], list(SENSES))
loop, steps, seen = WorldLoop(SimulationParameters(max_steps=250)), RealSteps(10_000), []
for seed in range(4):
    world = loop.reset(seed, seed)
    steps.begin(world)
    while not world.ended:
        outputs = [b.answer(world) for b in behaviors]
        leaves = tuple(x.leaf_id for x in outputs)
        seen.append(Situation(leaves, tuple(x.observation for x in outputs), critic_inputs(world, True)))
        command = law(world)
        world = loop.step(*command)
        steps.add(*command, world)
rng = np.random.default_rng(1)
scales = Scales.of(seen, True)
resolution = Resolution(world_tilings=4)
offsets = Features.random_offsets(resolution, len(scales.knots), rng)
total = hashlib.sha256()
for family in FAMILIES:
    parameters = WorldModelParameters(model_family=family, model_trees=2, imagined_max_steps=60)
    features = Features(scales, resolution, offsets, critic_tilings(WIDTHS, 4))
    world = ImaginedWorld(fit(steps, parameters, rng), team, features, Rewards(10.0, -10.0, -0.2), steps, parameters)
    for _ in range(2):
        for array in world.play(rng.normal(size=(300, 3)), 5, 4, 0.998, rng):
            total.update(array.tobytes())
    total.update(features.keys.tobytes())
print(json.dumps([grow_forest.is_compiled, total.hexdigest(), rng.random()]))
"""


def imagined(**environment: str) -> list[object]:
    """Whether it was compiled, the hash of what was imagined, and the next draw of the generator."""
    done = subprocess.run(
        [sys.executable, "-c", IMAGINE],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=580,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.timeout(1200)
def test_what_is_imagined_compiled_has_the_bits_of_what_is_imagined_interpreted() -> None:
    pytest.importorskip("numba")
    interpreted, compiled = imagined(FBQL_COMPILE="0"), imagined()
    assert (interpreted[0], compiled[0]) == (False, True)
    assert compiled[1:] == interpreted[1:]
