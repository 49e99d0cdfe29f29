"""The argument parser of every command, and the options that several of them share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import limits_of, types_of
from fbql_common.core.text import one_line
from fbql_common.files import check_output

from fbql.cli.exit_codes import BAD_INPUT
from fbql.cli.output import print_result, write

RUN_HELP = "run directory, ROS 2 bag (MCAP), or .mcap file"


class Parser(argparse.ArgumentParser):
    """Takes no abbreviated option, reports a usage error in one line and exits with 2."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)

    def print_help(self, file: Any = None) -> None:
        if file is None:
            print_result(self.format_help().removesuffix("\n"))
        else:
            super().print_help(file)

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{one_line(f'{self.prog}: {message} (see --help)')}\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        write(file or sys.stderr, message)


class Help(argparse.ArgumentDefaultsHelpFormatter):
    """Shows each option's default, except where the option's own text does."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        default = action.default
        return action.help if default is None or default is False or default == [] else super()._get_help_string(action)


def output_path(text: str) -> Path:
    """The type of an option that names an output."""
    try:
        return check_output(Path(text))
    except BadInput as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def without_effect(arguments: argparse.Namespace, names: Iterable[str], why: str) -> Iterator[str]:
    """A line for each of these options that was given although it has no effect.

    Args:
        names: as attributes of `arguments`. None and False mean that an option was not given.
    """
    for name in names:
        value = getattr(arguments, name)
        if value is not None and value is not False and value != []:
            yield f"--{name.replace('_', '-')} has no effect {why}"


def add_json_option(parser: argparse._ActionsContainer) -> None:
    """Adds --json."""
    parser.add_argument("--json", action="store_true", help="print one JSON object, and nothing else, on stdout")


def add_recording_options(parser: argparse._ActionsContainer) -> None:
    """Adds --allow-incomplete and --skip-corrupt, for recordings that were cut off or damaged."""
    parser.add_argument(
        "--allow-incomplete", action="store_true", help="exit with 0 instead of 3 if a recording is incomplete"
    )
    parser.add_argument("--skip-corrupt", action="store_true", help="skip damaged chunks instead of stopping there")


def add_parameter_options(
    parser: Parser,
    declaration: type[Any],
    title: str,
    description: str,
    extra: dict[str, tuple[str, str]] | None = None,
) -> None:
    """Adds an option for each parameter of a declaration (see `fbql_common.core.parameters`); without one it is None.

    Args:
        extra: by parameter, one more choice and the text that is added to the help.
    """
    group = parser.add_argument_group(title, description)
    kinds = types_of(declaration)
    for name, limits in limits_of(declaration).items():
        unit = f" [{limits.unit}]" if limits.unit else ""
        choice, more = (extra or {}).get(name, ("", ""))
        choices: Sequence[str] | None = (*limits.choices, *([choice] if choice else [])) if limits.choices else None
        group.add_argument(
            f"--{name.replace('_', '-')}",
            type=kinds[name],
            choices=choices,
            metavar=None if choices else "N",
            help=limits.description.replace("%", "%%") + unit + more,
        )
