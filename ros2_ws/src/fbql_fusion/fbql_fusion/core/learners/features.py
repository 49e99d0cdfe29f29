"""The features of a step: the joint leaves, and the tiles of the observations, that it falls into.

A feature is active or not. Each step has the same number of active features, and a feature gets its index when it is met
for the first time, so that memory grows with the visited situations and never with the product of the leaves. Nothing
here knows what is sensed: the values are ranked among those of the first episodes (`Scales`).

The weights depend on nothing else. The critic V, needed only while learning, may also see inputs from the task.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import accumulate, chain, combinations
from math import floor
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.core.kernels import kernel, kernel_for
from fbql_common.core.types import DRIVER_BLEND, NO_LEAF
from numpy.typing import NDArray

from fbql_fusion.core.controllers.interface import JointState
from fbql_fusion.core.learners.policy_arrays import check_arrays, check_range, rows_of
from fbql_fusion.core.learners.tilings import NO_TILINGS, TILE, Tilings

KNOTS = 17
"""Quantiles that a component's scale is made of."""
SIGNED_SHARE = 0.1
"""A component is signed if at least this share of its values is below 0, and at least this share above."""
_MIX = 1_000_003
BELOW_ONE = 1.0 - 1e-12
_SLOTS = 1 << 14
"""Slots that a `KeyIndex` starts with."""


class Situation(NamedTuple):
    """The input of the features: everything that the behaviors report in a step, except their references."""

    joint_state: JointState
    """Length n."""
    observed: tuple[tuple[float, ...], ...]
    """The observations, in groups, `Task.observed`: in soccer one per behavior. An unknown group is empty."""
    critic_inputs: tuple[float, ...] = ()
    """What the critic sees in addition, `Task.critic_inputs`; empty if it sees no more."""
    mask: tuple[bool, ...] | None = None
    """Which behaviors may drive, at least one, length n; None: all. Features do not depend on it."""
    guide: int | None = None
    """The behavior that the guide would choose, or DRIVER_BLEND; None if that is not a feature."""


class Scales:
    """Ranks: each component of what is sensed becomes a number in [0, 1), the share of the values seen below it.

    Ranks need neither units nor ranges, and resolve finely what is met often. Two situations that mirror each other
    (left and right) get the same ranks: components that take both signs are bearings or lateral offsets in frames after
    REP 103, and change their sign together. The last of them is made positive.

    Args:
        knots: quantiles of each component, [d, KNOTS], rows not decreasing.
        signed: which components change their sign in the mirror, [d].
        lengths: components of each group, sum d.
    """

    def __init__(self, knots: NDArray[np.float64], signed: NDArray[np.bool_], lengths: Sequence[int]) -> None:
        self.knots = knots
        self.signed = signed
        self.lengths = tuple(lengths)
        self._knots: list[list[float]] = knots.tolist()
        self._signed: list[bool] = signed.tolist()
        marked = [i for i, is_signed in enumerate(self._signed) if is_signed]
        self.decisive = marked[-1] if marked else -1
        """The component whose sign decides whether a situation is mirrored; -1 for none."""
        self._none = [False] * len(self._signed)

    @classmethod
    def of(cls, situations: Sequence[Situation], mirror: bool) -> Scales:
        """The scales of the values sensed in one or more situations in which every group is known."""
        lengths = [len(observed) for observed in situations[0].observed]
        values = np.array(
            [[x for observed in each.observed for x in observed] for each in situations], dtype=np.float64
        )
        share = SIGNED_SHARE * len(values)
        signed = ((values < 0).sum(axis=0) >= share) & ((values > 0).sum(axis=0) >= share)
        if not mirror:
            signed[:] = False
        if signed.any():
            decisive = values[:, np.flatnonzero(signed)[-1]]
            values[np.ix_(decisive < 0, signed)] *= -1.0
        knots = np.quantile(values, np.linspace(0.0, 1.0, KNOTS), axis=0).T
        return cls(np.ascontiguousarray(knots), signed, lengths)

    def ranks(self, observed: Sequence[Sequence[float]]) -> list[float | None]:
        """The rank of each component, length d; None for those of a group that is unknown, or has a different number of
        values.

        Args:
            observed: what is sensed, group by group.
        """
        values: list[float | None] = []
        for length, own in zip(self.lengths, observed, strict=True):
            values += own if len(own) == length else [None] * length
        decisive = values[self.decisive] if self.decisive >= 0 else None
        turned = self._signed if decisive is not None and decisive < 0.0 else self._none
        return [
            None if x is None else _rank(-x if turns else x, knots)
            for x, turns, knots in zip(values, turned, self._knots, strict=True)
        ]


