"""What a study is: independent tasks, each a deterministic function of plain values, and a table of their results."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from fbql.statistics.tables import Row, Table
from fbql_common.core.errors import BadInput

Parameters = dict[str, Any]
"""Plain JSON values: all that a task depends on."""
Result = dict[str, Any]
"""Plain JSON values."""

MOST_SEEDS = 1000
"""Of a study whose seeds have no other bound: more than anybody waits for."""
MOST_PLAYED = 1_000_000
"""And the same of what is played on each."""
MEASURED = "measured"
"""The one key of a result that may differ from run to run: what was measured with a clock."""


class Task(NamedTuple):
    """One piece of a study, done by one worker."""

    key: str
    """Its name within the study, fit for a file name."""
    parameters: Parameters


class Study(Protocol):
    """A module that is a study."""

    DESCRIPTION: str
    COLUMNS: Mapping[str, str]
    """Each column that `table` can have -> what it says, with its unit."""
    CAPTIONS: Mapping[str, str]
    """File of a figure, without its ending -> its caption."""

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Adds the study's own options."""
        ...

    def tasks(self, options: argparse.Namespace) -> list[Task]:
        """The tasks, in order. They depend on the options alone. Raises BadInput for options that can't be used."""
        ...

    def run(self, parameters: Parameters) -> Result:
        """Does one task.

        The same parameters give the same result, bit for bit, in whichever process; all but what stands under MEASURED.
        """
        ...

    def table(self, results: Mapping[str, Result]) -> list[Row]:
        """The study's table from the results of its tasks by key; tasks that failed are missing, so rows show their n."""
        ...

    def words(self, rows: Sequence[Row]) -> dict[str, Table]:
        """What `table` gave, as people read it: title -> table. This is what the pages of docs/ show."""
        ...

    def figures(self, results: Mapping[str, Result], directory: Path) -> list[Path]:
        """Draws the study's figures; gives the files. A study without figures gives none."""
        ...


def check_counts(options: argparse.Namespace, **most: int) -> None:
    """Raises BadInput where an option of these names is not from 1 to so many."""
    for name, limit in most.items():
        count = getattr(options, name)
        if not 1 <= count <= limit:
            raise BadInput(f"--{name.replace('_', '-')} is {count}; it must be 1 to {limit}")


STUDIES: dict[str, str] = {
    "ablation": "fbql_studies.ablation",
    "ladder": "fbql_studies.ladder",
    "leaf_tuning": "fbql_studies.leaf_tuning",
    "objectives": "fbql_studies.objectives",
    "paper": "fbql_studies.paper",
    "peers": "fbql_studies.peers_study",
    "scaling": "fbql_studies.scaling",
    "sensitivity": "fbql_studies.sensitivity",
    "trees": "fbql_studies.trees",
}
"""Name of a study -> the module that is it."""


def study_of(name: str) -> Study:
    """The study of a name in STUDIES."""
    return import_module(STUDIES[name])  # type: ignore[return-value]  # a module is its study
