"""Mutation testing of the pure cores: random small changes of their source, and the share of them that tests notice.

Every mutant is written into a private copy of the sources and tests, never into the checkout, and that core's own tests run
against it until the first one fails: those of the changed file first. A mutant that runs out of time counts as noticed. The
results are appended to a file of JSON lines; the same command again continues where it stopped.

A survivor is a missing test, or equivalent: no test could notice it. Those known to be equivalent are listed with the
reason in measure/equivalent_mutants.json and are not counted.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any

from fbql.cli.app import reporting
from fbql.cli.output import print_result, set_program
from fbql.cli.parser import Parser
from fbql.statistics.inference import wilson_interval
from fbql_common.core.errors import BadInput

from measure.mutation import Mutant, mutants_of

PROGRAM = "mutants.py"
ROOT = Path(__file__).resolve().parents[2]
SOURCES = Path("ros2_ws") / "src"
CORES = ("fbql_sim", "fbql_behaviors", "fbql_fusion", "fbql_common", "fbql_recording")
LEFT_OUT = {
    "fbql_fusion": "from_goals_alone or stands_still or goes_on_bit_for_bit or needs_no_reward or it_learns_with_and",
    "fbql_behaviors": "c_of_any_random_tree",
    "fbql_sim": "another_process",
}
"""Tests that take long, by words of their names."""
LIMIT_S = 300.0
"""Time that the tests of one mutant may take."""
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.json")
FAILED, INTERRUPTED = 1, 2
"""Exit codes of pytest: a test failed; it could not collect the tests, such as by an error of the import."""


@dataclass(frozen=True)
class Candidate:
    """A mutant, and the file of the checkout that it changes."""

    core: str
    file: str
    mutant: Mutant

    @property
    def key(self) -> tuple[str, int, int, str, str]:
        """What identifies it in the results."""
        mutant = self.mutant
        return self.file, mutant.line, mutant.column, mutant.before, mutant.after


def main(argv: Sequence[str]) -> int:
    """Runs the study. Returns the exit code."""
    set_program(PROGRAM)
    parser = Parser(prog=PROGRAM, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100, metavar="N", help="mutants to try (100)")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="seed of the choice of mutants (1)")
    parser.add_argument("--core", choices=CORES, help="only mutants of this core (all)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="results (runs/mutants-sSEED.jsonl)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args(list(argv))
    return reporting(lambda: _run(arguments))


def _run(arguments: argparse.Namespace) -> int:
    if arguments.runs < 1:
        raise BadInput(f"--runs is {arguments.runs}; it must be 1 or more")
    out = arguments.out or ROOT / "runs" / f"mutants-s{arguments.seed}.jsonl"
    chosen = candidates([arguments.core] if arguments.core else CORES)
    random.Random(arguments.seed).shuffle(chosen)
    result = summary(study(chosen[: arguments.runs], out), known_equivalents())
    print_result(json.dumps(result) if arguments.json else as_text(result))
    return 0


def candidates(cores: Sequence[str]) -> list[Candidate]:
    """Every mutant of the cores."""
    return [
        Candidate(core, str(path.relative_to(ROOT)), mutant)
        for core in cores
        for path in sorted((ROOT / SOURCES / core / core / "core").rglob("*.py"))
        for mutant in mutants_of(path.read_text())
    ]


def study(chosen: Sequence[Candidate], out: Path) -> list[dict[str, Any]]:
    """The results for the chosen mutants; those that are not in the file yet are run, and appended to it."""
    done = {_key(row): row for row in _read(out)}
    todo = [each for each in chosen if each.key not in done]
    if todo:
        out.parent.mkdir(parents=True, exist_ok=True)
        with private_copy() as place, out.open("a") as file:
            if out.stat().st_size and not out.read_bytes().endswith(b"\n"):
                file.write("\n")  # the last line was cut off
            for core in sorted({each.core for each in todo}):
                _check_unchanged(place, core)
            for number, each in enumerate(todo, start=1):
                row = tried(place, each)
                done[each.key] = row
                file.write(json.dumps(row) + "\n")
                file.flush()
                word = "noticed" if row["noticed"] else "SURVIVED"
                print(f"{number}/{len(todo)} {word} {_words(row)} ({row['seconds']} s)", file=sys.stderr, flush=True)
    return [done[each.key] for each in chosen]


@contextmanager
def private_copy() -> Iterator[Path]:
    """A copy of sources and tests, with links to everything else."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as name:
        place = Path(name)
        ignored = shutil.ignore_patterns("__pycache__", ".hypothesis", "node_modules")
        shutil.copytree(ROOT / SOURCES, place / SOURCES, ignore=ignored)
        shutil.copytree(ROOT / "tests", place / "tests", ignore=ignored)
        for path in ROOT.iterdir():
            if path.name not in ("ros2_ws", "tests", "runs", ".git", ".hypothesis"):
                (place / path.name).symlink_to(path)
        yield place


