"""Commands of ours in the test's own process: `replay(["RUN", "--verify"])` is `scripts/replay.py RUN --verify`."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence

from fbql.cli.app import run
from fbql.cli.interrupts import NUMBERS

Main = Callable[[Sequence[str]], int]


def _command(name: str) -> Main:
    def main(words: Sequence[str]) -> int:
        before = {number: signal.getsignal(number) for number in NUMBERS}
        try:
            return run(name, words, f"{name}.py")
        except SystemExit as end:  # the parser's, of a usage error
            assert isinstance(end.code, int)
            return end.code
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    return main


bringup = _command("bringup")
compare = _command("compare")
demonstrate = _command("demonstrate")
experiment = _command("experiment")
induce = _command("induce")
lesson = _command("lesson")
make_trees = _command("make_trees")
recover = _command("recover")
replay = _command("replay")
report = _command("report")
sweep = _command("sweep")
train = _command("train")
tree = _command("tree")
tune = _command("tune")
