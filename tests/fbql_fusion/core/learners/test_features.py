"""Features of a situation: ranks, the mirror, tiles, and memory that grows with what was visited."""

from __future__ import annotations

from itertools import combinations
from math import isfinite

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.types import NO_LEAF
from fbql_fusion.core.learners.features import (
    KNOTS,
    Features,
    KeyIndex,
    Resolution,
    Scales,
    Situation,
    indices_of,
    situation_keys,
    tile_keys,
)
from fbql_fusion.core.learners.parameters import FeatureParameters
from fbql_fusion.core.learners.tilings import Tilings, critic_tilings
from fbql_fusion.core.tasks.soccer.critic import WIDTHS
from hypothesis import given
from hypothesis import strategies as st

LENGTHS = (2, 1, 3)
SIGNED = np.array([False, True, False, True, True, False])
"""Of what three behaviors sense: the second, fourth and fifth number change their sign in the mirror."""
DECISIVE = 4
DEFAULT = Resolution()
senses = st.floats(-4, 4).filter(lambda x: x == 0.0 or abs(x) > 1e-6)


def situation(leaves: tuple[int, ...], values: list[float], lengths: tuple[int, ...] = LENGTHS) -> Situation:
    ends = np.cumsum(lengths).tolist()
    return Situation(
        leaves, tuple(tuple(values[end - length : end]) for end, length in zip(ends, lengths, strict=True))
    )


def sensed(rng: np.random.Generator, count: int) -> list[Situation]:
    """Situations with values of both signs where a component is signed, else above 0."""
    values = rng.normal(size=(count, len(SIGNED)))
    values[:, ~SIGNED] = np.abs(values[:, ~SIGNED])
    return [situation(tuple(rng.integers(0, 5, 3).tolist()), row) for row in values.tolist()]


def critic_of(resolution: Resolution) -> Tilings:
    return critic_tilings(WIDTHS, resolution.world_tilings)


def made(resolution: Resolution = DEFAULT, mirror: bool = True) -> Features:
    rng = np.random.default_rng(1)
    scales = Scales.of(sensed(rng, 300), mirror)
    return Features(
        scales, resolution, Features.random_offsets(resolution, len(scales.knots), rng), critic_of(resolution)
    )


def mirrored(given: Situation) -> Situation:
    """The same seen in the mirror, in other leaves."""
    flat = [x for observed in given.observed for x in observed]
    flipped = [-x if is_signed else x for x, is_signed in zip(flat, SIGNED, strict=True)]
    return situation(tuple(leaf + 5 for leaf in given.joint_state), flipped)


def of_leaves(features: Features) -> int:
    """How many of the active features are of leaves; they come first."""
    n = len(features.scales.lengths)
    return n + n * (n - 1) // 2 if features.resolution.leaf_pairs else 0


@st.composite
def situations(draw: st.DrawFn) -> Situation:
    values = draw(st.lists(senses, min_size=len(SIGNED), max_size=len(SIGNED)))
    return situation(draw(st.tuples(*[st.integers(0, 4)] * 3)), values)


# Ranks


def test_a_rank_is_the_share_of_the_values_below() -> None:
    scales = Scales.of([situation((0,), [float(x)], (1,)) for x in range(0, 161)], mirror=False)
    for value, rank in [(0.0, 0.0), (40.0, 0.25), (100.0, 0.625), (5.0, 1 / 32), (-1.0, 0.0)]:
        assert scales.ranks([[value]]) == [pytest.approx(rank)]
    assert 0.999 < (scales.ranks([[1e9]])[0] or 0.0) < 1.0
    assert scales.ranks([[]]) == scales.ranks([[1.0, 2.0]]) == [None]


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40), st.lists(st.floats(-2e6, 2e6), min_size=2, max_size=9))
def test_ranks_lie_in_0_to_1_and_never_fall_as_the_value_rises(seen: list[float], values: list[float]) -> None:
    scales = Scales.of([situation((0,), [x], (1,)) for x in seen], mirror=False)
    ranks = [rank for x in sorted(values) for rank in scales.ranks([[x]]) if rank is not None]
    assert len(ranks) == len(values)
    assert all(0.0 <= rank < 1.0 for rank in ranks)
    assert ranks == sorted(ranks)