def _tile_keys_interpreted(
    values: NDArray[np.float64],
    knots: NDArray[np.float64],
    signed: NDArray[np.bool_],
    decisive: int,
    sizes: NDArray[np.float64],
    shifts: NDArray[np.float64],
    factors: NDArray[np.int64],
    families: NDArray[np.int64],
) -> NDArray[np.int64]:
    at = values.copy()
    turned = decisive >= 0 and values[decisive] < 0.0
    for c, own in enumerate(knots.tolist()):
        at[c] = _rank(float(-values[c] if turned and signed[c] else values[c]), own)
    tiles = np.floor(sizes * at + shifts).astype(np.int64)
    return (tiles * factors).sum(axis=1) + families & TILE  # arrays wrap round without a warning


@kernel_for(_tile_keys_interpreted)
def tile_keys(
    values: NDArray[np.float64],
    knots: NDArray[np.float64],
    signed: NDArray[np.bool_],
    decisive: int,
    sizes: NDArray[np.float64],
    shifts: NDArray[np.float64],
    factors: NDArray[np.int64],
    families: NDArray[np.int64],
) -> NDArray[np.int64]:
    """`Scales.ranks` of the first values, then `Tilings.keys` of these and the rest, [K]; for compiled code.

    Args:
        values: everything sensed, then the critic's inputs if the tilings have components for them.
        knots, signed, decisive: of the scales.
        sizes, shifts, factors, families: of the tilings.
    """
    components, count = knots.shape
    turned = decisive >= 0 and values[decisive] < 0.0
    at = values.copy()
    for c in range(components):
        x = -values[c] if turned and signed[c] else values[c]
        low, high = 0, count
        while low < high:
            middle = (low + high) // 2
            if x < knots[c, middle]:
                high = middle
            else:
                low = middle + 1
        if low == 0:
            at[c] = 0.0
        elif low == count:
            at[c] = BELOW_ONE
        else:
            below = knots[c, low - 1]
            at[c] = min((low - 1 + (x - below) / (knots[c, low] - below)) / (count - 1), BELOW_ONE)
    keys = families.copy()
    for k in range(len(families)):
        for c in range(len(at)):
            if sizes[k, c] > 0.0 or shifts[k, c] > 0.0:
                keys[k] += floor(sizes[k, c] * at[c] + shifts[k, c]) * factors[k, c]
        keys[k] &= TILE
    return keys


def _parts_of[T](values: Sequence[T], lengths: Sequence[int]) -> list[Sequence[T]]:
    """The values of each group, one after the other."""
    ends = list(accumulate(lengths))
    return [values[end - length : end] for end, length in zip(ends, lengths, strict=True)]


def _rank(x: float, knots: list[float]) -> float:
    """The share of values below x, in [0, 1), linear between the knots."""
    i = bisect_right(knots, x)
    if i == 0:
        return 0.0
    if i == len(knots):
        return BELOW_ONE
    low = knots[i - 1]
    return min((i - 1 + (x - low) / (knots[i] - low)) / (len(knots) - 1), BELOW_ONE)


class Resolution(NamedTuple):
    """How finely the features distinguish situations."""

    leaf_pairs: bool = True
    """Whether there is a feature for each leaf and each pair of leaves."""
    pair_tilings: int = 4
    """Tilings of each pair of groups of what is sensed."""
    pair_tiles: int = 6
    """Tiles along each component of such a tiling."""
    joint_tilings: int = 4
    """Tilings of everything that is sensed."""
    joint_tiles: int = 4
    """Tiles along each component of such a tiling."""
    world_tilings: int = 0
    """Tilings of each group of the inputs that only the critic sees, `Task.critic_widths`."""
    mirror: bool = True
    """Whether situations that mirror each other share their tiles."""


class FeatureTables(NamedTuple):
    """What the keys of a complete situation are made of, as arrays: the input of kernels. n behaviors, d components."""

    knots: NDArray[np.float64]
    """Of the scales, [d, KNOTS]."""
    signed: NDArray[np.bool_]
    """[d]"""
    decisive: int
    tilings: Tilings
    """Those of the observations, then those of the critic's inputs."""
    leaf_bases: NDArray[np.int64]
    """Key of each behavior's leaf 0, [n]; empty if leaves are not features."""
    pairs: NDArray[np.int64]
    """Pairs of behaviors, and the key of their leaves 0, [P, 3]; empty if they are not features."""
    active: int
    """F"""
    critic: int
    """F'"""


