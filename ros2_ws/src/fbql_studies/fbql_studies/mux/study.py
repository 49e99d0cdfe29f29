"""A mux that learns which source to follow, against tuned priorities, in rooms that neither has seen.

The robot, its rooms and its sources are those of `fbql_studies.rooms`; a room is its family and seed. Rooms for tuning, for
training and for testing never overlap, and no test room influences a choice. Every task plays in the twin of IR-SIM; with
`--worlds both` the trained policies also play the test rooms in IR-SIM itself.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.kernels import prepare
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters

from fbql_studies.mux import tables
from fbql_studies.rooms.learned import Mux
from fbql_studies.rooms.maps import Room, room_of
from fbql_studies.rooms.play import End, alone, blended, by_priorities
from fbql_studies.rooms.priorities import HAND_SET, TUNED, settings
from fbql_studies.rooms.sources import SOURCES
from fbql_studies.rooms.tree_source import sources_with_tree
from fbql_studies.rooms.worlds import IrSimWorld, TwinWorld, World
from fbql_studies.runner.study import MOST_SEEDS, Parameters, Result, StudyTask, add_count, check_counts

DESCRIPTION = "a mux that learns from success and collision, against tuned priorities, in unseen rooms"
CAPTIONS: Mapping[str, str] = {}
COLUMNS, table, words = tables.COLUMNS, tables.table, tables.words
TRAPS, DOORS = "traps", "doors"
TWIN, BOTH = "twin", "both"

FIRST_TEST_ROOM = 900_000
FIRST_TUNING_ROOM = 100_000
FIRST_TRAINING_ROOM = 1_000_000
ROOMS_OF_A_TRAINING = 10_000
"""The rooms of training seed s begin at FIRST_TRAINING_ROOM + s * ROOMS_OF_A_TRAINING."""
SETTINGS_SEED, BLENDS_SEED = 1, 2
EVENNESS = 0.7
"""Of the Dirichlet distribution that blends are drawn from; below 1, most have a large weight."""
SETTINGS_OF_A_TASK, BLENDS_OF_A_TASK = 20, 10
CHECKPOINTS = (250, 500, 1000, 2000)
"""Episodes after which a training's policy is tested, in addition to its beginning and its end."""
BLOCK = 100
"""Training episodes of a point of the learning curve."""
NOISE_M = 0.05


class Variant(NamedTuple):
    """One way to train."""

    family: str = TRAPS
    noise_m: float = 0.0
    gated: bool = False
    """Whether the sources are silent by their own conditions, those of the tuned priorities."""
    tree: bool = False
    """Whether a tree from teleoperation is among the sources."""
    changes: tuple[tuple[str, Any], ...] = ()
    """Parameters other than the defaults."""


