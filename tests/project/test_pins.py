"""Pinned results: digests, the shipped trees and policy, and a recording of an earlier release that still verifies.

A commit that changes one of these says so, and why. Every match is played for two seeds without ROS, for the first in a
process for each node, and for the second in one process; marked long, the other way round too.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from typing import NamedTuple

import pytest
from bringup_run import Run
from places import ROOT

RECORDED = ROOT / "tests" / "data" / "recorded_match"
SAME_EVERYWHERE = {
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR"
}
"""NumPy's exp and log differ in the last bit between processors with and without AVX-512."""


class Pinned(NamedTuple):
    """A match, and what came of it for the seeds 1 and 2."""

    options: Sequence[str]
    digests: tuple[str, str]
    contacts: tuple[tuple[int, int], tuple[int, int]]
    """Collisions begun, and steps in contact with a wall: the digest does not cover them."""


MATCHES = {
    "subsumption": Pinned(
        ["--controller", "subsumption", "--episodes", "2"],
        (
            "04c92b950d68f44d5b38e3a8249604ce858896e380e639977f2a438b4ff186a0",
            "1f4aca7afa67d2bbfb3f08dca61eb603d170a2ca3a390104e3fecce8588fb2cf",
        ),
        ((6, 16), (3, 6)),
    ),
    "subsumption, thresholds of the paper": Pinned(
        ["--controller", "subsumption", "--preset", "paper", "--episodes", "2", "--max-steps", "700"],
        (
            "4d0029092c71a9cfcd5d549fb8f31e74377d5723b18d479040a8fadee0df281c",
            "b5434f121fd3cf074d68080e185070919afb2771f239de8dc029a947b4e6ac43",
        ),
        ((5, 14), (8, 18)),
    ),
    "uniform": Pinned(
        ["--controller", "uniform", "--episodes", "2", "--max-steps", "700"],
        (
            "2ef9216b5fba7551c6dc5e2706a0dbee0acbfeb341963c2797f689cbafc6e501",
            "bd34f733f1475bf1ff5e721a4524d6bf0e68def7aca211ee0093b2ca97bc1be8",
        ),
        ((1, 211), (13, 197)),
    ),
    "fbql_literal": Pinned(
        ["--controller", "fbql_literal", "--episodes", "2", "--guided", "2", "--max-steps", "700"],
        (
            "c2065b68b07cd6d0c29dffdbc94f1e5b364c10a0efd19d9221f99d7b3abeda3b",
            "cfb8cd45bc048acd7388faf08e80df5b6f9fa51396d067e2ceac3f23a699e7ce",
        ),
        ((1, 30), (1, 5)),
    ),
    # A guided episode, from which the features are made, then a batch of episodes that is learned from.
    "fbql": Pinned(
        ["--controller", "fbql", "--episodes", "4", "--guided", "1", "--max-steps", "400"],
        (
            "e017651f685fe6d27875951aa32c9ca582107441d8149cd9a8c07d1815cf7456",
            "38434171e64f013e40087b89389121f5b0813e174a09d35e6a6761beafd417c4",
        ),
        ((9, 53), (11, 76)),
    ),
    "fbql, learning on from the shipped policy": Pinned(
        ["--controller", "fbql", "--episodes", "3"],
        (
            "d31760282c435293a22eba046f8c9836b0393630bf8a03e3a043ee98e54e1192",
            "57d495ff52bf763bf33b6a309f500a4078c3dfff4bb02e8de161bfb5ac375c99",
        ),
        ((1, 2), (1, 3)),
    ),
    "fbql, the shipped policy frozen": Pinned(
        ["--controller", "fbql", "--episodes", "3", "--no-learn"],
        (
            "2b4330a294783ced5ec48141409d3c4852445c05b1570e6f2c24fc4aeb3ae8cc",
            "f3431d0783d4199cd68a62ea1bc395b7f9e547e25656311fdf456a98408afabf",
        ),
        ((4, 67), (1, 5)),
    ),
    "fbql_value": Pinned(
        ["--controller", "fbql_value", "--episodes", "4", "--guided", "1", "--max-steps", "400"],
        (
            "0816d65258421275c60d0896a46a2ba7d4aa209b2b6b355b7c9c4d844b05a6de",
            "080becc492e5ecb0ebc9d3f34a2077301e79b72dc2f152c52bf0e3b5e95395e1",
        ),
        ((10, 78), (5, 40)),
    ),
}
MANY, ONE, WITHOUT_ROS = "a process for each node", "one process", "without ROS"
WAYS = {
    MANY: ("bringup.py", ["--no-record"]),
    ONE: ("bringup.py", ["--processes", "one"]),
    WITHOUT_ROS: ("train.py", []),
}
SHIPPED = {
    "approaching.json": "893da7baa80e211b75d17b363237e0846ff9e3b0493fbdb90688df67095332eb",
    "ball_seeking.json": "05fad7fdb370b1991688df572fd0c260e4e52d16800a7e0c4b7866050ecd2c74",
    "wall_avoiding.json": "669204d1b03da2eba7b63081ef33f6efbbc6dc46059f730bb69adf5c32dcf4ad",
    "fbql.npz": "ba8e5f06d27f97a70b2c604722e8716283600c9a7a99d705f1fe949456c6ef24",
}


def cases() -> list[object]:
    """Each match with each seed: in one way with ROS and without ROS, and in the other way with ROS, marked long."""
    daily = [pytest.param(name, seed, (way, WITHOUT_ROS)) for name in MATCHES for seed, way in ((1, MANY), (2, ONE))]
    others = [
        pytest.param(name, seed, (way,), marks=pytest.mark.long)
        for name in MATCHES
        for seed, way in ((2, MANY), (1, ONE))
    ]
    return [*daily, *others]


@pytest.mark.parametrize(("name", "seed", "ways"), cases())
def test_a_match_has_its_digest_and_its_contacts_in_every_way_to_play(
    start: Callable[..., Run], name: str, seed: int, ways: Sequence[str]
) -> None:
    options, digests, contacts = MATCHES[name]
    words = [*options, "--seed", str(seed), "--json"]
    runs: dict[str, Run] = {}
    for way in ways:
        script, more = WAYS[way]
        runs[way] = start(*words, *more, script=script, environment=SAME_EVERYWHERE)
    found: dict[str, tuple[str, tuple[int, int]]] = {}
    for way, run in runs.items():
        assert run.exit_code() == 0, f"{way}: {run.stderr}"
        result = json.loads(run.stdout)
        found[way] = result["digest"], (result["collisions_begun"], result["collision_steps"])
    assert found == dict.fromkeys(ways, (digests[seed - 1], contacts[seed - 1]))


def test_the_shipped_trees_and_policy_are_the_same_bytes() -> None:
    source = ROOT / "ros2_ws" / "src"
    files = [path for path in source.rglob("*") if path.name in SHIPPED and "share" not in path.parts]
    assert {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files} == SHIPPED


def test_a_recording_of_an_earlier_release_verifies(start: Callable[..., Run]) -> None:
    run = start(str(RECORDED), "--verify", "--json", script="replay.py", out=False, environment=SAME_EVERYWHERE)
    assert run.exit_code() == 0, run.stderr
    found = json.loads(run.stdout)
    assert (found["identical"], found["steps"], found["not_recomputed"]) == (True, 644, {})
