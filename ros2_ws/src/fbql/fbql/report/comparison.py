"""Runs side by side: groups of runs that differ only in their seed, and the results of each group.

Runs belong to one group if they have the same controller, trees (by hash), initial policy (by hash) and parameters. Guided
episodes, and those whose end was not recorded, are not counted.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple

from fbql_behaviors.storage import tree_from_bytes
from fbql_common.core import recording_names
from fbql_common.core.errors import BadInput
from fbql_common.core.plain_json import json_from
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_recording.plain_yaml import mapping_from_yaml
from fbql_recording.run import Run
from fbql_recording.run_files import read_inside

from fbql.report.contents import counted
from fbql.report.texts import plain, value_text
from fbql.statistics.inference import (
    Interval,
    holm,
    interquartile_mean,
    paired_p_value,
    probability_of_improvement,
    ratio_of_sums,
)

POLICY = "policy before"
TREE = "tree of "
"""Prefix of a behavior's name."""
MOST_NAMED = 8
"""Most differences that a label names."""
IQM = "iqm_cost"
"""The interquartile mean of steps per goal over runs."""
FEW_RUNS = 5
"""With fewer runs than this a bootstrap interval is too narrow."""
_SEED = "seed"
_OF_THE_NODE = {field.name for field in fields(FusionNodeParameters)} - {
    field.name for field in fields(FusionParameters)
}
_LEFT_OUT = {"fusion": {_SEED, *_OF_THE_NODE}, "simulator": {_SEED, "lockstep_timeout_s"}}
"""Parameters without influence on the match: paths, time-outs, what is recorded."""
MEASURES = {
    "success_rate": ("goals", "episodes"),
    "cost_per_goal": ("steps", "goals"),
    "own_goals_per_episode": ("own_goals", "episodes"),
    "collisions_per_episode": ("collisions", "episodes"),
}
"""Name -> numerator and denominator: ratios of sums over the runs of a group."""


@dataclass(frozen=True)
class RunResult:
    """One run: its setting and its counts."""

    name: str
    controller: str
    seed: int | None
    setting: Mapping[str, str]
    """What defines its group: controller, trees, policy and parameters, by name, as texts."""
    counts: Mapping[str, int]
    """episodes, goals, own_goals, timeouts, steps, collisions, contact_steps."""
    digest: str | None
    is_complete: bool

    @property
    def cost(self) -> float:
        """Steps per goal; a run without a goal costs all its steps, as in `fbql.statistics.runs`."""
        return self.counts["steps"] / max(self.counts["goals"], 1)

    def ratio(self, measure: str) -> float | None:
        """A measure of this run; None: not available."""
        numerator, denominator = (self.counts[name] for name in MEASURES[measure])
        return numerator / denominator if denominator else None

    @property
    def row(self) -> dict[str, Any]:
        """The run as a row of a table."""
        return {
            "run": self.name,
            "controller": self.controller,
            "seed": self.seed,
            **{name: self.counts[name] for name in ("episodes", "goals", "own_goals", "timeouts")},
            "success_rate": self.ratio("success_rate"),
            "cost_per_goal": self.ratio("cost_per_goal"),
            "collisions": self.counts["collisions"],
            "digest": None if self.digest is None else self.digest[:8],
            "complete": self.is_complete,
        }


@dataclass
class Group:
    """Runs that differ only in their seed."""

    letter: str
    runs: list[RunResult]
    label: str = ""
    """What distinguishes it from the other groups."""

    def interval(self, measure: str) -> Interval | None:
        """The ratio of sums over the runs, with its 95 % interval if there are several; None: not available."""
        names = MEASURES[measure]
        numerators, denominators = ([run.counts[name] for run in self.runs] for name in names)
        if not sum(denominators):
            return None
        return ratio_of_sums(numerators, denominators)

    @property
    def row(self) -> dict[str, Any]:
        """The group as a row of a table: each measure with the ends of its interval, and the interquartile mean of the cost."""
        row: dict[str, Any] = {"kind": self.letter, "runs": len(self.runs)}
        has_goals = any(run.counts["goals"] for run in self.runs)
        # The runs of a group have the same trees: there is one cluster.
        iqm = interquartile_mean([run.cost for run in self.runs], [0] * len(self.runs)) if has_goals else None
        for measure, found in {**{each: self.interval(each) for each in MEASURES}, IQM: iqm}.items():
            row |= {measure: None, f"{measure}_low": None, f"{measure}_high": None}
            if found is not None:
                row |= zip((measure, f"{measure}_low", f"{measure}_high"), map(_finite, found), strict=True)
        return row


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def result_of(run: Run) -> RunResult:
    """Reads a run to its end. Raises Corrupt."""
    episodes = [
        _Ended(episode.outcome, episode.steps, episode.collisions_begun or 0, episode.collision_steps or 0)
        for episode in counted(run.episodes())
        if episode.outcome is not None
    ]
    digest = (run.summary or {}).get("digest")
    return _result(run.path.name, run.parameters, run.attachments, episodes, digest, run.is_complete)


