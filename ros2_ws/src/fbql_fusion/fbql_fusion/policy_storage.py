"""Policies as files: a .npz of plain arrays, checked before anything in it is used. Never a pickle.

Arrays: format_version int64 [], kind text [], behaviors text [n], tree_hashes text [n], leaf_counts int64 [n], and
the controller's own arrays as array/<name>.
"""

from __future__ import annotations

import io
import re
import sys
import zipfile
import zlib
from math import prod
from pathlib import Path
from typing import IO, Any

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.files import unreadable, write_atomically
from numpy.lib import format as npy
from numpy.typing import NDArray

from fbql_fusion.core.policy import Policy
from fbql_fusion.core.session import Session

FORMAT_VERSION = 1
MAX_BYTES = 256 * 1024 * 1024
"""Largest policy file, and largest sum of its arrays, that is read [bytes]."""
MAX_ARRAYS = 64
_HEADER = re.compile(
    r"\{'descr': '(?P<dtype>\|b1|\|[iu]1|<[iu][248]|<f[248]|<U[1-9]\d{0,6})', 'fortran_order': (?P<fortran>True|False), "
    r"'shape': \((?P<shape>|\d{1,15},|\d{1,15}(?:, \d{1,15}){1,7})\), \} *\n"
)
"""The header that NumPy writes for numbers and text, as a policy has them. NumPy's own reader evaluates it as Python."""
_PREFIX = "array/"

_NO_POLICY = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, MemoryError)
"""What zipfile and NumPy raise for bytes that are not a .npz file."""


def save_policy(path: Path, policy: Policy) -> None:
    """Writes a policy, completely or not at all.

    Raises:
        BadInput: a value that is not finite: such a policy would be refused when it is loaded.
        OSError: the file could not be written.
    """
    write_atomically(path, policy_bytes(policy))


def policy_bytes(policy: Policy) -> bytes:
    """The file's bytes; the same policy gives the same bytes.

    Raises:
        BadInput: a value that is not finite.
    """
    arrays: dict[str, NDArray[Any]] = {
        "format_version": np.array(FORMAT_VERSION, dtype=np.int64),
        "kind": np.array(policy.kind),
        "behaviors": np.array(policy.behaviors),
        "tree_hashes": np.array(policy.tree_hashes),
        "leaf_counts": np.array(policy.leaf_counts, dtype=np.int64),
    }
    for name, array in policy.arrays.items():
        if not np.isfinite(array).all():
            raise BadInput(f"the policy's array '{name}' has a value that is not finite; it is not saved")
        arrays[_PREFIX + name] = array
    buffer = io.BytesIO()
    # np.savez would put the time of writing into the file.
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            npy.write_array(member, array, allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), member.getvalue())
    return buffer.getvalue()


def learned_bytes(session: Session[Any, Any, Any]) -> bytes | None:
    """The file's bytes of what a session has learned; None where nothing is learned.

    Raises:
        BadInput: a value that is not finite, or a controller of the user's own whose `to_arrays` can't be used.
    """
    policy = session.policy()
    return None if policy is None else policy_bytes(policy)


def load_policy(path: Path) -> Policy:
    """Reads a policy and checks its form. `Session` checks that it fits its controller, behaviors and trees.

    Raises:
        BadInput: no such file, too large, not a policy, of another format version, or a value that is not finite:
            one line with the file and the reason.
    """
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise BadInput(f"{path}: {size} bytes; a policy has at most {MAX_BYTES}")
        with path.open("rb") as file:
            return _policy_in(file, str(path))
    except OSError as error:
        raise unreadable(path, error) from None


def policy_from_bytes(data: bytes, where: str) -> Policy:
    """The policy in a file's bytes, such as those in a recording. `where` names them in errors."""
    return _policy_in(io.BytesIO(data), where)


