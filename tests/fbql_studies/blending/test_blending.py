"""The study of blending: what a mixture and a smoothed command are, and that each way is trained and played by itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.session import episode_seed
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from fbql_studies.blending import study as blending
from fbql_studies.blending.mixing import SmoothedLoop, is_mixture, with_copies, with_mixtures
from fbql_studies.common.methods import FBQL, RETUNED
from fbql_studies.common.play import frozen
from fbql_studies.common.training import train, training_of
from studies import make_short, shipped, tasks_of

TINY = ("--trees", "1", "--seeds", "1", "--max-steps", "120", "--episodes", "3", "--evaluate", "2")


def test_a_mixture_commands_the_mean_of_its_two_and_senses_nothing() -> None:
    behaviors = shipped()
    world = WorldLoop().reset(0, episode_seed(1, 0))
    alone = [behavior.answer(world) for behavior in behaviors]
    team = with_mixtures(behaviors)
    answers = [behavior.answer(world) for behavior in team]
    assert answers[:3] == alone
    pairs = [(0, 1), (0, 2), (1, 2)]
    for (i, j), answer in zip(pairs, answers[3:], strict=True):
        assert answer.left_rad_s == (alone[i].left_rad_s + alone[j].left_rad_s) / 2
        assert answer.right_rad_s == (alone[i].right_rad_s + alone[j].right_rad_s) / 2
        assert (answer.leaf_id, answer.leaf_count, answer.observation) == (0, 1, ())
    assert len({answer.tree_hash for answer in answers}) == len({each.name for each in team}) == 6
    assert [is_mixture(each) for each in team] == [False] * 3 + [True] * 3


def test_a_copy_commands_what_its_original_does_and_is_no_mixture() -> None:
    world = WorldLoop().reset(0, episode_seed(1, 0))
    team = with_copies(shipped())
    commands = [behavior.answer(world).command for behavior in team]
    assert commands[:3] == commands[3:]
    assert not any(map(is_mixture, team))


def test_smoothed_wheels_get_a_moving_average_that_begins_anew_with_each_episode() -> None:
    smoothed, plain = SmoothedLoop(SimulationParameters(), 2.0), WorldLoop()
    sent = [(40.0, 20.0), (20.0, 20.0), (10.0, 50.0)]
    for episode in range(2):
        seed = episode_seed(1, episode)
        assert smoothed.reset(episode, seed) == plain.reset(episode, seed)
        for command, expected in zip([(40.0, 20.0), (0.0, 20.0), (0.0, 80.0)], sent, strict=True):
            assert smoothed.step(*command) == plain.step(*expected)


def test_steps_are_mixed_where_a_mixture_drives_or_weights_are_shared() -> None:
    loop = WorldLoop(SimulationParameters(max_steps=200))

    def share(team: list[Behavior], **changes: Any) -> float:
        names = [each.name for each in team]
        fusion = FusionParameters(behaviors=names, learn=False, guided=0, seed=3, episodes=2, goals=0, **changes)
        counts = blending._played(SoccerSession(fusion), team, loop)
        return counts[blending.MIXED_STEPS] / counts["steps"]

    drawn = {"controller": "fbql", "fbql_play": "drawn"}
    assert 0.3 < share(with_mixtures(shipped()), **drawn) < 0.7, "untrained, each of the six drives as often"
    assert share(with_copies(shipped()), **drawn) == 0.0
    assert share(shipped(), controller="uniform") == 1.0
    assert share(shipped(), controller="subsumption") == 0.0


def test_each_way_is_trained_and_played_and_the_table_says_how_often_it_mixes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_short(monkeypatch)
    tasks = tasks_of(blending, *TINY)
    assert len({task.key for task in tasks}) == len(tasks) == len(blending.TRAINED) + 1
    assert all("/" not in task.key and " " not in task.key for task in tasks)
    results = {task.key: blending.run(task.parameters) for task in tasks}
    assert json.loads(json.dumps(results)) == results
    rows = {row["method"]: row for row in blending.table(results)}
    json.dumps(rows, allow_nan=False)
    assert {*blending.TRAINED, *blending.PLAYED, RETUNED} <= set(rows)
    assert set().union(*rows.values()) <= set(blending.COLUMNS)
    assert rows[FBQL]["mixed_share"] == rows["copies as further choices"]["mixed_share"] == 0.0
    assert rows[RETUNED]["mixed_share"] is None
    assert 0.0 < rows["blended play"]["mixed_share"] <= 1.0
    text = blending.words([*rows.values()])
    assert [line[0] for line in text["how often commands are mixtures"].body] == [*blending.TRAINED, *blending.PLAYED]
    pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")
    for run in (run for result in results.values() for run in result["runs"]):
        run["goals"] = 2  # none of such short episodes ends in a goal
    assert [file.name for file in blending.figures(results, tmp_path)] == ["curves.json", "fusion_blending.svg"]


def test_the_default_is_fbql_as_the_other_studies_play_it(monkeypatch: pytest.MonkeyPatch) -> None:
    make_short(monkeypatch)
    task = tasks_of(blending, *TINY)[0]
    run = next(each for each in blending.run(task.parameters)["runs"] if each["method"] == FBQL)
    loop = WorldLoop(SimulationParameters(max_steps=120))
    fusion = training_of(blending.SEEDS.training(0), 3)
    trained = train(fusion, shipped(), loop)
    counts = frozen(fusion, shipped(), loop, blending.SEEDS.judging(0, 0), 2, trained.policy)
    assert {name: run[name] for name in counts} == counts