@kernel
def situation_keys(
    features: FeatureTables, leaves: NDArray[np.int64], values: NDArray[np.float64]
) -> NDArray[np.int64]:
    """The keys of a situation's features, [F + F'], as `Features` has them.

    Args:
        leaves: joint state, [n].
        values: everything sensed, then the critic's inputs if the tilings have components for them.
    """
    tilings = features.tilings
    tiles = tile_keys(
        values,
        features.knots,
        features.signed,
        features.decisive,
        tilings.sizes,
        tilings.shifts,
        tilings.factors,
        tilings.families,
    )
    singles, pairs = len(features.leaf_bases), len(features.pairs)
    keys = np.empty(singles + pairs + len(tiles), dtype=np.int64)
    for i in range(singles):
        keys[i] = features.leaf_bases[i] - leaves[i]
    for i in range(pairs):
        first, second, base = features.pairs[i]
        keys[singles + i] = base + leaves[first] * _MIX + leaves[second]
    keys[singles + pairs :] = tiles
    return keys


class KeyIndex(NamedTuple):
    """The index of each feature by its key: a hash table with open addressing; the input of kernels."""

    slots: NDArray[np.int64]
    """Key and index of a feature; index -1 where the slot is free, [a power of 2, 2]."""
    keys: NDArray[np.int64]
    """The key of each feature, in the order of their indices, [at least known]."""
    known: int
    """Number of features."""

    @classmethod
    def of(cls, keys: NDArray[np.int64]) -> KeyIndex:
        """The index of these features."""
        slots = np.full((_SLOTS, 2), -1, dtype=np.int64)
        index = cls(slots, np.empty(_SLOTS, dtype=np.int64), 0)
        return indices_of(keys, index, np.empty(len(keys), dtype=np.int64))


@kernel
def indices_of(keys: NDArray[np.int64], index: KeyIndex, found: NDArray[np.int64]) -> KeyIndex:
    """Writes the index of each key to `found`; keys met for the first time get the next ones.

    Returns:
        The index with these keys. The given one must not be used any more.
    """
    slots, known_keys, known = index.slots, index.keys, index.known
    mask = len(slots) - 1
    for i in range(len(keys)):
        key = keys[i]
        at = (key ^ (key >> 17) ^ (key >> 37)) & mask
        while slots[at, 1] >= 0 and slots[at, 0] != key:
            at = (at + 1) & mask
        if slots[at, 1] < 0:
            slots[at, 0], slots[at, 1] = key, known
            known_keys[known] = key
            known += 1
            if 2 * known >= len(slots):
                mask = 2 * len(slots) - 1
                slots = np.full((2 * len(slots), 2), -1, dtype=np.int64)
                longer = np.empty(2 * len(known_keys), dtype=np.int64)
                longer[:known] = known_keys[:known]
                known_keys = longer
                for j in range(known):
                    other = known_keys[j]
                    at = (other ^ (other >> 17) ^ (other >> 37)) & mask
                    while slots[at, 1] >= 0:
                        at = (at + 1) & mask
                    slots[at, 0], slots[at, 1] = other, j
            found[i] = known - 1
        else:
            found[i] = slots[at, 1]
    return KeyIndex(slots, known_keys, known)