def has_no_recording(directory: Path) -> bool:
    """Whether this is the directory of a run that was not recorded, such as one of train."""
    return (directory / "episodes.csv").is_file() and not any(directory.glob("*.mcap*"))


def result_without_recording(directory: Path) -> RunResult:
    """Reads the directory of a run that was not recorded. Raises BadInput for files that are not those of a run."""
    config = mapping_from_yaml(_inside(directory, "config.yaml"), f"{directory}: config.yaml")
    try:
        summary = json_from(_inside(directory, "summary.json"))
    except BadInput as error:
        raise BadInput(f"{directory}: summary.json: {error}") from None
    if not isinstance(summary, dict):
        raise BadInput(f"{directory}: summary.json is not one object")
    parameters = config.get("parameters")
    if not isinstance(parameters, Mapping):
        raise BadInput(f"{directory}: config.yaml has no parameters")
    simulator = parameters.get("simulator")
    if isinstance(simulator, Mapping):
        # A match in one process is that of the graph in lockstep, which names its speed: 0.
        parameters = {**parameters, "simulator": {"realtime": 0.0, **simulator}}
    files = {f"{recording_names.TREES}{path.name}": path for path in sorted((directory / "trees").glob("*.json"))}
    fusion = parameters.get("fusion")
    policy = fusion.get("policy") if isinstance(fusion, Mapping) else None
    if isinstance(policy, str) and policy:
        files[recording_names.POLICY_BEFORE] = Path(policy)
    attachments = {name: path.read_bytes() for name, path in files.items() if path.is_file()}
    digest = summary.get("digest")
    return _result(
        directory.name,
        parameters,
        attachments,
        _ended_in(directory),
        digest if isinstance(digest, str) else None,
        summary.get("incomplete") is not True,
    )


class _Ended(NamedTuple):
    """An episode that ended, and counts."""

    outcome: str
    steps: int
    collisions: int
    contact_steps: int


def _inside(directory: Path, name: str) -> bytes:
    data = read_inside(directory, name)
    if data is None:
        raise BadInput(f"{directory}: {name} is not there, and there is no recording")
    return data


def _ended_in(directory: Path) -> list[_Ended]:
    """The episodes of an episodes.csv that count."""
    try:
        rows = list(csv.DictReader(io.StringIO(_inside(directory, "episodes.csv").decode())))
        return [
            _Ended(row["outcome"], int(row["steps"]), int(row["collisions_begun"]), int(row["collision_steps"]))
            for row in rows
            if row["phase"] != "guided"
        ]
    except (ValueError, KeyError, TypeError, csv.Error) as error:
        raise BadInput(f"{directory}: episodes.csv has no such rows ({error!r})") from None


def _result(
    name: str,
    parameters: Mapping[str, Any],
    attachments: Mapping[str, bytes],
    episodes: Sequence[_Ended],
    digest: str | None,
    is_complete: bool,
) -> RunResult:
    outcomes = [episode.outcome for episode in episodes]
    fusion = parameters.get("fusion", {})
    seed = fusion.get(_SEED) if isinstance(fusion, Mapping) else None
    setting = _setting(parameters, attachments)
    return RunResult(
        plain(name),
        setting["controller"],
        seed if isinstance(seed, int) else None,
        setting,
        {
            "episodes": len(episodes),
            "goals": outcomes.count("goal"),
            "own_goals": outcomes.count("own_goal"),
            "timeouts": outcomes.count("timeout"),
            "steps": sum(episode.steps for episode in episodes),
            "collisions": sum(episode.collisions for episode in episodes),
            "contact_steps": sum(episode.contact_steps for episode in episodes),
        },
        digest,
        is_complete,
    )


def _setting(of_nodes: Mapping[str, Any], attachments: Mapping[str, bytes]) -> dict[str, str]:
    """What defines the group of a run, by name. A hash stands for a file."""
    setting = {"controller": "n/a"}
    for node, left_out in _LEFT_OUT.items():
        parameters = of_nodes.get(node)
        if isinstance(parameters, Mapping):
            setting |= {plain(name): value_text(value) for name, value in parameters.items() if name not in left_out}
    for name, data in sorted(attachments.items()):
        if name.startswith(recording_names.TREES):
            tree = name.removeprefix(recording_names.TREES).removesuffix(".json")
            setting[plain(f"{TREE}{tree}")] = _tree_hash(data)
        elif name == recording_names.POLICY_BEFORE:
            setting[POLICY] = hashlib.sha256(data).hexdigest()
    return setting


