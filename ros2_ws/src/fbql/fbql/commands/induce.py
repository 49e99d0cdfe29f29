"""Induces a behavior's tree from demonstrations, or a tree for any robot from bags, and writes the tree file."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from fbql_behaviors.bag_reading import load_spec
from fbql_behaviors.core.bag_patterns import BagPatterns
from fbql_behaviors.core.evaluation import axis_rmse, wheel_rmse
from fbql_behaviors.core.induction import InductionParameters
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import Demonstration, Patterns
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_behaviors.core.tree_value import tree_value
from fbql_behaviors.demonstration_storage import load_demonstrations
from fbql_behaviors.storage import save_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.field import WHEELS
from fbql_common.core.parameters import types_of
from fbql_common.core.text import as_lines
from fbql_common.files import output_directory, write_atomically
from fbql_fusion.core.controllers.parameters import SessionParameters

from fbql.cli.exit_codes import DONE
from fbql.cli.interrupts import Interrupts
from fbql.cli.observations import add_observation_option, register_observations, unused_observations
from fbql.cli.output import complain, json_text, print_result, say, warn, writing
from fbql.cli.parser import Parser, add_json_option, add_parameter_options, output_path, without_effect
from fbql.cli.places import command_text, new_path, ros2_text
from fbql.cli.words import counted, percent
from fbql.demonstrations.from_bags import BagData, bag_request, data_of_bags
from fbql.demonstrations.make_tree import (
    CART,
    DEMONSTRATION_SEED,
    INDUCTION_SEED,
    InducedTree,
    InductionRequest,
    induced_tree,
    instructed,
    optimum_of,
    patterns_for,
    request_of,
    unused_parameters,
)
from fbql.demonstrations.skill import STARTS, SkillReport, skill_of
from fbql.report.induction import Induction, induction_page

BESIDE = Path()
"""The value of --report without a file."""


def parser(program: str) -> Parser:
    """The command line."""
    command = Parser(
        prog=program,
        description="Induces a behavior's decision tree from demonstrations, or a tree for any robot from ROS 2 bags.",
    )
    command.add_argument("behavior", metavar="BEHAVIOR", help=f"such as: {', '.join(OBSERVATIONS)}")
    command.add_argument(
        "--demos",
        type=Path,
        action="append",
        metavar="DIR",
        help="recording of demonstrations, or a directory of them; may be repeated (the scripted instructor, seed 1)",
    )
    command.add_argument(
        "--bag",
        type=Path,
        action="append",
        metavar="DIR",
        help="ROS 2 bag of any robot (rosbag2 in MCAP or SQLite 3), from which --spec says what to take; may be repeated",
    )
    command.add_argument(
        "--spec", type=Path, metavar="FILE", help="with --bag: what is sensed and commanded (YAML, see docs/bags.md)"
    )
    command.add_argument("--every", type=int, metavar="N", help="take every N-th step of a demonstration as a pattern")
    command.add_argument("--patterns", type=int, metavar="N", help="take at most N patterns")
    command.add_argument("--seed", type=int, metavar="S", help=f"seed of the trials ({INDUCTION_SEED})")
    command.add_argument(
        "--out", type=output_path, metavar="FILE", help="tree file (runs/TIME-tree-BEHAVIOR/BEHAVIOR.json)"
    )
    add_json_option(command)
    command.add_argument(
        "--report",
        type=output_path,
        nargs="?",
        const=BESIDE,
        metavar="FILE",
        help="write a page about the tree and how it was made (beside the tree file, as .html)",
    )
    command.add_argument(
        "--curve",
        type=output_path,
        metavar="FILE",
        help="write the learning curve as CSV: the root's value after each trial",
    )
    command.add_argument(
        "--starts",
        type=int,
        metavar="N",
        help=f"starts to measure the tree's skill from, beside the instructor and the shipped tree ({STARTS}; 0: none)",
    )
    command.add_argument("--leaves", type=int, metavar="N", help="leaves of --method cart (chosen by cross-validation)")
    add_observation_option(command)
    more = "; cart: scikit-learn's, for comparison (needs the extra studies; in a clone it is installed once)"
    about = "defaults are those of the behavior's recipe"
    add_parameter_options(command, InductionParameters, "induction", about, {"method": (CART, more)})
    return command


def run(arguments: argparse.Namespace, _interrupts: Interrupts) -> int:
    """Induces the tree. Returns 0."""
    names = ("seed", "every", "patterns", "leaves", *types_of(InductionParameters))
    given = {name: value for name in names if (value := getattr(arguments, name)) is not None}
    task = _of_bags(arguments, given) if arguments.bag else _of_demonstrations(arguments, given)
    request, patterns = task.request, task.patterns
    warn(patterns.warnings())
    made = induced_tree(request, patterns)
    if task.recipe:
        made = replace(made, tree=replace(made.tree, recipe=task.recipe))
    skill = _skill(arguments, task, made)
    path = arguments.out or new_path(f"tree-{request.behavior}") / f"{request.behavior}.json"
    report = path.with_suffix(".html") if arguments.report is BESIDE else arguments.report
    replaced = path.exists()
    with writing(path), output_directory(path.parent):
        save_tree(path, made.tree)
    if report is not None:
        _write(report, _page(task, made, skill))
    if arguments.curve is not None:
        _write(arguments.curve, _curve(made.curve))
    if replaced:
        say(f"{path}: replaced the existing tree")
    if made.tree.leaf_count == 1:
        warn(["the tree is a single leaf, the same command for every observation; record more demonstrations, or move "
              "--split-cost closer to 0"])  # fmt: skip
    rmse = made.rmse_levels
    result = {
        "leaves": made.tree.leaf_count,
        "rmse_levels": rmse,
        "rmse_rad_s": None if rmse is None or patterns.commands != WHEELS else rad_s_of(rmse),
        "root_value": made.value if isfinite(made.value) else None,
        "seconds": made.seconds,
        "path": str(path),
        "patterns": len(patterns),
        "sha256": made.tree.hash,
        "report": None if report is None else str(report),
    }
    if skill is not None:
        result["skill"] = skill.values
    if task.bags is not None:
        read = task.bags.read
        result |= {"commands": read.commands, "dropped": read.dropped, "clamped": read.clamped}
        result["training_rmse"] = axis_rmse(made.tree, patterns)
    notes = _drops(task.bags.read) if task.bags else ()
    print_result(json_text(result) if arguments.json else "\n".join([_words(result, notes), *_skill_words(skill)]))
    if not arguments.json:
        for line in _next_steps(path, request.behavior, arguments.observation, task.bags is not None):
            say(line)
    return DONE


class _Task(NamedTuple):
    """What to induce, and from what."""

    request: InductionRequest
    patterns: Patterns
    demonstrations: int
    source: str
    """Where the demonstrations came from."""
    bags: BagData | None = None

    @property
    def recipe(self) -> dict[str, Any]:
        """The recipe of the observations that the tree file holds; empty for an observation in code."""
        return self.bags.recipe if self.bags else {}


def _of_demonstrations(arguments: argparse.Namespace, given: dict[str, Any]) -> _Task:
    if arguments.spec is not None:
        raise BadInput("--spec says what to take from a bag: name one with --bag DIR")
    sources = register_observations(arguments.observation, [arguments.behavior])
    request = request_of(arguments.behavior, **given)
    _check_options(arguments, request, unused_observations(sources, [arguments.behavior]))
    demonstrations = _demonstrations(request, arguments.demos)
    source = f"Scripted instructor, seed {DEMONSTRATION_SEED}"
    if arguments.demos:
        source = "Recordings " + ", ".join(path.name for path in arguments.demos)
    return _Task(request, patterns_for(request, demonstrations), len(demonstrations), source)


def _of_bags(arguments: argparse.Namespace, given: dict[str, Any]) -> _Task:
    if arguments.demos or arguments.observation:
        other = "--demos" if arguments.demos else "--observation"
        raise BadInput(f"--bag and {other} exclude each other: the specification says what a bag's tree senses")
    if arguments.spec is None:
        raise BadInput("--bag needs --spec FILE: what is sensed and commanded (docs/bags.md)")
    for note in without_effect(arguments, ["starts"], "with --bag: only soccer is simulated"):
        complain(note)
    spec = load_spec(arguments.spec)
    request = bag_request(arguments.behavior, len(spec.features), **given)
    _check_options(arguments, request)
    bags = data_of_bags(arguments.bag, spec, request.recipe.every, request.recipe.patterns)
    request = bag_request(arguments.behavior, len(spec.features), len(bags.read.patterns), **given)
    source = f"{'Bag' if len(arguments.bag) == 1 else 'Bags'} " + ", ".join(path.name for path in arguments.bag)
    numbers = len(set(bags.read.patterns.demonstration.tolist()))
    return _Task(request, bags.read.patterns, numbers, source, bags)


def _check_options(arguments: argparse.Namespace, request: InductionRequest, notes: Iterable[str] = ()) -> None:
    """Reports options without effect. Raises BadInput for --curve where there is none."""
    unused = unused_parameters(request.method)
    for note in (*notes, *without_effect(arguments, unused, f"with --method {request.method}")):
        complain(note)
    if arguments.curve is not None and request.method != "rl":
        raise BadInput("--curve needs --method rl; the other methods have no trials")


def _demonstrations(request: InductionRequest, paths: Sequence[Path] | None) -> list[Demonstration]:
    if not paths:
        say(f"no --demos: the scripted instructor demonstrates (seed {DEMONSTRATION_SEED})")
        return instructed(request)
    return [each for path in paths for each in load_demonstrations(path, request.behavior)]


def _skill(arguments: argparse.Namespace, task: _Task, made: InducedTree) -> SkillReport | None:
    """How well the tree plays; None if it is not to be measured, or can't be."""
    starts = STARTS if arguments.starts is None else arguments.starts
    if starts < 0:
        raise BadInput(f"--starts is {starts}; it must be 0 or more")
    return None if task.bags is not None or not starts else skill_of(made.tree, task.patterns, starts)


