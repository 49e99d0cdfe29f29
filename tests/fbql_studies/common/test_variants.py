"""Studies of changes to fbql (ablation, sensitivity): every change can be tried, and is named as options."""

from __future__ import annotations

from types import ModuleType

import pytest
from fbql.statistics.runs import method_row, runs_by_method
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from fbql_studies.ablation import study as ablation
from fbql_studies.common import variants
from fbql_studies.common.play import frozen
from fbql_studies.common.training import train, training_of
from fbql_studies.sensitivity import study as sensitivity
from studies import shipped

VARIED = (ablation, sensitivity)
CHANGES = {variants.as_set(each): each for study in VARIED for each in study.VARIANTS.trained.values()}
MAX_STEPS = 120


@pytest.fixture(scope="module")
def loop() -> WorldLoop:
    return WorldLoop(SimulationParameters(max_steps=MAX_STEPS))


@pytest.mark.parametrize("study", VARIED)
def test_every_variant_changes_a_parameter_and_each_is_tried_once(study: ModuleType) -> None:
    default = FusionParameters()
    trained, played = study.VARIANTS.trained, study.VARIANTS.played
    assert not set(trained) & set(played)
    for changes in (*trained.values(), *played.values()):
        assert any(getattr(default, name) != value for name, value in changes.items())
    assert len({str(sorted(changes.items())) for changes in (*trained.values(), *played.values())}) == len(
        trained
    ) + len(played)
    assert all(name in ("fbql_play", "fbql_patience", "fbql_play_s") for each in played.values() for name in each)


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
def test_every_variant_can_be_trained_and_played(changes: variants.Changes, loop: WorldLoop) -> None:
    fusion = training_of(5, 1, **{"guided": 2, **changes})
    trained = train(fusion, shipped(), loop)
    assert frozen(fusion, shipped(), loop, 77, 1, trained.policy)["episodes"] == 1


def test_changes_are_told_as_options_that_the_command_takes() -> None:
    changes = ablation.VARIANTS.trained["leaves and pairs of leaves only"] | {"fbql_mirror": False, "preset": "paper"}
    words = variants.as_set(changes)
    assert words == "--set fbql_pair_tilings=0 --set fbql_joint_tilings=0 --set fbql_mirror=false --set preset=paper"
    rows = [{"method": "no mirror", "changes": words}, {"method": "fbql", "changes": ""}]
    assert variants.changes_table(rows) == {"what is changed": (["method", "changes"], [["no mirror", f"`{words}`"]])}


def test_a_single_run_is_compared_without_p_and_a_control_not_with_itself() -> None:
    def run(method: str, steps: int, seed: int) -> dict[str, object]:
        ends = {
            "episodes": 2000,
            "goals": 1999,
            "own_goals": 1,
            "timeouts": 0,
            "collisions_begun": 3,
            "collision_steps": 9,
        }
        return {"method": method, "tree_seed": 1, "seed": seed, "steps": steps, "steps_to_goals": steps, **ends}

    def told(seeds: int) -> dict[str, str]:
        runs = [run(method, steps, seed) for seed in range(seeds) for method, steps in (("fbql", 600), ("other", 900))]
        by_method = runs_by_method(runs, ["fbql", "other"])
        rows = [method_row(method, by_method, {"default": "fbql"}) for method in by_method]
        table = variants.words(rows)["one change each"]
        at, rate = table.head.index("to default"), table.head.index("success rate")
        assert [line[rate] for line in table.body] == ["0.999", "0.999"], "one was missed"
        return {line[0]: line[at] for line in table.body}

    assert told(1) == {"fbql": "", "other": "1.50"}
    assert told(2) == {"fbql": "", "other": "1.50 (1.50 to 1.50), p .5"}


def test_a_single_run_is_drawn_without_an_interval_and_an_endless_one_as_an_arrow() -> None:
    pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")
    from fbql_studies.common.drawing import intervals_figure

    def lines(low: float | None, high: float | None) -> int:
        (axis,) = intervals_figure([{"method": "a", "r": 0.6, "r_low": low, "r_high": high}], "r", "x").axes
        return sum(1 for line in axis.lines if line.get_ydata()[0] == 0 and line.get_xdata()[0] != 1.0)

    assert [lines(None, None), lines(0.5, 0.7), lines(0.5, None)] == [1, 2, 3]
