"""Odd arguments to the functions of `import fbql`: a result, or an error in one line, and nothing else."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fbql
import numpy as np
import pytest
from fuzzing import TooLong, bounded, dice, odd_value, read_or_refused

LONGEST_PLAY_S = 2.0
"""A match of odd length is ended after this time: it was accepted [s]."""
LENGTHS = {"episodes", "goals", "max_steps", "guided", "parameters"}
"""Arguments that may make a match as long as somebody likes."""
PLAY: dict[str, tuple[Any, ...]] = {
    "controller": ("uniform", "fbql_literal", "fbql", "subsumption"),
    "episodes": (1, np.int32(2)),
    "goals": (None,),
    "guided": (None, 0, 1),
    "seed": (0, np.uint64(2**62)),
    "learn": (True, np.True_),
    "preset": (None, "tuned", "paper"),
    "policy": (None, "none"),
    "trees": (None, {}),
    "observations": ((), []),
    "max_steps": (20,),
    "parameters": ({}, {"friction": 0.05}, {"layers": ["wall_avoiding", "approaching", "ball_seeking"]}),
    "steps": (False, True),
}
INDUCE: dict[str, tuple[Any, ...]] = {
    "behavior": ("ball_seeking", "wall_avoiding"),
    "method": (None, "rl", "dp"),
    "seed": (0, np.int64(7)),
    "every": (None, 5),
    "patterns": (20, np.int16(30)),
    "observations": ((),),
    "trials": (3,),
    "split_cost": (-0.02,),
}


def odd_argument(rng: random.Random) -> Any:
    """What nobody would give on purpose, NumPy's own types and objects of Python included."""
    odd = (odd_value(rng), np.float32(rng.choice((0.5, np.nan, np.inf))), np.arange(3), np.array("x"), object, b"x", 1j)
    return rng.choice((*odd, {1: 2}, {"x": odd_value(rng)}, Path("nowhere"), iter(()), rng.choice("xyz")))


def call(function: Callable[..., Any], usual: dict[str, tuple[Any, ...]], rng: random.Random) -> None:
    """Calls a function with arguments of which one or two are odd."""
    arguments = {name: rng.choice(values) for name, values in usual.items() if rng.random() < 0.7 or None not in values}
    odd = rng.sample(sorted(usual), rng.choice((1, 1, 2)))
    for name in odd:
        arguments[name] = odd_argument(rng)
        if name == "parameters" and rng.random() < 0.8:
            arguments[name] = {
                rng.choice(("friction", "dt_s", "layers", "behaviors", "discount", "x")): odd_argument(rng)
            }
    try:
        with bounded(LONGEST_PLAY_S if LENGTHS.intersection(odd) else 20.0):
            read_or_refused(lambda: function(**arguments))
    except TooLong:
        if not LENGTHS.intersection(odd):
            raise
    except BaseException as error:
        error.add_note(f"{function.__name__}({arguments})")
        raise


@pytest.mark.parametrize(("function", "usual"), [(fbql.play, PLAY), (fbql.train, PLAY), (fbql.induce, INDUCE)])
def test_odd_arguments_give_a_result_or_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, function: Callable[..., Any], usual: dict[str, tuple[Any, ...]]
) -> None:
    monkeypatch.chdir(tmp_path)
    for rng in dice(usual=40):
        call(function, usual, rng)
    assert list(tmp_path.iterdir()) == []
