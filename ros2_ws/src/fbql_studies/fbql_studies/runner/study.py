"""The interface of a study: independent tasks, each a deterministic function of plain values, and a table of their results.

A study is a folder of this package; its module `study` implements the protocol Study.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from fbql.statistics.tables import Row, Table
from fbql_common.core.errors import BadInput

Parameters = dict[str, Any]
"""Plain JSON values: everything that a task depends on."""
Result = dict[str, Any]
"""Plain JSON values."""

MOST_SEEDS = 1000
"""The default limit for the number of seeds: more than anybody would wait for."""
MOST_PLAYED = 1_000_000
"""The same for the number of episodes played with each."""
MEASURED = "measured"
"""The only key of a result that may differ between runs: times measured with a clock."""


class StudyTask(NamedTuple):
    """One piece of a study, done by one worker."""

    key: str
    """Its name within the study, fit for a file name."""
    parameters: Parameters


class Study(Protocol):
    """A module that is a study."""

    DESCRIPTION: str
    COLUMNS: Mapping[str, str]
    """Each column that `table` can have -> its meaning, with its unit."""
    CAPTIONS: Mapping[str, str]
    """File of a figure, without its ending -> its caption."""

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Adds the study's own options."""
        ...

    def tasks(self, options: argparse.Namespace) -> list[StudyTask]:
        """The tasks, in order; they depend on the options alone. Raises BadInput for options that can't be used."""
        ...

    def run(self, parameters: Parameters) -> Result:
        """Runs one task.

        The same parameters give the same result, bit for bit, in any process, except for the values under MEASURED.
        """
        ...

    def table(self, results: Mapping[str, Result]) -> list[Row]:
        """The study's table from the results of its tasks by key; tasks that failed are missing, so rows show their n."""
        ...

    def words(self, rows: Sequence[Row]) -> dict[str, Table]:
        """The rows of `table` as people read them: title -> table. The pages of docs/results show these."""
        ...

    def figures(self, results: Mapping[str, Result], directory: Path) -> list[Path]:
        """Draws the study's figures and returns the files, `curves.json` included; empty if it has no figures."""
        ...


def add_count(parser: argparse.ArgumentParser, option: str, default: int, what: str) -> None:
    """Adds an option that takes a number."""
    parser.add_argument(option, type=int, default=default, metavar="N", help=f"{what} ({default})")


def check_counts(options: argparse.Namespace, **most: int) -> None:
    """Raises BadInput if an option of these names is not from 1 to its limit."""
    for name, limit in most.items():
        count = getattr(options, name)
        if not 1 <= count <= limit:
            raise BadInput(f"--{name.replace('_', '-')} is {count}; it must be 1 to {limit}")


STUDIES: dict[str, str] = {
    name: f"fbql_studies.{name}.study"
    for name in (
        "ablation",
        "blending",
        "imagination",
        "ladder",
        "law",
        "leaf_tuning",
        "limits",
        "mux",
        "objectives",
        "paper",
        "peers",
        "scaling",
        "sensitivity",
        "trees",
    )
}
"""Name of a study -> its module. A new study is a folder with a `study.py`, and its name here."""


def study_of(name: str) -> Study:
    """The study of a name in STUDIES."""
    return import_module(STUDIES[name])  # type: ignore[return-value]  # a module is its study
