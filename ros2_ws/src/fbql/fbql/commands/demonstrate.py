"""Records demonstrations of a behavior, by its scripted instructor or by a person; replays and merges them.

The scripted instructor drives in the simulator in one process, as fast as possible. A person drives live on the ROS graph
(`fbql.keyboard`). Both make the same kind of recording, from which `induce` makes a tree.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from itertools import islice
from pathlib import Path

import numpy as np
from fbql_behaviors.core.instructors import INSTRUCTORS, Habits
from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.patterns import Demonstration, patterns_of
from fbql_behaviors.core.recipes import recipe_of
from fbql_behaviors.demonstration_storage import Recording
from fbql_common.core.errors import BadInput
from fbql_common.terminal.screen import trouble_with_terminal

from fbql.cli.exit_codes import DONE, FAILED
from fbql.cli.interrupts import Interrupts
from fbql.cli.observations import add_observation_option, register_observations, unused_observations
from fbql.cli.output import LiveLine, complain, json_text, print_result, say, writing
from fbql.cli.parser import Parser, add_json_option, output_path, without_effect
from fbql.cli.places import command_text, new_path
from fbql.cli.words import counted
from fbql.demonstrations.instruct import instruct, simulation_of, starts
from fbql.demonstrations.origins import Origin, about_origins, merge, recordings_of
from fbql.demonstrations.recording import save_demonstrations
from fbql.demonstrations.replay import verify
from fbql.keyboard.show import show
from fbql.keyboard.show_in_browser import show_in_browser
from fbql.watch.option import add_watch_option, require_way

SCRIPTED_SEED = 1
SLOWEST, FASTEST = 0.01, 100.0
"""Bounds of --realtime."""


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Records, replays or merges. Returns the exit code."""
    _check_usage(arguments)
    sources = register_observations(arguments.observation, [arguments.behavior] if arguments.behavior else [])
    recordings = _recordings(arguments)
    behavior = recordings[0].behavior if recordings else arguments.behavior
    for note in _unused(arguments, sources, behavior):
        complain(note)
    if arguments.realtime is None:
        arguments.realtime = 1.0
    if arguments.replay is not None:
        return _replay(arguments, recordings, interrupts)
    if arguments.merge is not None:
        return _merge(arguments, recordings)
    return _by_keyboard(arguments, interrupts) if arguments.keyboard else _by_script(arguments)


def _by_script(arguments: argparse.Namespace) -> int:
    behavior = arguments.behavior
    seed = SCRIPTED_SEED if arguments.seed is None else arguments.seed
    recipe = recipe_of(behavior)
    count = recipe.demonstrations if arguments.demonstrations is None else arguments.demonstrations
    steps = recipe.steps if arguments.steps is None else arguments.steps
    out = arguments.out or new_path(f"demonstrations-{behavior}-s{seed}")
    with closing(LiveLine()) as line:
        demonstrations = instruct(
            behavior, seed, count, steps, lambda made: line.show(f"{made} of {counted(count, 'demonstration')}")
        )
    seeds = {episode: start for episode, (start, _) in enumerate(islice(starts(behavior, seed), count))}
    details = {"seed": seed, "habits": asdict(Habits())}
    origin = Origin("scripted", simulation_of(behavior), seeds, details)
    with writing(out):
        save_demonstrations(out, behavior, demonstrations, about_origins([origin]))
    _report(arguments, behavior, demonstrations, out)
    return DONE


