"""Policy files: what is saved is loaded, and what is no policy is refused in one line, unread."""

import io
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_fusion.core.policy import Policy
from fbql_fusion.policy_storage import MAX_ARRAYS, MAX_BYTES, load_policy, policy_bytes, save_policy
from file_limit import largest_file
from hypothesis import given, settings
from hypothesis import strategies as st

POLICY = Policy(
    "fbql_literal",
    ("ball_seeking", "wall_avoiding"),
    ("ab" * 32, "cd" * 32),
    (110, 11),
    {
        "joint_states": np.array([[0, 1], [5, 10]], np.int32),
        "q": np.array([[0.1, -0.2], [1e-300, 3.0]]),
        "weights": np.array([[0.5, 0.5], [0.25, 0.75]]),
    },
)


def arrays_of(policy: Policy) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(policy_bytes(policy)), allow_pickle=False) as file:
        return dict(file)


def refusal(path: Path) -> str:
    """The line that loading this file ends with."""
    with pytest.raises(BadInput) as error:
        load_policy(path)
    line = str(error.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    return line


def test_what_is_saved_is_loaded(tmp_path):
    save_policy(tmp_path / "policy.npz", POLICY)
    loaded = load_policy(tmp_path / "policy.npz")
    assert loaded[:4] == POLICY[:4]
    assert loaded.arrays.keys() == POLICY.arrays.keys()
    for name, array in POLICY.arrays.items():
        assert loaded.arrays[name].dtype == array.dtype
        assert loaded.arrays[name].tolist() == array.tolist()


def test_a_policy_that_knows_nothing_yet_is_saved_too(tmp_path):
    empty = {name: array[:0] for name, array in POLICY.arrays.items()}
    save_policy(tmp_path / "policy.npz", POLICY._replace(arrays=empty))
    assert load_policy(tmp_path / "policy.npz").arrays["q"].shape == (0, 2)


def test_the_same_policy_gives_the_same_bytes_and_numpy_reads_them():
    assert policy_bytes(POLICY) == policy_bytes(POLICY)
    assert arrays_of(POLICY)["array/q"].tolist() == POLICY.arrays["q"].tolist()


def test_saving_replaces_a_policy_whole_or_not_at_all(tmp_path):
    path = tmp_path / "policy.npz"
    save_policy(path, POLICY)
    before = path.read_bytes()
    big = POLICY._replace(arrays={"q": np.zeros((10_000, 2))})
    with largest_file(10_000), pytest.raises(OSError, match="File too large"):
        save_policy(path, big)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["policy.npz"]
    save_policy(path, big)
    assert load_policy(path).arrays["q"].shape == (10_000, 2)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_not_finite_is_not_saved(value):
    with pytest.raises(BadInput, match="'q'"):
        policy_bytes(POLICY._replace(arrays={"q": np.array([[0.0, value]])}))


# What is no policy


def test_a_missing_file_and_a_directory_are_refused(tmp_path):
    assert "no such file" in refusal(tmp_path / "policy.npz")
    assert "cannot be read" in refusal(tmp_path)


@pytest.mark.parametrize("data", [b"", b"{}", b"PK\x03\x04", b"\x93NUMPY", pickle.dumps([1, 2])])
def test_a_file_that_is_no_npz_is_refused(tmp_path, data):
    (tmp_path / "p").write_bytes(data)
    assert "not a policy file" in refusal(tmp_path / "p")


@settings(deadline=None)
@given(st.data())
def test_a_damaged_policy_is_loaded_unharmed_or_refused(tmp_path_factory, data):
    """One byte changed, or the file cut: never another error than BadInput, never other numbers."""
    path = tmp_path_factory.mktemp("damaged") / "p"
    good = policy_bytes(POLICY)
    if data.draw(st.booleans()):
        path.write_bytes(good[: data.draw(st.integers(0, len(good) - 1))])
    else:
        spoilt = bytearray(good)
        spoilt[data.draw(st.integers(0, len(good) - 1))] ^= data.draw(st.integers(1, 255))
        path.write_bytes(spoilt)
    try:
        loaded = load_policy(path)
    except BadInput:
        return
    assert all(
        array.tolist() == POLICY.arrays[name].tolist() for name, array in loaded.arrays.items() if name in POLICY.arrays
    )


def test_a_pickle_is_never_unpickled(tmp_path):
    class Trap:
        def __reduce__(self) -> tuple[object, tuple[object, ...]]:
            return Path.touch, (tmp_path / "sprung",)

    arrays = arrays_of(POLICY) | {"array/q": np.array([Trap()], dtype=object)}
    np.savez(tmp_path / "p.npz", allow_pickle=True, **arrays)
    assert "holds neither numbers nor text" in refusal(tmp_path / "p.npz")
    assert not (tmp_path / "sprung").exists()


def test_a_huge_file_is_refused_unread(tmp_path):
    with (tmp_path / "p").open("wb") as file:
        file.truncate(1_000_000_000)
    assert f"at most {MAX_BYTES}" in refusal(tmp_path / "p")


def test_a_zip_bomb_is_refused_unpacked(tmp_path):
    with zipfile.ZipFile(tmp_path / "p", "w", zipfile.ZIP_DEFLATED) as archive, archive.open("q.npy", "w") as member:
        for _ in range(MAX_BYTES // 2**20 + 1):
            member.write(bytes(2**20))
    assert (tmp_path / "p").stat().st_size < 2**20
    assert "unpacks to" in refusal(tmp_path / "p")


def test_too_many_arrays_are_refused(tmp_path):
    arrays = arrays_of(POLICY) | {f"array/{i}": np.zeros(1) for i in range(MAX_ARRAYS)}
    np.savez(tmp_path / "p.npz", **arrays)
    assert "arrays; a policy has at most" in refusal(tmp_path / "p.npz")


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (True,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1e0,), }",
        "{'descr': '<U0', 'fortran_order': False, 'shape': (100000000000,), }",
        "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1,), }",
        "{'descr': ('<f8', (1,)), 'fortran_order': False, 'shape': (1,), }",
        "{'descr': '<f8', 'fortran_order': 1, 'shape': (1,), }",
        "{'descr': __import__('os').system('true'), 'fortran_order': False, 'shape': (1,), }",
        "(" * 5000,
        "",
    ],
)
def test_a_header_that_numpy_does_not_write_is_refused(tmp_path, header):
    text = f"{header}\n".encode()
    with zipfile.ZipFile(tmp_path / "p", "w") as archive:
        archive.writestr("q.npy", b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + bytes(8))
    assert "array 'q' holds neither numbers nor text, or has a header" in refusal(tmp_path / "p")


