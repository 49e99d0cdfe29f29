"""The codec and the middleware's own serializer agree on every primitive, wherever it stands."""

from __future__ import annotations

import math

import pytest
from fbql_common.core.cdr import Codec
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import (
    Bool,
    Float32,
    Float64,
    Int8,
    Int16,
    Int32,
    Int64,
    UInt8,
    UInt16,
    UInt32,
    UInt64,
)

INTEGERS = {
    "int8": Int8, "int16": Int16, "int32": Int32, "int64": Int64,
    "uint8": UInt8, "uint16": UInt16, "uint32": UInt32, "uint64": UInt64,
}  # fmt: skip
SINGLES = st.floats(width=32, allow_nan=False).filter(lambda value: not 3.402823466e38 < abs(value) < math.inf)
"""Without the largest: the generated check has it to ten digits only, and refuses it, when it is read too."""


@pytest.mark.parametrize("kind", INTEGERS)
def test_the_ends_of_every_integers_range_are_what_the_middleware_writes(kind):
    bits = int(kind.lstrip("uint"))
    ends = (0, 2**bits - 1) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for value in (*ends, 1):
        data = serialize_message(INTEGERS[kind](data=value))
        assert Codec([kind]).decode(data) == [value]
        assert deserialize_message(Codec([kind]).encode([value]), INTEGERS[kind]).data == value


@given(SINGLES)
def test_a_float32_is_what_the_middleware_writes(value):
    data = serialize_message(Float32(data=value))
    assert Codec(["float32"]).decode(data) == [value]
    assert deserialize_message(Codec(["float32"]).encode([value]), Float32).data == value


def test_a_bool_and_a_float64_are_what_the_middleware_writes():
    assert Codec(["bool"]).decode(serialize_message(Bool(data=True))) == [True]
    assert Codec(["float64"]).decode(serialize_message(Float64(data=math.pi))) == [math.pi]


@given(
    st.integers(-128, 127), st.integers(0, 2**16 - 1), SINGLES, st.integers(0, 2**64 - 1),
    st.lists(st.integers(-(2**15), 2**15 - 1), max_size=5), st.integers(0, 255),
)  # fmt: skip
def test_each_is_aligned_to_its_own_size(tiny, small, single, large, shorts, byte):
    """Read back whatever stands before it; the offsets are those of the CDR rules."""
    codec = Codec(["int8", "uint16", "float32", "uint8", "uint64", "sequence<int16>", "int8"])
    values = [tiny, small, single, byte, large, tuple(shorts), tiny]
    data = codec.encode(values)
    assert codec.decode(data) == values
    assert data[4 + 2 : 4 + 4] == small.to_bytes(2, "little")
    assert data[4 + 16 : 4 + 24] == large.to_bytes(8, "little")