def _skill_words(skill: SkillReport | None) -> Iterator[str]:
    """How well the tree plays, and what more to demonstrate."""
    if skill is None:
        return
    yield f"  skill, from the same {counted(skill.starts, 'start')}: {skill.measure} (95 % interval)"
    for each in skill.skills:
        low, high = each.cost.low, each.cost.high
        interval = f" ({low:.0f} to {high:.0f})" if isfinite(low) and isfinite(high) else ""
        arrived = "" if each.arrived is None else f"; {percent(each.arrived)} arrived"
        contact = f"; {each.contact_per_1000:.1f} of 1000 steps in contact with a wall"
        yield f"    {each.driver:<23}  {each.cost.estimate:.0f}{interval}{arrived}{contact}"
    gaps = skill.coverage.gaps()
    if gaps:
        yield "  demonstrate more of this, where it drove but nothing was demonstrated:"
        yield from (f"    {percent(gap.share)} of its driving: {gap.where}" for gap in gaps)
        first, *second = (feature.name.replace("_", " ") for feature in skill.coverage.features)
        lines = skill.coverage.map()
        if lines:
            yield f"  {first} to the right{f', {second[0]} upwards' if second else ''}: # shown, ? missing, . not needed"
            yield from (f"    {line}" for line in lines)
    elif skill.coverage.share_shown is not None:
        yield "  wherever it drove, something was demonstrated"