def _tree_hash(data: bytes) -> str:
    """The hash of a tree; that of the bytes if they are not a tree."""
    try:
        return tree_from_bytes(data).hash
    except BadInput:
        return hashlib.sha256(data).hexdigest()


def groups_of(runs: Sequence[RunResult]) -> tuple[list[Group], list[str]]:
    """The groups in the order of their first runs, and notes.

    A run that occurs twice (same group, seed and digest) is counted once: it is not another seed.
    """
    notes: list[str] = []
    by_setting: dict[tuple[tuple[str, str], ...], Group] = {}
    for run in runs:
        group = by_setting.setdefault(tuple(sorted(run.setting.items())), Group(_letter(len(by_setting)), []))
        twin = next((each for each in group.runs if run.seed is not None and each.seed == run.seed), None)
        if twin is not None and run.digest is not None and twin.digest == run.digest:
            notes.append(
                f"{run.name} is the same run as {twin.name} (seed {run.seed}, digest {run.digest[:8]}); counted once"
            )
            continue
        if twin is not None:
            notes.append(f"{run.name} and {twin.name} have the same seed, {run.seed}, but different digests")
        group.runs.append(run)
    groups = list(by_setting.values())
    for group, label in zip(groups, _labels(groups), strict=True):
        group.label = label
    if any(1 < len(group.runs) < FEW_RUNS for group in groups):
        notes.append(f"intervals over fewer than {FEW_RUNS} runs are too narrow; add seeds")
    return groups, notes


def _letter(place: int) -> str:
    """A, B, ... Z, AA, AB, ..."""
    return (_letter(place // 26 - 1) if place >= 26 else "") + chr(ord("A") + place % 26)


def _labels(groups: Sequence[Group]) -> list[str]:
    """What distinguishes the groups: the controller, and every setting that is not the same in all of them."""
    settings = [group.runs[0].setting for group in groups]
    names = sorted({name for setting in settings for name in setting} - {"controller"})
    differing = [name for name in names if len({setting.get(name) for setting in settings}) > 1]
    labels: list[str] = []
    for setting in settings:
        parts = [f"{name} {_short(name, setting.get(name))}" for name in differing[:MOST_NAMED]]
        more = [f"and {len(differing) - MOST_NAMED} more"] if len(differing) > MOST_NAMED else []
        labels.append(", ".join([setting["controller"], *parts, *more]))
    return labels


def _short(name: str, value: str | None) -> str:
    if value is None:
        return "n/a"
    return value[:8] if name == POLICY or name.startswith(TREE) else value


@dataclass(frozen=True)
class Pair:
    """A group against the first one, seed by seed: runs with the same seed have the same starts."""

    letter: str
    against: str
    seeds: int
    cost_ratio: float | None
    """Steps per goal, divided by the other group's, over the seeds that both have; None without a goal."""
    p: float | None
    """p of the paired test that both cost the same; None with fewer than two seeds."""
    p_holm: float | None
    """The same, adjusted by Holm for all groups that are compared with the first."""
    improves: float | None
    """Probability that a run costs less than one of the other group; None without a shared seed."""
    improves_low: float | None
    """The lower end of its 95 % interval."""
    improves_high: float | None
    """The upper end."""


def pairs_of(groups: Sequence[Group]) -> list[Pair]:
    """Every group against the first."""
    if not groups:
        return []
    first = {run.seed: run for run in groups[0].runs if run.seed is not None}
    found: list[tuple[str, int, float | None, float | None, Interval]] = []
    for group in groups[1:]:
        both = [(run, first[run.seed]) for run in group.runs if run.seed in first]
        costs = [_cost([pair[side] for pair in both]) for side in (0, 1)]
        ratio = costs[0] / costs[1] if costs[0] is not None and costs[1] else None
        ours, theirs = ([pair[side].cost for pair in both] for side in (0, 1))
        improves = probability_of_improvement(ours, theirs, [0] * len(both)) if both else Interval(nan, nan, nan)
        found.append((group.letter, len(both), ratio, _finite(paired_p_value(ours, theirs)), improves))
    adjusted = holm([p for _, _, _, p, _ in found])
    return [
        Pair(letter, groups[0].letter, seeds, ratio, p, p_holm, *map(_finite, improves))
        for (letter, seeds, ratio, p, improves), p_holm in zip(found, adjusted, strict=True)
    ]


def _cost(runs: Sequence[RunResult]) -> float | None:
    goals = sum(run.counts["goals"] for run in runs)
    return sum(run.counts["steps"] for run in runs) / goals if goals else None


def name_of(path: Path, others: Sequence[Path]) -> str:
    """The name of a run: the last part of its path, or as many parts as distinguish it from the others."""
    for count in range(1, len(path.parts) + 1):
        name = Path(*path.parts[-count:])
        if sum(Path(*other.parts[-count:]) == name for other in others) == 1:
            return str(name)
    return str(path)
