"""Mutation testing of the pure cores: random small changes of their source, and the share of them that tests notice.

Every mutant is written into a private copy of the sources and tests, never into the checkout, and the tests that execute
its line run against it until the first one fails: tests of the cores, and those of other packages that call a core in
their own process. A mutant that uses up its time counts as noticed, one whose line no test executes does not. The
results are appended to a file of JSON lines; the same command resumes where it stopped, and --again retries the
survivors.

A survivor is a missing test, or equivalent: no test could notice it, or it only changes how fast something is. Those
known to be equivalent are listed with the reason in measure/equivalent_mutants.json and are not counted.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import monotonic
from typing import Any

from fbql.cli.app import reporting
from fbql.cli.output import print_result, set_program
from fbql.cli.parser import Parser
from fbql.statistics.inference import wilson_interval
from fbql_common.core.errors import BadInput

from measure.covering import ROOT, SOURCES, Suite, private_suite
from measure.mutation import Mutant, mutants_of
from measure.rows import read_rows, row_appender

PROGRAM = "mutants.py"
CORES = ("fbql_sim", "fbql_behaviors", "fbql_fusion", "fbql_common", "fbql_recording")
TESTS = (
    "*/core/**/test_*.py",
    "fbql_behaviors/test_*storage.py",
    "fbql_behaviors/test_observation_loading.py",
    "fbql_behaviors/test_shipped_trees.py",
    "fbql_common/test_cdr_primitives.py",
    "fbql_common/test_declare.py",
    "fbql_common/test_wire.py",
    "fbql_fusion/test_controller_loading.py",
    "fbql_fusion/test_policy_storage.py",
    "project/test_docs_parameters.py",
)
"""Modules whose tests count: those of the cores, and those of other packages that call a core in their own process."""
BUDGET_S = 60.0
COVERAGE = "mutants-coverage.jsonl"
"""File beside the results with what the tests execute."""
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.json")

Key = tuple[str, str, int, str, str, int]


@dataclass(frozen=True)
class Candidate:
    """A mutant, and the file of the checkout that it changes."""

    core: str
    file: str
    text: str
    """The line that the change begins in."""
    occurrence: int
    """Number among the mutants that differ only in their line number."""
    mutant: Mutant

    @property
    def key(self) -> Key:
        """Identifies it in the results, even after lines above it were added."""
        mutant = self.mutant
        return self.file, self.text, mutant.column, mutant.before, mutant.after, self.occurrence


def main(argv: Sequence[str]) -> int:
    """Runs the study. Returns the exit code."""
    set_program(PROGRAM)
    parser = Parser(prog=PROGRAM, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100, metavar="N", help="mutants to try (100)")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="seed of the choice of mutants (1)")
    parser.add_argument("--core", choices=CORES, help="only mutants of this core (all)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="results (runs/mutants-sSEED.jsonl)")
    parser.add_argument("--again", action="store_true", help="retry the survivors with the current tests")
    parser.add_argument(
        "--budget",
        type=float,
        default=BUDGET_S,
        metavar="S",
        help=f"CPU time for the tests of one mutant [s] ({BUDGET_S:g})",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args(list(argv))
    return reporting(lambda: _run(arguments))


def _run(arguments: argparse.Namespace) -> int:
    if arguments.runs < 1:
        raise BadInput(f"--runs is {arguments.runs}; it must be 1 or more")
    out = arguments.out or ROOT / "runs" / f"mutants-s{arguments.seed}.jsonl"
    chosen = sample([arguments.core] if arguments.core else CORES, arguments.seed)[: arguments.runs]
    result = summary(study(chosen, out, again=arguments.again, budget_s=arguments.budget), known_equivalents())
    print_result(json.dumps(result) if arguments.json else as_text(result))
    return 0


def sample(cores: Sequence[str], seed: int) -> list[Candidate]:
    """Every mutant of the cores in a random order, which stays the same for the others when mutants are added or
    removed."""
    return sorted(candidates(cores), key=lambda each: sha256(f"{seed} {each.key}".encode()).digest())


def candidates(cores: Iterable[str]) -> list[Candidate]:
    """Every mutant of the cores."""
    found: list[Candidate] = []
    for core in cores:
        for path in sorted((ROOT / SOURCES / core / core / "core").rglob("*.py")):
            source, seen = path.read_text(), Counter[Any]()
            rows = source.splitlines()
            for mutant in mutants_of(source):
                text = rows[mutant.line - 1].strip()
                place = text, mutant.column, mutant.before, mutant.after
                found.append(Candidate(core, str(path.relative_to(ROOT)), text, seen[place], mutant))
                seen[place] += 1
    return found


def study(
    chosen: Sequence[Candidate], out: Path, *, again: bool = False, budget_s: float = BUDGET_S
) -> list[dict[str, Any]]:
    """The results for the chosen mutants. Those not yet in the file, and with `again` the survivors, are tried and
    appended."""
    done = {_key(row): row for row in read_rows(out)}
    todo = [each for each in chosen if each.key not in done or (again and not done[each.key]["noticed"])]
    if todo:
        with private_suite() as suite, row_appender(out) as append:
            suite.run_unchanged(test_modules(), out.with_name(COVERAGE), _tell)
            for number, each in enumerate(todo, start=1):
                row = tried(suite, each, budget_s)
                done[each.key] = row
                append(row)
                word = "noticed" if row["noticed"] else "SURVIVED"
                _tell(f"{number}/{len(todo)} {word} {_words(row)} ({row['seconds']} s)")
    return [done[each.key] for each in chosen]


def test_modules() -> list[str]:
    """The test modules that count."""
    return [str(path.relative_to(ROOT)) for name in TESTS for path in sorted((ROOT / "tests").glob(name))]


def tried(suite: Suite, candidate: Candidate, budget_s: float) -> dict[str, Any]:
    """The result of one mutant."""
    begun_s, mutant = monotonic(), candidate.mutant
    verdict = suite.try_change(candidate.file, mutant.lines, mutant.source, budget_s)
    return {
        "core": candidate.core,
        "file": candidate.file,
        "line": mutant.line,
        "column": mutant.column,
        "text": candidate.text,
        "occurrence": candidate.occurrence,
        "kind": mutant.kind,
        "before": mutant.before,
        "after": mutant.after,
        "tests": verdict.tests,
        "noticed": verdict.noticed,
        "by": verdict.by,
        "seconds": round(monotonic() - begun_s, 1),
    }


def _key(row: Mapping[str, Any]) -> Key:
    return row["file"], row["text"], row["column"], row["before"], row["after"], row["occurrence"]


def known_equivalents() -> dict[Key, str]:
    """The reasons."""
    rows = json.loads(EQUIVALENT.read_text()) if EQUIVALENT.exists() else []
    return {_key(row): row["why"] for row in rows}


def summary(rows: Sequence[Mapping[str, Any]], equivalent: Mapping[Key, str]) -> dict[str, Any]:
    """Kill rates by core, and the survivors that are not known to be equivalent."""
    cores: dict[str, dict[str, Any]] = {}
    for core in [*CORES, "all"]:
        own = [row for row in rows if core in (row["core"], "all")]
        killed = sum(row["noticed"] for row in own)
        spared = sum(_is_equivalent(row, equivalent) for row in own)
        if counted := len(own) - spared:
            rate, low, high = wilson_interval(killed, counted)
            cores[core] = {
                "tried": len(own),
                "killed": killed,
                "equivalent": spared,
                "survived": counted - killed,
                "rate": rate,
                "low": low,
                "high": high,
            }
    survivors = [_words(row) for row in rows if not row["noticed"] and not _is_equivalent(row, equivalent)]
    return {"cores": cores, "survivors": survivors}


def _is_equivalent(row: Mapping[str, Any], equivalent: Mapping[Key, str]) -> bool:
    return not row["noticed"] and _key(row) in equivalent


def as_text(result: Mapping[str, Any]) -> str:
    """The result as a table and a list."""
    lines = [f"{'core':15} tried killed equivalent survived  rate without equivalents (95 % interval)"]
    lines += [
        f"{core:15} {row['tried']:5} {row['killed']:6} {row['equivalent']:10} {row['survived']:8}  "
        f"{row['rate']:.3f} ({row['low']:.3f} to {row['high']:.3f})"
        for core, row in result["cores"].items()
    ]
    lines += [f"survived: {words}" for words in result["survivors"]]
    return "\n".join(lines)


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _words(row: Mapping[str, Any]) -> str:
    before, after = (" ".join(row[name].split()) for name in ("before", "after"))
    return f"{row['file']}:{row['line']}: {before[:90]} -> {after[:90]}"
