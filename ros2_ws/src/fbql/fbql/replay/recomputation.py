"""A recorded run recomputed in this process: the recorded world states, given to newly made trees and a new session.

The simulator is not needed: the world states are the recorded ones, and so is which answers arrived in time. The recording
holds everything else: every parameter including the seed, the trees, and the policy that the run started from.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.observation_loading import find_observation
from fbql_behaviors.storage import tree_from_bytes
from fbql_common.core import recording_names
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import from_mapping
from fbql_fusion.controller_loading import register_installed
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.registry import fusion_parameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.core.tasks.soccer.world_model.soccer_imagination import PlayingTree
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_fusion.policy_storage import policy_from_bytes
from fbql_recording.run import Run

from fbql.match.trees import playing_trees


class OutOfPlace(Exception):
    """A recorded step that does not fit the schedule; the text says why."""


class RecordedSession:
    """A session that follows the steps of a recording: its episodes begin and restart where the recorded ones did."""

    def __init__(self, session: SoccerSession) -> None:
        self.session = session
        self._episode: int | None = None
        self._step = -1

    def enter(self, episode: int, step: int, begins_again: bool) -> None:
        """Takes the session to the step that it decides next. Raises OutOfPlace."""
        if self._episode is None:
            begun = self.session.next_episode()
            if begun is None:
                raise OutOfPlace("the run had ended before it")
            if begun[0] != episode:
                raise OutOfPlace(f"episode {begun[0]} comes next")
            self._episode, self._step = episode, -1
        if self._episode != episode:
            raise OutOfPlace(f"episode {self._episode} has not ended")
        # Older recordings do not mark a restart: a step number that goes back shows it.
        if begins_again or step <= self._step:
            self.session.restart_episode()
        self._step = step

    def resume(self, episode: int) -> None:
        """Continues with a later episode, after a gap."""
        self.session.skip_to_episode(episode)
        self._episode = None

    def left(self, ended: bool) -> None:
        """Call it after a step was decided; `ended`: it was the episode's last."""
        if ended:
            self._episode = None


def recorded_parameters(run: Run) -> tuple[FusionParameters, list[str]]:
    """The parameters of fusion that were in force, and a description of how this release's parameters differ.

    Raises:
        BadInput: the recording has none, or one is out of range.
    """
    found = run.parameters.get("fusion")
    if not found:
        raise BadInput(f"{run.path}: it has no parameters; only a recording made by the fusion node can be recomputed")
    controller = found.get("controller", "")
    if not (isinstance(controller, str) and register_installed(controller)):
        copy = f"{recording_names.CONTROLLERS}{controller}.py"
        there = f" (the recording has a copy, {copy})" if copy in run.attachments else ""
        raise BadInput(
            f"{run.path}: unknown controller '{controller}'; name its file with --controller FILE.py:{controller}{there}"
        )
    declaration = fusion_parameters(controller)
    found = {**found, **_in_seconds(found)}
    ours = [field.name for field in fields(declaration)]
    others = {field.name for field in fields(FusionNodeParameters)}
    lacking = [name for name in ours if name not in found]
    unknown = [name for name in found if name not in {*ours, *others, *_IN_STEPS}]
    notes = [f"not in the recording, so their defaults are used: {', '.join(lacking)}"] if lacking else []
    notes += [f"parameters of the recording that this release does not have: {', '.join(unknown)}"] if unknown else []
    values = {name: found[name] for name in ours if name in found}
    return from_mapping(declaration, values, f"{run.path}: config.yaml"), notes


_IN_STEPS = tuple(f"{learner}_{what}_steps" for learner in ("fbql", "fbql_value") for what in ("hold", "play"))
"""Durations that older recordings have in steps of 1/60 s."""


def _in_seconds(found: Mapping[str, Any]) -> dict[str, float]:
    """The parameters in seconds that take the place of those in steps."""
    steps = {name: found[name] for name in _IN_STEPS if isinstance(found.get(name), int)}
    return {f"{name.removesuffix('_steps')}_s": count / 60 for name, count in steps.items()}


def recorded_policy(run: Run, node: str = "fusion") -> Policy | None:
    """The policy that the run started from; None if it started untrained. Raises BadInput. `node`: the one that decided."""
    data = run.attachments.get(recording_names.POLICY_BEFORE)
    if data is not None:
        return policy_from_bytes(data, f"{run.path}: {recording_names.POLICY_BEFORE}")
    if run.parameters.get(node, {}).get("policy"):
        raise BadInput(f"{run.path}: it started from a policy that is not in the recording")
    return None