def test_a_component_is_signed_where_enough_of_its_values_are_on_both_sides() -> None:
    def signed(below: int, above: int, mirror: bool = True) -> bool:
        values = [-1.0] * below + [1.0] * above
        return bool(Scales.of([situation((0,), [x], (1,)) for x in values], mirror).signed[0])

    assert signed(10, 90)
    assert signed(90, 10)
    assert not signed(9, 91)
    assert not signed(91, 9)
    assert not signed(50, 50, mirror=False)


# The mirror


@given(situations())
def test_situations_that_mirror_each_other_share_their_tiles_and_not_their_leaves(given_: Situation) -> None:
    flat = [x for observed in given_.observed for x in observed]
    if flat[DECISIVE] == 0.0:
        return
    features = made()
    assert features.scales.signed.tolist() == SIGNED.tolist()
    one, other = features.row(given_), features.row(mirrored(given_))
    leaves = of_leaves(features)
    assert one[leaves:] == other[leaves:]
    assert not set(one[:leaves]) & set(other[:leaves])


def test_the_scales_are_the_same_whichever_side_was_met_more_often() -> None:
    seen = sensed(np.random.default_rng(9), 200)
    often_left = [mirrored(each) if k % 3 else each for k, each in enumerate(seen)]
    assert np.array_equal(Scales.of(seen, mirror=True).knots, Scales.of(often_left, mirror=True).knots)
    assert not np.array_equal(Scales.of(seen, mirror=False).knots, Scales.of(often_left, mirror=False).knots)


@given(situations())
def test_bearings_of_which_one_alone_changes_its_side_are_told_apart(given_: Situation) -> None:
    scales = made().scales
    flat = [x for observed in given_.observed for x in observed]
    one = scales.ranks(given_.observed)
    flat[1] = -flat[1]
    other = scales.ranks(situation(given_.joint_state, flat).observed)
    assert (one == other) == (flat[1] == 0.0)


def test_without_a_mirror_left_and_right_are_told_apart() -> None:
    features = made(mirror=False)
    here = sensed(np.random.default_rng(2), 1)[0]
    leaves = of_leaves(features)
    assert features.row(here)[leaves:] != features.row(mirrored(here))[leaves:]


# Active features


def literal_features(features: Features, given_: Situation) -> list[tuple[object, ...]]:
    """Each active feature spelled out."""
    lengths, resolution = features.scales.lengths, features.resolution
    n = len(lengths)
    leaves, ranks = given_.joint_state, features.scales.ranks(given_.observed)
    pairs = list(combinations(range(n), 2))
    found: list[tuple[object, ...]] = []
    if resolution.leaf_pairs:
        found += [("leaf", i, leaves[i]) for i in range(n)]
        found += [("leaves", i, j, leaves[i], leaves[j]) for i, j in pairs]
    starts = [sum(lengths[:i]) for i in range(n)]
    groups: list[tuple[tuple[int, ...], int, int]] = []
    groups += [(pair, row, resolution.pair_tiles) for pair in pairs for row in range(resolution.pair_tilings)]
    joint = range(resolution.pair_tilings, resolution.pair_tilings + resolution.joint_tilings)
    groups += [(tuple(range(n)), row, resolution.joint_tiles) for row in joint]
    for group, row, tiles in groups:
        tile = [
            int((ranks[starts[i] + c] or 0.0) * tiles + features.offsets[row, starts[i] + c])
            for i in group
            for c in range(lengths[i])
        ]
        found.append(("tile", group, row, *tile))
    return found


@pytest.mark.parametrize("lengths", [(1,), (1, 1), (2, 1, 3)])
@pytest.mark.parametrize("resolution", [Resolution(), Resolution(False, 1, 3, 2, 5), Resolution(True, 0, 1, 1, 30)])
def test_equal_indices_are_equal_features_and_no_others(lengths: tuple[int, ...], resolution: Resolution) -> None:
    """Against each feature spelled out, over many situations: leaves of one component and its tiles do not mix."""
    rng = np.random.default_rng(3)
    leaves = rng.integers(0, 40, size=(1500, len(lengths)))
    seen = [
        situation(tuple(own), values, lengths)
        for own, values in zip(leaves.tolist(), rng.random((1500, sum(lengths))).tolist(), strict=True)
    ]
    scales = Scales.of(seen, mirror=True)
    features = Features(scales, resolution, Features.random_offsets(resolution, sum(lengths), rng))
    index: dict[tuple[object, ...], int] = {}
    for each in seen:
        assert features.row(each) == [index.setdefault(key, len(index)) for key in literal_features(features, each)]
    assert len(features) == len(index) > 10


