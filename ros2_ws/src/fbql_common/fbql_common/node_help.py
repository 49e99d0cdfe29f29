"""The --help of a node: what it does, and its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fbql_common.core.parameters import defaults_of, limits_of, types_of


def asks_for_help(words: Sequence[str]) -> bool:
    """Whether a command line asks for help, outside its arguments for ROS."""
    own = words[: words.index("--ros-args")] if "--ros-args" in words else words
    return not {"-h", "--help"}.isdisjoint(own)


def help_text(program: str, about: str, declarations: Sequence[type[Any]]) -> str:
    """The whole text.

    Args:
        about: the docstring of the node's module.
        declarations: of its parameters.
    """
    lines = [
        f"usage: {program} [-h] [--ros-args -p NAME:=VALUE ... -r FROM:=TO ... --params-file FILE]",
        "",
        about.strip(),
    ]
    lines += ["", "parameters (docs/parameters.md has them as tables):"]
    for declaration in declarations:
        kinds, defaults = types_of(declaration), defaults_of(declaration)
        for name, limits in limits_of(declaration).items():
            kind = getattr(kinds[name], "__name__", "") if kinds[name] in (bool, int, float, str) else "list of strings"
            default = "required" if limits.required else f"default {_shown(defaults[name])}"
            unit = f" [{limits.unit}]" if limits.unit else ""
            choices = f"; one of: {', '.join(limits.choices)}" if limits.choices else ""
            lines.append(f"  {name} ({kind}, {default}){unit}: {limits.description}{choices}")
    return "\n".join(lines)


def _shown(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ",".join(map(str, value)) or "none"
    return str(value).lower() if isinstance(value, bool) else repr(value) if value == "" else str(value)
