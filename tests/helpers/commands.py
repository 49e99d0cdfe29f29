"""Commands of ours in the test's own process: `replay(["RUN", "--verify"])` is `scripts/replay.py RUN --verify`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from fbql.cli.app import run

Main = Callable[[Sequence[str]], int]


def _command(name: str) -> Main:
    return partial(run, name, program=f"{name}.py")


compare = _command("compare")
demonstrate = _command("demonstrate")
experiment = _command("experiment")
induce = _command("induce")
make_trees = _command("make_trees")
recover = _command("recover")
replay = _command("replay")
report = _command("report")
tree = _command("tree")
tune = _command("tune")