def _policy_in(file: IO[bytes], where: str) -> Policy:
    try:
        return _policy_from(_read(file))
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    except _NO_POLICY as error:
        reason = str(error).partition("\n")[0]
        raise BadInput(f"{where}: not a policy file ({reason or type(error).__name__})") from None


def _read(file: IO[bytes]) -> dict[str, NDArray[Any]]:
    """The arrays of a .npz, its sizes checked before anything is unpacked."""
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        if len(members) > MAX_ARRAYS:
            raise BadInput(f"{len(members)} arrays; a policy has at most {MAX_ARRAYS}")
        unpacked = sum(member.file_size for member in members)
        if unpacked > MAX_BYTES:
            raise BadInput(f"unpacks to {unpacked} bytes; a policy has at most {MAX_BYTES}")
        arrays: dict[str, NDArray[Any]] = {}
        for member in members:
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise BadInput(f"'{member.filename}' is compressed in a way that NumPy does not use")
            name = member.filename.removesuffix(".npy")
            if name in arrays:
                raise BadInput(f"array '{name}' occurs twice")
            with archive.open(member) as file:
                arrays[name] = _read_array(name, file, member.file_size)
        return arrays


def _read_array(name: str, file: IO[bytes], size: int) -> NDArray[Any]:
    """One .npy; its header must declare exactly the bytes that are there."""
    if npy.read_magic(file) != (1, 0):
        raise BadInput(f"array '{name}' has a .npy version other than 1.0")
    length = int.from_bytes(file.read(2), "little")
    match = _HEADER.fullmatch(file.read(length).decode("latin-1"))
    if match is None:
        raise BadInput(f"array '{name}' holds neither numbers nor text, or has a header that NumPy does not write")
    dtype = np.dtype(match["dtype"])
    shape = tuple(map(int, match["shape"].replace(",", " ").split()))
    promised, there = prod(shape) * dtype.itemsize, size - file.tell()
    if promised != there:
        raise BadInput(f"array '{name}' declares {promised} bytes and has {there}")
    data = file.read()
    if dtype.kind == "U" and data and np.frombuffer(data, "<u4").max() > sys.maxunicode:
        raise BadInput(f"array '{name}' has a character that does not exist")
    array: NDArray[Any] = np.ndarray(shape, dtype, data, order="F" if match["fortran"] == "True" else "C")
    return array.copy()


def _policy_from(arrays: dict[str, NDArray[Any]]) -> Policy:
    version = arrays.get("format_version")
    if version is None or version.shape or version.dtype != np.int64:
        raise BadInput("not a policy file (no format_version)")
    if version != FORMAT_VERSION:
        raise BadInput(f"format version {version}; supported: {FORMAT_VERSION}")
    kind = arrays.get("kind")
    if kind is None or kind.shape or kind.dtype.kind != "U":
        raise BadInput("array 'kind' is missing or not text")
    texts: list[tuple[str, ...]] = []
    for name in ("behaviors", "tree_hashes"):
        array = arrays.get(name)
        if array is None or array.ndim != 1 or array.dtype.kind != "U":
            raise BadInput(f"array '{name}' is missing or not a list of texts")
        texts.append(tuple(array.tolist()))
    behaviors, tree_hashes = texts
    counts = arrays.get("leaf_counts")
    if counts is None or counts.dtype != np.int64 or counts.ndim != 1 or (counts < 1).any():
        raise BadInput("array 'leaf_counts' is missing or not a list of numbers above 0")
    if not len(behaviors) == len(tree_hashes) == len(counts):
        raise BadInput(f"{len(behaviors)} behaviors, {len(tree_hashes)} tree hashes, {len(counts)} leaf counts")
    learned = {name.removeprefix(_PREFIX): array for name, array in arrays.items() if name.startswith(_PREFIX)}
    for name, array in learned.items():
        if array.dtype.kind == "U" or not np.isfinite(array).all():
            raise BadInput(f"array '{name}' has a value that is not a finite number")
    return Policy(str(kind), behaviors, tree_hashes, tuple(counts.tolist()), learned)
