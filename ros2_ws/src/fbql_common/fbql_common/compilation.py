"""Compiles the kernels of the cores with Numba, and caches the result for the next process.

Numba is imported here and nowhere else, once enough has been learned from to make it pay. Without it, or with
FBQL_COMPILE=0, kernels stay interpreted: the results are the same, bit for bit, but take several times as long.

The cache is NUMBA_CACHE_DIR if that is set, else __pycache__ beside the source, else the user's cache directory
(~/.cache/numba). Where none of them can be written, each process compiles for itself. A damaged cache is emptied.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import sys
from contextlib import suppress
from functools import cache
from importlib import import_module
from time import monotonic
from types import FunctionType
from typing import Any

from fbql_common.core.kernels import KERNELS, Kernel

SLOW_S = 2.0
"""A compilation that takes longer is reported."""
_PLACES = ("UserProvided", "InTree", "UserWide")
_LOCATORS = ",".join(f"{__name__}.{name}" for name in _PLACES)


def compile_kernels() -> None:
    """Makes every kernel run compiled from its first call on. Does nothing without Numba."""
    if os.environ.get("FBQL_COMPILE") == "0":
        return
    try:
        numba = import_module("numba")
    except ImportError:
        return
    namespaces: dict[int, dict[str, Any]] = {}
    compiled: dict[Kernel[..., Any], Any] = {}
    for kernel in KERNELS:
        function = kernel.function
        own = namespaces.setdefault(id(function.__globals__), dict(function.__globals__))
        compiled[kernel] = _compiled(numba, _within(function, own))
    for names in namespaces.values():
        names.update({name: compiled[each] for name, each in names.items() if isinstance(each, Kernel)})
    for kernel, dispatcher in compiled.items():
        kernel.run, kernel.is_compiled = _FirstCall(kernel, dispatcher), True


class _FirstCall:
    """A compiled kernel until it has been called once: that call compiles it, or loads what an earlier process made."""

    spent_s = 0.0
    """Time that kernels took to compile in this process."""
    is_reported = False

    def __init__(self, kernel: Kernel[..., Any], dispatcher: Any) -> None:
        self._kernel = kernel
        self._dispatcher = dispatcher

    def __call__(self, *arguments: Any) -> Any:
        self._kernel.run = self._dispatcher
        begun_s = monotonic()
        result = self._dispatcher(*arguments)
        if not self._dispatcher.stats.cache_hits:
            _FirstCall.spent_s += monotonic() - begun_s
            if _FirstCall.spent_s > SLOW_S and not _FirstCall.is_reported:
                _FirstCall.is_reported = True
                print("compiling the learning code, which takes some seconds once", file=sys.stderr, flush=True)
        return result


def _within(function: Any, names: dict[str, Any]) -> Any:
    """The same function with other globals, in which kernels stand for their compiled form."""
    twin = FunctionType(function.__code__, names, function.__name__, function.__defaults__)
    twin.__qualname__, twin.__module__ = function.__qualname__, function.__module__
    return twin


def _compiled(numba: Any, function: Any) -> Any:
    """The function as Numba compiles it: kept on disk where a place can be written to."""
    config = numba.core.config
    before = getattr(config, "CACHE_LOCATOR_CLASSES", "")
    config.CACHE_LOCATOR_CLASSES = before or _LOCATORS
    try:
        dispatcher = numba.njit(cache=True, error_model="numpy")(function)
        _make_forgiving(dispatcher._cache)
        return dispatcher
    except RuntimeError:  # no place: neither beside the source nor in the user's cache
        return numba.njit(error_model="numpy")(function)
    finally:
        config.CACHE_LOCATOR_CLASSES = before


def _make_forgiving(kept: Any) -> None:
    """Keeps a failure of a function's cache from ending the learning: the function is then compiled once more."""
    load, save = kept.load_overload, kept.save_overload

    def load_if_sound(*arguments: Any) -> Any:
        try:
            return load(*arguments)
        except Exception:  # a damaged file: whatever unpickling it raises
            with suppress(OSError):
                kept.flush()
            return None

    def save_if_possible(*arguments: Any) -> None:
        with suppress(OSError):
            save(*arguments)

    kept.load_overload, kept.save_overload = load_if_sound, save_if_possible


@cache
def _sources_stamp() -> str:
    """A hash of every file that has kernels. Numba's own stamp covers only the file of a function, not those it calls."""
    files = sorted({inspect.getfile(kernel.function) for kernel in KERNELS})
    total = hashlib.sha256()
    for file in files:
        with open(file, "rb") as source:  # noqa: PTH123 - plain strings, as Numba has them
            total.update(source.read())
    return total.hexdigest()


def __getattr__(name: str) -> Any:
    """The places where Numba looks for compiled code. They exist only where Numba does, so they are made on demand."""
    if name not in _PLACES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    base = getattr(import_module("numba.core.caching"), f"{name}CacheLocator")
    made = type(name, (base,), {"get_source_stamp": lambda _self: _sources_stamp()})
    globals()[name] = made
    return made
