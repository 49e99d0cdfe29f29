"""The paper's protocol: 20 guided episodes, then until 50 goals, for every method on the same trees and the same starts.

A task is a tree set and some run seeds; the Subsumption that is tuned for a tree set has its own task, so that it is
tuned only once, and so have the methods that imagine, which take longest. Every method meets the same episodes: methods that
learn nothing play the guided ones as well, so that episode k of a run has the same start for each.

Afterwards each method plays frozen, by what it has learned within these goals, on episodes of another run seed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import batched
from pathlib import Path

from fbql.match.in_process import play
from fbql.match.trees import playing_trees
from fbql.statistics.courses import courses
from fbql.statistics.runs import Runs, method_row, runs_by_method
from fbql.statistics.tables import Row, with_all_columns
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import Phase
from fbql_fusion.core.controllers.parameters import GUIDED_EPISODES
from fbql_fusion.core.learners.literal.equations import count_ties
from fbql_fusion.core.learners.literal.learner import FbqlLiteral
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_recording.core.metrics import OUTCOMES
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.methods import (
    FBQL,
    FBQL_MODEL,
    LEARNERS,
    LITERAL_TWIN,
    PAPER,
    RETUNED,
    TIES_FIRST,
    TIES_NONE,
    TUNED,
    UNIFORM,
    greedy,
    guided,
    guided_data,
    imagined_once,
    papers_guide,
    untrained,
)
from fbql_studies.common.play import counts_of, frozen
from fbql_studies.common.training import (
    add_first_seeds,
    add_max_steps,
    after_guidance,
    as_it_learns,
    behaviors_of,
    check_first_seeds,
)
from fbql_studies.common.tuning import retuned
from fbql_studies.paper import tables
from fbql_studies.runner.study import (
    MOST_PLAYED,
    MOST_SEEDS,
    Parameters,
    Result,
    StudyTask,
    add_count,
    check_counts,
)

DESCRIPTION = "the paper's protocol: 20 guided episodes, then until 50 goals, all methods on the same starts"
CAPTIONS = {
    "fusion_paper": "The analogues of the paper's Figs. 10 to 14, as moving averages over 5 successes with 95 % intervals over tree sets and runs",
}
COLUMNS, words = tables.COLUMNS, tables.words
MOST_TREE_SETS = 100
"""The tree sets of other studies come after these."""
RUNS_PER_TASK = 4
FROZEN_SEEDS = 100_000
"""Added to a run seed to get the run seed of the frozen play."""
MOST_EPISODES = 400
"""A run ends after this many episodes, regardless of its goals."""


def _methods_of(learner: str) -> dict[str, FusionParameters]:
    """A learner and its frozen twins, with either guide. All play as the learner does while it learns."""
    drawn = {"controller": learner, **as_it_learns(learner)}
    papers = papers_guide(learner)
    return {
        learner: FusionParameters(**drawn),
        guided(learner): FusionParameters(**drawn, learn=False),
        papers: FusionParameters(**drawn, preset="paper"),
        guided(papers): FusionParameters(**drawn, preset="paper", learn=False),
        untrained(learner): FusionParameters(**drawn, learn=False),
    }


def _greedy_methods() -> dict[str, FusionParameters]:
    """fbql that does not explore, and its frozen twins. They know what fbql_model knows before it imagines, and play like it."""
    found: dict[str, FusionParameters] = {}
    for preset, method in _by_guide(greedy(FBQL)).items():
        fusion = FusionParameters(controller=FBQL, fbql_explore=False, preset=preset)
        found |= {method: fusion, guided(method): replace(fusion, learn=False)}
    return found


def _imagining_methods() -> dict[str, FusionParameters]:
    """fbql_model and its twins."""
    found: dict[str, FusionParameters] = {}
    for preset, method in _by_guide(FBQL_MODEL).items():
        fusion = FusionParameters(controller=FBQL_MODEL, preset=preset)
        found |= {
            method: fusion,
            imagined_once(method): replace(fusion, learn=False),
            guided_data(method): replace(fusion, fbql_model_data="guided"),
        }
    return found


def _by_guide(method: str) -> dict[str, str]:
    """Preset of the guide -> the method that it guides."""
    return {FusionParameters().preset: method, "paper": papers_guide(method)}


IMAGINING = _imagining_methods()
METHODS: dict[str, FusionParameters] = {
    PAPER: FusionParameters(controller="subsumption", preset="paper"),
    TUNED: FusionParameters(controller="subsumption", preset="tuned"),
    RETUNED: FusionParameters(controller="subsumption"),
    UNIFORM: FusionParameters(controller="uniform"),
    TIES_NONE: FusionParameters(controller="fbql_literal", tie_rule="none"),
    TIES_FIRST: FusionParameters(controller="fbql_literal", tie_rule="first"),
    LITERAL_TWIN: FusionParameters(controller="fbql_literal", learn=False),
    **{method: fusion for learner in LEARNERS for method, fusion in _methods_of(learner).items()},
    **_greedy_methods(),
    **IMAGINING,
}
"""The guide of a learner is Subsumption with the tuned preset unless the method's name names another."""
TWINS: dict[str, dict[str, str]] = {
    **{
        method: {"untrained": untrained(learner), "guided": guided(method)}
        for learner in LEARNERS
        for method in (learner, papers_guide(learner))
    },
    **{method: {"guided": guided(method)} for method in _by_guide(greedy(FBQL)).values()},
    **{
        method: {
            "guided": guided(frozen_start),
            "imagined": imagined_once(method),
            "guided_data": guided_data(method),
            "learner": fbql,
        }
        for method, frozen_start, fbql in zip(
            _by_guide(FBQL_MODEL).values(), _by_guide(greedy(FBQL)).values(), _by_guide(FBQL).values(), strict=True
        )
    },
}
"""Method that learns -> its twins: the same play without learning at all, or with learning stopped after the guided episodes.
For fbql_model the latter is that of the greedy fbql, which knows the same; and there are those that imagined once, or with no
data but the guided episodes', and the fbql with the same guide."""
STOPPED = {
    method
    for method, fusion in METHODS.items()
    if not fusion.learn and method.endswith((guided(""), imagined_once("")))
}
"""The twins that play what was learned by the end of the guided episodes. fbql_model imagines there for the first time."""
CONTROLS = {"paper": PAPER, "retuned": RETUNED, "frozen": LITERAL_TWIN}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--seeds", 20, "run seeds of each tree set")
    add_count(parser, "--trees", 5, "tree sets, each from other demonstrations")
    most = f"a run that takes more than {MOST_EPISODES} episodes ends there"
    add_count(parser, "--goals", 50, f"goals after the guided episodes; {most}")
    add_count(parser, "--evaluate", 60, "episodes of frozen play after that")
    add_max_steps(parser)
    add_first_seeds(parser)


