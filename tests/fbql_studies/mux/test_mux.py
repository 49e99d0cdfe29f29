"""The study of the mux: whole at small size, its seeds, that it repeats, and what its table compares."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from fbql.statistics.tables import as_markdown
from fbql_common.core.errors import BadInput
from fbql_studies.mux import study as mux
from fbql_studies.mux import tables
from fbql_studies.runner.study import Result
from studies import tasks_of

SMALL = (
    "--seeds",
    "1",
    "--episodes",
    "3",
    "--evaluate",
    "2",
    "--settings",
    "3",
    "--blends",
    "2",
    "--tuning-rooms",
    "2",
)


def test_no_room_is_used_for_two_purposes() -> None:
    tuning = range(mux.FIRST_TUNING_ROOM, mux.FIRST_TUNING_ROOM + mux.ROOMS_OF_A_TRAINING)
    test = range(mux.FIRST_TEST_ROOM, mux.FIRST_TEST_ROOM + mux.ROOMS_OF_A_TRAINING)
    assert tuning.stop <= test.start
    assert test.stop <= mux.FIRST_TRAINING_ROOM
    with pytest.raises(BadInput, match="--episodes is 10001"):
        tasks_of(mux, "--episodes", str(mux.ROOMS_OF_A_TRAINING + 1))


@pytest.mark.parametrize("name", ["seeds", "episodes", "evaluate", "settings", "blends", "tuning-rooms"])
def test_a_study_of_nothing_is_refused(name: str) -> None:
    with pytest.raises(BadInput, match=f"--{name} is 0"):
        tasks_of(mux, f"--{name}", "0")


def test_every_candidate_is_played_once_whatever_the_size_of_a_task() -> None:
    found = tasks_of(mux, "--settings", "45", "--blends", "11")
    assert len({task.key for task in found}) == len(found)
    for part, family, count in (("settings", "traps", 45), ("settings", "doors", 45), ("blends", "traps", 11)):
        own = [t.parameters for t in found if (t.parameters["part"], t.parameters.get("family")) == (part, family)]
        assert [k for each in own for k in range(each["first"], each["last"])] == list(range(count))
    assert json.loads(json.dumps([task.parameters for task in found])) == [task.parameters for task in found]


@pytest.fixture(scope="module", autouse=True)
def interpreted() -> Iterator[None]:
    """Compiling takes longer than what is played here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mux, "prepare", lambda: None)
        yield


@pytest.fixture(scope="module")
def results(interpreted: None) -> dict[str, Result]:
    """The whole study, small."""
    return {task.key: mux.run(task.parameters) for task in tasks_of(mux, *SMALL)}


def test_a_task_gives_the_same_result_twice(results: dict[str, Result]) -> None:
    found = {task.key: task.parameters for task in tasks_of(mux, *SMALL)}
    for key in ("fixed-noise", "settings-traps-0", "learned-prior_3-seed0"):
        assert mux.run(found[key]) == results[key] == json.loads(json.dumps(results[key]))


def test_every_method_is_compared_with_the_tuned_priorities_on_the_same_rooms(results: dict[str, Result]) -> None:
    rows = mux.table(results)
    assert {row["rooms"] for row in rows} == {2}
    methods = {(row["method"], row["family"], row["noise_m"], row["trained"]) for row in rows}
    assert len(methods) == len(rows)
    assert {("learned", "traps", 0.0, 0), ("learned", "traps", 0.0, 3), ("learned, noise", "traps", 0.05, 3)} <= methods
    assert {("priorities, tuned", "doors", 0.0, None), ("best constant blend", "traps", 0.0, None)} <= methods
    assert set().union(*rows) <= set(mux.COLUMNS)
    page = "\n".join(as_markdown(each) for each in mux.words(rows).values())
    assert "| learned, prior 3 | 3 | 1 |" in page
    assert "| priorities, tuned | traps | 3 |" in page


def test_before_any_episode_a_prior_plays_its_guide(results: dict[str, Result]) -> None:
    run = results["learned-prior_3-seed0"]["runs"][0]
    assert run["trained"] == 0
    assert run != {**results["learned-seed0"]["runs"][0], "method": run["method"]}


def test_irsim_plays_what_the_twin_plays() -> None:
    key, parameters = next(
        (task.key, task.parameters) for task in tasks_of(mux, *SMALL, "--worlds", "both") if task.key == "learned-seed0"
    )
    twin, irsim = mux.run(parameters)["runs"][-2:]
    assert key == "learned-seed0"
    assert irsim.pop("method") == "learned, in IR-SIM"
    assert irsim == {name: value for name, value in twin.items() if name != "method"}


def test_without_irsim_the_option_is_refused_before_anything_is_played(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "irsim", None)
    with pytest.raises(BadInput, match="IR-SIM, which is not installed"):
        tasks_of(mux, "--worlds", "both")


def run(method: str, seed: int, outcomes: str, costs: list[int], **more: Any) -> Result:
    return {
        "method": method, "seed": seed, "family": "traps", "noise_m": 0.0, "outcomes": outcomes, "costs": costs,
        "steps": sum(costs), **more,
    }  # fmt: skip


def candidate(what: str, tuning_cost: int, costs: list[int]) -> Result:
    tuning = {"episodes": 2, "successes": 2, "collisions": 0, "cost": tuning_cost, "steps": tuning_cost}
    outcomes = "".join("s" if cost < 400 else "t" for cost in costs)
    return {"what": what, "tuning": tuning, "test": {"outcomes": outcomes, "costs": costs, "steps": sum(costs)}}


def test_the_priorities_are_chosen_by_the_rooms_of_tuning_and_reported_on_the_test_rooms() -> None:
    found = {
        "a": {"part": "settings", "family": "traps", "candidates": [candidate("first", 300, [100] * 4)]},
        "b": {"part": "settings", "family": "traps", "candidates": [candidate("second", 200, [200, 200, 400, 400])]},
        "c": {"runs": [run("learned", seed, "ssst", [100, 100, 100, 400], trained=5) for seed in (0, 1)]},
    }
    rows = {row["method"]: row for row in tables.table(found)}
    tuned, learned = rows["priorities, tuned"], rows["learned"]
    assert (tuned["what"], tuned["candidates"], tuned["cost"], tuned["ratio"]) == ("second", 2, 600.0, 1.0)
    assert (learned["cost"], learned["ratio"], learned["ratio_worst"]) == (700 / 3, 700 / 3 / 600, 700 / 3 / 600)
    assert (learned["success"], learned["gain"], learned["collisions"]) == (0.75, 0.25, 0.0)
    assert learned["gain_low"] <= 0.25 <= learned["gain_high"]


def test_an_interval_is_of_trainings_and_of_rooms() -> None:
    alike = [run("learned", seed, "st" * 50, [100, 400] * 50, trained=5) for seed in range(5)]
    apart = [
        run("learned", seed, ("s" if seed < 2 else "t") * 100, [100 if seed < 2 else 400] * 100, trained=5)
        for seed in range(5)
    ]
    widths = []
    for runs in (alike, apart):
        (row,) = tables.table({"a": {"runs": runs}})
        widths.append(row["success_high"] - row["success_low"])
    assert 0.1 < widths[0] < 0.3, "rooms alone differ"
    assert widths[1] > 0.6, "trainings alone differ"


def test_a_method_that_never_reaches_the_goal_has_no_cost() -> None:
    (row,) = tables.table({"a": {"runs": [run("goal alone", 0, "cc", [400, 400])]}})
    assert row["cost"] is None