def recorded_playing_trees(run: Run, instead: Mapping[str, Behavior] | None = None) -> list[PlayingTree]:
    """The trees of the run's behaviors, in order; empty where the fusion node did not have them. Raises BadInput.

    Args:
        instead: behaviors that play with another tree.
    """
    told = {name: value for name, value in run.parameters.get("fusion", {}).items() if name == "tree_files"}
    files = from_mapping(FusionNodeParameters, told, f"{run.path}: config.yaml").tree_files
    recorded = dict(_trees_by_name(run))
    trees = [recorded.get(f"{recording_names.TREES}{Path(file).name}") for file in files]
    known = {name: tree for name, tree in zip(run.behaviors, trees, strict=False) if tree is not None}
    known |= {name: behavior.tree for name, behavior in (instead or {}).items()}
    return playing_trees(known[name] for name in run.behaviors if name in known)


def what_is_lost(run: Run) -> str:
    """Says which input of the decisions was lost with a part of the recording, so that they can't be recomputed; "" if
    none was."""
    if run.is_complete:
        return ""
    fusion = run.parameters.get("fusion")
    if not fusion:
        return f"the parameters of the run ({recording_names.CONFIG}) are lost"
    if fusion.get("policy") and recording_names.POLICY_BEFORE not in run.attachments:
        return f"the policy that the run started from ({recording_names.POLICY_BEFORE}) is lost"
    return ""


def recorded_trees(run: Run) -> dict[str, Tree]:
    """The trees in the recording, by hash. Raises BadInput for a damaged one."""
    return {tree.hash: tree for _, tree in _trees_by_name(run)}


def _trees_by_name(run: Run) -> Iterator[tuple[str, Tree]]:
    for name, data in run.attachments.items():
        if name.startswith(recording_names.TREES):
            try:
                yield name, tree_from_bytes(data)
            except BadInput as error:
                raise BadInput(f"{run.path}: {name}: {error}") from None


class RecordedBehaviors:
    """The behaviors of a recording, made of its trees when an answer needs them.

    Args:
        trees: by hash.
        observations: FILE.py:NAME of what the user's own behaviors sense, by behavior. Code from a recording is never
            run, only what the user names or has installed.
    """

    def __init__(self, run: Run, trees: Mapping[str, Tree], observations: Mapping[str, str]) -> None:
        self._run = run
        self._trees = trees
        self._observations = observations
        self._made: dict[tuple[str, str], Behavior | None] = {}
        self.missing: dict[str, str] = {}
        """Why the answers of a behavior can't be recomputed, by its name."""

    def behavior(self, name: str, tree_hash: str) -> Behavior | None:
        """The behavior with this tree; None if it can't be made; `missing` then holds the reason."""
        key = (name, tree_hash)
        if key not in self._made:
            self._made[key] = self._make(name, tree_hash)
        return self._made[key]

    def _make(self, name: str, tree_hash: str) -> Behavior | None:
        tree = self._trees.get(tree_hash)
        if tree is None:
            self.missing[name] = f"its tree (SHA-256 {tree_hash[:12]}) is not in the recording"
            return None
        source = self._observations.get(tree.behavior, "")
        copy = self._run.attachments.get(f"{recording_names.OBSERVATIONS}{name}.py")
        if not source and copy is not None and tree.behavior not in OBSERVATIONS:
            self.missing[name] = (
                "what it senses is defined in a user file; name it with --observation "
                f"(the recording has a copy, {recording_names.OBSERVATIONS}{name}.py)"
            )
            return None
        return Behavior(name, tree, find_observation(tree.behavior, source))


def changed_software(run: Run, revision: str, here: Mapping[str, str]) -> list[str]:
    """One line for each package whose version differs from the one that made the recording."""
    versions: Mapping[str, Any] = {
        **run.config.get("versions", {}),
        "revision": run.config.get("git_revision", revision),
    }
    return [
        f"recorded with {name} {versions[name]}, here is {version}"
        for name, version in {**here, "revision": revision}.items()
        if name in versions and str(versions[name]) != version
    ]
