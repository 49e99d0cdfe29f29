"""The study of what is built in: every change is one, each training has a twin, and every world its own control."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fbql_fusion.core.learners.dyna import learner
from fbql_fusion.core.learners.dyna.parameters import FbqlModelParameters
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_studies.common.methods import FBQL, FBQL_MODEL, RETUNED, TUNED, guided
from fbql_studies.common.training import training_of
from fbql_studies.imagination import study
from studies import make_short, tasks_of

TINY = ("--trees", "1", "--seeds", "1", "--max-steps", "60", "--goals", "1", "--evaluate", "2")
FEW = {
    "fbql_model_first_episodes": 2,
    "fbql_model_episodes": 1,
    "fbql_model_refit_episodes": 2,
    "imagined_max_steps": 30,
}


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hardly anything is imagined, and every training ends after five episodes."""
    make_short(monkeypatch)
    monkeypatch.setattr(learner, "prepare", lambda: None)  # for so few imagined episodes compiling does not pay
    monkeypatch.setattr(study, "MOST_EPISODES", 5)
    monkeypatch.setattr(study, "training_of", lambda *given, **changes: replace(training_of(*given, **changes), **FEW))


def test_every_change_is_one_and_can_be_told_from_the_others() -> None:
    fusion = [
        FusionParameters(controller=learner, **changes)
        for learner, changes, world in study.TRIALS.values()
        if not world
    ]
    worlds = [SimulationParameters(), *(SimulationParameters(**changed) for changed in study.WORLDS.values())]
    for each in (fusion, worlds):
        assert all(one != other for k, one in enumerate(each) for other in each[:k])


def test_no_generic_model_keeps_anything_that_was_entered_by_hand() -> None:
    for name, changes in study.VARIANTS.items():
        if name.startswith(("generic", "none")):
            assert (
                changes.items()
                >= {"model_known_sizes": False, "model_mirror": False, "model_gain_deviation": 0.0}.items()
            )
    generic = {changes["model_family"] for changes in study.VARIANTS.values() if "model_family" in changes}
    assert generic == {"forest", "neighbours", "linear"}


def test_every_training_is_beside_its_twin_and_the_control_of_its_world(
    few: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    world = "commands are 50 ms late"
    wanted = (FBQL, FBQL_MODEL, f"{FBQL_MODEL}, generic, nearest neighbours", f"{FBQL_MODEL} where {world}")
    tasks = [
        task
        for task in tasks_of(study, *TINY)
        if task.parameters.get("method") in wanted or task.parameters.get("world") in ("", world)
    ]
    results = {task.key: study.run(task.parameters) for task in tasks}
    assert len(results) == len(wanted) + 2
    rows = {row["method"]: row for row in study.table(results)}
    controls = {TUNED, RETUNED, f"{RETUNED} where {world}"}
    assert rows.keys() == {*controls, *wanted, *map(guided, wanted)}
    for method in wanted:
        assert rows[method]["learning_cost"] is None or rows[method]["learning_cost"] > 0
        assert rows[guided(method)]["is_twin"]
        assert not rows[method]["is_twin"]
    assert rows[f"{FBQL_MODEL} where {world}"]["changes"] == "--set command_delay_s=0.05"
    titles = study.words(list(rows.values()))
    told = {title: {line[0] for line in table.body} for title, table in titles.items()}
    assert told["what is built in"] == {TUNED, RETUNED, *wanted[:3]}
    assert told["other worlds"] == {f"{RETUNED} where {world}", wanted[3]}
    pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")
    study.figures(results, tmp_path)


def test_the_twin_is_the_policy_of_the_first_imagination(few: None, monkeypatch: pytest.MonkeyPatch) -> None:
    kept: dict[str, Any] = {}

    def judge(_seeds: object, _parameters: object, played: dict[str, Any], *_: object) -> list[object]:
        kept.update(played)
        return []

    monkeypatch.setattr(study, "judge", judge)
    task = next(task for task in tasks_of(study, *TINY) if task.parameters.get("method") == FBQL_MODEL)
    study.run(task.parameters)
    policy, twin = (kept[name][1].arrays for name in (FBQL_MODEL, guided(FBQL_MODEL)))
    first = FbqlModelParameters().fbql_model_batch_episodes  # one batch holds all that is imagined at a time here
    assert first > FEW["fbql_model_first_episodes"]
    assert twin["counts"].tolist() == [1, 1]
    assert twin["imagined_at"].tolist() == [0]
    assert policy["counts"].tolist() == [5, 3]
    assert len(policy["real_marks"]) > len(twin["real_marks"])


def test_an_episode_lasts_as_long_whatever_a_step_takes() -> None:
    for world, steps in (("", 120), ("a step takes 1/30 s", 60), ("a step takes 1/120 s", 240)):
        loop = study.world_loop(world, 120)
        seen = loop.reset(0, 1)
        while not seen.ended:
            seen = loop.step(0.0, 0.0)
        assert seen.step == steps
