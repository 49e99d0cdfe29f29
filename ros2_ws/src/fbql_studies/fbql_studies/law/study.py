"""The scripted law: its constants tuned on training episodes, then played on others, beside the kinematic bound.

A task is one search, or the constants that ship. Searches differ in their random numbers and their episodes. Run seeds
below FIRST_RUN_SEED are for tuning; those of the evaluation are used by no other study.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
from fbql.statistics.inference import Interval, ratio_of_sums
from fbql.statistics.tables import Row, Table, between, finite, number, tabulate
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.scripted_law import TUNED, UNTUNED, LawConstants, law
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.play import Score, bound_steps, driven
from fbql_studies.law.tuning import search
from fbql_studies.runner.study import MOST_PLAYED, Parameters, Result, StudyTask, add_count, check_counts

DESCRIPTION = (
    "the constants of the scripted law that sees everything, tuned on training episodes, and the kinematic bound"
)
CAPTIONS: Mapping[str, str] = {}
FIRST_SEED = 400
"""Run seed of the first generation of the first search."""
MOST_GENERATIONS = 50
MOST_SEARCHES = 10
CHOOSING_SEED = 12
"""Run seed on whose episodes the searches are compared."""
EVALUATION_SEED = 20_000
"""Run seed of the evaluation; blocks of BLOCK episodes are its runs."""
BLOCK = 50
TUNING_MAX_STEPS = 1000
"""Steps after which an episode of a search is truncated: a law that needs more is not worth the time."""
AS_SHIPPED = {"set by hand": UNTUNED, "tuned, as shipped": TUNED}
SHIPPED = "shipped"
COLUMNS = {
    "law": "the constants that are played: those that ship, or those that a search found",
    "tries": "sets of constants that the search tried",
    "tried_steps": "simulated steps that it took",
    "choosing_cost": "cost/goal on the episodes by which the searches are compared, which are none of their own",
    "cost_per_goal": "steps of all episodes / goals, on episodes that nothing was tuned or chosen on; for a bound, steps per "
    "episode",
    "cost_low": "the lower end of its 95 % interval, a bootstrap over blocks of 50 episodes; null with one block",
    "cost_high": "the upper end; null with one block",
    "goals": "episodes that ended in a goal",
    "episodes": "episodes",
    "collisions_begun_per_goal": "how often the robot began to touch a wall / goals",
    "bound": "what the bound assumes of the ball",
    "constant": "name of a constant of the law",
    "values": "its value in each law: the shipped ones first, then the searches",
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--searches", 3, "searches, each with other random numbers and episodes")
    add_count(parser, "--generations", 30, "generations of a search")
    add_count(parser, "--population", 40, "sets of constants in a generation")
    add_count(parser, "--episodes", 20, "training episodes that each of them plays")
    add_count(parser, "--evaluate", 500, "episodes of the comparison, and of the evaluation")


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """The shipped constants, then the searches."""
    played = dict.fromkeys(("population", "episodes", "evaluate"), MOST_PLAYED)
    check_counts(options, searches=MOST_SEARCHES, generations=MOST_GENERATIONS, **played)
    budget = {name: getattr(options, name) for name in ("generations", "population", "episodes")}
    given = {"evaluate": options.evaluate}
    return [
        StudyTask(SHIPPED, {"part": SHIPPED, **given}),
        *(StudyTask(f"search{k}", {"part": "search", "search": k, **budget, **given}) for k in range(options.searches)),
    ]


def run(parameters: Parameters) -> Result:
    """Searches and plays what was found, or plays the shipped constants and computes the bounds."""
    episodes = parameters["evaluate"]
    if parameters["part"] == SHIPPED:
        laws = [{"law": name, **_played(constants, episodes)} for name, constants in AS_SHIPPED.items()]
        blocks = _blocks(episodes)
        bounds = {
            ball: [bound_steps(seed, count)[ball] / count for seed, count in blocks] for ball in bound_steps(0, 1)
        }
        return {"laws": laws, "bounds": bounds}
    k, count = parameters["search"], parameters["episodes"]
    loop = WorldLoop(SimulationParameters(max_steps=TUNING_MAX_STEPS))
    tried = 0

    def cost(constants: LawConstants, generation: int) -> float:
        nonlocal tried
        seed = FIRST_SEED + k * MOST_GENERATIONS + generation
        score = Score.of(driven(partial(law, constants=constants), loop, seed, count))
        tried += score.steps
        return score.cost

    found = search(cost, parameters["generations"], parameters["population"], np.random.default_rng(k))
    own = {
        "law": f"search {k}",
        "tries": parameters["generations"] * parameters["population"],
        "tried_steps": tried,
        **_played(found.constants, episodes),
    }
    return {"laws": [own], "best": found.best}


def _blocks(episodes: int) -> list[tuple[int, int]]:
    """Run seed and number of episodes of each block of the evaluation."""
    return [
        (EVALUATION_SEED + block, min(BLOCK, episodes - first)) for block, first in enumerate(range(0, episodes, BLOCK))
    ]


def _played(constants: LawConstants, episodes: int) -> Result:
    loop, drive = WorldLoop(), partial(law, constants=constants)
    return {
        "constants": asdict(constants),
        "choosing_cost": finite({"cost": Score.of(driven(drive, loop, CHOOSING_SEED, episodes)).cost})["cost"],
        "blocks": [driven(drive, loop, seed, count) for seed, count in _blocks(episodes)],
    }


def table(results: Mapping[str, Result]) -> list[Row]:
    """The laws, the bounds, and the constants of each law."""
    laws = [each for result in results.values() for each in result["laws"]]
    rows = [_law_row(each) for each in laws]
    for result in results.values():
        for ball, means in result.get("bounds", {}).items():
            rows.append(finite({"bound": ball, **_cost(ratio_of_sums(means, [1.0] * len(means)))}))
    names = laws[0]["constants"] if laws else {}
    return rows + [{"constant": name, "values": [each["constants"][name] for each in laws]} for name in names]


def _law_row(played: Result) -> Row:
    blocks = played["blocks"]
    total = {name: sum(block[name] for block in blocks) for name in ("goals", "episodes", "collisions_begun")}
    cost = ratio_of_sums([block["steps"] for block in blocks], [block["goals"] for block in blocks])
    begun = total.pop("collisions_begun")
    return finite(
        {
            "law": played["law"],
            "tries": played.get("tries"),
            "tried_steps": played.get("tried_steps"),
            "choosing_cost": played["choosing_cost"],
            **_cost(cost),
            **total,
            "collisions_begun_per_goal": begun / total["goals"] if total["goals"] else None,
        }
    )


def _cost(interval: Interval) -> Row:
    return dict(zip(("cost_per_goal", "cost_low", "cost_high"), interval, strict=True))


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    laws = [row["law"] for row in rows if "law" in row]
    constants = [[row["constant"], *(f"{value:g}" for value in row["values"])] for row in rows if "constant" in row]
    return {
        "laws": tabulate(
            (row for row in rows if "law" in row),
            {
                "law": lambda row: row["law"],
                "tries": lambda row: number(row["tries"], ".0f"),
                "steps tried": lambda row: number(row["tried_steps"], ".3g"),
                "cost/goal, to choose": lambda row: number(row["choosing_cost"], ".1f"),
                "cost/goal (95 %)": lambda row: between(row, "cost_per_goal", "cost_low", "cost_high", ".1f"),
                "goals / episodes": lambda row: f"{row['goals']} / {row['episodes']}",
                "collisions / goal": lambda row: number(row["collisions_begun_per_goal"], ".2f"),
            },
        ),
        "kinematic bound": tabulate(
            (row for row in rows if "bound" in row),
            {
                "the ball": lambda row: row["bound"],
                "steps at least (95 %)": lambda row: between(row, "cost_per_goal", "cost_low", "cost_high", ".1f"),
            },
        ),
        "constants": Table(["constant", *laws], constants),
    }


def figures(_results: Mapping[str, Result], _directory: Path) -> list[Path]:
    """This study has none."""
    return []
