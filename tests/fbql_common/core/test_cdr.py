"""The CDR codec against the transfer syntax, computed by hand, and against itself."""

import contextlib
import struct

import pytest
from fbql_common.core.cdr import Codec, Malformed
from hypothesis import given
from hypothesis import strategies as st

KINDS = {
    "bool": st.booleans(),
    "uint8": st.integers(0, 255),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "float64": st.floats(allow_nan=False),
    "string": st.text(st.characters(exclude_characters="\x00", exclude_categories=("Cs",)), max_size=9),
}
VALUES = KINDS | {f"sequence<{kind}>": st.lists(values, max_size=5).map(tuple) for kind, values in KINDS.items()}


@st.composite
def messages(draw):
    kinds = draw(st.lists(st.sampled_from(sorted(VALUES)), min_size=1, max_size=12))
    return kinds, [draw(VALUES[kind]) for kind in kinds]


def test_primitives_are_aligned_to_their_own_size():
    data = Codec(["uint8", "int32", "uint8", "float64"]).encode((1, 2, 3, 4.0))
    assert data == b"\x00\x01\x00\x00" + b"\x01\0\0\0" + b"\x02\0\0\0" + b"\x03" + b"\0" * 7 + struct.pack("<d", 4.0)


def test_string_is_its_length_with_the_terminator_and_its_bytes():
    assert Codec(["uint8", "string"]).encode((7, "ab")) == b"\x00\x01\x00\x00" + b"\x07\0\0\0" + b"\x03\0\0\0ab\0"


def test_sequence_of_doubles_is_aligned_behind_its_length():
    data = Codec(["sequence<float64>"]).encode(((1.5,),))
    assert data == b"\x00\x01\x00\x00" + b"\x01\0\0\0" + b"\0\0\0\0" + struct.pack("<d", 1.5)


def test_empty_sequence_of_doubles_has_no_padding():
    assert Codec(["sequence<float64>"]).encode(((),)) == b"\x00\x01\x00\x00" + b"\0\0\0\0"


@given(messages())
def test_decode_gives_back_what_was_encoded(message):
    kinds, values = message
    codec = Codec(kinds)
    assert codec.decode(codec.encode(values)) == values


@given(messages(), st.data())
def test_truncated_bytes_are_malformed(message, data):
    kinds, values = message
    codec = Codec(kinds)
    whole = codec.encode(values)
    cut = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(Malformed):
        codec.decode(whole[:cut])


@given(messages(), st.binary(max_size=200))
def test_garbage_is_malformed_or_decoded_but_never_another_error(message, garbage):
    codec = Codec(message[0])
    with contextlib.suppress(Malformed):
        codec.decode(b"\x00\x01\x00\x00" + garbage)


def test_big_endian_and_too_long_bytes_are_malformed():
    codec = Codec(["int32"])
    with pytest.raises(Malformed, match="little-endian"):
        codec.decode(b"\x00\x00\x00\x00\x00\x00\x00\x01")
    with pytest.raises(Malformed, match="too long"):
        codec.decode(codec.encode((1,)) + bytes(4))


def test_padding_at_the_end_is_accepted():
    codec = Codec(["int32", "bool"])
    assert codec.decode(codec.encode((1, True)) + bytes(3)) == [1, True]


def test_room_for_each_sequence_is_accepted_at_the_end_and_no_byte_more():
    codec = Codec(["sequence<int32>", "sequence<bool>", "int32"])
    data = codec.encode(((), (), 1))
    assert codec.decode(data + bytes(3 + 2 * 4)) == [(), (), 1]
    with pytest.raises(Malformed, match="12 bytes too long"):
        codec.decode(data + bytes(3 + 2 * 4 + 1))


def test_a_sequence_has_at_most_4096_items():
    codec = Codec(["sequence<uint8>"])
    assert codec.decode(codec.encode((bytes(4096),))) == [(0,) * 4096]
    with pytest.raises(Malformed, match="a sequence of 4097 items"):
        codec.decode(codec.encode(([0] * 4097,)))


def test_a_text_without_its_null_character_is_malformed():
    codec = Codec(["string"])
    for text in (b"\x00\0\0\0", b"\x02\0\0\0ab"):
        with pytest.raises(Malformed, match="does not end"):
            codec.decode(b"\x00\x01\x00\x00" + text)


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        ("float64", "1.0"),
        ("float64", None),
        ("int64", 1.5),
        ("int64", 2**63),
        ("uint8", -1),
        ("bool", "False"),
        ("bool", None),
        ("bool", 2),
        ("string", 3),
        ("string", b"x"),
        ("sequence<float64>", "12"),
        ("sequence<float64>", 1.0),
        ("sequence<string>", [1]),
        ("sequence<int32>", [2**31]),
    ],
)
def test_value_of_a_wrong_type_is_refused_before_anything_is_sent(kind, value):
    with pytest.raises(TypeError):
        Codec([kind]).encode((value,))


def test_integers_and_numpy_numbers_in_a_double_field_keep_their_value():
    import numpy as np

    codec = Codec(["float64"])
    for value in (3, np.float32(3), np.float64(3), np.int64(3), True):
        assert codec.decode(codec.encode((value,))) == [float(value)]


def test_unknown_field_type_is_refused():
    with pytest.raises(TypeError, match="geometry_msgs/Pose"):
        Codec(["geometry_msgs/Pose"])


@pytest.mark.parametrize("kind", ["string", "sequence<string>"])
def test_a_text_ends_with_its_only_null_character(kind):
    """The middleware would end it at the first one, and two readers would read two texts."""
    codec = Codec([kind])
    data = codec.encode(("abcd" if kind == "string" else ("x", "abcd"),))
    with pytest.raises(Malformed, match="a null character"):
        codec.decode(data.replace(b"b", b"\0"))


@pytest.mark.parametrize("text", ["a\0b", "\0", "\ud800"])
def test_a_text_that_no_message_can_hold_is_a_type_error(text):
    with pytest.raises(TypeError):
        Codec(["string"]).encode((text,))


@pytest.mark.parametrize("kind", ["float128", "sequence<float128>", "sequence<sequence<float64>>", "sequence"])
def test_a_kind_that_is_not_on_the_wire_is_refused(kind: str) -> None:
    with pytest.raises(TypeError, match="is not supported by the CDR codec"):
        Codec(["float64", kind])