@given(situations(), situations())
def test_the_same_situation_has_the_same_features_and_each_complete_one_as_many(one: Situation, two: Situation) -> None:
    features = made()
    first = features.row(one)
    second = features.row(two)
    assert features.row(one) == first
    assert len(set(first)) == len(first) == len(second) == features.active_features == 6 + 3 * 4 + 4


def test_a_leaf_that_changes_alone_changes_its_own_feature_and_its_pairs() -> None:
    features = made()
    here = sensed(np.random.default_rng(4), 1)[0]
    before = features.row(here)
    after = features.row(here._replace(joint_state=(99, *here.joint_state[1:])))
    assert [k for k, (a, b) in enumerate(zip(before, after, strict=True)) if a != b] == [0, 3, 4]


@given(situations())
def test_known_features_are_the_active_ones_that_were_met(given_: Situation) -> None:
    features = made()
    assert features.known(given_) == []
    assert len(features) == 0
    assert features.known(given_) == [] != features.row(given_) == features.known(given_)


def test_a_component_of_zeros_is_on_neither_side_and_a_zero_is_not_turned() -> None:
    def scales(*rows: tuple[float, float]) -> Scales:
        return Scales.of([situation((0,), list(row), (2,)) for row in rows], mirror=True)

    assert scales(*[(1.0, -1.0)] * 5, *[(1.0, 0.0)] * 5).signed.tolist() == [False, False]
    assert scales(*[(1.0, 1.0)] * 5, *[(1.0, 0.0)] * 5).signed.tolist() == [False, False]
    seen = scales(*[(1.0, 1.0)] * 5, *[(-1.0, -1.0)] * 5, (7.0, 0.0))
    assert seen.signed.tolist() == [True, True]
    assert (seen.knots[0, 0], seen.knots[0, -1]) == (1.0, 7.0)


def test_features_have_the_keys_by_which_stored_policies_know_them() -> None:
    knots = np.tile(np.arange(17.0), (3, 1))
    offsets = np.array([[0.0, 0.25, 0.5], [0.5, 0.0, 0.75]])
    critic = critic_tilings([(0.5, 0.0), (0.25, 1.0)], 2)
    scales = Scales(knots, np.zeros(3, dtype=np.bool_), (2, 1))
    features = Features(scales, Resolution(True, 1, 4, 1, 2, 2, False), offsets, critic, has_guide=True)
    row = features.row(Situation((3, 7), ((1.0, 9.0), (15.0,)), (0.3, -0.6), None, 1))
    leaf = 1_000_003  # between the leaves 0 of two behaviors
    assert features.keys[row].tolist() == [
        -3, -leaf - 3, -2 * leaf - 7, -2 * leaf * leaf + 3 * leaf + 7,
        4055268194245554566, 4119232222577285619,
        993030498011093029, 1630884211869812962, 662038778959673298, 1198170743839357126,
    ]  # fmt: skip
    assert features.keys.tolist()[:2] == [-1, -2], "no driver of the guide, and its first one"


def test_features_resolve_as_the_parameters_do_unless_told() -> None:
    given_ = FeatureParameters()
    assert Resolution() == Resolution(
        given_.fbql_leaf_pairs, given_.fbql_pair_tilings, given_.fbql_pair_tiles, given_.fbql_joint_tilings,
        given_.fbql_joint_tiles, 0, given_.fbql_mirror,
    )  # fmt: skip


# What is missing


@given(situations(), st.sets(st.integers(0, 1)))
def test_features_with_a_missing_behavior_are_left_out_and_the_others_stay(given_: Situation, gone: set[int]) -> None:
    """The third behavior, whose bearing says left or right, is there."""
    features = made()
    whole = features.row(given_)
    leaves = tuple(NO_LEAF if i in gone else leaf for i, leaf in enumerate(given_.joint_state))
    part = features.known(Situation(leaves, tuple(() if i in gone else x for i, x in enumerate(given_.observed))))
    left = 3 - len(gone)
    pairs = left * (left - 1) // 2
    assert len(part) == left + pairs + 4 * pairs + (0 if gone else 4)
    assert [f for f in whole if f in part] == part


