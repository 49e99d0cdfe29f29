"""The argument parser of every command."""

from __future__ import annotations

import argparse
from typing import NoReturn

from fbql.cli.exit_codes import BAD_INPUT


class Parser(argparse.ArgumentParser):
    """Reports a usage error in one line and exits with 2."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message} (see --help)\n")


class Help(argparse.ArgumentDefaultsHelpFormatter):
    """Shows each option's default, except where the option's own text does."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        default = action.default
        return action.help if default is None or default is False or default == [] else super()._get_help_string(action)
