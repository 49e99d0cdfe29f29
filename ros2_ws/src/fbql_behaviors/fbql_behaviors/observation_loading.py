"""Finds the observation of a behavior: in this package, in a Python file that the user names, or in an installed package.

A file is named as FILE.py:NAME, where NAME is an `Observation` at the file's top level and also the behavior's name;
FILE.py alone will do when it defines only one. An installed package declares an entry point:

    entry_points={"fbql_behaviors.observations": ["escaping = my_package.escaping:escaping"]}

Only code that the user named or installed is run. A tree file names a behavior, never code.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, pi
from numbers import Real
from types import FunctionType
from typing import Any, NamedTuple, cast

from fbql_common.core.errors import BadInput, in_one_line
from fbql_common.core.types import World
from fbql_common.own_code import load_installed, load_module, split_source

from fbql_behaviors.core.observation import OBSERVATIONS, Observation, observation_of

GROUP = "fbql_behaviors.observations"
_POSES = (-0.5, 0.4, 0.3, 0.1, 0.2, 0.4, -0.1, 0.05, -0.02, -0.5, 0.9, -pi / 2)
_SAMPLE = World(0, 0, 0, *_POSES, *[False] * 6)
"""An ordinary world state, on which every loaded observation is tried."""


class Loaded(NamedTuple):
    """An observation from a file."""

    behavior: str
    observation: Observation
    source: str
    """FILE.py:NAME with an absolute path: where any other process finds it."""


def find_observation(behavior: str, source: str = "") -> Observation:
    """The observation of a behavior: from the file `source` if given, else this package's, else an installed one.

    Raises BadInput: there is none, or it cannot be used.
    """
    if source:
        loaded = load_observation(source)
        if loaded.behavior != behavior:
            raise BadInput(f"{source} is the observation of behavior '{loaded.behavior}', not of '{behavior}'")
        return loaded.observation
    if behavior not in OBSERVATIONS:
        installed = _installed(behavior)
        if installed is not None:
            return installed
    try:
        return observation_of(behavior)
    except BadInput as error:
        raise BadInput(
            f"{error}; your own behavior needs its observation: FILE.py:{behavior}, or an installed package's"
        ) from None


def load_observation(source: str) -> Loaded:
    """The observation that FILE.py:NAME, or FILE.py with only one, defines. Raises BadInput with file and reason."""
    path, name = split_source(source)
    module = load_module(path, "an observation")
    defined = {key: value for key, value in vars(module).items() if isinstance(value, Observation)}
    if not name and len(defined) == 1:
        name = next(iter(defined))
    if name not in defined:
        there = f"it has: {', '.join(sorted(defined))}" if defined else "it has none"
        raise BadInput(f"{path}: which Observation? write {path.name}:NAME; {there}")
    return Loaded(name, _check(name, defined[name], str(path)), f"{path}:{name}")


def _installed(behavior: str) -> Observation | None:
    installed = load_installed(GROUP, behavior, "behavior")
    if installed is None:
        return None
    loaded, where = installed
    if not isinstance(loaded, Observation):
        raise BadInput(f"{where}: is a {type(loaded).__name__}, expected an Observation")
    return _check(behavior, loaded, where)


def _check(behavior: str, observation: Observation, where: str) -> Observation:
    """The observation, once its parts are known to be valid. Raises BadInput."""
    names = [feature.name for feature in observation.features]
    if not names or len(set(names)) < len(names):
        raise BadInput(f"{where}: behavior '{behavior}' needs features, each with its own name")
    for feature in observation.features:
        if not feature.low < feature.high:
            raise BadInput(f"{where}: feature '{feature.name}': low {feature.low} must be below high {feature.high}")
    if observation.instructor is not None and not callable(observation.instructor):
        raise BadInput(f"{where}: 'instructor' of behavior '{behavior}' is not a function")
    _try_sense(observation.sense, names, f"{where}: 'sense' of behavior '{behavior}'")
    return observation


def _try_sense(sense: Any, names: Sequence[str], where: str) -> None:
    """Raises BadInput unless `sense` returns a finite number for each name."""
    if not callable(sense):
        raise BadInput(f"{where} is not a function")
    try:
        observed: Any = sense(_SAMPLE)
    except Exception as error:  # whatever it raises
        file = sense.__code__.co_filename if isinstance(sense, FunctionType) else ""
        raise BadInput(f"{where}: {in_one_line(error, file)}") from None
    expected = f"expected {len(names)}: {', '.join(names)}"
    if not isinstance(observed, tuple | list):
        raise BadInput(f"{where} returns a {type(observed).__name__} instead of a tuple; {expected}")
    values = cast("Sequence[Any]", observed)
    if len(values) != len(names):
        raise BadInput(f"{where} returns {len(values)} value{'' if len(values) == 1 else 's'}; {expected}")
    for name, value in zip(names, values, strict=True):
        if isinstance(value, bool) or not isinstance(value, Real):
            raise BadInput(f"{where} returns a {type(value).__name__} as '{name}', expected a number")
        if not isfinite(value):
            raise BadInput(f"{where} returns {value} as '{name}', expected a finite number")