DRAWN = (
    PAPER, RETUNED, TIES_NONE, *LEARNERS, papers_guide(FBQL), guided(papers_guide(FBQL)), FBQL_MODEL,
    imagined_once(FBQL_MODEL),
)  # fmt: skip
"""The methods of the figures."""


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """For each tree set a task for the Subsumption tuned for it; for RUNS_PER_TASK seeds of it one for the methods that imagine,
    and one for all others."""
    check_counts(
        options,
        seeds=MOST_SEEDS,
        trees=MOST_TREE_SETS,
        goals=MOST_EPISODES,
        evaluate=MOST_PLAYED,
        max_steps=MOST_PLAYED,
    )
    check_first_seeds(options)
    given = {"goals": options.goals, "max_steps": options.max_steps, "evaluate": options.evaluate}
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    trees = range(options.first_trees, options.first_trees + options.trees)
    found = [
        StudyTask(
            f"retuned-trees{tree}-seeds{options.seeds}",
            {"part": RETUNED, "tree_seed": tree, "run_seeds": list(seeds), **given},
        )
        for tree in trees
    ]
    return found + [
        StudyTask(
            f"{part}trees{tree}-seeds{block[0]}to{block[-1]}",
            {"part": part.removesuffix("-") or "others", "tree_seed": tree, "run_seeds": list(block), **given},
        )
        for block in batched(seeds, RUNS_PER_TASK)
        for tree in trees
        for part in ("", "imagining-")
    ]


