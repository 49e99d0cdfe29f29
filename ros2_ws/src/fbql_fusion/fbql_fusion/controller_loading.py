"""Where a controller comes from: this package, a Python file that the user names, or an installed package.

A file is named as FILE.py:NAME. NAME, at the file's top level, is a class or function (parameters, generator) that
returns a controller, and is also the controller's name; FILE.py alone is enough if it has only one class with a method
`select`. Its own parameters are those of its attribute `Parameters`, see `core.registry`. An installed package declares
the same as an entry point of the group `fbql.controllers`:

    entry_points={"fbql.controllers": ["greedy = my_package.greedy:Greedy"]}
"""

from __future__ import annotations

from importlib.metadata import entry_points
from types import ModuleType
from typing import NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.own_code import load_installed, load_module, split_source

from fbql_fusion.core.controllers.parameters import CONTROLLERS
from fbql_fusion.core.registry import register_controller

GROUP = "fbql.controllers"


class KnownController(NamedTuple):
    """A controller that can be created by its name."""

    name: str
    source: str = ""
    """FILE.py:NAME with an absolute path, by which any other process finds it; "" if it does not come from a file."""


def is_file(source: str) -> bool:
    """Whether this names a user's file and not a known or installed controller."""
    return source.endswith(".py") or ".py:" in source


def resolve_controller(source: str) -> KnownController:
    """Registers a controller: FILE.py:NAME, or the name of one that is known or installed.

    Raises BadInput, with the file and the reason, if there is none or it can't be used.
    """
    if is_file(source):
        return _from_file(source)
    if not register_installed(source):
        known = ", ".join([*CONTROLLERS, *sorted(installed())])
        raise BadInput(f"unknown controller '{source}'; choose one of: {known}; or FILE.py:NAME for your own")
    return KnownController(source)


def register_installed(name: str) -> bool:
    """Registers a controller of an installed package. Returns whether a controller of this name is known now."""
    if name in CONTROLLERS:
        return True
    found = load_installed(GROUP, name, "controller")
    if found is None:
        return False
    factory, where = found
    _register(name, factory, where)
    return True


def installed() -> set[str]:
    """The names of the controllers that installed packages declare. None of them is loaded."""
    return {entry.name for entry in entry_points(group=GROUP)} - set(CONTROLLERS)


def _from_file(source: str) -> KnownController:
    path, name = split_source(source)
    module = load_module(path, "a controller")
    if not name:
        classes = [key for key, value in vars(module).items() if _is_controller(value, module)]
        if len(classes) != 1:
            there = f"it has: {', '.join(sorted(classes))}" if classes else "it has no class with a method 'select'"
            raise BadInput(f"{path}: which controller? write {path.name}:NAME; {there}")
        name = classes[0]
    if not hasattr(module, name):
        raise BadInput(f"{path}: there is no '{name}' in it")
    _register(name, getattr(module, name), str(path))
    return KnownController(name, f"{path}:{name}")


def _is_controller(value: object, module: ModuleType) -> bool:
    return isinstance(value, type) and value.__module__ == module.__name__ and hasattr(value, "select")


def _register(name: str, factory: object, where: str) -> None:
    try:
        register_controller(name, factory)  # pyright: ignore[reportArgumentType] - it looks at what it is given
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
