"""Times of induction and of a decision, on the patterns that the shipped trees are made from.

For each behavior every round measures, one after the other: 50 trials of RL, exact dynamic programming, scikit-learn's
DecisionTreeClassifier by entropy (the criterion of eqs. 1 and 2) and its DecisionTreeRegressor of both wheels (least squares,
which has no classes to count), both with as many leaves as the exact tree; then decisions. Results are medians over rounds,
for the slowest behavior; `dp_over_cart` is the median over rounds of the ratio to the classifier, for the worst behavior.

decision_us: observation -> leaf -> reference. behavior_us: the same from the world state on, as a complete answer.
All times are processor time of this process, all threads together: other programs on the machine hardly matter.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from fbql.demonstrations.instruct import instruct
from fbql.demonstrations.make_tree import DEMONSTRATION_SEED, INDUCTION_SEED
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.induction import induce
from fbql_behaviors.core.observation import OBSERVATIONS, observation_of
from fbql_behaviors.core.patterns import Patterns, patterns_of
from fbql_behaviors.core.quantizer import levels_of_classes
from fbql_behaviors.core.recipes import RECIPES
from fbql_common.core.errors import BadInput

PROGRAM = "induction.py"
DECISIONS = 2000
GROWTH = (1_000, 10_000, 100_000, 1_000_000)
GROWTH_DEMONSTRATIONS = 400
GROWTH_ROUNDS = 3
MILLISECONDS, MICROSECONDS = 1e3, 1e6


def main(argv: Sequence[str]) -> int:
    """Runs the benchmark. Returns the exit code."""
    parser = argparse.ArgumentParser(
        prog=PROGRAM, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=9, metavar="N", help="rounds to take medians over (9)")
    parser.add_argument("--growth", action="store_true", help="measure up to a million patterns, too")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args(list(argv))
    try:
        if arguments.rounds < 1:
            raise BadInput(f"--rounds is {arguments.rounds}; it must be 1 or more")
        result = measure(arguments.rounds)
    except BadInput as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 2
    if arguments.growth:
        result["growth"] = growth()
    print(json.dumps(result) if arguments.json else as_text(result))
    return 0


def measure(rounds: int) -> dict[str, Any]:
    """The results, with those of each behavior under `behaviors`."""
    behaviors: dict[str, dict[str, float]] = {}
    for behavior, recipe in RECIPES.items():
        demonstrations = instruct(behavior, DEMONSTRATION_SEED, recipe.demonstrations, recipe.steps)
        patterns = patterns_of(demonstrations, OBSERVATIONS[behavior], recipe.every, recipe.patterns)
        exact = replace(recipe.induction, method="dp")
        tree = induce(behavior, patterns, exact, INDUCTION_SEED).tree
        worlds = [world for demonstration in demonstrations for world in demonstration.worlds][:DECISIONS]
        sense, decide, answer = observation_of(behavior).sense, tree.answer, Behavior(behavior, tree).answer
        observations = [sense(world) for world in worlds]
        cart, cart_regressor = carts(patterns, tree.leaf_count)
        measured: dict[str, Callable[[], object]] = {
            "rl50_ms": partial(induce, behavior, patterns, replace(recipe.induction, trials=50), INDUCTION_SEED),
            "dp_ms": partial(induce, behavior, patterns, exact, INDUCTION_SEED),
            "cart_ms": cart,
            "cart_regressor_ms": cart_regressor,
            "decision_us": lambda decide=decide, observations=observations: [decide(each) for each in observations],
            "behavior_us": lambda answer=answer, worlds=worlds: [answer(each) for each in worlds],
        }
        scale = {name: MILLISECONDS if name.endswith("ms") else MICROSECONDS / len(observations) for name in measured}
        found: dict[str, list[float]] = {name: [] for name in measured}
        for _ in range(rounds):
            for name, work in measured.items():
                found[name].append(seconds(work) * scale[name])
        row = {name: median(values) for name, values in found.items()}
        for name, control in (("dp_over_cart", "cart_ms"), ("dp_over_cart_regressor", "cart_regressor_ms")):
            row[name] = median(dp / other for dp, other in zip(found["dp_ms"], found[control], strict=True))
        behaviors[behavior] = row
        print(f"{behavior}: {numbers(row)}", file=sys.stderr, flush=True)
    names = next(iter(behaviors.values()))
    worst = {name: max(row[name] for row in behaviors.values()) for name in names}
    return {**worst, "patterns": 1000, "rounds": rounds, "clock": "processor time", "behaviors": behaviors}


def carts(patterns: Patterns, leaves: int) -> tuple[Callable[[], object], Callable[[], object]]:
    """Functions that fit scikit-learn's classifier, and its regressor."""
    try:
        from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor
    except ModuleNotFoundError:
        raise BadInput("CART is scikit-learn's: pip install -r requirements/study.txt") from None
    levels = levels_of_classes(patterns.wheel_class)

    def classifier() -> object:
        model = DecisionTreeClassifier(criterion="entropy", max_leaf_nodes=leaves, random_state=0)
        return model.fit(patterns.x, patterns.wheel_class)

    def regressor() -> object:
        return DecisionTreeRegressor(max_leaf_nodes=leaves, random_state=0).fit(patterns.x, levels)

    return classifier, regressor


def growth() -> list[dict[str, float]]:
    """Times against the number of patterns, which are drawn from many demonstrations and jittered."""
    behavior, recipe = "ball_seeking", RECIPES["ball_seeking"]
    demonstrations = instruct(behavior, DEMONSTRATION_SEED, GROWTH_DEMONSTRATIONS, recipe.steps)
    shown = patterns_of(demonstrations, OBSERVATIONS[behavior])
    rng = np.random.default_rng(DEMONSTRATION_SEED)
    rows: list[dict[str, float]] = []
    for count in GROWTH:
        chosen = rng.integers(len(shown), size=count)
        x = shown.x[chosen] + rng.normal(0.0, 0.01, (count, 2))
        patterns = Patterns(shown.features, x, shown.wheel_class[chosen], shown.demonstration[chosen])
        exact = replace(recipe.induction, method="dp")
        row: dict[str, float] = {"patterns": count}
        for name, parameters in (("rl50_ms", recipe.induction), ("dp_ms", exact)):
            times = [seconds(partial(induce, behavior, patterns, parameters, 0)) for _ in range(GROWTH_ROUNDS)]
            row[name] = median(times) * MILLISECONDS
        row["dp_us_per_pattern"] = row["dp_ms"] / count * 1e3
        rows.append(row)
        print(f"growth: {numbers(row)}", file=sys.stderr, flush=True)
    return rows


def seconds(work: Callable[[], object]) -> float:
    """Processor time of some work [s], all threads together."""
    begun_s = process_time()
    work()
    return process_time() - begun_s


def numbers(row: dict[str, float]) -> str:
    """Names and numbers in one line."""
    return ", ".join(f"{name} {value:.3g}" for name, value in row.items())


def as_text(result: dict[str, Any]) -> str:
    """The results as text."""
    lines = [numbers({name: value for name, value in result.items() if isinstance(value, float)})]
    return "\n".join([*lines, *(numbers(row) for row in result.get("growth", []))])