def test_with_nobody_there_nothing_is_active() -> None:
    features = made()
    assert features.row(Situation((NO_LEAF,) * 3, ((),) * 3)) == []
    assert len(features) == 0


@given(st.lists(st.lists(st.floats(), max_size=4), min_size=3, max_size=3))
def test_numbers_that_are_no_observation_are_no_tiles_and_break_nothing(observed: list[list[float]]) -> None:
    features = made()
    active = features.row(Situation((1, 2, 3), tuple(tuple(x) for x in observed)))
    complete = [len(x) for x in observed] == list(LENGTHS)
    assert (len(active) == features.active_features) == complete
    assert all(x is None or isfinite(x) for x in features.scales.ranks(observed))


def test_a_behavior_that_tells_nothing_of_what_it_senses_leaves_the_tiles_to_the_others() -> None:
    resolution = Resolution(True, 2, 6, 2, 4)
    rng = np.random.default_rng(5)
    seen = [situation((1, 2, 3), values, (2, 0, 1)) for values in rng.random((50, 3)).tolist()]
    scales = Scales.of(seen, mirror=True)
    features = Features(scales, resolution, Features.random_offsets(resolution, 3, rng))
    assert {len(features.row(each)) for each in seen} == {6 + 3 * 2 + 2} == {features.active_features}
    tiles = {features.row(each)[-1] for each in seen}
    assert len(tiles) > 5, "the joint tilings tell apart what the others sense"


@pytest.mark.parametrize(("resolution", "active"), [(Resolution(), 3), (Resolution(False), 0)])
def test_where_nobody_tells_what_it_senses_only_leaves_are_left(resolution: Resolution, active: int) -> None:
    seen = [situation((leaf, 2), [], (0, 0)) for leaf in range(5)]
    features = Features(
        Scales.of(seen, mirror=True), resolution, Features.random_offsets(resolution, 0, np.random.default_rng(0))
    )
    assert [len(features.row(each)) for each in seen] == [active] * 5
    assert features.active_features == active


# Memory


@pytest.mark.parametrize("leaf_count", [10, 100, 10_000])
def test_memory_grows_with_what_was_visited_and_never_with_the_product_of_the_leaves(leaf_count: int) -> None:
    """Eight behaviors of 100 leaves have 10^16 joint states."""
    rng = np.random.default_rng(6)
    lengths = (2,) * 8
    leaves = rng.integers(0, leaf_count, size=(200, 8)).tolist()
    seen = [
        situation(tuple(own), values, lengths)
        for own, values in zip(leaves, rng.random((200, 16)).tolist(), strict=True)
    ]
    resolution = Resolution()
    features = Features(Scales.of(seen, mirror=True), resolution, Features.random_offsets(resolution, 16, rng))
    for visits, each in enumerate(seen, 1):
        features.row(each)
        assert len(features) <= visits * features.active_features
    held = len(features)
    for each in seen:
        features.row(each)
    assert len(features) == held
    assert len(features.keys) == held
    assert features.active_features == 8 + 28 + 4 * 28 + 4


# As arrays


def test_what_is_kept_is_taken_over() -> None:
    features = made(Resolution(True, 3, 5, 1, 2))
    rng = np.random.default_rng(7)
    seen = sensed(rng, 50)
    active = [features.row(each) for each in seen]
    again = Features.from_arrays(features.to_arrays(), features.resolution, 3)
    assert [again.known(each) for each in seen] == active
    assert len(again) == len(features)
    assert again.active_features == features.active_features
    new = sensed(rng, 20)
    assert [again.row(each) for each in new] == [features.row(each) for each in new]
    assert all(np.array_equal(again.to_arrays()[name], array) for name, array in features.to_arrays().items())


def test_what_v_is_told_comes_after_the_active_features_and_is_kept_too() -> None:
    features = made(Resolution(world_tilings=4))
    rng = np.random.default_rng(11)
    seen = [each._replace(critic_inputs=tuple(rng.uniform(-0.5, 0.5, 8).tolist())) for each in sensed(rng, 30)]
    rows = [features.row(each) for each in seen]
    assert {len(row) for row in rows} == {features.active_features + features.critic_features}
    assert features.critic_features == 4 * 4
    assert [row[: features.active_features] for row in rows] == [features.known(each) for each in seen]
    inputs = {f for row in rows for f in row[features.active_features :]}
    assert not inputs & {f for each in seen for f in features.known(each)}
    assert features.known(seen[0]) == features.known(seen[0]._replace(critic_inputs=())), "frozen play does without"
    again = Features.from_arrays(features.to_arrays(), features.resolution, 3, critic_of(features.resolution))
    assert [again.row(each) for each in seen] == rows
    assert len(again) == len(features)


