"""CDR, the wire format of ROS 2 messages, for messages made of primitives, strings and sequences of them.

Converting Python messages to CDR and back is the largest cost of a ROS graph in Python. For a flat message it reduces to a
`struct` call per run of primitives. From the field types of a message, `Codec` makes encode and decode, which produce the
same bytes as the middleware's own serializer (tests/fbql_common/test_wire.py compares them).

Source: OMG DDSI-RTPS 2.3, section 10 (encapsulation), and OMG CORBA 3.3 part 2, section 9.3 (CDR transfer syntax):
plain CDR, little-endian, each primitive aligned to its own size counted from the end of the 4-byte header.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from struct import Struct
from struct import error as struct_error

HEADER = b"\x00\x01\x00\x00"
"""Encapsulation header of plain CDR, little-endian."""

_PRIMITIVES = {
    "bool": ("?", 1),
    "int8": ("b", 1),
    "uint8": ("B", 1),
    "int16": ("h", 2),
    "uint16": ("H", 2),
    "int32": ("i", 4),
    "uint32": ("I", 4),
    "int64": ("q", 8),
    "uint64": ("Q", 8),
    "float32": ("f", 4),
    "float64": ("d", 8),
}
_LENGTH = Struct("<I")
_PADDING = tuple(b"\x00" * n for n in range(8))
_MAX_ITEMS = 4096
_BOOLS = (True, False)


class Malformed(ValueError):
    """Bytes that are not a message of the expected type."""


class _Run:
    """Consecutive primitives: one Struct for each of the eight alignments it can start at."""

    def __init__(self, kinds: Sequence[str]) -> None:
        self.count = len(kinds)
        self.bools = tuple(place for place, kind in enumerate(kinds) if kind == "bool")
        self.structs = [Struct(self._format(kinds, start)) for start in range(8)]

    @staticmethod
    def _format(kinds: Sequence[str], start: int) -> str:
        text, offset = "<", start
        for kind in kinds:
            code, size = _PRIMITIVES[kind]
            padding = -offset % size
            text += "x" * padding + code
            offset += padding + size
        return text


class Codec:
    """Encodes the values of one message type, in field order, and decodes them again.

    Args:
        kinds: the fields: a primitive ("bool", "int8" to "int64", "uint8" to "uint64", "float32", "float64"),
            "string", or "sequence<X>" of any of these.

    Raises:
        TypeError: a kind that is not supported.
    """

    def __init__(self, kinds: Sequence[str]) -> None:
        self._parts: list[_Run | str] = []
        run: list[str] = []
        for kind in kinds:
            if kind in _PRIMITIVES:
                run.append(kind)
                continue
            element = kind.removeprefix("sequence<").removesuffix(">")
            if kind != "string" and (element == kind or (element not in _PRIMITIVES and element != "string")):
                raise TypeError(f"field type {kind} is not supported by the CDR codec")
            if run:
                self._parts.append(_Run(run))
                run = []
            self._parts.append(kind)
        if run:
            self._parts.append(_Run(run))
        # The end is padded to 4 bytes, and the middleware reserves 4 for each empty sequence.
        self._slack = 3 + 4 * sum(kind.startswith("sequence") for kind in kinds)

    def encode(self, values: Sequence[object]) -> bytes:
        """The message as CDR bytes with their encapsulation header.

        Raises:
            TypeError: a value that is not of its field's type, or does not fit in it.
        """
        out = [HEADER]
        size = 0
        index = 0
        try:
            for part in self._parts:
                if type(part) is _Run:
                    data = part.structs[size & 7].pack(*values[index : index + part.count])
                    for place in part.bools:  # struct takes anything for a bool
                        if values[index + place] not in _BOOLS:
                            raise TypeError(f"{values[index + place]!r} is neither true nor false")
                    index += part.count
                else:
                    data = _encode_variable(part, values[index], size)  # pyright: ignore[reportArgumentType]
                    index += 1
                out.append(data)
                size += len(data)
        except (struct_error, AttributeError, OverflowError, UnicodeEncodeError) as error:
            raise TypeError(f"a value does not fit its field: {error}") from None
        return b"".join(out)

    def decode(self, data: bytes) -> list[object]:
        """The values in field order; sequences come as tuples.

        Raises:
            Malformed: not plain little-endian CDR, too short, too long, or text that is not UTF-8.
        """
        if data[:2] != b"\x00\x01":
            raise Malformed("not little-endian CDR")
        values: list[object] = []
        offset = 4
        try:
            for part in self._parts:
                if type(part) is _Run:
                    struct = part.structs[(offset - 4) & 7]
                    values.extend(struct.unpack_from(data, offset))
                    offset += struct.size
                else:
                    value, offset = _decode_variable(part, data, offset)  # pyright: ignore[reportArgumentType]
                    values.append(value)
        except (struct_error, UnicodeDecodeError) as error:
            raise Malformed(str(error)) from None
        if len(data) - offset > self._slack:
            raise Malformed(f"{len(data) - offset} bytes too long")
        return values


def _encode_variable(kind: str, value: object, size: int) -> bytes:
    padding = _PADDING[-size & 3]
    if kind == "string":
        return padding + _encode_string(value)
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise TypeError(f"{value!r} is not a sequence")
    items: Sequence[object] = value  # pyright: ignore[reportUnknownVariableType]
    out = padding + _LENGTH.pack(len(items))
    element = kind[9:-1]
    if element == "string":
        for item in items:
            out += _PADDING[-(size + len(out)) & 3] + _encode_string(item)
        return out
    if not items:
        return out
    width = _PRIMITIVES[element][1]
    return out + _PADDING[-(size + len(out)) & (width - 1)] + _items(len(items), element).pack(*items)


@lru_cache(256)
def _items(count: int, element: str) -> Struct:
    """The items of a sequence. Cached: a message type has few lengths."""
    return Struct(f"<{count}{_PRIMITIVES[element][0]}")


@lru_cache(256)
def _encode_string(value: object) -> bytes:
    """Cached: the texts of a step (frame, names, hashes) are the same in every step."""
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is not a text")
    text = value.encode()
    if b"\0" in text:
        raise TypeError(f"{value!r} contains a null character, which would end the text")
    return _LENGTH.pack(len(text) + 1) + text + b"\x00"


def _decode_variable(kind: str, data: bytes, offset: int) -> tuple[object, int]:
    if kind == "string":
        return _decode_string(data, offset)
    (count,), offset = _LENGTH.unpack_from(data, offset + (-offset & 3)), offset + (-offset & 3) + 4
    if count > _MAX_ITEMS:
        raise Malformed(f"a sequence of {count} items")
    element = kind[9:-1]
    if element == "string":
        texts: list[str] = []
        for _ in range(count):
            text, offset = _decode_string(data, offset)
            texts.append(text)
        return tuple(texts), offset
    if not count:
        return (), offset
    offset += -(offset - 4) & (_PRIMITIVES[element][1] - 1)
    items = _items(count, element)
    return items.unpack_from(data, offset), offset + items.size


def _decode_string(data: bytes, offset: int) -> tuple[str, int]:
    offset += -offset & 3
    (length,) = _LENGTH.unpack_from(data, offset)
    end = offset + 4 + length
    if length == 0 or end > len(data) or data[end - 1] != 0:
        raise Malformed("a text that does not end")
    return _text(data[offset + 4 : end - 1]), end


@lru_cache(256)
def _text(data: bytes) -> str:
    if b"\0" in data:  # CORBA 3.3 part 2, section 9.3.2.7: none but the last; the middleware ends the text here
        raise Malformed("a text with a null character in it")
    return data.decode()
