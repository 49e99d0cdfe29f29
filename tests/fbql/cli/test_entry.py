"""What an installation starts: `fbql`, and a program for each command that `ros2 run` finds."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

import pytest
from held_signals import until_interrupts_wait
from places import ROOT

START_S = 120
RECORDED = str(ROOT / "tests" / "data" / "recorded_match")
PROGRAMS = [
    each
    for found in distributions(name="fbql")  # several where `pip install .` has left its egg-info in the clone
    for each in found.entry_points.select(group="console_scripts")
]
COMMANDS = {each.name: each.value for each in PROGRAMS if each.module == "fbql.cli.entry"}


def test_every_program_of_the_package_is_started_there() -> None:
    others = {each.value for each in PROGRAMS if each.module.partition(".")[0] == "fbql"}
    assert others == set(COMMANDS.values()) == {"fbql.cli.entry:main", "fbql.cli.entry:executable"}


@pytest.mark.parametrize(
    ("program", "words", "code", "said"),
    [
        ("fbql", ("compare", RECORDED, "copy"), 1, "fbql compare: ended by SIGINT; nothing was compared"),
        ("compare", (RECORDED, "copy"), 1, "compare: ended by SIGINT; nothing was compared"),
        ("fbql", ("tree", "explain", "ball_seeking"), 130, "fbql tree: interrupted"),
        ("tree", ("explain", "ball_seeking"), 130, "tree: interrupted"),
    ],
)
def test_an_interrupt_while_it_is_loaded_waits_and_ends_it_without_a_traceback(
    tmp_path: Path, program: str, words: tuple[str, ...], code: int, said: str
) -> None:
    shutil.copytree(RECORDED, tmp_path / "copy")
    module, _, function = COMMANDS[program].partition(":")
    load = f"import sys; from {module} import {function}; sys.argv[0] = {program!r}; sys.exit({function}())"
    popen = subprocess.Popen(
        [sys.executable, "-c", load, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    until_interrupts_wait(popen)
    popen.send_signal(signal.SIGINT)
    stdout, stderr = popen.communicate(timeout=START_S)
    assert (popen.returncode, stdout, stderr) == (code, "", f"{said}\n")