def test_arrays_are_of_the_types_that_are_told() -> None:
    features = made()
    features.row(sensed(np.random.default_rng(8), 1)[0])
    told = {name: (str(array.dtype), array.shape) for name, array in features.to_arrays().items()}
    assert told == {
        "keys": ("int64", (22,)),
        "knots": ("float64", (6, KNOTS)),
        "signed": ("bool", (6,)),
        "lengths": ("int64", (3,)),
        "offsets": ("float64", (8, 6)),
        "resolution": ("int64", (7,)),
    }


def test_a_group_of_fewer_than_no_observations_is_refused() -> None:
    features = made()
    arrays = {**features.to_arrays(), "lengths": np.array([4, -1, 3])}
    with pytest.raises(BadInput, match="'lengths' has a number below 0"):
        Features.from_arrays(arrays, features.resolution, 3)


@pytest.mark.parametrize("mirror", [False, True])
def test_the_kernel_finds_the_keys_of_ranks_and_tilings(mirror: bool) -> None:
    features = made(mirror=mirror)
    scales, tilings = features.scales, features._tilings.beside(critic_tilings(WIDTHS, 3))
    rng = np.random.default_rng(2)
    for each in sensed(rng, 300):
        values = np.array([x for observed in each.observed for x in observed] + rng.normal(size=8).tolist())
        values[rng.integers(len(values))] = rng.choice([0.0, -0.0, 1e5, scales.knots[0, 0], scales.knots[2, -1]])
        at = [*scales.ranks([values[:2].tolist(), values[2:3].tolist(), values[3:6].tolist()]), *values[6:]]
        with np.errstate(over="ignore"):
            found = tile_keys.function(values, scales.knots, scales.signed, scales.decisive, *tilings)
        assert found.tolist() == tilings.keys(at)


def test_the_kernel_mirrors_by_the_first_component_where_it_is_the_only_signed_one() -> None:
    features = made(mirror=True)
    only_first = np.arange(6) == 0
    scales = Scales(features.scales.knots, only_first, features.scales.lengths)
    tilings = features._tilings.beside(critic_tilings(WIDTHS, 3))
    for each in sensed(np.random.default_rng(3), 50):
        values = np.array([x for observed in each.observed for x in observed] + [0.0] * 8)
        values[0] = -abs(values[0])
        at = [*scales.ranks([values[:2].tolist(), values[2:3].tolist(), values[3:6].tolist()]), *values[6:]]
        with np.errstate(over="ignore"):
            found = tile_keys.function(values, scales.knots, scales.signed, scales.decisive, *tilings)
        assert found.tolist() == tilings.keys(at)


def test_keys_of_tables_are_those_of_the_features() -> None:
    for resolution in (DEFAULT, Resolution(leaf_pairs=False), Resolution(pair_tilings=0, joint_tilings=0)):
        features = made(resolution)
        for each in sensed(np.random.default_rng(9), 50):
            row = features.row(each)
            values = np.array([x for observed in each.observed for x in observed])
            keys = situation_keys(features.tables(), np.array(each.joint_state), values)
            assert features.keys[row].tolist() == keys.tolist()


def test_an_index_of_keys_finds_every_feature_and_numbers_new_ones_in_order() -> None:
    rng = np.random.default_rng(1)
    keys = rng.integers(-(1 << 40), 1 << 62, 30_000)
    index = KeyIndex.of(keys)
    found = np.empty(30_002, dtype=np.int64)
    index = indices_of(np.concatenate([keys[::-1], [5, 5]]), index, found)
    assert found.tolist() == [*reversed(range(30_000)), 30_000, 30_000]
    assert index.keys[: index.known].tolist() == [*keys.tolist(), 5]


def test_keys_that_are_added_get_the_next_indices() -> None:
    features = made()
    row = features.row(sensed(np.random.default_rng(9), 1)[0])
    features.add_keys(np.array([11, 12]))
    assert len(features) == len(row) + 2
    assert features.keys[-2:].tolist() == [11, 12]
    with pytest.raises(ValueError, match="11"):
        features.add_keys(np.array([11]))
