"""The fused command: the weighted sum of the references of the behaviors that answered (the paper's Fig. 4)."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

from fbql_common.core.command_space import Command, CommandSpace

from fbql_fusion.core.tasks.interface import Answers

SUM_TOLERANCE = 1e-9
"""Weights whose sum is this close to 1 are used as they are."""


class Blend(NamedTuple):
    """A command and the weights that made it."""

    command: Command
    weights: tuple[float, ...]
    """0 where a behavior did not answer; they sum to 1, or are all 0 where none answered."""
    rejected: bool
    """The given weights were unusable, and uniform ones replaced them."""


def blend(weights: Sequence[float], answers: Answers, space: CommandSpace) -> Blend:
    """sum_i w_i ref_a_i for each axis of the command, within the axis's limits.

    Weights of behaviors that did not answer, or may not drive, are shared among the others in proportion. Weights of a
    wrong number, or that are not finite, are rejected: the behaviors that answered then weigh the same. If no behavior
    answered, the command is 0 on every axis.

    Args:
        weights: w_i, length n.
        answers: length n; None where a behavior did not answer.
    """
    commands = [answer.command for answer in answers if answer is not None and answer.active]
    # False for a NaN too, so that bad weights take the long way.
    if len(weights) == len(answers) == len(commands) and -SUM_TOLERANCE < sum(weights) - 1.0 < SUM_TOLERANCE:
        used, rejected = tuple(weights), False
    else:
        live = [answer is not None and answer.active for answer in answers]
        used, rejected = live_weights(weights, live)
        commands = [space.standstill if answer is None else answer.command for answer in answers]
    command: list[float] = []
    for (_, _, low, high, _), values in zip(space.axes, zip(*commands)):  # noqa: B905 - every command has the axes
        blended = 0.0
        for weight, value in zip(used, values):  # noqa: B905 - as many as each other
            blended += weight * value
        command.append(low if blended < low else high if blended > high else blended)
    return Blend(tuple(command), used, rejected)


def live_weights(weights: Sequence[float], live: Sequence[bool]) -> tuple[tuple[float, ...], bool]:
    """The weights renormalized over the behaviors that are live, and whether they had to be rejected.

    Args:
        weights: w_i; any length.
        live: which of the n behaviors answered.

    Returns:
        Length n: 0 where not live, the rest sums to 1 (all 0 where nobody is live).
    """
    alive = sum(live)
    if alive == 0:
        return (0.0,) * len(live), False
    uniform = tuple([1.0 / alive if is_live else 0.0 for is_live in live])
    if len(weights) != len(live) or not all(isfinite(weight) for weight in weights):
        return uniform, True
    kept = [weight if is_live else 0.0 for weight, is_live in zip(weights, live, strict=True)]
    total = sum(kept)
    if not isfinite(total):
        return uniform, True
    if total <= 0.0:
        # All the weight was on behaviors that are gone: nothing is known about those that are left.
        return uniform, False
    return tuple([weight / total for weight in kept]), False
