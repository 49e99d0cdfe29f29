"""Declared parameters: which values each takes, and what is said of any other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import (
    check,
    defaults_of,
    from_mapping,
    groups_among,
    limits_of,
    owned_by,
    parameter,
    types_of,
)


@dataclass(frozen=True)
class Shared:
    seed: int = parameter(0, "seed", low=0)
    rate: float = parameter(0.5, "rate", unit="1/s", low=0.0, high=1.0)
    free: float = parameter(0.0, "anything finite")
    whole: int = parameter(0, "anything that travels")
    mode: str = parameter("a", "one of two", choices=("a", "b"))
    on: bool = parameter(False, "switch")
    names: list[str] = parameter(["x"], "some names")


@owned_by("mine", "yours")
@dataclass(frozen=True)
class Own(Shared):
    extra: float = parameter(1.0, "of one part", required=True)


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 0},
        {"rate": 0.0},
        {"rate": 1.0},
        {"free": -1e300},
        {"whole": 2**63 - 1},
        {"whole": -(2**63 - 1)},
        {"mode": "b"},
        {"on": True},
        {"names": []},
        {"names": ["y", "z"]},
    ],
)
def test_a_value_within_its_limits_is_taken(change: dict[str, Any]) -> None:
    made = from_mapping(Shared, change, "here")
    assert {name: getattr(made, name) for name in change} == change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"seed": -1}, "parameter 'seed' is -1, outside of [0, 9.22337e+18]"),
        ({"seed": True}, "parameter 'seed' must be a whole number, not True"),
        ({"seed": 1.0}, "parameter 'seed' must be a whole number, not 1.0"),
        ({"rate": 1}, "parameter 'rate' must be a decimal number, not 1"),
        ({"rate": 1.0000001}, "parameter 'rate' is 1.0000001, outside of [0, 1] 1/s"),
        ({"rate": float("nan")}, "parameter 'rate' is nan, outside of [0, 1] 1/s"),
        ({"free": float("inf")}, "parameter 'free' is inf, outside of [-inf, inf]"),
        ({"free": float("-inf")}, "parameter 'free' is -inf, outside of [-inf, inf]"),
        ({"whole": 2**63}, "parameter 'whole' is 9223372036854775808, outside of [-9.22337e+18, 9.22337e+18]"),
        ({"whole": -(2**64)}, "parameter 'whole' is -18446744073709551616, outside of [-9.22337e+18, 9.22337e+18]"),
        ({"mode": "c"}, "parameter 'mode' is 'c'; choose one of: a, b"),
        ({"mode": 1}, "parameter 'mode' must be a text, not 1"),
        ({"on": 1}, "parameter 'on' must be true or false, not 1"),
        ({"names": ("x",)}, "parameter 'names' must be list[str], not ('x',)"),
        ({"names": ["x", 1]}, "parameter 'names' must be list[str], not ['x', 1]"),
        ({"sped": 1}, "unknown parameter 'sped'; known are: seed, rate, free, whole, mode, on, names"),
    ],
)
def test_any_other_is_refused_in_one_line_that_says_what_it_may_be(change: dict[str, Any], says: str) -> None:
    with pytest.raises(BadInput) as refusal:
        from_mapping(Shared, change, "here")
    assert str(refusal.value) == f"here: {says}"


def test_a_group_is_named_with_its_parameters() -> None:
    with pytest.raises(BadInput, match=r"here: parameter 'topics\.joy\.seed' is -1"):
        check(Shared(seed=-1), "here", "topics.joy.")
    assert groups_among(["t.b.x", "t.a.x", "t.a.y", "u.c.x", "t.x", "ts.d.x"], "t") == ["t.a", "t.b"]


def test_a_declaration_tells_its_defaults_types_and_limits_in_order() -> None:
    assert list(defaults_of(Own).items()) == [
        ("seed", 0), ("rate", 0.5), ("free", 0.0), ("whole", 0), ("mode", "a"), ("on", False), ("names", ["x"]),
        ("extra", 1.0),
    ]  # fmt: skip
    assert list(types_of(Own).values()) == [int, float, float, int, str, bool, list[str], float]
    assert [limits.required for limits in limits_of(Own).values()] == [False] * 7 + [True]
    limits = limits_of(Own)["rate"]
    assert (limits.description, limits.unit, limits.low, limits.high, limits.choices) == ("rate", "1/s", 0.0, 1.0, None)


def test_only_the_parameters_that_a_declaration_adds_are_stamped_with_its_owners() -> None:
    owners = {name: limits.owners for name, limits in limits_of(Own).items()}
    assert owners == dict.fromkeys(limits_of(Shared), ()) | {"extra": ("mine", "yours")}


def test_no_two_instances_share_a_list() -> None:
    first, second = Shared(), Shared()
    first.names.append("y")
    assert second.names == ["x"]