PLAIN = "learned"
VARIANTS: Mapping[str, Variant] = {
    PLAIN: Variant(),
    "learned, prior 3": Variant(changes=(("fbql_prior", 3.0), ("play_s", 0.1), ("fbql_patience", 0))),
    "learned, prior 2": Variant(changes=(("fbql_prior", 2.0),)),
    "learned, gated sources": Variant(gated=True),
    "learned, noise": Variant(noise_m=NOISE_M),
    "learned, doors": Variant(family=DOORS),
    "learned, with a tree": Variant(tree=True),
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--seeds", 10, "trainings of each variant")
    add_count(parser, "--episodes", 4000, "episodes of each training")
    add_count(parser, "--evaluate", 300, "test rooms")
    add_count(parser, "--settings", 240, "settings among which priorities are tuned")
    add_count(parser, "--blends", 80, "constant blends among which the best is chosen")
    add_count(parser, "--tuning-rooms", 300, "rooms on which priorities and blends are tuned")
    parser.add_argument(
        "--worlds",
        choices=[TWIN, BOTH],
        default=TWIN,
        help=f"{BOTH}: the trained policies play the test rooms in IR-SIM itself as well, which is slow ({TWIN})",
    )


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """The baselines of each family and noise, then a training for each variant and seed, seed by seed."""
    counts = {"episodes": options.episodes, "evaluate": options.evaluate, "tuning_rooms": options.tuning_rooms}
    check_counts(
        options, seeds=MOST_SEEDS, settings=10_000, blends=10_000, **dict.fromkeys(counts, ROOMS_OF_A_TRAINING)
    )
    if options.worlds == BOTH:
        IrSimWorld()  # is it installed?
    tuned = {name: counts[name] for name in ("evaluate", "tuning_rooms")}
    found = [
        StudyTask(f"fixed-{name}", {"part": "fixed", "evaluate": options.evaluate, **conditions})
        for name, conditions in _CONDITIONS.items()
    ]
    for family in (TRAPS, DOORS):
        for part, count, size in (
            ("settings", options.settings, SETTINGS_OF_A_TASK),
            ("blends", options.blends if family == TRAPS else 0, BLENDS_OF_A_TASK),
        ):
            found += [
                StudyTask(
                    f"{part}-{family}-{first}",
                    {"part": part, "family": family, "first": first, "last": min(first + size, count), **tuned},
                )
                for first in range(0, count, size)
            ]
    found += [
        StudyTask(
            f"{name.replace(', ', '-').replace(' ', '_')}-seed{seed}",
            {
                "part": "training",
                "method": name,
                "seed": seed,
                "episodes": options.episodes,
                "evaluate": options.evaluate,
                "worlds": options.worlds,
            },
        )
        for seed in range(options.seeds)
        for name in VARIANTS
    ]
    return found


_CONDITIONS: Mapping[str, Parameters] = {
    TRAPS: {"family": TRAPS, "noise_m": 0.0},
    DOORS: {"family": DOORS, "noise_m": 0.0},
    "noise": {"family": TRAPS, "noise_m": NOISE_M},
}


def run(parameters: Parameters) -> Result:
    """Plays the baselines, or some of those that are tuned, or trains and tests a mux."""
    prepare()
    match parameters["part"]:
        case "fixed":
            return _fixed(parameters)
        case "training":
            return _training(parameters)
        case _:
            return _tuned(parameters)


def rooms(family: str, first: int, count: int) -> Iterable[Room]:
    """Rooms by consecutive seeds."""
    return (room_of(family, seed) for seed in range(first, first + count))


def counts_of(ends: Iterable[End]) -> Result:
    """Episodes as they are stored: a letter for each outcome, and what each cost."""
    listed = list(ends)
    return {
        "outcomes": "".join(end.outcome[0] for end in listed),
        "costs": [end.cost for end in listed],
        "steps": sum(end.steps for end in listed),
    }


def shortened(counts: Result) -> Result:
    """Counts of episodes without what each of them was."""
    outcomes = counts["outcomes"]
    return {
        "episodes": len(outcomes),
        "successes": outcomes.count("s"),
        "collisions": outcomes.count("c"),
        "cost": sum(counts["costs"]),
        "steps": counts["steps"],
    }


def _fixed(parameters: Parameters) -> Result:
    """The baselines without tuning, and the tuned priorities that guide the learned mux."""
    family, world = parameters["family"], TwinWorld(parameters["noise_m"])
    test = list(rooms(family, FIRST_TEST_ROOM, parameters["evaluate"]))
    found = {f"{name} alone": alone(source, world, test) for name, source in sources_with_tree().items()} | {
        "uniform blend": blended([1.0 / len(SOURCES)] * len(SOURCES), world, test),
        "priorities, set by hand": by_priorities(HAND_SET, world, test),
        "priorities, the guide": by_priorities(TUNED[family], world, test),
    }
    runs = [{"method": method, **_condition(parameters), **counts_of(ends)} for method, ends in found.items()]
    return {"runs": runs}


def _condition(parameters: Parameters) -> Result:
    return {"family": parameters["family"], "noise_m": parameters["noise_m"]}


def _tuned(parameters: Parameters) -> Result:
    """Settings, or blends, on the tuning rooms, and also on the test rooms, which do not influence the choice."""
    family, world = parameters["family"], TwinWorld()
    first, last = parameters["first"], parameters["last"]
    tuning = list(rooms(family, FIRST_TUNING_ROOM, parameters["tuning_rooms"]))
    test = list(rooms(family, FIRST_TEST_ROOM, parameters["evaluate"]))
    found: list[Result] = []
    if parameters["part"] == "settings":
        candidates: list[Any] = [*settings(last, SETTINGS_SEED)[first:]]
        play: Any = by_priorities
    else:
        candidates = np.random.default_rng(BLENDS_SEED).dirichlet([EVENNESS] * len(SOURCES), last)[first:].tolist()
        play = blended
    for candidate in candidates:
        tuned = shortened(counts_of(play(candidate, world, tuning)))
        found.append({"what": _plain(candidate), "tuning": tuned, "test": counts_of(play(candidate, world, test))})
    return {"candidates": found, "part": parameters["part"], "family": family}


def _plain(candidate: Sequence[Any]) -> list[Any]:
    """A candidate as JSON."""
    return [[*each] if isinstance(each, tuple) else each for each in candidate]


def _training(parameters: Parameters) -> Result:
    """One training, tested frozen at its checkpoints."""
    method, seed, episodes = parameters["method"], parameters["seed"], parameters["episodes"]
    variant = VARIANTS[method]
    family, setting = variant.family, TUNED[variant.family]
    world = TwinWorld(variant.noise_m)
    sources = sources_with_tree() if variant.tree else SOURCES
    learning = MuxLearningParameters(
        behaviors=list(sources), seed=seed, learn=True, episodes=episodes, **dict(variant.changes)
    )
    test = list(rooms(family, FIRST_TEST_ROOM, parameters["evaluate"]))
    row = {"method": method, "seed": seed, "family": family, "noise_m": variant.noise_m}

    def tested(policy: Policy | None, world: World, trained: int) -> Result:
        """Frozen. Without a policy and without a prior nothing is preferred, and the driver is drawn."""
        play = "held" if policy is not None or learning.fbql_prior else "drawn"
        frozen = replace(learning, learn=False, episodes=0, fbql_play=play)
        return {
            **row,
            "trained": trained,
            **counts_of(Mux(frozen, setting, policy, sources, variant.gated).play(world, test)),
        }

    mux = Mux(learning, setting, None, sources, variant.gated)
    runs = [tested(None, world, 0)]
    curve: list[Result] = []
    block: list[End] = []
    training = rooms(family, FIRST_TRAINING_ROOM + seed * ROOMS_OF_A_TRAINING, episodes)
    for done, end in enumerate(mux.play(world, training), start=1):
        block.append(end)
        if done % BLOCK == 0 or done == episodes:
            curve.append(shortened(counts_of(block)))
            block = []
        if done in CHECKPOINTS or done == episodes:
            runs.append(tested(mux.session.policy(), world, done))
    if parameters["worlds"] == BOTH:
        played = tested(mux.session.policy(), IrSimWorld(variant.noise_m), episodes)
        runs.append({**played, "method": f"{method}, in IR-SIM"})
    return {"runs": runs, "curve": curve}


def figures(_results: Mapping[str, Result], _directory: Path) -> list[Path]:
    """This study has none."""
    return []
