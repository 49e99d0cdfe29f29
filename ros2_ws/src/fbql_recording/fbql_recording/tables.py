"""A run's steps and episodes as tables: pandas DataFrames, CSV and Parquet. Files are written block by block.

Columns are those of `core.columns`, flat: "weights" becomes "weights.NAME" for each behavior's name, and an observation
has the names of its tree's features. pandas and pyarrow are optional, and needed only for DataFrames and Parquet.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import fields
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.core.plain_json import json_from
from fbql_common.core.recording_names import TREES
from fbql_common.files import DISK_FAILURES, atomic_file, atomic_text, remedy

from fbql_recording.core.columns import Columns, blocks_of, flat
from fbql_recording.core.episodes import Episode
from fbql_recording.core.steps import Step
from fbql_recording.run import Run

FORMATS = (".csv", ".parquet")


def steps_frame(run: Run) -> Any:
    """The steps as a pandas DataFrame, one row per step. Raises BadInput without pandas, `Corrupt`."""
    pandas = _optional("pandas")
    columns = flat(run.arrays(), run.behaviors)
    return pandas.DataFrame(_named(columns, _features(run)))


def episodes_frame(run: Run) -> Any:
    """The episodes as a pandas DataFrame; values that the recording does not contain are <NA>. Raises BadInput,
    `Corrupt`."""
    return _optional("pandas").DataFrame(_episode_columns(run.episodes())).convert_dtypes()


def write_steps(run: Run, *paths: Path, progress: Callable[[int], None] = lambda _: None) -> int:
    """Writes the steps as tables, CSV or Parquet by each file's name, and reads them once; returns their number.

    In a CSV a float has enough digits to be read back exactly; NaN, which is "n/a", is an empty field.

    Args:
        progress: called now and then with the number of steps written; an exception from it ends the writing.

    Raises:
        BadInput: another kind of file, it can't be written, or Parquet without pyarrow; `Corrupt`.
        OSError: the disk is full or fails; the file, which is its `filename`, is left as it was.
    """
    features = _features(run)
    blocks = (_named(flat(block, run.behaviors), features) for block in _blocks(run))
    written = 0
    with _writers(paths) as write:
        for block in blocks:
            write(block)
            written += len(block["step"])
            progress(written)
    return written


def write_episodes(run: Run, *paths: Path, episodes: Sequence[Episode] | None = None) -> int:
    """Writes the episodes as tables, like `write_steps`; returns their number.

    Args:
        episodes: those of `run.episodes()`, if the caller has them already.
    """
    columns = _episode_columns(run.episodes() if episodes is None else episodes)
    with _writers(paths) as write:
        write(columns)
    return len(columns["index"])


def _blocks(run: Run) -> Iterator[Columns]:
    """The columns block by block; each has all columns, even if a behavior never answered in it."""
    steps = run.steps()
    first: list[Step] = []
    widths = [0] * len(run.behaviors)
    for step in steps:
        first.append(step)
        for index, output in enumerate(step.outputs):
            if output is not None:
                widths[index] = max(widths[index], len(output.observation))
        if all(widths):
            break
    for block in blocks_of(chain(first, steps), run.recorded):
        for name, width in zip(run.behaviors, widths, strict=True):
            key = f"observation.{name}"
            if key in block and block[key].shape[1] < width:
                block[key] = np.full((len(block[key]), width), np.nan)
        yield block


def _features(run: Run) -> dict[str, str]:
    """The name of each column of an observation, from the trees in the recording."""
    names: dict[str, str] = {}
    for name in run.behaviors:
        data = run.attachments.get(f"{TREES}{name}.json")
        try:
            features = [] if data is None else [str(feature["name"]) for feature in json_from(data)["features"]]
        except (ValueError, KeyError, TypeError):
            features = []  # no tree file: the columns keep their numbers
        names |= {f"observation.{name}.{index}": f"observation.{name}.{each}" for index, each in enumerate(features)}
    return names


def _named(columns: Columns, names: dict[str, str]) -> Columns:
    return {names.get(name, name): column for name, column in columns.items()}


def _episode_columns(episodes: Sequence[Episode]) -> dict[str, list[Any]]:
    names = [field.name for field in fields(Episode)]
    return {name.rstrip("_"): [getattr(episode, name) for episode in episodes] for name in names}


# Files


@contextmanager
def _writers(paths: Sequence[Path]) -> Iterator[Callable[[Any], None]]:
    """A function that writes a block of columns to every file."""
    with ExitStack() as files:
        writers = [files.enter_context(_writer(path)) for path in paths]

        def write(columns: Any) -> None:
            for each in writers:
                each(columns)

        yield write


@contextmanager
def _writer(path: Path) -> Iterator[Any]:
    """A function that writes a block of columns."""
    if path.suffix not in FORMATS:
        raise BadInput(f"{path}: write .csv or .parquet")
    try:
        if path.suffix == ".csv":
            with atomic_text(path) as file:
                yield _Csv(file).write
        else:
            with atomic_file(path) as file, _Parquet(file) as parquet:
                yield parquet.write
    except OSError as error:
        if error.errno in DISK_FAILURES:
            raise
        raise BadInput(f"{path}: can't be written ({error.strerror or error}); {remedy(error)}") from None


class _Csv:
    def __init__(self, file: Any) -> None:
        self._writer = csv.writer(file, lineterminator="\n")
        self._begun = False

    def write(self, columns: Columns | dict[str, list[Any]]) -> None:
        if not self._begun:
            self._begun = True
            self._writer.writerow(columns)
        values = [column.tolist() if isinstance(column, np.ndarray) else column for column in columns.values()]
        for row in zip(*values, strict=True):
            self._writer.writerow(["" if value is None or value != value else value for value in row])


class _Parquet:
    def __init__(self, file: BinaryIO) -> None:
        self._arrow = _optional("pyarrow")
        self._parquet = import_module("pyarrow.parquet")
        self._file = file
        self._writer: Any = None

    def __enter__(self) -> _Parquet:
        return self

    def __exit__(self, *_: object) -> None:
        if self._writer is not None:
            self._writer.close()

    def write(self, columns: Columns | dict[str, list[Any]]) -> None:
        table = self._arrow.table(dict(columns))
        if self._writer is None:
            self._writer = self._parquet.ParquetWriter(self._file, table.schema, compression="zstd")
        self._writer.write_table(table)


def _optional(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise BadInput(f"{name} is not installed; `pip install {name}`, or use run.arrays()") from None
