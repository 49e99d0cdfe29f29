"""The options of a match, shared by bringup (ROS) and train (in-process)."""

from __future__ import annotations

import argparse
import re
import shlex
from collections.abc import Collection, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from difflib import get_close_matches
from pathlib import Path
from typing import Any, cast

import numpy as np
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import from_mapping, limits_of, types_of
from fbql_common.files import remedy
from fbql_fusion.controller_loading import resolve_controller
from fbql_fusion.core.controllers.parameters import CONTROLLERS, guided_episodes
from fbql_fusion.core.parameters import FusionParameters, check_fusion, unused_parameters
from fbql_fusion.core.registry import fusion_parameters, learns
from fbql_fusion.core.soccer_session import plays_instead
from fbql_fusion.core.tasks.soccer.subsumption import PRESETS
from fbql_fusion.node_parameters import DEFAULT_GOALS, FusionNodeParameters
from fbql_fusion.shipped import shipped_policy
from fbql_recording.run_directory import create_next_run_directory, create_run_directory
from fbql_sim.core.parameters import SimulationParameters

from fbql.cli.controllers import add_controller_option
from fbql.cli.observations import add_observation_option, register_observations, unused_observations
from fbql.cli.parser import Help, Parser, add_json_option, output_path
from fbql.cli.places import RUNS
from fbql.match.trees import playing_trees

RESERVED_NAMES = {"simulator", "fusion", "bringup", "behavior"}
_OF_THE_RUN = {"controller", "seed", "episodes", "goals", "guided", "learn"}
"""Parameters that the next run chooses anew."""
_OPTIONS = _OF_THE_RUN | {"preset", "max_steps"}
"""Parameters that have an option of their own; --set gives the others."""


@dataclass(frozen=True)
class Match:
    """What to play, and where the run is written."""

    fusion: FusionParameters
    simulation: SimulationParameters
    behaviors: dict[str, Path]
    """Tree file of each behavior, in the order of fusion.behaviors."""
    policy: Path | None
    out: Path
    """The run directory. Unless the user named it, it is only known for sure when it is made."""
    out_named: bool
    trees: Path | None = None
    """The directory of the trees, if the user named one."""
    observations: dict[str, str] = field(default_factory=dict[str, str])
    """FILE.py:NAME of what each user-supplied behavior senses, by the behavior that its tree file names."""
    controller_file: str = ""
    """FILE.py:NAME of a user-supplied controller."""
    notes: tuple[str, ...] = ()
    """Notes on what the user may not expect, one line each: how the match starts, and which options have no effect."""


def match_parser(program: str, description: str) -> Parser:
    """A parser with the options that every way of playing a match has."""
    parser = Parser(prog=program, description=description, formatter_class=Help)
    play = parser.add_argument_group("what is played")
    add_controller_option(play, "who fuses the behaviors (fbql; with --preset alone, subsumption)")
    play.add_argument(
        "--seed", type=int, default=0, metavar="S", help="seed of the run; every episode's seed is derived from it"
    )
    add_play_options(play)
    play.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="any other parameter of fusion or simulation, such as tie_rule=first or ball_robot_friction=0.1; may be repeated",
    )
    result = parser.add_argument_group("what comes out")
    result.add_argument(
        "--out",
        type=output_path,
        metavar="DIR",
        help="run directory to create; it must not exist (runs/TIME-CONTROLLER-sSEED)",
    )
    add_json_option(result)
    return parser


def add_play_options(play: argparse._ArgumentGroup) -> None:
    """Adds the options that every way of playing has in addition to the controller, the seed and --set."""
    play.add_argument("--preset", choices=tuple(PRESETS), help="thresholds of Subsumption (tuned)")
    play.add_argument("--episodes", type=int, metavar="N", help="end after N episodes, guided ones not counted")
    play.add_argument("--goals", type=int, metavar="N", help=f"end after N goals (without --episodes: {DEFAULT_GOALS})")
    play.add_argument(
        "--guided",
        type=int,
        metavar="N",
        help="guided episodes before that (20 for a controller that learns and starts without a policy, else 0)",
    )
    play.add_argument(
        "--max-steps", type=int, default=4000, metavar="N", help="steps after which an episode is truncated: a timeout"
    )
    play.add_argument(
        "--learn",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="continue to learn, where the controller can",
    )
    play.add_argument(
        "--policy",
        metavar="FILE",
        help="policy.npz of an earlier run to start from, or none; by default fbql starts from the shipped policy, "
        "unless its behaviors or trees differ or it has guided episodes; the other controllers start untrained",
    )
    play.add_argument(
        "--trees",
        type=Path,
        metavar="DIR",
        help="directory with NAME.json of each behavior; shipped trees take the place of missing ones (the shipped trees)",
    )
    add_observation_option(play)


