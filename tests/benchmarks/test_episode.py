"""The benchmark of an episode runs and tells what it says it tells; how fast things are is not a test's business."""

from __future__ import annotations

import json

import pytest
from fbql.match.in_process import play
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.world_loop import WorldLoop
from measure import episode


@pytest.mark.parametrize("controller", [pytest.param("fbql_literal", marks=pytest.mark.long), "fbql", "subsumption"])
def test_the_benchmark_of_an_episode_prints_one_object_with_its_figures(
    controller: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        episode.main(["--controller", controller, "--steps", "1500", "--rounds", "3", "--warm-up", "2", "--json"]) == 0
    )
    printed = capsys.readouterr().out
    assert printed.count("\n") == 1
    result = json.loads(printed)
    assert result["steps_per_s"] > 0.0
    assert 0.0 < result["ratio"] < 1.0, "the whole can't be faster than a part of it"
    assert result["physics_steps_per_s"] > result["steps_per_s"]
    parts = result["step_us"]
    assert sum(parts.values()) - parts["whole"] == pytest.approx(parts["whole"], rel=0.3)
    assert result["steps"] >= 1500
    assert result["warm_up"] == (0 if controller == "subsumption" else 2)
    # The same match by itself.
    behaviors = [
        Behavior(name, load_tree(shipped_trees() / f"{name}.json"))
        for name in FusionParameters(controller=controller).behaviors
    ]
    policy = None
    if controller != "subsumption":
        learning = SoccerSession(FusionParameters(controller=controller, seed=episode.WARM_UP_SEED, episodes=2))
        play(learning, WorldLoop(), behaviors, lambda: True)
        policy = learning.policy()
    fusion = FusionParameters(controller=controller, seed=episode.SEED, guided=0, episodes=result["episodes"])
    session = SoccerSession(fusion, policy)
    play(session, WorldLoop(), behaviors, lambda: True)
    assert (session.digest, session.steps) == (result["digest"], result["steps"])


def test_numbers_out_of_range_are_refused_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        episode.main(["--rounds", "0"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == "episode.py: --rounds is 0; it must be 1 or more (see --help)\n"
