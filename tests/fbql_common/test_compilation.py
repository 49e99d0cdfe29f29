"""Compiled and interpreted kernels: the same bits, and a process that can't compile, or keep what it compiled, works too."""

from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from fbql_common.compilation import _compiled

LEARN = """
import hashlib, json, sys
import numpy as np
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.kernels import prepare
from fbql_fusion.core.learners import features
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from fbql.match.in_process import play

if "block" in sys.argv:
    sys.modules["numba"] = None
session = SoccerSession(FusionParameters(controller="fbql", seed=3, episodes=6, guided=2))
assert "numba" not in sys.modules or "block" in sys.argv, "imported before anything learns"
if "short" not in sys.argv:
    prepare()
behaviors = [Behavior(name, load_tree(shipped_trees() / f"{name}.json")) for name in session.behaviors]
play(session, WorldLoop(SimulationParameters(max_steps=500)), behaviors, lambda: True)
arrays = session.policy().arrays
assert "short" not in sys.argv or "numba" not in sys.modules, "a short training does not wait for it"
total = hashlib.sha256()
for name in sorted(arrays):
    total.update(arrays[name].tobytes())
print(json.dumps([features.tile_keys.is_compiled, session.digest, total.hexdigest()]))
"""


def learn(*arguments: str, **environment: str) -> list[object]:
    """Whether it was compiled, the digest of what was played, and the hash of what was learned."""
    words = [sys.executable, "-c", LEARN, *arguments]
    done = subprocess.run(
        words, env={**os.environ, **environment}, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def interpreted() -> list[object]:
    """What comes of it without compiling."""
    result = learn(FBQL_COMPILE="0")
    assert result[0] is False
    return result


def test_what_is_learned_compiled_has_the_bits_of_what_is_learned_interpreted(interpreted: list[object]) -> None:
    assert learn() == [True, *interpreted[1:]]


def test_a_short_training_does_not_load_numba(interpreted: list[object]) -> None:
    assert learn("short") == interpreted


def test_learning_works_without_numba(interpreted: list[object]) -> None:
    assert learn("block") == interpreted


def test_learning_works_where_no_place_can_be_written_to(interpreted: list[object], tmp_path: Path) -> None:
    """Whoever tests as root can write anywhere, so the places are names that can't be directories."""
    (tmp_path / "file").touch()
    (tmp_path / "sitecustomize.py").write_text(
        "import fbql_common.compilation as c\nc._PLACES = ('UserProvided',)\nc._LOCATORS = c.__name__ + '.UserProvided'\n"
    )
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    place = str(tmp_path / "file" / "cache")
    assert learn(PYTHONPATH=path, NUMBA_CACHE_DIR=place) == [True, *interpreted[1:]]


def test_a_damaged_cache_is_repaired_and_a_full_disk_costs_only_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    numba = pytest.importorskip("numba")
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "thrice.py").write_text("def thrice(x):\n    return 3.0 * x\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    thrice = importlib.import_module("thrice").thrice

    assert _compiled(numba, thrice)(2.0) == 6.0
    files = [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert {path.suffix for path in files} == {".nbi", ".nbc"}
    for path in files:
        path.write_bytes(b"")
    repaired = _compiled(numba, thrice)
    assert repaired(2.0) == 6.0
    assert not repaired.stats.cache_hits
    kept = _compiled(numba, thrice)
    assert kept(2.0) == 6.0
    assert kept.stats.cache_hits

    shutil.rmtree(tmp_path / "cache")
    full = _compiled(numba, thrice)
    shutil.rmtree(tmp_path / "cache")
    (tmp_path / "cache").touch()  # no directory can be made any more, by root neither
    assert full(2.0) == 6.0
