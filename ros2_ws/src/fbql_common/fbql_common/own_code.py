"""Loads the user's code: a Python file given as FILE.py:NAME, or an entry point of an installed package.

Only code that the user named or installed is run, never code that a recording, a tree or a policy names.
"""

from __future__ import annotations

import hashlib
import sys
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

from fbql_common.core.errors import BadInput, in_one_line
from fbql_common.files import unreadable


def split_source(source: str) -> tuple[Path, str]:
    """The absolute path of FILE.py:NAME, and NAME; "" where it is FILE.py alone."""
    place, colon, name = source.rpartition(":")
    if not colon or source.endswith(".py"):
        place, name = source, ""
    return Path(place).absolute(), name


def content_hash(source: str) -> str:
    """The first 12 digits of the SHA-256 of the file that FILE.py:NAME names. Raises BadInput if it can't be read."""
    return hashlib.sha256(_content(split_source(source)[0])).hexdigest()[:12]


def load_module(path: Path, what: str) -> ModuleType:
    """The file as a module, run once per process and content. Raises BadInput with the file, the line and the reason.

    Args:
        what: the object expected in it, in words, such as "an observation".
    """
    if path.suffix != ".py":
        raise BadInput(f"{path}: {what} is a Python file; write FILE.py:NAME")
    content = _content(path)
    name = f"fbql_own_{hashlib.sha256(str(path).encode() + content).hexdigest()[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module
    try:
        # An import would run bytecode that is cached by size and second: of a file edited twice in a second, the old one.
        exec(compile(content, str(path), "exec", dont_inherit=True), vars(module))
    except Exception as error:  # whatever the file raises
        del sys.modules[name]
        raise BadInput(f"{path}: {in_one_line(error, str(path))}") from None
    return module


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise unreadable(path, error) from None


def load_installed(group: str, name: str, what: str) -> tuple[object, str] | None:
    """The object of an entry point, and a description of its place; None if no package declares it.

    Args:
        what: the kind of thing it belongs to, such as "behavior".

    Raises:
        BadInput: two packages declare it, or it cannot be loaded.
    """
    entries = {entry.value: entry for entry in entry_points(group=group, name=name)}
    if not entries:
        return None
    values = sorted(entries)
    if len(values) > 1:
        raise BadInput(f"{what} '{name}' is installed twice: {', '.join(values)}; remove one of the packages")
    where = f"entry point {group}: {name} = {values[0]}"
    try:
        return entries[values[0]].load(), where
    except Exception as error:  # whatever a foreign module raises
        raise BadInput(f"{where}: {in_one_line(error)}") from None
