"""What would have been decided: a recording recomputed with other parameters, another controller or other trees.

Open loop: the world states stay the recorded ones. The result is what would have been decided in each of them, not where
that would have led; a controller that learns does so from transitions that its own commands did not cause.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_recording.core.steps import Step
from fbql_recording.run import Run

from fbql.replay.recomputation import OutOfPlace, RecordedSession


class Compared(NamedTuple):
    """One step as it was recorded, and as it would have been decided."""

    step: Step
    outputs: Sequence[BehaviorOutput | None]
    command: WheelCommand
    decision: Decision

    @property
    def command_rad_s(self) -> float:
        """The larger difference of the two wheels' commands [rad/s]."""
        recorded, ours = self.step.command, self.command
        assert recorded is not None
        return max(abs(ours.left_rad_s - recorded.left_rad_s), abs(ours.right_rad_s - recorded.right_rad_s))

    @property
    def weight(self) -> float:
        """The share of the weight that other behaviors have, 0 to 1: half the sum of absolute differences."""
        recorded = self.step.decision
        assert recorded is not None
        return sum(abs(a - b) for a, b in zip(self.decision.weights, recorded.weights, strict=True)) / 2.0

    @property
    def others(self) -> list[bool]:
        """For each behavior, whether its leaf or its reference differs."""
        return [_answer(now) != _answer(was) for now, was in zip(self.outputs, self.step.outputs, strict=True)]

    @property
    def differs(self) -> bool:
        """Whether an answer, a weight or the command differs."""
        recorded = self.step.decision
        assert recorded is not None
        return any(self.others) or self.decision.weights != recorded.weights or self.command_rad_s > 0.0


def _answer(output: BehaviorOutput | None) -> tuple[Any, ...] | None:
    return None if output is None else (output.leaf_id, output.left_rad_s, output.right_rad_s)


def compare_steps(run: Run, session: SoccerSession, behaviors: Mapping[str, Behavior]) -> Iterator[Compared]:
    """Every step of a recording, decided again by another session.

    Args:
        session: without a limit on episodes or goals: the recording says when the run ends.
        behaviors: those with another tree; for the rest, the recorded answers are used.

    Raises:
        BadInput: the recording has a gap, or messages are missing.
    """
    recorded = RecordedSession(session)
    others = [behaviors.get(name) for name in run.behaviors]
    for step in run.steps():
        if step.after_gap:
            raise BadInput(
                f"{run.path}: messages before episode {step.episode}, step {step.step} are lost; what follows can't be "
                "recomputed"
            )
        world = step.world
        if world is None or step.command is None or step.decision is None:
            if run.is_complete:
                raise BadInput(f"{run.path}: episode {step.episode}, step {step.step} is incomplete")
            continue  # the recording was cut off within its last step
        try:
            recorded.enter(step.episode, step.step, step.begins_again)
        except OutOfPlace as error:
            raise BadInput(
                f"{run.path}: episode {step.episode}, step {step.step} can't be recomputed: {error}"
            ) from None
        outputs = [
            output if output is None or other is None else other.answer(world)
            for other, output in zip(others, step.outputs, strict=True)
        ]
        command, decision = session.decide(world, outputs)
        recorded.left(world.ended)
        yield Compared(step, outputs, command, decision)


@dataclass
class DifferenceTally:
    """How many steps differ, and by how much."""

    behaviors: tuple[str, ...]
    steps: int = 0
    differing: int = 0
    """Steps in which anything differs."""
    leaves: Counter[str] = field(default_factory=Counter[str])
    """By behavior: steps in which its leaf or reference differs."""
    drivers: int = 0
    """Steps in which another behavior drives."""
    weights: int = 0
    """Steps with other weights."""
    weight_sum: float = 0.0
    weight_max: float = 0.0
    commands: int = 0
    """Steps with another command."""
    command_sum_rad_s: float = 0.0
    command_max_rad_s: float = 0.0
    first: Step | None = None
    """The first step that differs."""
    most: Step | None = None
    """The step whose commands differ most."""

    def add(self, compared: Compared) -> None:
        """Counts a step."""
        step, recorded = compared.step, compared.step.decision
        assert recorded is not None
        self.steps += 1
        for name, other in zip(self.behaviors, compared.others, strict=True):
            self.leaves[name] += other
        weight, command = compared.weight, compared.command_rad_s
        self.drivers += compared.decision.driver != recorded.driver
        self.weights += compared.decision.weights != recorded.weights
        self.weight_sum += weight
        self.weight_max = max(self.weight_max, weight)
        self.commands += command > 0.0
        self.command_sum_rad_s += command
        if command > self.command_max_rad_s:
            self.command_max_rad_s, self.most = command, step
        if compared.differs:
            self.differing += 1
            self.first = self.first or step

    @property
    def values(self) -> dict[str, Any]:
        """As JSON values; means are over all steps, None without any."""
        steps = self.steps
        return {
            "steps": steps,
            "steps_that_differ": self.differing,
            "answers": {name: self.leaves[name] for name in self.behaviors},
            "drivers": self.drivers,
            "weights": {
                "steps": self.weights,
                "mean": self.weight_sum / steps if steps else None,
                "max": self.weight_max if steps else None,
            },
            "commands": {
                "steps": self.commands,
                "mean_rad_s": self.command_sum_rad_s / steps if steps else None,
                "max_rad_s": self.command_max_rad_s if steps else None,
            },
            "first_difference": _place(self.first),
            "largest_difference": _place(self.most),
        }


def _place(step: Step | None) -> dict[str, int] | None:
    return None if step is None else {"episode": step.episode, "step": step.step, "stamp_ns": step.stamp_ns}


@dataclass
class EpisodeTally:
    """One episode's differences, and its outcome."""

    index: int
    phase: int
    tally: DifferenceTally
    outcome: str | None = None

    @property
    def values(self) -> dict[str, Any]:
        """As JSON values."""
        return {"episode": self.index, "outcome": self.outcome, **self.tally.values}


class Tallies:
    """The differences of a whole recording, and of each of its episodes."""

    def __init__(self, behaviors: tuple[str, ...]) -> None:
        self.whole = DifferenceTally(behaviors)
        self.episodes: list[EpisodeTally] = []
        self._last_step = -1

    def add(self, compared: Compared) -> None:
        """Counts a step."""
        step, world = compared.step, compared.step.world
        assert world is not None
        if not self.episodes or self.episodes[-1].index != step.episode or step.step <= self._last_step:
            tally = DifferenceTally(self.whole.behaviors)
            self.episodes.append(EpisodeTally(step.episode, compared.decision.phase, tally))
        self._last_step = step.step
        self.whole.add(compared)
        self.episodes[-1].tally.add(compared)
        if world.terminated:
            self.episodes[-1].outcome = "goal" if world.goal else "own_goal"
        elif world.truncated:
            self.episodes[-1].outcome = "timeout"
