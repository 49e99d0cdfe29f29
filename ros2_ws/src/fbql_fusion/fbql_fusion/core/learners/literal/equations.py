"""Equations 5 and 6 of the paper, as printed, and the bounds that make eq. 6 a set of weights.

Everything here is a pure function of plain sequences with one entry for each behavior. For three behaviors plain
Python is several times faster than NumPy. Arrays of length n are in the order of the behaviors.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from math import isfinite


def fused_value(weights: Sequence[float], q: Sequence[float]) -> float:
    """sum_j w(s', B_j) Q(s', B_j): the value of the next state, in eq. 5."""
    value = 0.0
    for w, x in zip(weights, q, strict=True):
        value += w * x
    return value


def updated_q(
    q: Sequence[float],
    weights: Sequence[float],
    reward: float,
    next_value: float,
    learning_rate: float,
    discount: float,
) -> tuple[float, ...]:
    """Eq. 5: Q(s, B_i) + alpha [w(s, B_i) r + gamma sum_j w(s', B_j) Q(s', B_j) - Q(s, B_i)], for every i.

    Args:
        q: Q_k(s, B_i), length n.
        weights: w_k(s, B_i), length n.
        reward: r, of the transition from s to s'.
        next_value: `fused_value` of s', from the values before this update; 0 where s' is terminal.
        learning_rate: alpha.
        discount: gamma.

    Returns:
        Q_{k+1}(s, B_i), length n.
    """
    later = discount * next_value
    return tuple([x + learning_rate * (w * reward + later - x) for x, w in zip(q, weights, strict=True)])


def maxima(q: Sequence[float]) -> tuple[int, ...]:
    """The behaviors with the largest Q, every tied one. Empty where a Q is not a number."""
    best = max(q)
    return tuple([i for i, x in enumerate(q) if x == best])


def printed_weights(
    weights: Sequence[float], q: Sequence[float], best: Collection[int], weight_gain: float, weight_offset: float
) -> tuple[float, ...]:
    """Eq. 6 as printed, before "we normalize the value".

    w + (1 - w) delta (Q + f) for the argmax, w - w delta (Q + f) for the others.

    Args:
        weights: w_k(s, B_i), length n.
        q: Q_{k+1}(s, B_i), length n.
        best: the indices that count as the argmax.
        weight_gain: delta.
        weight_offset: f.

    Returns:
        Length n. Nothing keeps them within [0, 1] or their sum at 1: Q + f < 0 reverses the update, delta (Q + f) > 1
        overshoots.
    """
    return bounded_weights(weights, q, best, weight_gain, weight_offset, float("-inf"), float("inf"))


def bounded_weights(
    weights: Sequence[float],
    q: Sequence[float],
    best: Collection[int],
    weight_gain: float,
    weight_offset: float,
    gain_low: float,
    gain_high: float,
) -> tuple[float, ...]:
    """Eq. 6 with delta (Q + f) bounded to [gain_low, gain_high], before normalizing.

    With [0, 1] weights within [0, 1] stay there.
    """
    updated: list[float] = []
    for i, w in enumerate(weights):
        gain = weight_gain * (q[i] + weight_offset)
        if gain < gain_low:
            gain = gain_low
        elif gain > gain_high:
            gain = gain_high
        updated.append(w + (1.0 - w) * gain if i in best else w - w * gain)
    return tuple(updated)


def normalised(weights: Sequence[float], floor: float) -> tuple[float, ...] | None:
    """Weights raised to at least `floor`, then divided by their sum over the behaviors of the state.

    Returns:
        Length n, sum 1, each at least floor / (1 + n floor) where the sum before was at most 1;
        None where the sum is zero or not finite, so that there is nothing to divide by.
    """
    raised = [floor if w < floor else w for w in weights]
    total = sum(raised)
    if total == 0.0 or not isfinite(total):
        return None
    return tuple([w / total for w in raised])


def count_ties(q: Iterable[Sequence[float]]) -> int:
    """In how many joint states all Q are equal, to the last bit: eq. 6 has no argmax to choose there.

    Args:
        q: Q(s, B_i) of each joint state, each of length n.
    """
    return sum(all(x == row[0] for x in row) for row in q)