def _write(path: Path, text: str) -> None:
    with writing(path), output_directory(path.parent):
        write_atomically(path, text.encode())


def _page(task: _Task, made: InducedTree, skill: SkillReport | None) -> str:
    request, patterns = task.request, task.patterns
    return induction_page(
        Induction(
            tree=made.tree,
            patterns=patterns,
            demonstrations=task.demonstrations,
            source=task.source,
            method=request.method,
            objective=request.parameters.objective,
            value=made.value,
            worth=tree_value(made.tree, patterns, request.parameters),
            optimum=optimum_of(request, patterns),
            rmse=made.rmse_levels,
            training_rmse=wheel_rmse(made.tree, patterns),
            curve=made.curve,
            tried=made.tried,
            notes=_drops(task.bags.read) if task.bags else (),
            skill=skill,
        )
    )


def _next_steps(path: Path, behavior: str, observations: Sequence[str], of_bags: bool) -> list[str]:
    """What to type next: read the tree, and let it play."""
    own = [word for each in observations for word in ("--observation", each)]
    steps = [(f"{command_text('tree')} explain {shlex.join([str(path), *own])}", "each of its rules in words")]
    if of_bags:
        node = f"{ros2_text()} run fbql_behaviors twist_behavior --ros-args -p tree_file:={shlex.quote(str(path))}"
        steps.append((node, "play it on the robot: it publishes cmd_vel"))
    elif behavior in SessionParameters().behaviors and path.name == f"{behavior}.json":
        words = ["--trees", str(path.parent), "--controller", "subsumption", "--watch", "--goals", "3"]
        steps.append((f"{command_text('bringup')} {shlex.join(words)}", "watch it play in the team"))
    return ["Next:", *(line for command, meaning in steps for line in (f"  {command}", f"      {meaning}"))]


def _drops(read: BagPatterns) -> list[str]:
    """The numbers of commands of the bags that were used, dropped or clamped, a line each."""
    lines = [f"{counted(read.commands, 'command')} in the bags"]
    lines += [f"{number} dropped: {reason}" for reason, number in sorted(read.dropped.items())]
    lines += [f"{number} clamped: {name} outside its limits" for name, number in sorted(read.clamped.items())]
    return lines


def _curve(values: Sequence[float]) -> str:
    """The learning curve as CSV; values that diverged are inf or nan."""
    lines = (f"{trial},{value!r}" for trial, value in enumerate(values, start=1))
    return "\n".join(("trial,root_value_nat", *lines, ""))


def _words(result: dict[str, Any], notes: Iterable[str] = ()) -> str:
    error = "n/a (needs two demonstrations)"
    if result["rmse_levels"] is not None:
        error = f"{result['rmse_levels']:.2f} levels"
        if result["rmse_rad_s"] is not None:
            error += f", {result['rmse_rad_s']:.1f} rad/s"
    value = "not finite: it diverged" if result["root_value"] is None else f"{result['root_value']:.4f} nat"
    return as_lines(
        (
            f"{counted(result['leaves'], 'leaf', 'leaves')} from {counted(result['patterns'], 'pattern')} in {result['seconds']:.3f} s",
            *(f"  {note}" for note in notes),
            f"  held-out error of the {'commands        ' if 'commands' in result else 'wheel velocities'}   {error}",
            f"  value of the root                        {value}",
            f"  tree                                     {result['path']}",
            *([f"  report                                   {result['report']}"] if result["report"] else []),
        )
    )
