"""The study of the scripted law: its search finds a known optimum, and its table has the laws, the bounds and the constants."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from math import log

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_sim.core.scripted_law import TUNED, UNTUNED, LawConstants
from fbql_studies.common.play import KICKED, PUSHED, bound_steps
from fbql_studies.common.training import FIRST_RUN_SEED
from fbql_studies.law import study as law
from fbql_studies.law.tuning import search
from studies import tasks_of

BEST = replace(UNTUNED, speed_m_s=2.0, cone_rad=0.4, turn_gain_1_s=20.0)
TINY = ("--searches", "2", "--generations", "2", "--population", "3", "--episodes", "1", "--evaluate", "2")


def distance(constants: LawConstants, _generation: int = 0) -> float:
    return sum(log(value / asdict(BEST)[name]) ** 2 for name, value in asdict(constants).items())


def test_the_search_finds_the_constants_of_the_least_cost_wherever_they_are() -> None:
    found = search(distance, 40, 60, np.random.default_rng(1))
    assert distance(found.constants) < 0.1 * distance(UNTUNED)
    assert found.constants.speed_m_s == pytest.approx(2.0, rel=0.1)
    assert len(found.best) == 40 and found.best[-1] < found.best[0]


def test_the_search_begins_with_the_constants_set_by_hand_and_repeats_with_its_random_numbers() -> None:
    tried: list[LawConstants] = []

    def cost(constants: LawConstants, _generation: int) -> float:
        tried.append(constants)
        return distance(constants)

    one, other = (search(cost, 3, 5, np.random.default_rng(4)) for _ in range(2))
    assert tried[0] == UNTUNED
    assert one == other and tried[:15] == tried[15:]


def test_every_generation_has_episodes_of_its_own_that_are_for_tuning() -> None:
    last = law.FIRST_SEED + law.MOST_SEARCHES * law.MOST_GENERATIONS
    assert law.CHOOSING_SEED < law.FIRST_SEED < last <= FIRST_RUN_SEED < law.EVALUATION_SEED
    seeds: list[int] = []
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(law, "driven", lambda _drive, _loop, seed, count: seeds.append(seed) or COUNTS)
        for task in tasks_of(law, *TINY, "--evaluate", "120"):
            law.run(task.parameters)
    tuning = {seed for seed in seeds if law.FIRST_SEED <= seed < last}
    assert len(tuning) == 4, "two searches of two generations"
    assert {*seeds} - tuning == {law.CHOOSING_SEED, *(law.EVALUATION_SEED + block for block in range(3))}


COUNTS = {
    "goals": 1, "own_goals": 0, "timeouts": 0, "episodes": 1, "steps": 100, "collisions_begun": 1, "collision_steps": 2,
    "steps_to_goals": 100,
}  # fmt: skip


def test_the_table_has_the_laws_the_bounds_and_every_constant() -> None:
    results = {task.key: law.run(task.parameters) for task in tasks_of(law, *TINY)}
    assert json.loads(json.dumps(results, allow_nan=False)) == results
    rows = law.table(results)
    json.dumps(rows, allow_nan=False)
    names = [row["law"] for row in rows if "law" in row]
    assert names == ["set by hand", "tuned, as shipped", "search 0", "search 1"]
    assert [row["bound"] for row in rows if "bound" in row] == [KICKED, PUSHED]
    assert {row["constant"] for row in rows if "constant" in row} == {*asdict(UNTUNED)}
    shipped = [row["values"][:2] for row in rows if "constant" in row]
    assert shipped == [list(pair) for pair in zip(asdict(UNTUNED).values(), asdict(TUNED).values(), strict=True)]
    assert {name: len(table.body) for name, table in law.words(rows).items()} == {
        "laws": 4, "kinematic bound": 2, "constants": len(asdict(UNTUNED)),
    }  # fmt: skip
    assert {column for row in rows for column in row} <= {*law.COLUMNS}


def test_a_bound_is_summed_over_the_starts_of_the_episodes() -> None:
    first, both = bound_steps(5, 1), bound_steps(5, 2)
    assert 60 <= first[KICKED] < first[PUSHED] <= 94
    assert both[KICKED] - first[KICKED] >= 60


@pytest.mark.parametrize("option", ["--searches", "--generations", "--population", "--episodes", "--evaluate"])
def test_numbers_below_1_are_refused(option: str) -> None:
    with pytest.raises(BadInput, match=f"^{option} is 0; it must be 1 to"):
        tasks_of(law, option, "0")
