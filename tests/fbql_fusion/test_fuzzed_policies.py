"""Whatever a policy file holds: it is a policy that fits or is refused, in one line either way."""

from __future__ import annotations

import io
import json
import random
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fbql_fusion.core.policy import Policy
from fbql_fusion.policy_storage import policy_bytes, policy_from_bytes
from fbql_fusion.run_recorder import launcher_parameters
from fuzzing import dice, odd_bytes, odd_copy, odd_value, read_or_refused

POLICY = Policy(
    "fbql_literal", ("a", "b"), ("0" * 64, "1" * 64), (3, 2), {"q": np.zeros((3, 2)), "n": np.arange(4, dtype=np.int64)}
)
DATA = policy_bytes(POLICY)
SHAPES = (
    "()",
    "(True,)",
    "(-1,)",
    "(2,)",
    "(2, 1)",
    "(10000000000000, 0)",
    "(1e3,)",
    "((2,),)",
    "[2]",
    "(0,)",
    "(2" + ", 1" * 40 + ")",
)
TYPES = ("<f8", ">f8", "<i8", "|b1", "<U3", "<U0", "|O", "<c16", "|V8", "<M8[s]", "|S3", "f8", "", "<f16", [["a", "<f8"]], "<U999999999")  # fmt: skip
METHODS = (*[zipfile.ZIP_STORED] * 50, *[zipfile.ZIP_DEFLATED] * 8, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
HEADERS = ("{" * 200, "(" * 5000, "{'descr': __import__('os').system('true')}", "", "\0" * 50, "'" * 9000)


def odd_member(rng: random.Random, data: bytes) -> bytes:
    """A .npy with an odd header, or odd text."""
    if rng.random() < 0.3:
        return odd_bytes(data, rng)
    if rng.random() < 0.2:
        header = rng.choice(HEADERS)
    else:
        order = rng.choice(("True", "False", "1", "None"))
        header = f"{{'descr': {rng.choice(TYPES)!r}, 'fortran_order': {order}, 'shape': {rng.choice(SHAPES)}, }}\n"
    content = rng.choice((b"", bytes(8), bytes(16), b"\xff" * 16, b"\xff\xff\x11\0" * 6, b"\0\xd8\0\0" * 6, data[-16:]))
    version = rng.choice((b"\x01\x00", b"\x01\x00", b"\x01\x00", b"\x02\x00", b"\x03\x00"))
    text = header.encode()
    size = len(text).to_bytes(2 if version[0] == 1 else 4, "little")
    return b"\x93NUMPY" + version + size + text + content


def test_mutated_bytes_are_a_policy_or_refused():
    for rng in dice(400):
        data = odd_bytes(DATA, rng)
        read_or_refused(lambda data=data: policy_from_bytes(data, "x"))


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_odd_arrays_are_a_policy_or_refused():
    with zipfile.ZipFile(io.BytesIO(DATA)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for rng in dice(400):
        target = rng.choice(list(members))
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", rng.choice(METHODS)) as archive:
            for name, data in members.items():
                name = rng.choice(("../x", "a\n", "array/é", "array/", "x" * 1000)) if rng.random() < 0.05 else name
                archive.writestr(name, odd_member(rng, data) if name == target else data)
        found = read_or_refused(lambda buffer=buffer: policy_from_bytes(buffer.getvalue(), "x"))
        if found is not None:
            policy_from_bytes(policy_bytes(found), "x")


def test_a_mutated_parameter_file_is_the_parameters_of_nodes_or_refused(tmp_path: Path):
    path = tmp_path / "parameters.yaml"
    document = {
        "/fusion": {"ros__parameters": {"seed": 1, "behaviors": ["a", "b"]}},
        "/a": {"ros__parameters": {"x": 0.5}},
    }
    for rng in dice(200):
        text = json.dumps(odd_copy(document, rng) if rng.random() < 0.9 else odd_value(rng)).encode()
        path.write_bytes(odd_bytes(text, rng, b"&a *a << !!int") if rng.random() < 0.5 else text)
        found = read_or_refused(lambda: launcher_parameters(path))
        assert found is None or all(isinstance(values, dict) for values in found.values())