def match_from(arguments: argparse.Namespace, has_policy: bool = False) -> Match:
    """The match that the arguments describe.

    Args:
        has_policy: a policy is given as an object, and takes the place of a file.

    Raises:
        BadInput: a value out of range, an unknown parameter, a file that is not there.
    """
    goals = arguments.goals
    if goals is None:
        goals = 0 if arguments.episodes is not None else DEFAULT_GOALS
    for option, least in (("episodes", 1), ("goals", 1), ("guided", 0)):
        if getattr(arguments, option) is not None and getattr(arguments, option) < least:
            raise BadInput(f"--{option} is {getattr(arguments, option)}; it must be {least} or more")
    controller = resolve_controller(arguments.controller or ("subsumption" if arguments.preset else "fbql"))
    values: dict[str, Any] = {
        "controller": controller.name,
        "preset": arguments.preset or "tuned",
        "episodes": arguments.episodes or 0,
        "goals": goals,
        "seed": arguments.seed,
        "learn": arguments.learn,
    }
    if arguments.guided is not None:
        values["guided"] = arguments.guided
    simulation: dict[str, Any] = {"max_steps": arguments.max_steps}
    declaration = fusion_parameters(controller.name)
    _refuse_clashes(controller.name, declaration)
    given = [_add_setting(setting, declaration, values, simulation) for setting in arguments.set]
    if arguments.preset:
        given.append("preset")
    with errors_name_options():
        fusion = from_mapping(declaration, values, "fusion")
        check_fusion(fusion, "fusion")
        simulated = from_mapping(SimulationParameters, simulation, "simulation")
    for name in RESERVED_NAMES & set(fusion.behaviors):
        raise BadInput(f"--set behaviors has '{name}', which is the name of another node")
    behaviors = _tree_files(fusion.behaviors, arguments.trees)
    observations = register_observations(arguments.observation)
    fits = _are_shipped(behaviors)
    shipped = fusion.controller == "fbql" and fusion.guided <= 0 and fits
    policy = _policy(arguments.policy, shipped)
    has_policy = has_policy or policy is not None
    notes = [] if has_policy else [*_notes_on_the_start(fusion, fits, arguments.policy is not None)]
    notes += _unused(fusion, has_policy, given)
    if arguments.policy == "none" and not learns(fusion):
        notes.append(f"--policy none has no effect: {fusion.controller} takes no policy")
    trees = _loadable_trees(behaviors)
    notes += unused_observations(observations, {tree.behavior for tree in trees})
    if len(trees) == len(behaviors) and (instead := plays_instead(fusion, playing_trees(trees))):
        notes.append(instead)
    notes += _notes_on_trees(behaviors, arguments.trees)
    return Match(
        fusion=fusion,
        simulation=simulated,
        behaviors=behaviors,
        policy=policy,
        out=_out(arguments.out, fusion),
        out_named=arguments.out is not None,
        trees=arguments.trees and arguments.trees.absolute(),
        observations=observations,
        controller_file=controller.source,
        notes=tuple(notes),
    )


@contextmanager
def errors_name_options() -> Generator[None]:
    """A context in which an error about a parameter names the option that gave its value."""
    try:
        yield
    except BadInput as error:
        raise BadInput(re.sub(r"^(?:fusion|simulation): parameter '(\w+)'", _option, str(error))) from None


def _option(parameter: re.Match[str]) -> str:
    name = parameter[1]
    return f"--{name.replace('_', '-')}" if name in _OPTIONS else f"--set {name}"


def _refuse_clashes(controller: str, declaration: type[FusionParameters]) -> None:
    """Raises BadInput where an own parameter has the name of one that --set or config.yaml has for another part."""
    for whose, other in (("the fusion node", FusionNodeParameters), ("the simulation", SimulationParameters)):
        for name in _own_names(declaration):
            if name in limits_of(other):
                raise BadInput(
                    f"controller '{controller}': {whose} has a parameter '{name}' already; choose another name"
                )


