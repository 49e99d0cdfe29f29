"""Memory does not grow with the recording: whatever reads one from its first step to its last keeps none of it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from fbql_recording.run import open_run
from recorded_match import record_match

SHORT, LONG = 1, 7
"""Episodes."""
STEPS = 6_500
"""So many more the long recording has at least; it has 7,558 more.

A reader that keeps 6,500 steps takes 9 MiB as the bytes that were recorded, 15 MiB as messages, 27 MiB as `Step`s (measured
by keeping what `Run.step_data`, `McapFile.messages` and `Run.steps` yield).
"""
GROWTH_MIB = 8.0
"""How much more memory the long one may take: chunks and blocks are not all of one size (measured: at most 3 MiB)."""
COMMANDS = {
    "verify": ("replay", ["--verify"]),
    "what if": ("replay", ["--preset", "tuned", "--csv", "OUT", "--figure", "OUT.svg"]),
    "report": ("report", ["--out", "OUT"]),
    "recover": ("recover", ["--out", "OUT"]),
    "compare": ("compare", []),
}
PROGRAM = """
import sys
from fbql.cli.app import run
code = run({module!r}, {arguments!r})
with open("/proc/self/status") as status:
    (peak,) = [line.split()[1] for line in status if line.startswith("VmHWM")]
print(code, peak, file=sys.stderr)
"""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A short and a long one. Not to be changed."""
    place = tmp_path_factory.mktemp("recordings")
    options = {"controller": "subsumption", "preset": "paper", "max_steps": 4000}
    short, long = (record_match(place / f"{count}", episodes=count, **options) for count in (SHORT, LONG))
    assert open_run(long).counts["/world"] - open_run(short).counts["/world"] > STEPS
    return short, long


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the recording is compared with. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("other") / "run", seed=4)


def peak_mib(command: str, runs: list[Path], place: Path) -> float:
    """The most memory that a command takes in a process of its own."""
    place.mkdir()
    module, options = COMMANDS[command]
    arguments = [*map(str, runs), *(option.replace("OUT", str(place / "out")) for option in options)]
    program = PROGRAM.format(module=module, arguments=arguments)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    code, peak_kib = done.stderr.splitlines()[-1].split()
    assert code == "0", done.stderr
    return int(peak_kib) / 1024


@pytest.mark.parametrize("command", COMMANDS)
def test_memory_does_not_grow_with_the_recording(recordings, other, tmp_path, command):
    beside = [other] if command == "compare" else []
    short, long = (peak_mib(command, [run, *beside], tmp_path / run.name) for run in recordings)
    assert long - short < GROWTH_MIB