def _by_keyboard(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    interrupts.install()
    from fbql.keyboard.drive import demonstrate_by_keyboard  # it needs ROS, which the other ways do not

    behavior = arguments.behavior
    # Each sitting has other starts, so that two are worth merging.
    seed = int(np.random.SeedSequence().generate_state(1)[0]) if arguments.seed is None else arguments.seed
    out = arguments.out or new_path(f"demonstrations-{behavior}-keyboard")
    kept, well = demonstrate_by_keyboard(behavior, seed, arguments.realtime, out, arguments.ascii, interrupts)
    if not kept:
        complain("nothing was demonstrated; nothing was written")
        return FAILED
    _report(arguments, behavior, [each.demonstration for each in kept], out)
    return DONE if well else FAILED


def _recordings(arguments: argparse.Namespace) -> list[Recording]:
    """The recordings that --replay or --merge names."""
    paths = arguments.merge or ([] if arguments.replay is None else [arguments.replay])
    return recordings_of(paths, arguments.behavior) if paths else []


def _merge(arguments: argparse.Namespace, recordings: Sequence[Recording]) -> int:
    behavior = recordings[0].behavior
    demonstrations, origins = merge(recordings)
    out = arguments.out or new_path(f"demonstrations-{behavior}-merged")
    register_observations([], [behavior])
    with writing(out):
        save_demonstrations(out, behavior, demonstrations, about_origins(origins))
    _report(arguments, behavior, demonstrations, out)
    return DONE


def _replay(arguments: argparse.Namespace, recordings: Sequence[Recording], interrupts: Interrupts) -> int:
    behavior = recordings[0].behavior
    register_observations([], [behavior])
    found = verify(recordings)
    if arguments.watch == "browser":
        title = arguments.replay.resolve().name  # `.` has a name too
        show_in_browser(title, recordings, arguments.realtime, interrupts)
    elif arguments.watch or not trouble_with_terminal():
        show(recordings, arguments.realtime, arguments.ascii, interrupts)
    demonstrations = [demonstration for recording in recordings for demonstration in recording.demonstrations]
    if found.first_difference:
        complain(found.first_difference)
    elif found.without_start:
        unknown = f"{found.without_start} of {counted(len(demonstrations), 'demonstration')}"
        complain(f"{unknown} can't be driven again: the recording does not contain their start")
    else:
        say(f"driven again: all {found.steps} steps are identical, bit for bit")
    more = {"identical": found.identical, "steps": found.steps, "first_difference": found.first_difference}
    _report(arguments, behavior, demonstrations, arguments.replay, more)
    return DONE if found.identical else FAILED


def _report(
    arguments: argparse.Namespace,
    behavior: str,
    demonstrations: Sequence[Demonstration],
    path: Path,
    more: dict[str, object] | None = None,
) -> None:
    """Prints what was recorded, and what to type next."""
    recipe = recipe_of(behavior)
    patterns = len(patterns_of(demonstrations, observation_of(behavior), recipe.every, recipe.patterns))
    say(f"{counted(len(demonstrations), 'demonstration')}, {counted(patterns, 'pattern')}: {path}")
    if arguments.json:
        result = {"demonstrations": len(demonstrations), "patterns": patterns, "path": str(path), **(more or {})}
        print_result(json_text(result))
    else:
        observations = [word for each in arguments.observation for word in ("--observation", each)]
        words = [behavior, "--demos", str(path), *observations]
        say(f"Next: {command_text('induce')} {shlex.join(words)}")


def _check_usage(arguments: argparse.Namespace) -> None:
    modes = [name for name in ("keyboard", "replay", "merge") if getattr(arguments, name)]
    if len(modes) > 1:
        raise BadInput(f"--{modes[0]} and --{modes[1]} exclude each other; choose one")
    mode = modes[0] if modes else ""
    if arguments.behavior is None and mode in ("", "keyboard"):
        raise BadInput(f"name the BEHAVIOR, one of: {', '.join(INSTRUCTORS)}")
    for name, of in (("demonstrations", ("",)), ("steps", ("",)), ("seed", ("", "keyboard"))):
        if getattr(arguments, name) is not None and mode not in of:
            raise BadInput(f"--{name} cannot be combined with --{mode}")
    if arguments.watch is not None:
        if mode != "replay":
            raise BadInput("--watch shows recorded demonstrations; add --replay DIR, or drive with --keyboard instead")
        require_way(arguments.watch)
    if arguments.realtime is not None and not SLOWEST <= arguments.realtime <= FASTEST:
        raise BadInput(f"--realtime is {arguments.realtime:g}, outside of [{SLOWEST:g}, {FASTEST:g}]")


def _unused(arguments: argparse.Namespace, sources: Mapping[str, str], behavior: str) -> Iterator[str]:
    """The options that have no effect on what was requested."""
    yield from unused_observations(sources, [behavior])
    how = ("realtime", "ascii")
    if not (arguments.keyboard or arguments.replay):
        yield from without_effect(arguments, how, "without --keyboard or --replay")
    if arguments.replay is not None:
        yield from without_effect(arguments, ["out"], "with --replay: nothing is written")
        if arguments.watch == "browser":
            yield from without_effect(arguments, ["ascii"], "with --watch browser")
        elif trouble_with_terminal():
            yield from without_effect(arguments, how, "without a terminal: nothing is shown")


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(
        prog=program,
        description="Records demonstrations of a behavior as an MCAP recording: by its scripted instructor, or, with "
        "--keyboard, by a person who drives live. Replays and merges recordings.",
    )
    command.add_argument("behavior", metavar="BEHAVIOR", nargs="?", help=f"such as: {', '.join(INSTRUCTORS)}")
    modes = command.add_argument_group("instead of the scripted instructor")
    modes.add_argument("--keyboard", action="store_true", help="drive yourself, with the keys that the screen shows")
    modes.add_argument(
        "--replay", type=Path, metavar="DIR", help="show recorded demonstrations, and drive them again to compare"
    )
    modes.add_argument("--merge", type=Path, nargs="+", metavar="DIR", help="merge several recordings into one")
    add_watch_option(modes, "--replay: show the demonstrations (what it does where there is a terminal)")
    modes.add_argument(
        "--realtime",
        type=float,
        metavar="F",
        help="--keyboard, --replay: speed relative to real time; 0.5 is slow motion (1)",
    )
    modes.add_argument(
        "--ascii",
        action="store_true",
        help="--keyboard, --replay: draw without braille patterns, which some fonts lack",
    )
    command.add_argument(
        "--seed",
        type=int,
        metavar="S",
        help=f"seed of the starts and of the instructor's hand ({SCRIPTED_SEED}; --keyboard: a new one each time)",
    )
    command.add_argument(
        "--demonstrations", type=int, metavar="N", help="number of demonstrations (from the behavior's recipe)"
    )
    command.add_argument("--steps", type=int, metavar="N", help="maximum number of steps of each (from the recipe)")
    command.add_argument(
        "--out",
        type=output_path,
        metavar="DIR",
        help="directory to create; it must not exist (runs/TIME-demonstrations-BEHAVIOR-...)",
    )
    add_json_option(command)
    add_observation_option(command)
    return command
