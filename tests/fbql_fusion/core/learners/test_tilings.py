"""Tile coding, against its formula in whole numbers: stored policies depend on every key."""

from __future__ import annotations

from math import floor

import numpy as np
from fbql_fusion.core.learners.tilings import Tilings, splitmix64
from hypothesis import given
from hypothesis import strategies as st

VALUES = st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=3)
FIRST = 1001
SIZES = ((2.0, 0.0, 0.5), (4.0, 8.0, 1.0))
SHIFTS = ((0.25, 0.5, 0.0), (0.75, 0.0, 0.125))


def made(first: int = FIRST) -> Tilings:
    return Tilings.of([np.array(row) for row in SIZES], [np.array(row) for row in SHIFTS], 3, first)


def literal(values: list[float], first: int = FIRST) -> list[int]:
    """Each tile's coordinates times its own factors, and the tiling's own number, modulo 2^62."""
    numbers = iter(splitmix64(8, first))
    keys: list[int] = []
    for sizes, shifts in zip(SIZES, SHIFTS, strict=True):
        factors = [next(numbers) for _ in range(3)]
        tiles = [floor(x * size + shift) for x, size, shift in zip(values, sizes, shifts, strict=True)]
        key = sum(tile * factor for tile, factor in zip(tiles, factors, strict=True)) + next(numbers)
        keys.append(key % 2**62)
    return keys


def test_the_numbers_are_those_of_splitmix64_whatever_the_first() -> None:
    """The first three that its authors' C code gives for the seed 0, without their lowest bit."""
    published = [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]
    assert splitmix64(3) == [number >> 1 for number in published]
    assert splitmix64(2, first=2) == splitmix64(3)[1:]
    assert splitmix64(0) == []


@given(VALUES)
def test_a_key_is_the_sum_of_coordinates_times_factors_and_the_number_of_the_tiling(values: list[float]) -> None:
    assert made().keys(values) == literal(values)


@given(VALUES, VALUES)
def test_tilings_beside_others_keep_their_keys(first: list[float], second: list[float]) -> None:
    both = made().beside(made(5))
    assert both.keys([*first, *second]) == literal(first) + literal(second, 5)
