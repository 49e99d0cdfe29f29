"""Packs columns into few bytes, for a page that contains its data: quantised, differences, byte by byte, deflated.

A column is int32: multiples of its unit, or the bits of float32 where the unit is 0. Stored is the difference of each
row from the one before (modulo 2^32, the first from 0), as an unsigned number with the sign in bit 0: first the lowest
byte of all rows, then the second, the third and the highest. Columns follow each other, and the whole is deflated
(zlib, RFC 1950). Neighboring steps differ little, so most of these bytes are 0.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

NOT_AVAILABLE = -(2**31)
"""Stands for NaN: "n/a"."""
TOO_LARGE = -(2**31) + 1
"""Stands for a number that is too large for int32, and for infinity."""
FLOAT32 = 0.0
"""The unit of a column that is kept as float32."""
_LIMIT = 2**31 - 2


class Packing(NamedTuple):
    """How a column is packed."""

    name: str
    unit: float
    """Values are stored as whole multiples of it; `FLOAT32`: about 7 digits of any number."""


def pack(columns: Mapping[str, NDArray[Any]], packings: Sequence[Packing], level: int = 6) -> bytes:
    """Some columns [m] of one block of steps, as bytes."""
    planes = [_planes(quantised(columns[packing.name], packing.unit)) for packing in packings]
    return zlib.compress(b"".join(planes), level)


def unpack(data: bytes, packings: Sequence[Packing], rows: int) -> dict[str, NDArray[np.float64]]:
    """The columns again, float64 [rows], to half a unit: NaN is "n/a", infinity what was too large."""
    planes = np.frombuffer(zlib.decompress(data), np.uint8).reshape(len(packings), 4, rows)
    return {
        packing.name: restored(_from_planes(plane), packing.unit)
        for packing, plane in zip(packings, planes, strict=True)
    }


def quantised(column: NDArray[Any], unit: float) -> NDArray[np.int32]:
    """A column as int32: multiples of a unit, or the bits of float32 where the unit is 0."""
    values = np.asarray(column, np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        if unit == FLOAT32:
            return values.astype(np.float32).view(np.int32)
        scaled = np.rint(values / unit)
        fits = np.abs(scaled) <= _LIMIT
    whole = np.where(fits, scaled, TOO_LARGE).astype(np.int64)
    whole[np.isnan(values)] = NOT_AVAILABLE
    return whole.astype(np.int32)


def restored(whole: NDArray[np.int32], unit: float) -> NDArray[np.float64]:
    """The numbers that the int32 values represent. The inverse of `quantised`, to half a unit."""
    if unit == FLOAT32:
        return whole.view(np.float32).astype(np.float64)
    values = whole.astype(np.float64) * unit
    values[whole == NOT_AVAILABLE] = np.nan
    values[whole == TOO_LARGE] = np.inf
    return values


def _planes(whole: NDArray[np.int32]) -> bytes:
    bits = whole.view(np.uint32)
    step = np.diff(bits, prepend=np.uint32(0)).view(np.int32)
    unsigned = ((step << 1) ^ (step >> 31)).view(np.uint32).astype("<u4")
    return np.ascontiguousarray(unsigned.view(np.uint8).reshape(-1, 4).T).tobytes()


def _from_planes(planes: NDArray[np.uint8]) -> NDArray[np.int32]:
    unsigned = np.ascontiguousarray(planes.T).view("<u4")[:, 0].astype(np.uint32)
    step = (unsigned >> np.uint32(1)) ^ (np.uint32(0) - (unsigned & np.uint32(1)))
    return np.cumsum(step, dtype=np.uint32).view(np.int32)