def _own_names(declaration: type[FusionParameters]) -> list[str]:
    """The parameters that only a controller of the user's own has."""
    ours = limits_of(FusionParameters)
    return [name for name in limits_of(declaration) if name not in ours]


def _notes_on_the_start(fusion: FusionParameters, fits: bool, asked: bool) -> Iterator[str]:
    """Notes on what a user may not expect when a match starts without a policy."""
    if not learns(fusion):
        return
    if fusion.controller == "fbql" and not (fits or asked):
        yield "starts untrained: the shipped policy belongs to the shipped trees; --policy FILE names another"
    if not fusion.learn:
        yield f"{fusion.controller} neither learns nor has a policy: its weights stay as they were at the start; give --policy FILE"


def _unused(fusion: FusionParameters, has_policy: bool, given: Sequence[str]) -> Iterator[str]:
    """The options that have no effect with this controller."""
    learner = learns(fusion)
    if not (learner or fusion.learn):
        yield f"--no-learn has no effect: {fusion.controller} does not learn"
    yield from unused_parameters(fusion, given, guided_episodes(fusion, learner and fusion.learn, has_policy) > 0)


def _are_shipped(behaviors: dict[str, Path]) -> bool:
    """Whether these are the behaviors and trees that the shipped policy was learned with, in whatever files."""
    if list(behaviors) != FusionParameters().behaviors:
        return False
    try:
        return all(load_tree(path).hash == load_tree(_tree_file(name, None)).hash for name, path in behaviors.items())
    except BadInput:
        return False  # it is reported where the tree is played


def _loadable_trees(files: dict[str, Path]) -> list[Tree]:
    """The trees in these files. One that can't be read is reported where it is played."""
    found: list[Tree] = []
    for path in files.values():
        with suppress(BadInput):
            found.append(load_tree(path))
    return found


def _add_setting(
    setting: str, declared: type[FusionParameters], fusion: dict[str, Any], simulation: dict[str, Any]
) -> str:
    """Adds the value of a --set to the node's that has the parameter. Returns the parameter's name."""
    name, equals, text = setting.partition("=")
    declarations = ((fusion, declared), (simulation, SimulationParameters))
    for values, declaration in declarations:
        if equals and name in limits_of(declaration):
            values[name] = parse_value(text, types_of(declaration)[name], name)
            return name
    known = [name for _, declaration in declarations for name in limits_of(declaration)]
    if not equals or not name:
        raise BadInput(f"--set {setting}: write NAME=VALUE; docs/parameters.md has the names")
    raise BadInput(f"--set {setting}: fusion and simulation have no parameter '{name}'; {similar(name, known)}")


def values_of_setting(setting: str) -> list[str]:
    """The settings NAME=VALUE in a text NAME=VALUE,VALUE,...; one where a value is itself a list."""
    name, _, text = setting.partition("=")
    declarations = (*map(fusion_parameters, CONTROLLERS), SimulationParameters)
    kinds = {types_of(declaration).get(name) for declaration in declarations}
    return [setting] if list[str] in kinds else [f"{name}={value.strip()}" for value in text.split(",")]


def similar(name: str, known: Sequence[str]) -> str:
    """A hint for an unknown name: the names like it, or where all of them are listed."""
    found = get_close_matches(name, known)
    return f"did you mean {' or '.join(found)}?" if found else "docs/parameters.md has the names"


def parse_value(text: str, kind: Any, name: str) -> Any:
    """The value of a text, for a parameter of this kind. Raises BadInput."""
    if kind is bool:
        if text in ("true", "false"):
            return text == "true"
        raise BadInput(f"--set {name}: '{text}' is neither true nor false")
    if kind == list[str]:
        return [item.strip() for item in text.split(",") if item.strip()]
    try:
        return kind(text)
    except ValueError:
        expected = "whole number" if kind is int else "number"
        raise BadInput(f"--set {name}: '{text}' is not a {expected}") from None


def _tree_files(behaviors: Sequence[str], directory: Path | None) -> dict[str, Path]:
    """The tree file of each behavior: that of the directory or, where it has none, the shipped one. Raises BadInput."""
    if directory is not None and len(_lacking(behaviors, directory)) == len(behaviors):
        names = ", ".join(f"{name}.json" for name in behaviors)
        raise BadInput(f"--trees {directory}: none of {names} is there; induce --out DIR/BEHAVIOR.json makes one")
    return {name: _tree_file(name, directory) for name in behaviors}