class Features:
    """The indices of a situation's active features.

    Active are the leaf of each behavior, each pair of leaves, one tile of each tiling, and which behavior the guide would
    choose, if that is a feature. The tilings of a kind are shifted against each other by `offsets`, so that together they
    distinguish more than one and still generalize. An unknown group of observations is left out of the tilings.

    Args:
        scales: of what is sensed.
        offsets: shift of each tiling along each component, in tiles, [tilings, d].
        critic: tilings of the inputs that only the critic sees, see `critic_tilings`.
        behaviors: n; None: as many as there are groups.
        has_guide: whether the guide's choice is a feature. Its n + 1 values then are the first features.
    """

    def __init__(
        self,
        scales: Scales,
        resolution: Resolution,
        offsets: NDArray[np.float64],
        critic: Tilings = NO_TILINGS,
        behaviors: int | None = None,
        has_guide: bool = False,
    ) -> None:
        self.scales = scales
        self.resolution = resolution
        self.offsets = offsets
        self.has_guide = has_guide
        sensed, d = len(scales.lengths), len(scales.knots)
        n = sensed if behaviors is None else behaviors
        self._index: dict[int, int] = {_guide_key(i): i + 1 for i in range(-1, n)} if has_guide else {}
        pairs = list(combinations(range(n), 2))
        self._leaves = [(-1 - i) * _MIX for i in range(n)] if resolution.leaf_pairs else []
        self._leaf_pairs = [(i, j, (-1 - i * n - j) * _MIX * _MIX) for i, j in pairs] if resolution.leaf_pairs else []
        groups: list[tuple[tuple[int, ...], int, int]] = []
        groups += [
            (pair, t, resolution.pair_tiles)
            for pair in combinations(range(sensed), 2)
            for t in range(resolution.pair_tilings)
        ]
        groups += [
            (tuple(range(sensed)), resolution.pair_tilings + t, resolution.joint_tiles)
            for t in range(resolution.joint_tilings)
        ]
        owner = np.repeat(np.arange(sensed), scales.lengths)
        asked = [(group, np.isin(owner, group), row, tiles) for group, row, tiles in groups]
        asked = [each for each in asked if each[1].any()]
        self._tilings = Tilings.of(
            [tiles * member.astype(np.float64) for _, member, _, tiles in asked],
            [offsets[row] * member for _, member, row, _ in asked],
            d,
            first=1,
        )
        self._with_critic = self._tilings.beside(critic)
        self._needs = [[i for i in group if scales.lengths[i]] for group, *_ in asked] + [[]] * len(critic.sizes)
        """The groups that a tiling needs."""
        leaves = n + len(pairs) if resolution.leaf_pairs else 0
        self.active_features = has_guide + leaves + len(asked)
        """F: how many are active where everything is known."""
        self.critic_features = len(critic.sizes)
        """F': how many more V sees."""

    @staticmethod
    def random_offsets(resolution: Resolution, components: int, generator: np.random.Generator) -> NDArray[np.float64]:
        """Offsets for `Features`, [tilings, d]."""
        return generator.random((resolution.pair_tilings + resolution.joint_tilings, components))

    def __len__(self) -> int:
        """Features met so far."""
        return len(self._index)

    @property
    def keys(self) -> NDArray[np.int64]:
        """The key of every feature, in the order of their indices, [m]."""
        return np.fromiter(self._index, dtype=np.int64, count=len(self._index))

    def load_keys(self, keys: NDArray[np.int64]) -> None:
        """Restores keys as `keys` returns them. Raises BadInput for a duplicate key."""
        index = {key: i for i, key in enumerate(keys.tolist())}
        if len(index) != len(keys):
            raise BadInput("the policy's array 'keys' has a feature twice")
        self._index = index

    def add_keys(self, keys: NDArray[np.int64]) -> None:
        """Gives the next indices to new features, in order. Raises ValueError for one that has an index."""
        for key in keys.tolist():
            if self._index.setdefault(key, len(self._index)) != len(self._index) - 1:
                raise ValueError(f"the feature with key {key} has an index already")

    def tables(self) -> FeatureTables:
        """The same features for compiled code, which `situation_keys` reads. Raises BadInput if the guide's choice is one of
        them."""
        if self.has_guide:
            raise BadInput("compiled situations do not know what the guide would choose; set fbql_prior to 0")
        pairs = np.array(self._leaf_pairs, dtype=np.int64).reshape(-1, 3)
        return FeatureTables(
            self.scales.knots,
            self.scales.signed,
            self.scales.decisive,
            self._with_critic if self.critic_features else self._tilings,
            np.array(self._leaves, dtype=np.int64),
            pairs,
            self.active_features,
            self.critic_features,
        )

    def of_guide(self, behavior: int) -> int:
        """The feature that the guide would choose a behavior."""
        return self._index[_guide_key(behavior)]

    def row(self, situation: Situation) -> list[int]:
        """The active features, then those of the critic's further inputs: the part of a situation that is kept to
        learn from. Features met for the first time get an index. If V sees more, the situation must contain it."""
        index = self._index
        keys = self._keys(situation, situation.critic_inputs if self.critic_features else ())
        try:
            return list(map(index.__getitem__, keys))
        except KeyError:
            return [index.setdefault(key, len(index)) for key in keys]

    def active_in(self, row: list[int]) -> list[int]:
        """The active features of a row."""
        return row[: len(row) - self.critic_features]

    def known(self, situation: Situation) -> list[int]:
        """The active features that have an index."""
        index = self._index
        return [index[key] for key in self._keys(situation, ()) if key in index]

    def _keys(self, situation: Situation, critic_inputs: tuple[float, ...]) -> list[int]:
        """A number for each active feature, and then for each tile of the critic's inputs, if there are any: equal for
        equal features, and for different ones only with probability 2^-62.

        Only the keys of leaves are below 0, and those of the guide's choice.
        """
        leaves = situation.joint_state
        keys = [base - leaf for base, leaf in zip(self._leaves, leaves) if leaf != NO_LEAF]  # noqa: B905 - none, or as many
        if self.has_guide:
            keys.insert(0, _guide_key(DRIVER_BLEND if situation.guide is None else situation.guide))
        keys += [
            base + leaves[i] * _MIX + leaves[j] for i, j, base in self._leaf_pairs if leaves[i] != NO_LEAF != leaves[j]
        ]
        tilings = self._with_critic if critic_inputs else self._tilings
        if not len(tilings.families):
            return keys
        observed = situation.observed
        if tile_keys.is_compiled and tuple(map(len, observed)) == self.scales.lengths:
            scales, values = self.scales, np.array([*chain.from_iterable(observed), *critic_inputs])
            return keys + tile_keys.run(values, scales.knots, scales.signed, scales.decisive, *tilings).tolist()
        ranks = self.scales.ranks(observed)
        found = tilings.keys([*[0.0 if x is None else x for x in ranks], *critic_inputs])
        if None not in ranks:
            return keys + found
        known = [None not in own for own in _parts_of(ranks, self.scales.lengths)]
        needs = self._needs[: len(found)]
        return keys + [key for key, needed in zip(found, needs, strict=True) if all(known[i] for i in needed)]

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """keys int64 [m], knots float64 [d, KNOTS], signed bool [d], lengths int64 [n], offsets float64 [tilings, d],
        resolution int64 [7]."""  # fmt: skip
        scales = self.scales
        return {
            "keys": self.keys,
            "knots": scales.knots,
            "signed": scales.signed,
            "lengths": np.array(scales.lengths, dtype=np.int64),
            "offsets": self.offsets,
            "resolution": np.array(self.resolution, dtype=np.int64),
        }

    @classmethod
    def from_arrays(
        cls,
        arrays: Mapping[str, NDArray[Any]],
        resolution: Resolution,
        behaviors: int,
        critic: Tilings = NO_TILINGS,
        observed_lengths: tuple[int, ...] | None = None,
    ) -> Features:
        """The features that `to_arrays` returned. Raises BadInput for arrays that can't come from it.

        Args:
            observed_lengths: see `Task`.
        """
        groups = behaviors if observed_lengths is None else len(observed_lengths)
        check_arrays(arrays, {"lengths": ("i", (groups,)), "signed": ("b", (rows_of(arrays, "signed"),))})
        _check_resolution(arrays, resolution)
        lengths: list[int] = arrays["lengths"].tolist()
        if min(lengths, default=0) < 0:
            raise BadInput("the policy's array 'lengths' has a number below 0")
        if observed_lengths not in (None, tuple(lengths)):
            raise BadInput(
                f"the policy was learned with groups of {', '.join(map(str, lengths))} observations; here they are of "
                f"{', '.join(map(str, observed_lengths))}"
            )
        d, tilings = sum(lengths), resolution.pair_tilings + resolution.joint_tilings
        check_arrays(arrays, {"knots": ("f", (d, KNOTS)), "signed": ("b", (d,)), "offsets": ("f", (tilings, d))})
        check_arrays(arrays, {"keys": ("i", (rows_of(arrays, "keys"),))})
        check_range(arrays, "offsets", 0.0, 1.0)
        if (np.diff(arrays["knots"], axis=1) < 0).any():
            raise BadInput("the policy's array 'knots' has quantiles that decrease")
        scales, has_guide = (
            Scales(arrays["knots"], arrays["signed"], lengths),
            bool((arrays["keys"] == _guide_key(-1)).any()),
        )
        features = cls(scales, resolution, arrays["offsets"], critic, behaviors, has_guide)
        features.load_keys(arrays["keys"])
        return features


def _guide_key(behavior: int) -> int:
    """The key of the guide's choice, above those of leaves: -1 for DRIVER_BLEND, then down."""
    return -2 - behavior


def _check_resolution(arrays: Mapping[str, NDArray[Any]], expected: Resolution) -> None:
    """Raises BadInput if features were made with a resolution other than the parameters'."""
    check_arrays(arrays, {"resolution": ("i", (len(expected),))})
    for name, found, given in zip(Resolution._fields, arrays["resolution"].tolist(), expected, strict=True):
        if found != given:
            said = bool(found) if isinstance(given, bool) and found in (0, 1) else found
            raise BadInput(
                f"the policy was learned with fbql_{name} {str(said).lower()}, but the parameter is {str(given).lower()}; "
                "set it to that value, or choose another policy"
            )
