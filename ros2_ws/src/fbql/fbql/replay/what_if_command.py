"""`replay RUN --set ... --trees ...`: what would have been decided, and where and by how much that differs."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Generator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.observation_loading import find_observation
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import defaults_of, from_mapping, types_of
from fbql_common.core.text import as_lines
from fbql_common.files import atomic_text, write_atomically
from fbql_fusion.controller_loading import resolve_controller
from fbql_fusion.core.parameters import FusionParameters, check_fusion, unused_parameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.registry import fusion_parameters
from fbql_fusion.core.soccer_session import SoccerSession, plays_instead
from fbql_fusion.core.tasks.soccer.subsumption import FROM_PRESET
from fbql_fusion.policy_storage import load_policy
from fbql_recording.run import Run

from fbql.cli.interrupts import Interrupts
from fbql.cli.observations import register_observations, unused_observations
from fbql.cli.output import LiveLine, complain, json_text, print_result, writing
from fbql.match.options import errors_name_options, parse_value, similar
from fbql.replay.recomputation import recorded_parameters, recorded_playing_trees, recorded_policy
from fbql.replay.what_if import Compared, DifferenceTally, Tallies, compare_steps

NO_POLICY = "none"
_PROGRESS_STEPS = 1024
_SHOWN_EPISODES = 40
_ENDLESS = {"episodes": 0, "goals": 0}
"""The recording says when the run ends."""


def what_if_run(run: Run, arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Recomputes a run with the changes that the arguments make, and prints the differences. Returns 0. Raises
    BadInput."""
    run.require_match()
    controller = resolve_controller(arguments.controller).name if arguments.controller else ""
    recorded, notes = recorded_parameters(run)
    parameters = _changed(recorded, arguments, controller)
    policy = _policy(run, recorded, parameters, arguments.policy, notes)
    behaviors = _behaviors(run, arguments)
    endless = from_mapping(type(parameters), {**asdict(parameters), **_ENDLESS}, "fusion")
    trees = recorded_playing_trees(run, behaviors)
    notes += [line] if (line := plays_instead(endless, trees)) else []
    session = SoccerSession(endless, policy, trees)
    before = {**defaults_of(type(parameters)), **asdict(recorded)}
    changes = {name: [before[name], now] for name, now in asdict(parameters).items() if now != before[name]}
    tallies = Tallies(run.behaviors)
    total = max(run.counts.values(), default=0)
    figure = None
    if arguments.figure is not None:
        from fbql.replay.what_if_figure import WhatIfFigure  # matplotlib takes a second, and is an extra

        figure = WhatIfFigure(run.behaviors, total)
    with closing(LiveLine()) as line, _table(arguments.csv) as file:
        table = None if file is None else _Table(file, run.behaviors)
        for index, step in enumerate(compare_steps(run, session, behaviors), 1):
            tallies.add(step)
            if figure is not None:
                figure.add(step)
            if table is not None:
                table.add(step)
            if index % _PROGRESS_STEPS == 0:
                interrupts.check()
                line.show(f"{index} of {total} steps")
    if not tallies.whole.steps:
        raise BadInput(f"{run.path}: it has no steps; there is nothing to recompute")
    notes += unused_parameters(parameters, changes, session.guided > 0)
    what = ", ".join(f"{name}={now}" for name, (_, now) in changes.items())
    trees = f"trees of {', '.join(behaviors)} from {arguments.trees}" if behaviors else ""
    title = "; ".join(part for part in (what, trees) if part) or "nothing changes"
    if figure is not None:
        with writing(arguments.figure):
            write_atomically(arguments.figure, figure.svg(f"{run.path.name}: what if {title}"))
    if arguments.json:
        values = {"changed": changes, "trees": {name: each.tree.hash for name, each in behaviors.items()}}
        episodes = [each.values for each in tallies.episodes]
        print_result(json_text({**values, **tallies.whole.values, "episodes": episodes, "notes": notes}))
    else:
        print_result(as_lines([f"what if: {title}", *_words(tallies.whole), *_rows(tallies), *notes]))
    return 0


def _changed(recorded: FusionParameters, arguments: argparse.Namespace, controller: str) -> FusionParameters:
    declaration = fusion_parameters(controller or recorded.controller)
    kinds = types_of(declaration)
    values = {name: value for name, value in asdict(recorded).items() if name in kinds}
    if arguments.preset:
        # Thresholds that were set one by one would override the preset's.
        values |= {"preset": arguments.preset, "wall_threshold_m": FROM_PRESET, "approach_threshold_rad": FROM_PRESET}
    if controller:
        values["controller"] = controller
    for setting in arguments.set:
        name, equals, text = setting.partition("=")
        if not equals or name not in kinds or name in _ENDLESS or name == "behaviors":
            known = sorted(kinds.keys() - _ENDLESS.keys() - {"behaviors"})
            hint = f"; {similar(name, known)}" if equals and name not in kinds else ""
            raise BadInput(
                f"--set {setting}: write NAME=VALUE with a parameter of fusion (behaviors, schedule and "
                f"the world states stay as they were recorded){hint}"
            )
        values[name] = parse_value(text, kinds[name], name)
    with errors_name_options():
        parameters = from_mapping(declaration, values, "fusion")
        check_fusion(parameters, "fusion")
    return parameters


