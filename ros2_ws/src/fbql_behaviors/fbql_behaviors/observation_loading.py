"""Where the observation of a behavior comes from: this package, a Python file that the user names, or an installed package.

A file is named as FILE.py:NAME, and NAME, an `Observation` at the file's top level, is the behavior's name; FILE.py alone
will do when it has one. An installed package declares it as an entry point of the group `fbql_behaviors.observations`:

    entry_points={"fbql_behaviors.observations": ["escaping = my_package.escaping:escaping"]}

Only code that the user named or installed is run. A tree file names a behavior, never code.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Sequence
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from math import isfinite, pi
from numbers import Real
from pathlib import Path
from traceback import extract_tb
from types import FunctionType, ModuleType
from typing import Any, NamedTuple, cast

from fbql_common.core.errors import BadInput
from fbql_common.core.types import World

from fbql_behaviors.core.observation import OBSERVATIONS, Observation, observation_of

GROUP = "fbql_behaviors.observations"
_SAMPLE = World(
    stamp_ns=0,
    episode=0,
    step=0,
    robot_x_m=-0.5,
    robot_y_m=0.4,
    robot_yaw_rad=0.3,
    robot_speed_m_s=0.1,
    robot_yaw_rate_rad_s=0.2,
    ball_x_m=0.4,
    ball_y_m=-0.1,
    ball_vx_m_s=0.05,
    ball_vy_m_s=-0.02,
    wall_x_m=-0.5,
    wall_y_m=0.9,
    wall_yaw_rad=-pi / 2,
    goal=False,
    own_goal=False,
    collision_begun=False,
    collision=False,
    terminated=False,
    truncated=False,
)
"""An ordinary world state, on which an observation is tried before anything depends on it."""


class Loaded(NamedTuple):
    """An observation from a file."""

    behavior: str
    observation: Observation
    source: str
    """FILE.py:NAME with an absolute path: where any other process finds it."""


def find_observation(behavior: str, source: str = "") -> Observation:
    """The observation of a behavior: of the file `source` if one is given, else this package's, else an installed one.

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
            f"{error}; a behavior of your own takes its observation: FILE.py:{behavior}, or an installed package's"
        ) from None


def load_observation(source: str) -> Loaded:
    """The observation that FILE.py:NAME, or FILE.py with one only, defines. Raises BadInput with file and reason."""
    place, colon, name = source.rpartition(":")
    if not colon or source.endswith(".py"):
        place, name = source, ""
    path = Path(place).absolute()
    module = _module(path)
    defined = {key: value for key, value in vars(module).items() if isinstance(value, Observation)}
    if not name and len(defined) == 1:
        name = next(iter(defined))
    if name not in defined:
        there = f"it has: {', '.join(sorted(defined))}" if defined else "it has none"
        raise BadInput(f"{path}: which Observation? write {path.name}:NAME; {there}")
    return Loaded(name, _sound(name, defined[name], str(path)), f"{path}:{name}")


def _installed(behavior: str) -> Observation | None:
    found = sorted(entry_points(group=GROUP, name=behavior), key=lambda entry: entry.value)
    if not found:
        return None
    values = sorted({entry.value for entry in found})
    if len(values) > 1:
        raise BadInput(f"behavior '{behavior}' is installed twice: {', '.join(values)}; remove one of the packages")
    where = f"entry point {GROUP}: {behavior} = {values[0]}"
    try:
        loaded: object = found[0].load()
    except Exception as error:  # whatever a foreign module raises
        raise BadInput(f"{where}: {_told(error)}") from None
    if not isinstance(loaded, Observation):
        raise BadInput(f"{where}: is a {type(loaded).__name__}, expected an Observation")
    return _sound(behavior, loaded, where)


def _module(path: Path) -> ModuleType:
    """The file as a module, run once in a process."""
    name = f"fbql_observation_{hashlib.sha256(str(path).encode()).hexdigest()[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise BadInput(f"{path}: an observation is a Python file; write FILE.py:NAME")
    module = module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever the file raises
        del sys.modules[name]
        reason = f"cannot be read ({error.strerror})" if isinstance(error, OSError) else _told(error, str(path))
        raise BadInput(f"{path}: {reason}") from None
    return module


def _told(error: Exception, file: str = "") -> str:
    """An error of foreign code in one line, with the last line of its file that took part, if any did."""
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__} in line {error.lineno}: {error.msg}"
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == file]
    place = f" in line {lines[-1]}" if lines else ""
    return f"{type(error).__name__}{place}: {' '.join(str(error).split())}"


def _sound(behavior: str, observation: Observation, where: str) -> Observation:
    """An observation whose parts are what they should be."""
    names = [feature.name for feature in observation.features]
    if not names or len(set(names)) < len(names):
        raise BadInput(f"{where}: behavior '{behavior}' needs features, each with a name of its own")
    for feature in observation.features:
        if not feature.low < feature.high:
            raise BadInput(f"{where}: feature '{feature.name}': low {feature.low} must be below high {feature.high}")
    if observation.instructor is not None and not callable(observation.instructor):
        raise BadInput(f"{where}: 'instructor' of behavior '{behavior}' is not a function")
    _try_sense(observation.sense, names, f"{where}: 'sense' of behavior '{behavior}'")
    return observation


def _try_sense(sense: Any, names: Sequence[str], where: str) -> None:
    """Raises BadInput where it does not give a finite number for each of the names."""
    if not callable(sense):
        raise BadInput(f"{where} is not a function")
    try:
        found: Any = sense(_SAMPLE)
    except Exception as error:  # whatever it raises
        file = sense.__code__.co_filename if isinstance(sense, FunctionType) else ""
        raise BadInput(f"{where}: {_told(error, file)}") from None
    expected = f"expected {len(names)}: {', '.join(names)}"
    if not isinstance(found, tuple | list):
        raise BadInput(f"{where} gives a {type(found).__name__} instead of a tuple; {expected}")
    values = cast("Sequence[Any]", found)
    if len(values) != len(names):
        raise BadInput(f"{where} gives {len(values)} value{'' if len(values) == 1 else 's'}; {expected}")
    for name, value in zip(names, values, strict=True):
        if isinstance(value, bool) or not isinstance(value, Real):
            raise BadInput(f"{where} gives a {type(value).__name__} as '{name}', expected a number")
        if not isfinite(value):
            raise BadInput(f"{where} gives {value} as '{name}', expected a finite number")