def run(parameters: Parameters) -> Result:
    """Plays the methods of a task with each of its run seeds; returns their counts and episodes."""
    behaviors = behaviors_of(parameters["tree_seed"])
    loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
    result: Result = {"tree_seed": parameters["tree_seed"]}
    methods = {method: each for method, each in METHODS.items() if method != RETUNED and method not in IMAGINING}
    if parameters["part"] == "imagining":
        methods = IMAGINING
    elif parameters["part"] == RETUNED:
        wall_m, approach_rad = retuned(behaviors, loop)
        result["retuned"] = [wall_m, approach_rad]
        methods = {
            RETUNED: replace(METHODS[RETUNED], wall_threshold_m=wall_m, approach_threshold_rad=approach_rad),
        }
    runs: list[dict[str, object]] = []
    for seed in parameters["run_seeds"]:
        for method, fusion in methods.items():
            fusion = replace(
                fusion, seed=seed, guided=GUIDED_EPISODES, goals=parameters["goals"], episodes=MOST_EPISODES
            )
            policy = after_guidance(replace(fusion, learn=True), behaviors, loop) if method in STOPPED else None
            counts, learned = play_run(fusion, behaviors, loop, policy)
            afterwards = frozen(
                as_deployed(fusion), behaviors, loop, FROZEN_SEEDS + seed, parameters["evaluate"], learned or policy
            )
            runs.append({"method": method, "seed": seed, **counts, "frozen": afterwards})
    return {**result, "runs": runs}


def as_deployed(fusion: FusionParameters) -> FusionParameters:
    """The same method, as it plays when it has been trained: by the largest weight where that is its controller's way."""
    default = FusionParameters()
    names = [f"{fusion.controller}_play", f"{fusion.controller}_play_s"]
    return replace(fusion, **{name: getattr(default, name) for name in names if hasattr(default, name)})


def play_run(
    fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop, policy: Policy | None = None
) -> tuple[dict[str, object], Policy | None]:
    """One run of one method: its counts, and [outcome, steps, collisions begun, contact steps] of each episode; and its policy,
    where it learned."""
    session = SoccerSession(fusion, policy, playing_trees(behavior.tree for behavior in behaviors))
    play(session, loop, behaviors, lambda: True)
    counted = [record for record in session.records if record.phase is not Phase.GUIDED]
    result: dict[str, object] = {
        **counts_of(counted),
        "course": [
            [OUTCOMES.index(record.outcome), record.steps, record.collisions_begun, record.collision_steps]
            for record in counted
        ],
        "digest": session.digest,
    }
    learned = session.policy()
    if learned is not None and learned.kind == FbqlLiteral.kind and fusion.learn:
        q = learned.arrays["q"]
        result |= {"joint_states": len(q), "tied": count_ties(q)}
    return result, learned if session.is_learning else None


def table(results: Mapping[str, Result]) -> list[Row]:
    """Methods while they learn, with intervals over tree sets and runs and paired with the controls; the same frozen; then the
    rungs of 50 goals."""
    by_method, afterwards = runs_of(results), frozen_runs_of(results)
    rows = with_all_columns(
        [
            *(
                {
                    **method_row(method, by_method, CONTROLS | TWINS.get(method, {})),
                    **_tied(runs),
                    "when": tables.LEARNING,
                }
                for method, runs in by_method.items()
            ),
            *(
                {**method_row(method, afterwards, CONTROLS | TWINS.get(method, {})), "when": tables.FROZEN}
                for method in afterwards
            ),
        ]
    )
    if PAPER in by_method:
        for method, twins in TWINS.items():
            if method in by_method:
                rows += tables.rung_a_rows(method, by_method, PAPER, *dict.fromkeys(twins.values()))
    return rows


def runs_of(results: Mapping[str, Result]) -> dict[str, Runs]:
    """Method -> (tree seed, run seed) -> run."""
    return runs_by_method(_found(results), tuple(METHODS))


def frozen_runs_of(results: Mapping[str, Result]) -> dict[str, Runs]:
    """The same of the frozen play after the goals."""
    frozen_runs = [{**each, **each["frozen"]} for each in _found(results) if "frozen" in each]
    return runs_by_method(frozen_runs, tuple(METHODS))


def _found(results: Mapping[str, Result]) -> Iterator[Row]:
    return ({**each, "tree_seed": result["tree_seed"]} for result in results.values() for each in result["runs"])


def _tied(runs: Runs) -> Row:
    """How many joint states the literal learner met on average, and in what share of them all Q are equal in the end."""
    met = [run for run in runs.values() if "tied" in run]
    joint_states = sum(run["joint_states"] for run in met)
    if not joint_states:
        return {"joint_states": None, "tied_share": None}
    return {
        "joint_states": joint_states / len(met),
        "tied_share": sum(run["tied"] for run in met) / joint_states,
    }


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """The analogues of the paper's Figs. 10 to 14, and the numbers they are drawn from (curves.json)."""
    from fbql_studies.common.drawing import keep_and_draw
    from fbql_studies.paper.figures import FIGURES

    by_method = runs_of(results)
    drawn = {method: by_method[method] for method in DRAWN if method in by_method}
    return keep_and_draw(FIGURES, {"paper": courses(drawn)} if by_method else {}, directory)
