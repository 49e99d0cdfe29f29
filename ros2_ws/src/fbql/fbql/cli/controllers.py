"""The option --controller of the commands: a controller of this package, an installed one, or a user's file."""

from __future__ import annotations

import argparse
from typing import Any

from fbql_fusion.controller_loading import installed
from fbql_fusion.core.controllers.parameters import CONTROLLERS


def add_controller_option(parser: argparse._ActionsContainer, help_text: str, **how: Any) -> None:
    """Adds --controller NAME, whose value is for `fbql_fusion.controller_loading.resolve_controller`.

    Args:
        how: of argparse, such as action="append".
    """
    names = ", ".join([*CONTROLLERS, *sorted(installed())])
    parser.add_argument(
        "--controller", metavar="NAME", help=f"{help_text}: {names}; or FILE.py:NAME for your own", **how
    )
