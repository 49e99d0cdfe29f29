"""Wraps a user-supplied controller, so that any error in it is reported in one line instead of a traceback."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from numbers import Real
from typing import Any, cast

import numpy as np
from fbql_common.core.errors import BadInput, in_one_line
from fbql_common.core.types import Phase
from numpy.typing import NDArray

from fbql_fusion.core.controllers.interface import Controller, JointState, Selection, Transition
from fbql_fusion.core.tasks.interface import Answers

_CONTROLS = ("begin_episode", "select")
_LEARNS = ("learn", "to_arrays", "load_arrays")


class Guarded:
    """Forwards every call. Raises BadInput for any exception of the controller, and for a selection that can't be used.

    Args:
        where: its name in errors: "controller 'mine'".
        file: its source, whose lines are named in errors; "" if it is not known.
        behaviors: n.
    """

    def __init__(self, controller: Any, where: str, file: str, behaviors: int) -> None:
        self._controller = controller
        self._where = where
        self._file = file
        self._behaviors = behaviors

    def begin_episode(self, phase: Phase) -> None:
        """See `Controller`."""
        self._call("begin_episode", phase)

    def select(self, moment: Any, joint_state: JointState, answers: Answers) -> Selection:
        """See `Controller`."""
        selection = self._call("select", moment, joint_state, answers)
        wrong = _why_unusable(selection, self._behaviors)
        if wrong:
            raise BadInput(f"{self._where}: 'select' returns {wrong}")
        weights, driver, q, learned = selection
        return (
            tuple([float(x) for x in weights]),
            int(driver),
            tuple([float(x) for x in q]),
            tuple([float(x) for x in learned]),
        )

    def _call(self, method: str, *arguments: Any) -> Any:
        return guarded_call(getattr(self._controller, method), self._where, self._file, *arguments)


class GuardedLearner(Guarded):
    """The same for a controller that learns."""

    def __init__(self, controller: Any, where: str, file: str, behaviors: int, kind: str) -> None:
        super().__init__(controller, where, file, behaviors)
        self.kind = kind

    def learn(self, transition: Transition) -> None:
        """See `Learner`."""
        self._call("learn", transition)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """See `Learner`."""
        arrays = self._call("to_arrays")
        if wrong := _why_no_arrays(arrays):
            raise BadInput(f"{self._where}: 'to_arrays' gives {wrong}")
        return dict(arrays)

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """See `Learner`."""
        self._call("load_arrays", arrays)


def guard(controller: Any, name: str, file: str, behaviors: int) -> Controller:
    """A guarded controller, which is a `Learner` if the given one has all of a learner's methods.

    Raises BadInput where a method is missing.
    """
    where = f"controller '{name}'"
    learns = any(hasattr(controller, method) for method in _LEARNS)
    missing = [method for method in (*_CONTROLS, *(_LEARNS if learns else ())) if not hasattr(controller, method)]
    if missing:
        also = f"; one that learns has {', '.join(_LEARNS)}" if missing[0] in _LEARNS else ""
        raise BadInput(f"{where}: a {type(controller).__name__} has no method '{missing[0]}'{also}")
    if learns:
        return GuardedLearner(controller, where, file, behaviors, str(getattr(controller, "kind", name)))
    return Guarded(controller, where, file, behaviors)


def guarded_call(function: Callable[..., Any], where: str, file: str, *arguments: Any) -> Any:
    """Calls a user's function. Turns anything that it raises into a BadInput of one line."""
    try:
        return function(*arguments)
    except BadInput:
        raise
    except Exception as error:  # whatever a user's code raises
        raise BadInput(f"{where}: {in_one_line(error, file)}") from None


def _why_unusable(selection: Any, n: int) -> str:
    """What is wrong with a selection, in words; "" if nothing is."""
    if not isinstance(selection, tuple | list) or len(cast("Sequence[Any]", selection)) != 4:
        return f"a {_kind(selection)}; expected (weights, driver, q, learned weights)"
    weights, driver, q, learned = cast("Sequence[Any]", selection)
    if not isinstance(driver, int | np.integer) or not -1 <= driver < n:
        return f"driver {driver!r}; expected the index of a behavior, or -1 for a blend by the weights"
    for name, values, lengths in (("weights", weights, (n,)), ("q", q, (0, n)), ("learned weights", learned, (0, n))):
        try:
            numbers = [isinstance(x, Real) and isfinite(x) for x in values]
        except TypeError:
            return f"{name} that are a {_kind(values)}"
        except OverflowError:  # a whole number beyond the largest float
            numbers = [False]
        if len(numbers) not in lengths or not all(numbers):
            none = " or none" if 0 in lengths else ""
            return f"{name} {values!r}; expected {n} finite numbers{none}"
    return ""


def _why_no_arrays(arrays: Any) -> str:
    """What is wrong with the result of `to_arrays`, in words; "" if nothing is."""
    if not isinstance(arrays, Mapping):
        return f"a {_kind(arrays)}; expected a dict of name -> array"
    for name, array in cast("Mapping[Any, Any]", arrays).items():
        if not isinstance(name, str):
            return f"a {_kind(name)} as a name; expected a text"
        if not isinstance(array, np.ndarray):
            return f"'{name}' as a {_kind(array)}; expected an array of numbers"
        dtype = cast("NDArray[Any]", array).dtype
        if dtype.kind not in "iufb":
            return f"'{name}' as an array of {dtype}; expected an array of numbers"
    return ""


def _kind(value: Any) -> str:
    return type(value).__name__
