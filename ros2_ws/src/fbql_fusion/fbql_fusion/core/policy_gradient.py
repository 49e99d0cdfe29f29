"""Equations 10 to 15: fusion that learns. Pure functions; docs/fusion.md derives them beside eqs. 5 and 6.

N decisions, n behaviors, F active features a decision (for V the tiles that it is told as well). A decision is held for
k steps: R is the discounted reward of these steps and gamma^k the discount over them, so that everything is an SMDP's.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_TINY = 1e-12


def preferences(theta: Floats, active: Sequence[int]) -> list[float]:
    """sum_f theta_{f,i} over the active features f, length n. Features beyond the table are new and count 0.

    Args:
        theta: [features, n].
        active: indices, at most F.
    """
    if not active:
        return [0.0] * theta.shape[1]
    try:
        own = theta.take(active, axis=0)
    except IndexError:
        own = theta[[f for f in active if f < len(theta)]]
    return np.add.reduce(own, axis=0).tolist()


def softmax(values: Sequence[float]) -> tuple[float, ...]:
    """Eq. 10: w_i = exp(h_i) / sum_j exp(h_j), length n."""
    highest = max(values)
    powers = [exp(x - highest) for x in values]
    total = sum(powers)
    return tuple([x / total for x in powers])


def weights_of(theta: Floats, active: NDArray[np.int64]) -> Floats:
    """Eq. 10 for many decisions.

    Args:
        theta: [features, n].
        active: [N, F].

    Returns:
        w, [N, n].
    """
    h = theta.take(active.T, axis=0).sum(axis=0)  # whole columns at a time: the same sums, several times as fast
    h -= h.max(axis=1, keepdims=True)
    powers = np.exp(h)
    return powers / powers.sum(axis=1, keepdims=True)


def advantages(rewards: Floats, discounts: Floats, values: Floats, trace: float) -> Floats:
    """Eqs. 12 and 13: d_t = R_t + gamma^k_t V(s_{t+1}) - V(s_t) and A_t = d_t + gamma^k_t lambda A_{t+1}.

    Args:
        rewards: R of an episode's T decisions, [T].
        discounts: gamma^k, [T].
        values: V(s_0) ... V(s_T), [T + 1]; the last is 0 where the episode terminated.
        trace: lambda.

    Returns:
        A, [T].
    """
    return traced(rewards + discounts * values[1:] - values[:-1], discounts, trace)


def traced(surprises: Floats, discounts: Floats, trace: float) -> Floats:
    """Eq. 13's sum: each surprise and, faded, those after it: A_t = d_t + gamma^k_t lambda A_{t+1}, [T]."""
    own = surprises.tolist()
    fading = (discounts * trace).tolist()
    result = [0.0] * len(own)
    later = 0.0
    for t in range(len(own) - 1, -1, -1):
        result[t] = later = own[t] + fading[t] * later
    return np.array(result)


def normalised_advantages(values: Floats) -> Floats:
    """Shifted to mean 0 and scaled to deviation 1, so that alpha means the same early and late."""
    return (values - values.mean()) / (values.std() + 1e-8)


def guided_step(weights: Floats, driver: NDArray[np.int64]) -> Floats:
    """Eq. 11: 1[i = driver] - w_i, the gradient of log w_driver by the preferences, [N, n]."""
    step = -weights
    step[np.arange(len(step)), driver] += 1.0
    return step


def clipped_step(weights: Floats, drawn: NDArray[np.int64], chance: Floats, advantage: Floats, clip: float) -> Floats:
    """Eq. 14: A rho (1[i = drawn] - w_i), and 0 where rho left [1 - clip, 1 + clip] in the direction of A.

    Args:
        weights: w of eq. 10 now, [N, n].
        drawn: the behavior that drove, [N].
        chance: the weight by which it was drawn then, [N]; rho = w_drawn / chance.
        advantage: A, normalised, [N].

    Returns:
        The step of the preferences, [N, n].
    """
    rho = weights[np.arange(len(weights)), drawn] / chance
    done = ((advantage > 0.0) & (rho > 1.0 + clip)) | ((advantage < 0.0) & (rho < 1.0 - clip))
    return np.where(done, 0.0, advantage * rho)[:, None] * guided_step(weights, drawn)


def divergence(weights: Floats, drawn: NDArray[np.int64], chance: Floats) -> float:
    """Mean of rho - 1 - log rho: an estimate, never below 0, of how far the weights went from those of the drawing."""
    rho = weights[np.arange(len(weights)), drawn] / chance
    return float((rho - 1.0 - np.log(rho + _TINY)).mean())


def add_shared(table: Floats, active: NDArray[np.int64], steps: Floats, rate: float) -> None:
    """Eqs. 14 and 15's assignment: each of the F features of a decision takes rate / F of its step.

    Decisions that share features move each other: by L times its step, if all of them step alike. Where L > 1 (a robot
    that stands still decides the same over and over) the step is divided by L, so that nothing overshoots its target.

    Args:
        table: [features, n] or [features]; changed in place.
        active: [N, F].
        steps: [N, n] or [N].
    """
    features = active.shape[1]
    if not features:
        return
    every = active.ravel()
    moved = np.bincount(every)[active].sum(axis=1) * (rate / features)
    shares = steps.T / np.maximum(moved, 1.0) * (rate / features)
    for column, share in zip(np.atleast_2d(table.T), np.atleast_2d(shares), strict=True):
        np.add.at(column, every, np.repeat(share, features))
