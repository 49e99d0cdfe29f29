"""For the tests of the studies: a study's tasks, and the trees that ship in the place of induced ones, tuned in no time."""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import replace
from types import ModuleType

import pytest
from fbql.statistics import inference
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.recipes import RECIPES
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_studies.common import training, tuning
from fbql_studies.common.methods import BEHAVIORS, FBQL_MODEL
from fbql_studies.runner.study import StudyTask

FEW_DEMONSTRATIONS = {name: replace(recipe, demonstrations=12, steps=20) for name, recipe in RECIPES.items()}


def tasks_of(study: ModuleType, *arguments: str) -> list[StudyTask]:
    """The tasks of a study with these options."""
    parser = ArgumentParser()
    study.add_options(parser)
    return study.tasks(parser.parse_args(list(arguments)))


def shipped() -> list[Behavior]:
    """The behaviors of the trees that ship."""
    return [Behavior(name, load_tree(shipped_trees() / f"{name}.json")) for name in BEHAVIORS]


def make_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """The trees that ship, three guided episodes, the shortest tuning there is, and few resamples."""
    monkeypatch.setattr(inference, "RESAMPLES", 200)
    monkeypatch.setattr(training, "behaviors_of", lambda _seed: shipped())
    monkeypatch.setattr(training, "GUIDED_EPISODES", 3)
    monkeypatch.setattr(tuning, "WALL_M", (0.07,))
    monkeypatch.setattr(tuning, "APPROACH_RAD", (0.15,))
    monkeypatch.setattr(tuning, "TUNING_ROUNDS", ((2, 1),))
    monkeypatch.setattr(tuning, "BLEND_ROUNDS", ((1, 1),))


SHORT_IMAGINATION = {
    "fbql_model_first_episodes": 3, "fbql_model_episodes": 2, "fbql_model_refit_episodes": 1, "imagined_max_steps": 20
}  # fmt: skip


def make_imagination_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """A few short imagined episodes for fbql_model, in the paper's protocol and in the ladder; too few to compile for."""
    from fbql_studies.ladder import study as ladder
    from fbql_studies.paper import study as paper

    monkeypatch.setattr("fbql_fusion.core.learners.dyna.learner.prepare", lambda: None)
    short = {method: replace(fusion, **SHORT_IMAGINATION) for method, fusion in paper.IMAGINING.items()}
    monkeypatch.setattr(paper, "IMAGINING", short)
    monkeypatch.setattr(paper, "METHODS", paper.METHODS | short)
    monkeypatch.setattr(ladder, "TRAINED", {**ladder.TRAINED, FBQL_MODEL: (FBQL_MODEL, SHORT_IMAGINATION)})
