"""Hostile inputs made of sound ones, and what every reader owes to each: the right result, or one line.

The suite tries a few; FBQL_FUZZ_INPUTS=5000 makes each fuzzing test try that many, FBQL_FUZZ_SEED begins elsewhere.
"""

from __future__ import annotations

import json
import os
import random
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from time import monotonic
from types import FrameType
from typing import Any

from fbql_common.core.errors import BadInput

SEED = int(os.environ.get("FBQL_FUZZ_SEED", "0"))
LONGEST_S = 20.0
"""No input may take longer, on a busy machine too [s]."""
LONGEST_COMMAND_S = 90.0
"""The same for a whole command, which may draw figures [s]."""
_NUMBERS = (0, 1, 2, 4, 7, 127, 128, 255, 256, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)
_WORDS = (
    "",
    "x",
    "\n",
    "\x1b[31m",
    "\u202e",
    "a/b",
    "../x",
    "/proc/version",
    "~",
    "null",
    "NaN",
    "x" * 10_000,
    "é",
    "\0",
)
"""What is no name of a file elsewhere that can be written: some are given as names of outputs, perhaps by root."""


def dice(usual: int) -> Iterator[random.Random]:
    """A generator of random numbers for each input; how many inputs a test tries in the suite."""
    for number in range(int(os.environ.get("FBQL_FUZZ_INPUTS", usual))):
        yield random.Random(f"{SEED}:{number}")


def odd_value(rng: random.Random) -> Any:
    """A value of JSON or YAML where another one is expected."""
    return rng.choice(
        (
            None, True, False, [], {}, [[]], [None], {"": None}, 0.5, -0.0, 1e308, -1e308, 1e-308,
            rng.choice(_NUMBERS), -rng.choice(_NUMBERS), 10**30, rng.choice(_WORDS), [rng.choice(_NUMBERS)] * 4,
            {"nanoseconds": -1}, _nested(rng.choice((5, 50, 100))),
        )
    )  # fmt: skip


def odd_number(rng: random.Random) -> int:
    """A whole number at the edge of a width, or below zero."""
    return rng.choice(_NUMBERS) * rng.choice((1, 1, -1))


def odd_word(rng: random.Random) -> str:
    """A text that is a name of nothing."""
    return rng.choice(_WORDS)


def odd_variable(rng: random.Random) -> str:
    """A value that an environment variable can have: any bytes but a null."""
    how = rng.randrange(5)
    if how == 0:
        data = rng.randbytes(rng.randrange(20))
    elif how == 1:
        data = str(rng.choice((odd_number(rng), "9" * 5000, "1e999", "-0", "0x10"))).encode()
    elif how == 2:
        data = rng.choice(
            (b"/", b"/proc/self", b"/dev/null", b"/proc/version", b"~", b".", b"relative", b"/x" * 2000, b"*")
        )
    elif how == 3:
        data = rng.choice(
            (b"LOCALHOST", b"SUBNET", b"true", b"1", b"0", b"C", b"en_US.UTF-8", b"dumb", b"rmw_cyclonedds_cpp")
        )
    else:
        data = odd_word(rng).encode()
    return os.fsdecode(data.replace(b"\0", b""))


def _nested(depth: int) -> Any:
    value: Any = 0
    for _ in range(depth):
        value = [value]
    return value


def odd_copy(value: Any, rng: random.Random) -> Any:
    """A copy of a JSON or YAML value with one to four places changed: replaced, removed, doubled, swapped, renamed."""
    root = [deepcopy(value)]
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        places = list(_places(root))
        container, key = rng.choice(places)
        how = rng.randrange(6)
        if how == 0 and container is not root:
            del container[key]
        elif how == 1 and isinstance(container, list) and container is not root:
            container.insert(key, deepcopy(container[key]))
        elif how == 2:
            other, place = rng.choice(places)
            container[key] = deepcopy(other[place])
        elif how == 3 and isinstance(container, dict):
            container[str(rng.choice(_WORDS))] = container.pop(key)
        elif how == 4 and isinstance(container[key], int | float) and not isinstance(container[key], bool):
            container[key] = rng.choice((-container[key], container[key] + 1, container[key] * 1.5, 1e300, -1))
        else:
            container[key] = odd_value(rng)
    return root[0]


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every place of a value: the list or dict that holds it, and its index or name there."""
    pending = [value]
    while pending:
        container = pending.pop()
        for key in range(len(container)) if isinstance(container, list) else list(container):
            yield container, key
            if isinstance(container[key], list | dict):
                pending.append(container[key])


def odd_bytes(data: bytes, rng: random.Random, other: bytes = b"") -> bytes:
    """The data with one to four changes: bits, bytes, numbers, parts removed, doubled, moved, taken from `other`."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        at, end = sorted(rng.randrange(len(data) + 1) for _ in range(2))
        end = min(end, at + rng.choice((1, 2, 8, 64, 4096, 10**9)))
        how = rng.randrange(8)
        if how == 0 and at < len(data):
            data = data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
        elif how == 1:
            data = data[:at] + rng.randbytes(end - at if end - at < 5000 else 8) + data[end:]
        elif how == 2:
            size = rng.choice((1, 2, 4, 8))
            number = rng.choice(_NUMBERS) & (2 ** (8 * size) - 1)
            data = data[:at] + number.to_bytes(size, rng.choice(("little", "big"))) + data[at + size :]
        elif how == 3:
            data = data[:at] + data[end:]
        elif how == 4:
            data = data[:end] + data[at:]
        elif how == 5:
            data = data[:at]
        elif how == 6:
            source = other or data
            begin = rng.randrange(len(source) + 1)
            data = data[:at] + source[begin : begin + end - at] + data[end:]
        else:
            data = data[:at] + rng.choice(_WORDS).encode() + data[end:]
    return data


def read_or_refused[T](read: Callable[[], T]) -> T | None:
    """What `read` gives; None where it refuses its input in one line. Raises whatever else it raises."""
    begun_s = monotonic()
    try:
        return read()
    except BadInput as error:
        assert str(error).isprintable() and str(error)
        return None
    finally:
        assert monotonic() - begun_s < LONGEST_S


class TooLong(BaseException):
    """Something took longer than it may; a TimeoutError would be taken for a file that can't be read."""


@contextmanager
def bounded(longest_s: float = LONGEST_S) -> Iterator[None]:
    """Raises TooLong where something inside of it takes longer than that."""

    def late(_number: int, _frame: FrameType | None) -> None:
        raise TooLong(f"took longer than {longest_s} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, longest_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def finite_json(text: str) -> dict[str, Any]:
    """The one object in a JSON text, which has nothing in it that is not JSON."""

    def refuse(name: str) -> Any:
        raise AssertionError(f"{name} is not JSON")

    found = json.loads(text, parse_constant=refuse)
    assert isinstance(found, dict)
    return found
