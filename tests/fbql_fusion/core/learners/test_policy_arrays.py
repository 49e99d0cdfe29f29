"""Policies of the learners that hold their decisions (fault 43): one that does not fit is refused in one line, whatever array of it is wrong."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_fusion.core.learners.policy_arrays import generator_state, set_generator_state
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.policy_storage import policy_bytes, policy_from_bytes
from held_learners import LEARNERS, TABLE, learned
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from two_sides import DOWN, TwoSides, parameters, play

Array = NDArray[Any]
EACH = pytest.mark.parametrize("learner", LEARNERS)


@cache
def good(learner: str) -> Policy:
    """A policy with everything in it, episodes that wait too."""
    session = SoccerSession(parameters(learner, seed=1))
    play(session, 39)
    policy = session.policy()
    assert policy is not None
    return policy_from_bytes(policy_bytes(policy), "good")


NAMES = {learner: sorted(good(learner).arrays) for learner in LEARNERS}
ARRAYS = [(learner, name) for learner, names in NAMES.items() for name in names]
FLOATS = [(learner, name) for learner, name in ARRAYS if good(learner).arrays[name].dtype == np.float64]
TABLES = [(learner, name) for learner, name in ARRAYS if good(learner).arrays[name].ndim == 2]


def refusal(learner: str, arrays: dict[str, Array], **changes: object) -> str:
    """The line with which a session refuses the good policy with these arrays instead."""
    with pytest.raises(BadInput) as error:
        SoccerSession(parameters(learner, **changes), good(learner)._replace(arrays=arrays))
    assert "\n" not in str(error.value)
    return str(error.value)


def with_array(learner: str, name: str, array: Array) -> dict[str, Array]:
    return {**good(learner).arrays, name: array}


def changed(learner: str, name: str, at: int, value: float) -> dict[str, Array]:
    """With one number changed."""
    array = good(learner).arrays[name].copy()
    array.flat[at] = value
    return with_array(learner, name, array)


@EACH
def test_the_good_policy_is_taken_and_comes_back_bit_for_bit(learner: str) -> None:
    policy = good(learner)
    assert all(array.size for array in policy.arrays.values())
    assert policy.arrays["counts"].min() > 0
    again = SoccerSession(parameters(learner), policy).policy()
    assert again is not None
    assert policy_bytes(again) == policy_bytes(policy)


@EACH
def test_an_untrained_policy_is_taken_too(learner: str) -> None:
    session = SoccerSession(parameters(learner))
    play(session, 1)
    policy = session.policy()
    assert policy is not None
    again = SoccerSession(parameters(learner), policy).policy()
    assert again is not None
    assert policy_bytes(again) == policy_bytes(policy)


@EACH
def test_a_policy_without_episodes_that_wait_is_taken(learner: str) -> None:
    session = SoccerSession(parameters(learner, seed=1))
    play(session, 24)
    policy = session.policy()
    assert policy is not None
    assert policy.arrays["waiting_active"].shape == (0, 0)
    assert SoccerSession(parameters(learner), policy).policy() is not None


# Every array


@pytest.mark.parametrize(("learner", "name"), ARRAYS)
def test_a_missing_array_is_named(learner: str, name: str) -> None:
    arrays = {other: array for other, array in good(learner).arrays.items() if other != name}
    assert f"no array '{name}'" in refusal(learner, arrays)


@pytest.mark.parametrize(("learner", "name"), ARRAYS)
@pytest.mark.parametrize("dtype", ["int8", "int32", "int64", "uint64", "float16", "float32", "float64", "bool"])
def test_an_array_of_another_type_is_named(learner: str, name: str, dtype: str) -> None:
    array = good(learner).arrays[name]
    if array.dtype != dtype:
        with np.errstate(over="ignore", invalid="ignore"):
            assert f"'{name}' is {dtype}" in refusal(
                learner, with_array(learner, name, np.zeros_like(array, dtype=dtype))
            )


@pytest.mark.parametrize(("learner", "name"), ARRAYS)
@pytest.mark.parametrize(
    "shape",
    [
        lambda a: a[:-1],
        lambda a: a[:0],
        lambda a: np.concatenate([a, a[-1:]]),
        lambda a: a[None],
        lambda a: a[..., None],
        lambda a: a.reshape(-1)[:1].reshape(()),
    ],
    ids=["a row less", "none", "a row more", "a dimension more", "one behind", "one number"],
)
def test_an_array_of_another_shape_is_refused(learner: str, name: str, shape: Any) -> None:
    other = shape(good(learner).arrays[name])
    assert "the policy's array" in refusal(learner, with_array(learner, name, other))


@pytest.mark.parametrize(("learner", "name"), TABLES)
@pytest.mark.parametrize(
    "columns", [lambda a: a[:, :-1], lambda a: np.concatenate([a, a[:, -1:]], axis=1), lambda a: a.T]
)
def test_a_table_with_other_columns_is_refused(learner: str, name: str, columns: Any) -> None:
    table = columns(good(learner).arrays[name]).copy()
    assert "the policy's array" in refusal(learner, with_array(learner, name, table))


@pytest.mark.parametrize(("learner", "name"), FLOATS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_not_finite_is_refused(learner: str, name: str, value: float) -> None:
    size = good(learner).arrays[name].size
    for at in {0, size // 2, size - 1}:
        assert f"'{name}' has a value that is not finite" in refusal(learner, changed(learner, name, at, value))


OUTSIDE = [
    ("counts", 0, -1),
    ("counts", 1, -1),
    ("generator", 3, 2),  # an even increment
    ("generator", 4, 2),
    ("generator", 5, 2**32),
    ("knots", 5, 1e9),  # above the next quantile
    ("lengths", 0, -1),
    ("lengths", 0, 2**62),
    ("offsets", 0, -0.1),
    ("offsets", 0, 1.1),
    ("waiting_active", 0, -1),
    ("waiting_active", 7, 10**6),
    ("waiting_chance", 0, 0.0),
    ("waiting_chance", 0, -0.5),
    ("waiting_chance", 0, 1.5),
    ("waiting_discount", 0, -0.1),
    ("waiting_discount", 0, 1.1),
    ("waiting_driver", 0, -1),
    ("waiting_driver", 0, 2),
    ("waiting_lengths", 0, 0),
    ("waiting_lengths", 0, -3),
    ("waiting_lengths", 0, 2**63 - 1),
]


@EACH
@pytest.mark.parametrize(("name", "at", "value"), OUTSIDE)
def test_a_number_that_cannot_be_is_refused(learner: str, name: str, at: int, value: float) -> None:
    line = refusal(learner, changed(learner, name, at, value))
    assert "the policy's array" in line
    assert name in line or name == "lengths"


def test_updates_without_episodes_are_refused_where_only_episodes_that_are_not_guided_make_one() -> None:
    assert "the policy's array 'counts'" in refusal("fbql", changed("fbql", "counts", 0, 0))
    assert SoccerSession(
        parameters("fbql_value"), good("fbql_value")._replace(arrays=changed("fbql_value", "counts", 0, 0))
    )


@EACH
def test_a_feature_that_is_not_there_is_not_active(learner: str) -> None:
    outside = changed(learner, "waiting_active", 7, good(learner).arrays["keys"].size)
    assert "the policy's array 'waiting_active'" in refusal(learner, outside)


@EACH
def test_a_feature_that_is_there_twice_is_refused(learner: str) -> None:
    keys = good(learner).arrays["keys"]
    twice = with_array(learner, "keys", np.concatenate([keys[:-1], keys[:1]]))
    assert "a feature twice" in refusal(learner, twice)


@EACH
def test_the_lengths_of_the_episodes_that_wait_must_sum_to_their_decisions(learner: str) -> None:
    lengths = good(learner).arrays["waiting_lengths"].copy()
    lengths[0] += 1
    assert "waiting_" in refusal(learner, with_array(learner, "waiting_lengths", lengths))


@given(st.data())
def test_no_change_ends_in_another_error_and_what_is_taken_is_as_it_was_given(data: st.DataObject) -> None:
    """Any number of any array: it is refused in one line, or it can be played with and is saved as it was given."""
    learner, name = data.draw(st.sampled_from(ARRAYS))
    array = good(learner).arrays[name].copy()
    at = data.draw(st.integers(0, array.size - 1))
    if array.dtype == np.bool_:
        array.flat[at] = not array.flat[at]
    elif array.dtype == np.float64:
        array.flat[at] = data.draw(st.floats(-1e6, 1e6))
    else:
        info = np.iinfo(array.dtype)
        array.flat[at] = data.draw(st.integers(int(info.min), int(info.max)) | st.integers(0, 300))
    try:
        session = SoccerSession(parameters(learner), good(learner)._replace(arrays=with_array(learner, name, array)))
    except BadInput as error:
        assert "\n" not in str(error)
        return
    policy = session.policy()
    assert policy is not None
    assert np.array_equal(policy.arrays[name], array)
    play(session, 2)


# Of something else


@EACH
@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"fbql_leaf_pairs": False}, "fbql_leaf_pairs true, but the parameter is false"),
        ({"fbql_pair_tilings": 5}, "fbql_pair_tilings 4, but the parameter is 5"),
        ({"fbql_pair_tiles": 7}, "fbql_pair_tiles 6, but the parameter is 7"),
        ({"fbql_joint_tilings": 3}, "fbql_joint_tilings 4, but the parameter is 3"),
        ({"fbql_joint_tiles": 5}, "fbql_joint_tiles 4, but the parameter is 5"),
        ({"fbql_pair_tilings": 5, "fbql_joint_tilings": 3}, "fbql_pair_tilings 4"),
    ],
)
def test_a_policy_of_another_resolution_is_refused(learner: str, changes: dict[str, int], reason: str) -> None:
    assert reason in refusal(learner, dict(good(learner).arrays), **changes)


def test_a_policy_of_another_critic_is_refused() -> None:
    reason = "fbql_world_tilings 4, but the parameter is 0"
    assert reason in refusal("fbql", dict(good("fbql").arrays), fbql_world_tilings=0)


@EACH
@pytest.mark.parametrize("mirror", [False, True])
def test_a_policy_of_another_mirror_is_refused(learner: str, mirror: bool) -> None:
    session = SoccerSession(parameters(learner, fbql_mirror=mirror))
    play(session, 40)
    found, asked = str(mirror).lower(), str(not mirror).lower()
    reason = f"fbql_mirror {found}, but the parameter is {asked}"
    assert reason in refusal(learner, dict(learned(session).arrays), fbql_mirror=not mirror)


@EACH
@pytest.mark.parametrize(
    ("changes", "given_", "reason"),
    [
        ({"kind": "fbql_literal"}, {}, "to controller 'fbql_literal'"),
        ({}, {"controller": "fbql_literal"}, "to controller '{learner}'"),
        ({}, {"controller": "uniform"}, "takes no policy"),
        ({"behaviors": ("down", "up")}, {}, "in this order"),
        ({}, {"behaviors": ["up", "down", "third"]}, "the behaviors here are up, down, third"),
    ],
)
def test_a_policy_of_another_controller_or_other_behaviors_is_refused(
    learner: str, changes: dict[str, Any], given_: dict[str, Any], reason: str
) -> None:
    with pytest.raises(BadInput, match=reason.format(learner=learner)):
        SoccerSession(parameters(learner, **given_), good(learner)._replace(**changes))


def test_neither_learner_takes_a_policy_of_the_other() -> None:
    """Not even where its features fit."""
    for own, other in (LEARNERS, LEARNERS[::-1]):
        with pytest.raises(BadInput, match=f"to controller '{other}', not to '{own}'"):
            SoccerSession(parameters(own), good(other))
        session = SoccerSession(parameters(other, seed=1, fbql_world_tilings=0))
        play(session, 39)
        renamed = learned(session)._replace(kind=own)
        with pytest.raises(BadInput, match=f"no array '{TABLE[own]}'"):
            SoccerSession(parameters(own, fbql_world_tilings=0), renamed)


@EACH
def test_arrays_of_another_number_of_behaviors_are_refused(learner: str) -> None:
    three = good(learner)._replace(behaviors=("up", "down", "third"), tree_hashes=("a",) * 3, leaf_counts=(4,) * 3)
    with pytest.raises(BadInput, match="'lengths' is int64"):
        SoccerSession(parameters(learner, behaviors=["up", "down", "third"]), three)


@EACH
@pytest.mark.parametrize("change", [{"tree_hash": "other"}, {"leaf_count": 5}])
@pytest.mark.parametrize("learn", [True, False])
def test_a_policy_of_other_trees_is_refused_at_the_first_answer(
    learner: str, change: dict[str, Any], learn: bool
) -> None:
    session, task = SoccerSession(parameters(learner, learn=learn), good(learner)), TwoSides()
    begun = session.next_episode()
    assert begun is not None
    world, outputs = task.reset(*begun), task.answers()
    down = outputs[DOWN]
    assert down is not None
    outputs[DOWN] = down._replace(**change)
    with pytest.raises(BadInput, match="the policy was learned with another tree of down"):
        session.decide(world, outputs)


# The generator


@given(st.integers(0, 2**63), st.integers(0, 5))
def test_a_generator_goes_on_from_its_state(seed: int, draws: int) -> None:
    """An odd number of 32-bit draws leaves half a word behind."""
    generator = np.random.default_rng(seed)
    for _ in range(draws):
        generator.integers(0, 2**32, dtype=np.uint32)
    other = np.random.default_rng(1)
    set_generator_state(other, generator_state(generator))
    assert other.bit_generator.state == generator.bit_generator.state
    assert other.random(3).tolist() == generator.random(3).tolist()