def test_a_character_that_does_not_exist_is_refused(tmp_path):
    arrays = arrays_of(POLICY) | {"kind": np.frombuffer(b"\xff\xff\x11\x00", "<U1").reshape(())}
    np.savez(tmp_path / "p.npz", **arrays)
    assert "has a character that does not exist" in refusal(tmp_path / "p.npz")


def test_an_array_that_promises_more_than_is_there_is_refused(tmp_path):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 8)})
    with zipfile.ZipFile(tmp_path / "p", "w") as archive:
        archive.writestr("q.npy", header.getvalue() + bytes(64))
    assert "declares 64000000000000 bytes and has 64" in refusal(tmp_path / "p")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"format_version": np.array(2, np.int64)}, "format version 2; supported: 1"),
        ({"format_version": None}, "no format_version"),
        ({"format_version": np.array([1], np.int64)}, "no format_version"),
        ({"format_version": np.array("1")}, "no format_version"),
        ({"kind": None}, "'kind'"),
        ({"kind": np.array(3)}, "'kind'"),
        ({"behaviors": np.array([1, 2])}, "'behaviors'"),
        ({"behaviors": np.array(["a"])}, "1 behaviors, 2 tree hashes, 2 leaf counts"),
        ({"tree_hashes": np.array([["a"], ["b"]])}, "'tree_hashes'"),
        ({"leaf_counts": np.array([1.0, 2.0])}, "'leaf_counts'"),
        ({"leaf_counts": np.array([0, 2])}, "'leaf_counts'"),
        ({"array/q": np.array([[np.nan, 0.0]])}, "'q' has a value that is not a finite number"),
        ({"array/q": np.array(["text"])}, "'q' has a value that is not a finite number"),
        ({"array/q": np.array([b"bytes"])}, "neither numbers nor text"),
    ],
)
def test_a_policy_with_a_wrong_field_is_refused_by_its_name(tmp_path, change, reason):
    arrays = arrays_of(POLICY) | change
    np.savez(tmp_path / "p.npz", **{name: array for name, array in arrays.items() if array is not None})
    assert reason in refusal(tmp_path / "p.npz")
