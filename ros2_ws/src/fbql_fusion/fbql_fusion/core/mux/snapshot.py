"""Packs the snapshot that a decision of a mux was based on into its message, and unpacks it again, as verification needs it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from math import isnan
from typing import NamedTuple

from fbql_common.core.command_space import Command
from fbql_common.core.mux_types import MuxDecision
from fbql_common.core.types import Decision

from fbql_fusion.core.tasks.twist.answers import SourceAnswer, SourceLeaves
from fbql_fusion.core.tasks.twist.moment import MuxMoment


class Snapshot(NamedTuple):
    """What a decision depends on, and what else was known at that moment."""

    stamp_ns: int
    episode: int
    step: int
    reward: float
    terminated: bool
    truncated: bool
    outcome: str
    observed: tuple[float, ...]
    """Group by group; NaN where one is unknown."""
    active: tuple[bool, ...]
    commands: tuple[float, ...]
    """Of each source, a value per axis; 0 before the first."""
    ages_s: tuple[float, ...]
    """-1 before the first command."""
    overruled_by: str

    def moment(self, lengths: Sequence[int]) -> MuxMoment:
        """The moment of the task; a group with an unknown part is unknown."""
        groups = [self.observed[end - length : end] for end, length in zip(accumulate(lengths), lengths, strict=True)]
        observed = tuple(() if any(map(isnan, group)) else group for group in groups)
        return MuxMoment(
            self.stamp_ns, self.episode, self.step, observed, self.reward, self.terminated, self.truncated, self.outcome
        )

    def answers(self, leaves: SourceLeaves) -> list[SourceAnswer]:
        """The answers of the sources."""
        axes = len(self.commands) // len(self.active)
        return [leaves.answer(self.commands[axes * i : axes * (i + 1)], active) for i, active in enumerate(self.active)]

    def decided(self, decision: Decision, command: Command) -> MuxDecision:
        """The message of a decision based on this snapshot."""
        return MuxDecision(
            *decision,
            self.terminated,
            self.truncated,
            self.outcome,
            self.observed,
            self.active,
            self.commands,
            self.ages_s,
            self.overruled_by,
            tuple(command),
        )


def snapshot_of(decision: MuxDecision) -> Snapshot:
    """The snapshot of a decision."""
    return Snapshot(*(getattr(decision, name) for name in Snapshot._fields))
