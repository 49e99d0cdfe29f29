"""The option --observation of the commands: behaviors that no package of the project has."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Iterator, Mapping, Sequence

from fbql_behaviors.core.observation import OBSERVATIONS, register
from fbql_behaviors.observation_loading import find_observation, load_observation
from fbql_common.core.errors import BadInput


def add_observation_option(parser: argparse._ActionsContainer) -> None:
    """Adds --observation FILE.py:NAME, which may be repeated."""
    parser.add_argument(
        "--observation",
        action="append",
        default=[],
        metavar="FILE.py:NAME",
        help="what your own behavior senses: the Observation of this name in a Python file; NAME is the behavior's name",
    )


def register_observations(sources: Sequence[str], behaviors: Sequence[str] = ()) -> dict[str, str]:
    """Registers the observations of these files, and those that installed packages provide for these behaviors.

    Returns the file (FILE.py:NAME, absolute) of each behavior that came from one. Raises BadInput.
    """
    found: dict[str, str] = {}
    for source in sources:
        loaded = load_observation(source)
        if found.get(loaded.behavior, loaded.source) != loaded.source:
            raise BadInput(
                f"behavior '{loaded.behavior}' has two observations, {found[loaded.behavior]} and {source}; name one"
            )
        register(loaded.behavior, loaded.observation)
        found[loaded.behavior] = loaded.source
    for behavior in behaviors:
        if behavior not in OBSERVATIONS:
            register(behavior, find_observation(behavior))
    return found


def unused_observations(found: Mapping[str, str], behaviors: Collection[str]) -> Iterator[str]:
    """A line for each file that `register_observations` returned for a behavior other than these."""
    for behavior, source in found.items():
        if behavior not in behaviors:
            yield f"--observation has no effect: {source} is for behavior '{behavior}', which has no tree here"
