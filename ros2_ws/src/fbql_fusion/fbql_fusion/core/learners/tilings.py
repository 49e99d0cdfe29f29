"""Tile coding (Sutton & Barto, 9.5.4): grids over numbers, shifted against each other. Each tile has a key."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

FAR = 1e6
"""Numbers of at least this size are not tiled without scales: no task has meaningful ones, and their tiles could not be
counted."""
_CRITICS = 1_000_001
"""Keeps the keys of the critic's inputs different from those of the sensed values."""
_WORD = (1 << 64) - 1
TILE = (1 << 62) - 1
"""The bits of a tile's key."""


class Tilings(NamedTuple):
    """K tilings over d components."""

    sizes: NDArray[np.float64]
    """Tiles per unit of each component, 0 if the tiling ignores it, [K, d]."""
    shifts: NDArray[np.float64]
    """In tiles, [K, d]."""
    factors: NDArray[np.int64]
    """[K, d]"""
    families: NDArray[np.int64]
    """[K]"""

    @classmethod
    def of(
        cls, sizes: Sequence[NDArray[np.float64]], shifts: Sequence[NDArray[np.float64]], d: int, first: int
    ) -> Tilings:
        """Tilings with these sizes and shifts, [d] each. Different tilings use a different `first`, so that they share
        no key."""
        count = len(sizes)
        factors = np.array(splitmix64(count * (d + 1), first), dtype=np.int64).reshape(count, d + 1)
        return cls(
            np.array(sizes, dtype=np.float64).reshape(count, d),
            np.array(shifts, dtype=np.float64).reshape(count, d),
            factors[:, :d],
            factors[:, d],
        )

    def keys(self, values: Sequence[float]) -> list[int]:
        """The key of the tile of each tiling, 0 .. 2^62 - 1: equal for the same tile, and for different ones only with
        probability 2^-62.

        It is the sum of the tile's coordinates, each times its own factor, modulo 2^62.

        Args:
            values: the components, length d.
        """
        at = self.sizes * values
        at += self.shifts
        tiles = np.floor(at, out=at).astype(np.int64)
        tiles *= self.factors
        keys = np.add.reduce(tiles, axis=1)
        keys += self.families
        keys &= TILE
        return keys.tolist()

    def beside(self, other: Tilings) -> Tilings:
        """These tilings and then the others, over the components of both, one after the other, with the same keys."""
        (k, d), (more, others) = self.sizes.shape, other.sizes.shape

        def block_diagonal(own: NDArray[Any], its: NDArray[Any]) -> NDArray[Any]:
            both = np.zeros((k + more, d + others), dtype=own.dtype)
            both[:k, :d], both[k:, d:] = own, its
            return both

        return Tilings(
            block_diagonal(self.sizes, other.sizes),
            block_diagonal(self.shifts, other.shifts),
            block_diagonal(self.factors, other.factors),
            np.concatenate([self.families, other.families]),
        )


def critic_tilings(groups: Sequence[Sequence[float]], tilings: int) -> Tilings:
    """That many tilings for each group of the critic's inputs (`Task.critic_widths`): tiling t is shifted by
    t (2 c + 1) / tilings of a tile along component c. 1 and odd numbers to 15 leave some component unshifted.
    """
    d = len(groups[0]) if groups else 0
    odd = 2.0 * np.arange(d) + 1.0
    widths = [np.array(group) for group in groups for _ in range(tilings)]
    sizes = [np.divide(1.0, each, out=np.zeros(d), where=each > 0.0) for each in widths]
    shifts = [np.mod(odd * t / tilings, 1.0) for _ in groups for t in range(tilings)]
    return Tilings.of(sizes, shifts, d, _CRITICS)


def splitmix64(count: int, first: int = 1) -> list[int]:
    """That many pseudo-random numbers, 0 .. 2^63 - 1, fixed forever (SplitMix64): policies depend on them.

    Args:
        first: index of the first in the sequence of all.
    """
    numbers: list[int] = []
    for i in range(first, first + count):
        z = i * 0x9E3779B97F4A7C15 & _WORD
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & _WORD
        z = (z ^ z >> 27) * 0x94D049BB133111EB & _WORD
        numbers.append((z ^ z >> 31) >> 1)
    return numbers


NO_TILINGS = Tilings.of([], [], d=0, first=1)
"""The tilings of a critic that sees nothing more."""