def _tree_file(name: str, directory: Path | None) -> Path:
    places = [shipped_trees()] if directory is None else [directory, shipped_trees()]
    found = [path for place in places if (path := place / f"{name}.json").is_file()]
    if not found:
        raise BadInput(f"no tree for behavior '{name}': {places[0] / f'{name}.json'}: no such file")
    return found[0].resolve()


def _lacking(behaviors: Iterable[str], directory: Path) -> list[str]:
    """The behaviors without a tree in a directory."""
    return [name for name in behaviors if not (directory / f"{name}.json").is_file()]


def _notes_on_trees(behaviors: Iterable[str], directory: Path | None) -> Iterator[str]:
    """A line about the shipped trees that play in the place of missing ones."""
    if directory is not None and (names := _lacking(behaviors, directory)):
        yield f"--trees {directory} has no tree for {', '.join(names)}: shipped trees play there"


def _policy(given: str | None, shipped: bool) -> Path | None:
    """The policy file to start from, if any."""
    if given is None:
        return shipped_policy() if shipped else None
    if given == "none":
        return None
    path = Path(given)
    if path.is_dir():
        raise BadInput(f"--policy {path}: a directory; a run keeps its policy in {path / 'policy.npz'}")
    if not path.is_file():
        raise BadInput(f"--policy {path}: no such file")
    return path.resolve()


def _out(out: Path | None, fusion: FusionParameters) -> Path:
    if out is not None:
        return out.absolute()
    return RUNS / f"{datetime.now():%Y%m%d-%H%M%S}-{fusion.controller}-s{fusion.seed}"


def policy_summary(match: Match) -> tuple[str, str] | None:
    """The policy that a match starts from, in one word and in a sentence; None if the controller has none."""
    if not learns(match.fusion):
        return None
    if match.policy is None:
        return "none", "it started untrained"
    if match.policy == shipped_policy():
        return "shipped", "which it started from; --policy none starts untrained"
    return "given", f"which it started from: {match.policy}"


def same_options(match: Match) -> str:
    """The options that give bringup the behaviors, trees and parameters of a match again, for a shell; each after a
    space.

    Options that the next run chooses anew are left out: controller, policy, seed, how many episodes or goals, whether
    it learns.
    """
    words = [word for source in match.observations.values() for word in ("--observation", source)]
    if match.trees is not None:
        words += "--trees", str(match.trees)
    words += _settings(match.fusion, limits_of(FusionParameters).keys() - _OF_THE_RUN)
    words += _settings(match.simulation, limits_of(SimulationParameters))
    return _quoted(words)


def controller_options(match: Match) -> str:
    """The options by which bringup has the controller of a match again, with its own parameters; as `same_options`."""
    words = ["--controller", match.controller_file or match.fusion.controller]
    return _quoted([*words, *_settings(match.fusion, _own_names(type(match.fusion)))])


def _settings(values: FusionParameters | SimulationParameters, names: Collection[str]) -> list[str]:
    """Those of these parameters that are not at their defaults, as options."""
    words: list[str] = []
    usual = type(values)()
    for name in limits_of(type(values)):
        if name in names and (value := getattr(values, name)) != getattr(usual, name):
            words += "--set", f"{name}={set_text(value)}"
    return words


def _quoted(words: Sequence[str]) -> str:
    return "".join(f" {shlex.quote(word)}" for word in words)


def plain(value: Any) -> Any:
    """A scalar of NumPy, or an array without dimensions, as Python's own scalar; anything else as it is."""
    is_scalar = isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0)
    return value.item() if is_scalar else value


def set_text(value: object) -> str:
    """A parameter's value as --set takes it."""
    value = plain(value)
    if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str):
        return ",".join(str(item) for item in cast("Sequence[object]", value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def make_run_directory(match: Match) -> Match:
    """Creates the run directory and, below the checkout's runs/, its parents. Returns the match with that directory.

    Raises:
        BadInput: it exists, or can't be made.
    """
    path = match.out
    if RUNS in path.parents:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BadInput(f"{path.parent}: can't be created ({error.strerror}); {remedy(error)} with --out") from None
    if match.out_named:
        create_run_directory(path)
        return match
    return replace(match, out=create_next_run_directory(RUNS, path.name))
