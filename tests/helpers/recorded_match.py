"""A short match, played in this process and recorded as the fusion node records it: real trees, session, recorder."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml
from fbql.match.trees import playing_trees
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.observation_loading import find_observation
from fbql_behaviors.storage import load_tree
from fbql_common.core.types import BehaviorOutput, World
from fbql_common.wire import encode_command, encode_decision, encode_output, encode_world
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_fusion.policy_storage import load_policy
from fbql_fusion.run_recorder import RunRecorder
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from places import ROOT

TREES = ROOT / "ros2_ws" / "src" / "fbql_behaviors" / "fbql_behaviors" / "trees"

Hear = Callable[[World, list[BehaviorOutput | None]], Sequence[BehaviorOutput | None]]
"""What fusion gets to hear of the answers to a world state."""


def all_of_them(world: World, outputs: list[BehaviorOutput | None]) -> Sequence[BehaviorOutput | None]:
    """Every answer is heard."""
    return outputs


def record_match(
    directory: Path,
    *,
    max_steps: int = 60,
    policy: Path | None = None,
    hear: Hear = all_of_them,
    restart_at: Mapping[int, tuple[int, int]] | None = None,
    trees: Path = TREES,
    observations: Mapping[str, str] | None = None,
    close: bool = True,
    **fusion: Any,
) -> Path:
    """Plays and records a match; gives its run directory.

    Args:
        directory: of the run, to be made.
        max_steps: length of an episode.
        policy: to start from.
        hear: what of the behaviors' answers reaches fusion.
        restart_at: episode -> the step at which its world is lost once, and the one at which the new one is heard.
        trees: directory with NAME.json of each behavior.
        observations: FILE.py:NAME of what behaviors of one's own sense.
        close: whether the recording is finished; else it is what a SIGKILL leaves.
        fusion: parameters of fusion.
    """
    parameters = FusionParameters(**{"episodes": 2, "seed": 3, **fusion})
    files = {name: trees / f"{name}.json" for name in parameters.behaviors}
    trees_ = playing_trees(load_tree(path) for path in files.values())
    session = SoccerSession(parameters, None if policy is None else load_policy(policy), trees_)
    loop = WorldLoop(SimulationParameters(max_steps=max_steps))
    sources = dict(observations or {})
    behaviors = [
        Behavior(name, load_tree(path), find_observation(name, sources.get(name, ""))) for name, path in files.items()
    ]
    directory.mkdir()
    (directory / "log").mkdir()
    own = {name: {"observation": source} for name, source in sources.items()}
    nodes = {
        f"/{name}": {"ros__parameters": {"tree_file": str(path), **own.get(name, {})}} for name, path in files.items()
    }
    launcher_file = directory / "log" / "parameters.yaml"
    launcher_file.write_text(yaml.safe_dump(nodes))
    settings = FusionNodeParameters(
        run_directory=str(directory),
        policy="" if policy is None else str(policy),
        tree_files=[str(path) for path in files.values()],
        config_file=str(launcher_file),
    )
    run = RunRecorder(settings, session, lambda topic: f"/{topic}", pytest.fail)
    lost = dict(restart_at or {})
    while (begun := session.next_episode()) is not None:
        world = loop.reset(*begun)
        while True:
            outputs = hear(world, [behavior.answer(world) for behavior in behaviors])
            command, decision = session.decide(world, outputs)
            data = [b"" if output is None else encode_output(output) for output in outputs]
            run.record(world.stamp_ns, encode_world(world), data, encode_command(command), encode_decision(decision))
            if world.ended:
                break
            world = loop.step(command.left_rad_s, command.right_rad_s)
            if world.step == lost.get(world.episode, (-1, -1))[0]:
                _, first = lost.pop(world.episode)
                world = loop.reset(*session.restart_episode())
                run.episode_restarted()
                while world.step < first:
                    world = loop.step(0.0, 0.0)
        run.episode_ended()
    if close:
        run.close()
    else:
        run.flush()
    return directory


def digest_of(run: Path) -> str:
    """The digest that the run's summary tells."""
    return json.loads((run / "summary.json").read_text())["digest"]