def _check_unchanged(place: Path, core: str) -> None:
    """Raises BadInput unless the tests pass without a change, and are those of the copy."""
    code, words, _ = run_tests(place, core, [])
    if code != 0:
        raise BadInput(f"the tests of {core} do not pass without a change either: {words}")
    where = subprocess.run(
        [sys.executable, "-c", f"import {core}.core; print({core}.core.__file__)"],
        env=environment(place), cwd=place, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    if not Path(where.strip()).is_relative_to(place):
        raise BadInput(f"{core} is imported from {where.strip()}, not from the private copy")


def tried(place: Path, candidate: Candidate) -> dict[str, Any]:
    """The result of one mutant."""
    path, begun_s = place / candidate.file, monotonic()
    original = path.read_text()
    path.write_text(candidate.mutant.source)
    try:
        code, words, in_time = run_tests(place, candidate.core, _own_tests(candidate))
    finally:
        path.write_text(original)
    if in_time and code not in (0, FAILED, INTERRUPTED):
        raise BadInput(f"{candidate.file}:{candidate.mutant.line}: pytest ended with {code}: {words}")
    mutant = candidate.mutant
    return {
        "core": candidate.core,
        "file": candidate.file,
        "line": mutant.line,
        "column": mutant.column,
        "kind": mutant.kind,
        "before": mutant.before,
        "after": mutant.after,
        "noticed": code != 0,
        "by": words if in_time else f"more than {LIMIT_S:g} s",
        "seconds": round(monotonic() - begun_s, 1),
    }


def _own_tests(candidate: Candidate) -> list[str]:
    """The tests of the changed file: `core/a/b.py` has `core/a/test_b.py`, or those of the folder `core/a`."""
    path = Path(*Path(candidate.file).parts[3:])
    mirrored = Path("tests") / candidate.core / path.parent / f"test_{path.name}"
    found = [mirrored] if (ROOT / mirrored).exists() else []
    folder = mirrored.parent
    if folder.name != "core" and (ROOT / folder).is_dir():
        found.append(folder)
    return [str(each) for each in found]


def run_tests(place: Path, core: str, first: Sequence[str]) -> tuple[int, str, bool]:
    """pytest's exit code, its line about the failure, and whether it ended in time."""
    shutil.rmtree(place / ".hypothesis", ignore_errors=True)
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:randomly"]
    command += ["--hypothesis-seed=0", "--tb=no", *first, f"tests/{core}/core"]
    if core in LEFT_OUT:
        command += ["-k", f"not ({LEFT_OUT[core]})"]
    with subprocess.Popen(
        command, cwd=place, env=environment(place), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True,
    ) as process:  # fmt: skip
        try:
            text, _ = process.communicate(timeout=LIMIT_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return process.returncode, "", False
    lines = [line for line in text.splitlines() if line.startswith(("FAILED", "ERROR"))] or text.splitlines()[-1:]
    return process.returncode, lines[0][:200] if lines else "", True


def environment(place: Path) -> dict[str, str]:
    """Variables with which the packages of the copy are imported."""
    paths = [str(path) for path in sorted((place / SOURCES).iterdir()) if (path / "setup.py").exists()]
    paths += [os.environ["PYTHONPATH"]] if os.environ.get("PYTHONPATH") else []
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1"}


def _read(out: Path) -> list[dict[str, Any]]:
    """The rows of a results file; a last line that was cut off is left out."""
    rows: list[dict[str, Any]] = []
    if out.exists():
        for line in out.read_text().splitlines():
            try:
                rows.append(json.loads(line))
            except ValueError:
                continue
    return rows


def _key(row: Mapping[str, Any]) -> tuple[str, int, int, str, str]:
    return row["file"], row["line"], row["column"], row["before"], row["after"]


def known_equivalents() -> dict[tuple[str, str, str], str]:
    """The reason by file, text before and text after the change."""
    rows = json.loads(EQUIVALENT.read_text()) if EQUIVALENT.exists() else []
    return {(row["file"], row["before"], row["after"]): row["why"] for row in rows}


def summary(rows: Sequence[Mapping[str, Any]], equivalent: Mapping[tuple[str, str, str], str]) -> dict[str, Any]:
    """Kill rates by core, and the survivors that are not known to be equivalent."""
    counted = [row for row in rows if (row["file"], row["before"], row["after"]) not in equivalent]
    cores: dict[str, dict[str, Any]] = {}
    for core in [*CORES, "all"]:
        own = [row for row in counted if core in (row["core"], "all")]
        if own:
            killed = sum(row["noticed"] for row in own)
            rate, low, high = wilson_interval(killed, len(own))
            cores[core] = {"mutants": len(own), "killed": killed, "rate": rate, "low": low, "high": high}
    survivors = [_words(row) for row in counted if not row["noticed"]]
    return {"cores": cores, "equivalent": len(rows) - len(counted), "survivors": survivors}


def as_text(result: Mapping[str, Any]) -> str:
    """The result as a table and a list."""
    lines = [
        f"{core:15} {row['killed']:4} of {row['mutants']:4} killed, {row['rate']:.3f} ({row['low']:.3f} to {row['high']:.3f})"
        for core, row in result["cores"].items()
    ]
    lines.append(f"{result['equivalent']} more are known to be equivalent")
    lines += [f"survived: {words}" for words in result["survivors"]]
    return "\n".join(lines)


def _words(row: Mapping[str, Any]) -> str:
    before, after = (" ".join(row[name].split()) for name in ("before", "after"))
    return f"{row['file']}:{row['line']}: {before[:90]} -> {after[:90]}"
