"""A number taken out of a message by the path of its field.

    linear.x    pose.pose.orientation.yaw    data[3]    ranges[0:72].min    ranges[350:360,0:10].mean

A path names fields, with [i] for an element of an array and [a:b] for a slice, as in Python; several slices, divided by
commas, count as one array. It ends at a number; at min, mean or max of an array; or at yaw of a quaternion [rad]. Elements
that are not a number (NaN) are left out of min, mean and max; the mean of elements among which are both infinities is NaN.

It works on any object with the fields of a ROS message, whichever library made it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from math import atan2, fsum, inf, isnan, nan
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from fbql_common.core.errors import BadInput

_PART = re.compile(r"([A-Za-z]\w*)((?:\[[^\[\]]*\])*)\Z")
_SLICE = re.compile(r"\s*(-?\d{1,9})?\s*:\s*(-?\d{1,9})?\s*\Z")
_INDEX = re.compile(r"\s*-?\d{1,9}\s*\Z")
_QUATERNION = ("x", "y", "z", "w")

Slice = tuple[int | None, int | None]


def _mean(values: list[float]) -> float:
    try:
        return fsum(values) / len(values)
    except ValueError:  # of both infinities
        return nan
    except OverflowError:
        return 2.0 * fsum(x / 2.0 / len(values) for x in values)


REDUCTIONS: dict[str, Callable[[list[float]], float]] = {"min": min, "mean": _mean, "max": max}
YAW = "yaw"


class FieldPath(NamedTuple):
    """A path, parsed."""

    text: str
    steps: tuple[str | int | tuple[Slice, ...], ...]
    """Names of fields, elements, and slices."""
    ending: str
    """min, mean, max or yaw; empty: the number itself."""

    def read(self, message: Any, inf_as: float | None = None) -> float:
        """The number in a message; `inf_as` takes the place of +Inf.

        Raises BadInput: the message has no such field, element or slice, or it is not a number.
        """
        value = message
        for step in self.steps:
            if isinstance(step, str):
                value = _field(value, step, self.text)
            elif isinstance(step, int):
                value = _element(value, step, self.text)
            else:
                value = _slices(_array(value, self.text), step, self.text)
        if self.ending == YAW:
            return _yaw(value, self.text)
        if self.ending:
            found = [inf_as if inf_as is not None and x == inf else x for x in _array(value, self.text).tolist()]
            numbers = [x for x in found if not isnan(x)]
            return REDUCTIONS[self.ending](numbers) if numbers else nan
        if not isinstance(value, bool | int | float | np.number | np.bool_):
            raise BadInput(f"field '{self.text}' is {_kind(value)}, not a number{_hint(value)}")
        number = float(cast("float", value))
        return inf_as if inf_as is not None and number == inf else number


def parse_path(text: str) -> FieldPath:
    """The path that a text writes. Raises BadInput."""
    steps: list[str | int | tuple[Slice, ...]] = []
    parts = text.split(".")
    last = parts[-1] if len(parts) > 1 else ""
    is_sliced = len(parts) > 1 and parts[-2].endswith("]") and ":" in parts[-2].rpartition("[")[2]
    # `.min` of an array that is not sliced is told from a field of that name by the message alone: it must be sliced.
    ending = last if (last in REDUCTIONS and is_sliced) or last == YAW else ""
    for part in parts[: -1 if ending else None]:
        match = _PART.match(part)
        if match is None:
            raise BadInput(f"'{text}' is not the path of a field, such as linear.x or ranges[0:72].min")
        steps.append(match[1])
        steps += [_subscript(inner, text) for inner in match[2][1:-1].split("][")] if match[2] else []
    if any(isinstance(step, tuple) for step in steps[:-1]) or (
        isinstance(steps[-1], tuple) and ending not in REDUCTIONS
    ):
        raise BadInput(f"'{text}': a slice must be followed by .min, .mean or .max, and nothing else")
    return FieldPath(text, tuple(steps), ending)


def _subscript(inner: str, text: str) -> int | tuple[Slice, ...]:
    if _INDEX.match(inner):
        return int(inner)
    slices: list[Slice] = []
    for part in inner.split(","):
        match = _SLICE.match(part)
        if match is None:
            raise BadInput(f"'{text}': [{inner}] is neither an element, such as [3], nor a slice, such as [0:72]")
        slices.append((int(match[1]) if match[1] else None, int(match[2]) if match[2] else None))
    return tuple(slices)


def fields_of(value: Any) -> tuple[str, ...]:
    """The names of a message's fields; none for what is not a message."""
    declared: Any = getattr(value, "_fields_and_field_types", None) or getattr(value, "__dataclass_fields__", ())
    return tuple(str(name) for name in declared if not str(name).startswith("_"))


def _field(value: Any, name: str, text: str) -> Any:
    there = fields_of(value)
    if name not in there:
        listed = f"it has {', '.join(there)}" if there else f"that is {_kind(value)}"
        raise BadInput(f"field '{text}': there is no '{name}'; {listed}")
    return getattr(value, name)


def _array(value: Any, text: str) -> npt.NDArray[np.float64]:
    if isinstance(value, str) or not hasattr(value, "__len__") or not hasattr(value, "__getitem__"):
        raise BadInput(f"field '{text}': that is {_kind(value)}, not an array")
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise BadInput(f"field '{text}': the array does not hold numbers") from None
    if array.ndim != 1:
        raise BadInput(f"field '{text}': the array does not hold numbers")
    return array


def _element(value: Any, index: int, text: str) -> Any:
    if isinstance(value, str) or not hasattr(value, "__len__") or not hasattr(value, "__getitem__"):
        raise BadInput(f"field '{text}': that is {_kind(value)}, not an array")
    sequence: Sequence[Any] = value
    if not -len(sequence) <= index < len(sequence):
        raise BadInput(f"field '{text}': [{index}] is out of range, the array has {len(sequence)} elements")
    return sequence[index]


def _slices(array: npt.NDArray[np.float64], slices: tuple[Slice, ...], text: str) -> npt.NDArray[np.float64]:
    n = len(array)
    parts: list[npt.NDArray[np.float64]] = []
    for low, high in slices:
        begin = 0 if low is None else low + n * (low < 0)
        end = n if high is None else high + n * (high < 0)
        if not 0 <= begin < end <= n:
            shown = f"{'' if low is None else low}:{'' if high is None else high}"
            raise BadInput(f"field '{text}': slice [{shown}] is empty or out of range, the array has {n} elements")
        parts.append(array[begin:end])
    return np.concatenate(parts)


def _yaw(value: Any, text: str) -> float:
    if not set(_QUATERNION) <= set(fields_of(value)):
        raise BadInput(f"field '{text}': yaw needs a quaternion, but that is {_kind(value)}")
    x, y, z, w = (float(getattr(value, name)) for name in _QUATERNION)
    if x == y == z == w == 0.0:
        return nan
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def _kind(value: Any) -> str:
    if isinstance(value, str):
        return "a text"
    return "an array" if hasattr(value, "__len__") else f"a {type(value).__name__.rpartition('__')[2]}"


def _hint(value: Any) -> str:
    there = fields_of(value)
    if there:
        return f"; it has {', '.join(there)}"
    if isinstance(value, str) or not hasattr(value, "__len__"):
        return ""
    return f"; take an element, such as [0], or .min, .mean or .max of a slice, such as [0:{len(value)}].min"