def _policy(
    run: Run, recorded: FusionParameters, parameters: FusionParameters, given: str | None, notes: list[str]
) -> Policy | None:
    if given == NO_POLICY:
        return None
    if given is not None:
        return load_policy(Path(given))
    policy = recorded_policy(run)
    if policy is not None and parameters.controller != recorded.controller:
        notes.append("the run's policy belongs to another controller and is not used")
        return None
    return policy


def _behaviors(run: Run, arguments: argparse.Namespace) -> dict[str, Behavior]:
    """The behaviors that have a tree in the directory of --trees."""
    sources = register_observations(arguments.observation)
    if arguments.trees is None:
        return {}
    files = {name: arguments.trees / f"{name}.json" for name in run.behaviors}
    found: dict[str, Behavior] = {}
    for name, path in files.items():
        if path.is_file():
            tree = load_tree(path)
            found[name] = Behavior(name, tree, find_observation(tree.behavior, sources.get(tree.behavior, "")))
    if not found:
        raise BadInput(f"--trees {arguments.trees}: none of {', '.join(path.name for path in files.values())} is there")
    for note in unused_observations(sources, {each.tree.behavior for each in found.values()}):
        complain(note)
    return found


def _words(whole: DifferenceTally) -> list[str]:
    steps = whole.steps
    if not whole.differing:
        return [f"the same in all {steps} steps"]
    lines = [f"differs in {whole.differing} of {steps} steps ({_share(whole.differing, steps)})"]
    first, most = whole.first, whole.most
    if first is not None:
        lines.append(f"first at episode {first.episode}, step {first.step} ({first.stamp_ns / 1e9:.3f} s)")
    for name, count in whole.leaves.items():
        if count:
            lines.append(f"{name} answers differently in {count} steps ({_share(count, steps)})")
    if whole.drivers:
        lines.append(f"another behavior drives in {whole.drivers} steps ({_share(whole.drivers, steps)})")
    lines.append(
        f"weights differ in {whole.weights} steps ({_share(whole.weights, steps)}); "
        f"share moved to other behaviors: {whole.weight_sum / steps:.3g} on average, {whole.weight_max:.3g} at most"
    )
    lines.append(
        f"commands differ in {whole.commands} steps ({_share(whole.commands, steps)}); "
        f"by {whole.command_sum_rad_s / steps:.3g} rad/s on average, {whole.command_max_rad_s:.3g} rad/s at most"
    )
    if most is not None:
        lines.append(f"largest at episode {most.episode}, step {most.step} ({most.stamp_ns / 1e9:.3f} s)")
    return lines


def _rows(tallies: Tallies) -> list[str]:
    """A table of the episodes that differ."""
    differing = [each for each in tallies.episodes if each.tally.differing]
    if not differing:
        return []
    lines = ["", "episode  outcome    steps  differ  weights moved  commands differ by [rad/s]  at most"]
    for each in differing[:_SHOWN_EPISODES]:
        tally = each.tally
        lines.append(
            f"{each.index:7}  {each.outcome or 'n/a':9}{tally.steps:7}  {_share(tally.differing, tally.steps):>6}"
            f"{tally.weight_sum / tally.steps:15.3g}{tally.command_sum_rad_s / tally.steps:28.3g}"
            f"{tally.command_max_rad_s:9.3g}"
        )
    if len(differing) > _SHOWN_EPISODES:
        lines.append(f"... and {len(differing) - _SHOWN_EPISODES} more (--json has all, --csv every step)")
    return lines


def _share(count: int, of: int) -> str:
    return f"{100.0 * count / of:.1f} %"


class _Table:
    """A CSV of all steps: recorded beside recomputed values."""

    def __init__(self, file: TextIO, behaviors: Sequence[str]) -> None:
        self._writer = csv.writer(file, lineterminator="\n")
        each = ("leaf_id", "reference_left_rad_s", "reference_right_rad_s", "weight", "q")
        columns = ["episode", "step", "stamp_ns", "differs", "weights_moved", "command_differs_rad_s"]
        for what in ("recorded", "what_if"):
            columns += [f"{what}.command_left_rad_s", f"{what}.command_right_rad_s", f"{what}.driver"]
            columns += [f"{what}.{name}.{behavior}" for behavior in behaviors for name in each]
        self._writer.writerow(columns)

    def add(self, compared: Compared) -> None:
        """Writes a row."""
        step = compared.step
        row: list[Any] = [step.episode, step.step, step.stamp_ns, int(compared.differs)]
        row += [compared.weight, compared.command_rad_s]
        for command, decision, outputs in (
            (step.command, step.decision, step.outputs),
            (compared.command, compared.decision, compared.outputs),
        ):
            assert command is not None and decision is not None
            row += [command.left_rad_s, command.right_rad_s, decision.driver]
            for index, output in enumerate(outputs):
                answer = ["", "", ""] if output is None else [output.leaf_id, output.left_rad_s, output.right_rad_s]
                row += [*answer, decision.weights[index], decision.q[index] if decision.q else ""]
        self._writer.writerow(row)


@contextmanager
def _table(path: Path | None) -> Generator[TextIO | None]:
    """The file of --csv; None without it."""
    if path is None:
        yield None
        return
    with writing(path), atomic_text(path) as file:
        yield file
