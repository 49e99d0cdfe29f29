"""The fused command: the weighted sum of the references of the behaviors that answered (the paper's Fig. 4)."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_common.core.types import BehaviorOutput, made_of

SUM_TOLERANCE = 1e-9
"""Weights whose sum is this close to 1 are used as they are."""


class Blend(NamedTuple):
    """A command and the weights that made it."""

    left_rad_s: float
    right_rad_s: float
    weights: tuple[float, ...]
    """0 where a behavior did not answer; they sum to 1, or are all 0 where none answered."""
    rejected: bool
    """The given weights were unusable, and uniform ones replaced them."""


def blend(weights: Sequence[float], outputs: Sequence[BehaviorOutput | None]) -> Blend:
    """sum_i w_i ref_a_i for the left and the right wheel, at most the wheels' full velocity.

    Weights of behaviors that did not answer are shared among the others in proportion. Weights of a wrong number,
    or that are not finite, are rejected: the behaviors that answered then weigh the same. If no behavior answered, the
        command is 0, 0.

    Args:
        weights: w_i, length n.
        outputs: n answers; None where a behavior did not answer.
    """
    if len(weights) == len(outputs):
        left = right = total = 0.0
        for weight, output in zip(weights, outputs):  # noqa: B905 - as many as each other, or not here
            if output is None:
                break
            left += weight * output.left_rad_s
            right += weight * output.right_rad_s
            total += weight
        else:
            # False for a NaN too, so that bad weights take the long way.
            if -SUM_TOLERANCE < total - 1.0 < SUM_TOLERANCE:
                return made_of(Blend, (limited(left), limited(right), tuple(weights), False))
    used, rejected = live_weights(weights, [output is not None for output in outputs])
    left = right = 0.0
    for weight, output in zip(used, outputs, strict=True):
        if output is not None:
            left += weight * output.left_rad_s
            right += weight * output.right_rad_s
    return Blend(limited(left), limited(right), used, rejected)


def live_weights(weights: Sequence[float], live: Sequence[bool]) -> tuple[tuple[float, ...], bool]:
    """The weights renormalised over the behaviors that are live, and whether they had to be rejected.

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


def limited(wheel_rad_s: float) -> float:
    """A wheel velocity limited to what the wheels can reach [rad/s]. A blend of limited references needs no limit."""
    if wheel_rad_s > MAX_WHEEL_RAD_S:
        return MAX_WHEEL_RAD_S
    if wheel_rad_s < -MAX_WHEEL_RAD_S:
        return -MAX_WHEEL_RAD_S
    return wheel_rad_s
