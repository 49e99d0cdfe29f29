"""Columns as few bytes: what comes out again is what went in, to half a unit."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from fbql_recording.core.packing import FLOAT32, NOT_AVAILABLE, TOO_LARGE, Packing, pack, quantised, unpack
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

WHOLE = arrays(np.int64, st.integers(0, 40), elements=st.integers(-(2**31) + 2, 2**31 - 2))
FLOATS = arrays(np.float64, st.integers(0, 40), elements=st.floats(-2e5, 2e5))


@given(WHOLE)
def test_whole_numbers_come_back_the_same(column):
    found = unpack(pack({"a": column}, [Packing("a", 1.0)]), [Packing("a", 1.0)], len(column))
    assert np.array_equal(found["a"], column)


@given(FLOATS)
def test_numbers_come_back_to_half_a_unit(column):
    packings = [Packing("a", 1e-4)]
    found = unpack(pack({"a": column}, packings), packings, len(column))["a"]
    assert (np.abs(found - column) <= 0.5e-4 * (1 + 1e-9)).all()


@given(arrays(np.float64, 20, elements=st.floats(width=32)))
def test_float32_come_back_bit_for_bit(column):
    packings = [Packing("q", FLOAT32)]
    found = unpack(pack({"q": column}, packings), packings, 20)["q"]
    assert np.array_equal(found, column, equal_nan=True)


def test_what_is_not_there_and_what_is_too_large_are_told_apart():
    column = np.array([np.nan, np.inf, -np.inf, 1e300, -3e5, 0.25])
    assert quantised(column, 1e-4).tolist() == [NOT_AVAILABLE, TOO_LARGE, TOO_LARGE, TOO_LARGE, TOO_LARGE, 2500]
    packings = [Packing("a", 1e-4)]
    found = unpack(pack({"a": column}, packings), packings, 6)["a"]
    assert np.array_equal(found, [np.nan, np.inf, np.inf, np.inf, np.inf, 0.25], equal_nan=True)


def test_columns_do_not_mix():
    columns = {"a": np.arange(5), "b": np.linspace(0, 1, 5), "c": np.array([True, False, True, True, False])}
    packings = [Packing("c", 1.0), Packing("b", 1e-4), Packing("a", 1.0)]
    found = unpack(pack(columns, packings), packings, 5)
    assert {name: column.tolist() for name, column in found.items()} == {
        "a": [0, 1, 2, 3, 4],
        "b": [0, 0.25, 0.5, 0.75, 1],
        "c": [1, 0, 1, 1, 0],
    }


def test_bytes_are_as_the_module_says():
    # 300, then 2 less: differences 300 and -2, with the sign in bit 0: 600 and 3
    assert zlib.decompress(pack({"a": np.array([300, 298])}, [Packing("a", 1.0)])) == bytes([88, 3, 2, 0, 0, 0, 0, 0])


def test_a_smooth_column_takes_less_than_a_byte_a_row():
    column = np.cumsum(np.full(4096, 0.0123))
    assert len(pack({"a": column}, [Packing("a", 1e-4)])) < 200


def test_other_bytes_than_there_should_be_are_refused():
    with pytest.raises(ValueError):
        unpack(pack({"a": np.arange(5)}, [Packing("a", 1.0)]), [Packing("a", 1.0)], 6)


def test_what_the_page_reads_as_not_available_and_as_too_large_are_the_two_lowest_numbers():
    largest = 2.0**31 - 2
    column = np.array([np.nan, np.inf, largest, -largest, largest + 1, -largest - 1])
    least = -(2**31)
    assert quantised(column, 1.0).tolist() == [least, least + 1, largest, -largest, least + 1, least + 1]
