"""Kernels: pure functions of numbers and arrays that run compiled where that is possible, with the same bits.

A kernel is written once. Interpreted, it is plain NumPy; `fbql_common.compilation` replaces `run` of every kernel by its
compiled form when something is about to learn. Compiled code sums in NumPy's order, takes exponentials from the C library as
`math.exp` does, and never reorders or fuses arithmetic, so nothing that is learned depends on which of the two ran.

Inside a kernel, only other kernels, NumPy and `math` may be called.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

KERNELS: list[Kernel[..., Any]] = []
"""Every kernel, in the order of definition."""


class Kernel[**P, R]:
    """A function and the form of it that runs now."""

    def __init__(self, function: Callable[P, R], interpreted: Callable[P, R] | None) -> None:
        self.function = function
        """The function that is compiled."""
        self.interpreted = interpreted or function
        """The function that runs otherwise: the same, or NumPy's form of a loop that would be slow in Python."""
        self.run = self.interpreted
        self.is_compiled = False
        self.__doc__ = function.__doc__
        KERNELS.append(self)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        return self.run(*args, **kwargs)


def kernel[**P, R](function: Callable[P, R]) -> Kernel[P, R]:
    """Declares a kernel."""
    return Kernel(function, None)


def kernel_for[**P, R](interpreted: Callable[P, R]) -> Callable[[Callable[P, R]], Kernel[P, R]]:
    """Declares a kernel whose body is a loop; interpreted, the given NumPy expression takes its place."""
    return lambda function: Kernel(function, interpreted)


_compilers: list[Callable[[], None]] = []
"""Makes the kernels ready, once; set by `fbql_common`, which unlike a core may use clocks, files and compilers."""


def set_compiler(function: Callable[[], None]) -> None:
    """Determines what `prepare` calls, once."""
    _compilers[:] = [function]


def prepare() -> None:
    """Compiles the kernels, if that is possible and has not been done: something is about to learn."""
    while _compilers:
        _compilers.pop()()


def leave_interpreted() -> None:
    """Makes `prepare` do nothing from now on, for a process that must not pause for the seconds that compiling takes."""
    _compilers.clear()
