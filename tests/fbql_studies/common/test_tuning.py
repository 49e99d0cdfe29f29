"""What is tuned for a tree set: thresholds in rounds, constant weights on a grid."""

from __future__ import annotations

import pytest
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from fbql_studies.common import tuning
from fbql_studies.common.play import Score, frozen
from fbql_studies.runner.study import Result
from studies import shipped


def test_thresholds_are_chosen_in_rounds_that_the_cheapest_go_on_from(monkeypatch: pytest.MonkeyPatch) -> None:
    known = {(0.0, 0.0): (1.0, 9.0), (0.0, 1.0): (2.0, 5.0), (0.1, 0.0): (3.0, 4.0), (0.1, 1.0): (4.0, 0.0)}
    asked: list[tuple[tuple[float, float], int]] = []

    def cost(pair: tuple[float, float], _behaviors: object, _loop: object, episodes: int) -> float:
        asked.append((pair, episodes))
        return known[pair][episodes // 100]

    for name, value in {"WALL_M": (0.0, 0.1), "APPROACH_RAD": (0.0, 1.0), "_cost_with": cost}.items():
        monkeypatch.setattr(tuning, name, value)
    monkeypatch.setattr(tuning, "TUNING_ROUNDS", ((30, 3), (100, 1)))
    assert tuning.retuned([], WorldLoop()) == (0.1, 0.0)
    assert [episodes for _, episodes in asked] == [30] * 4 + [100] * 3


def test_the_constant_blend_is_the_cheapest_of_the_grid_on_the_tuning_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = {(0.6, 0.0, 0.4): (90, 1), (0.4, 0.2, 0.4): (200, 3), (1.0, 0.0, 0.0): (10, 0)}
    asked: set[tuple[int, int]] = set()

    def played(weights: tuple[float, ...], _behaviors: object, _loop: object, seed: int, episodes: int) -> Result:
        asked.add((seed, episodes))
        steps, goals = costs.get(weights, (1000, 1))
        return {**dict.fromkeys(Score._fields, 0), "steps": steps, "goals": goals}

    monkeypatch.setattr("fbql_studies.common.tuning.blend_played", played)
    assert tuning.best_blend(shipped(), WorldLoop()) == (0.4, 0.2, 0.4)
    assert asked == {(tuning.TUNING_SEED, episodes) for episodes, _ in tuning.BLEND_ROUNDS}


def test_equal_constant_weights_are_the_uniform_controller() -> None:
    loop = WorldLoop(SimulationParameters(max_steps=120))
    found = tuning.blend_played((1 / 3,) * 3, shipped(), loop, 77, 3)
    assert found == frozen(FusionParameters(controller="uniform"), shipped(), loop, 77, 3)
