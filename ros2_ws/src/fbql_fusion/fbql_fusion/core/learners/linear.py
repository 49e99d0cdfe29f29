"""Linear functions of binary features: their value is the sum of a table's rows over the active features.

With tile coding (Sutton & Barto, Reinforcement Learning, 2nd ed., 9.5.4) every situation has F active features.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CAPACITY = 1 << 14
"""Number of rows that a table starts with."""


def row_sum(table: Floats, active: Sequence[int]) -> list[float]:
    """The sum of the active rows, length n. Features beyond the table are new and count 0.

    Args:
        table: [features, n].
        active: indices, at most F.
    """
    if not active:
        return [0.0] * table.shape[1]
    try:
        rows = table.take(active, axis=0)
    except IndexError:
        rows = table[[f for f in active if f < len(table)]]
    return np.add.reduce(rows, axis=0).tolist()


def add_shared(table: Floats, active: NDArray[np.int64], steps: Floats, rate: float) -> None:
    """The assignment of eqs. 14, 15 and 20, a minibatch's gradient steps: each of the F features of a decision takes rate / F of its step.

    Decisions that share features move each other: by L times its step, if all of them step alike. Where L > 1 (a robot
        that stands still makes the same decision over and over) the step is divided by L, so that nothing overshoots
        its target.

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


def accumulate_td_errors(td_errors: Floats, discounts: Floats, trace: float) -> Floats:
    """Each TD error and, decayed, those after it: A_t = d_t + gamma^k_t lambda A_{t+1}, [T].

    Added to the value of s_t it gives the lambda-return (Sutton & Barto, 12.1).

    Args:
        td_errors: d, [T].
        discounts: gamma^k, [T].
        trace: lambda.
    """
    own = td_errors.tolist()
    decay = (discounts * trace).tolist()
    result = [0.0] * len(own)
    later = 0.0
    for t in range(len(own) - 1, -1, -1):
        result[t] = later = own[t] + decay[t] * later
    return np.array(result)


def log_weight_gradient(weights: Floats, driver: NDArray[np.int64]) -> Floats:
    """Eq. 11, and a part of eqs. 14 and 20: 1[i = driver] - w_i, [N, n].

    It is the gradient of log w_driver by the preferences of a softmax: alone, the step of behavioral cloning.

    Args:
        weights: w, [N, n].
        driver: [N].
    """
    step = -weights
    step[np.arange(len(step)), driver] += 1.0
    return step


def grow_table(table: Floats, rows: int) -> Floats:
    """The table itself if it has that many rows, else one of doubled length, filled with zeros."""
    capacity = len(table)
    while capacity < rows:
        capacity *= 2
    return table if capacity == len(table) else padded(table, capacity)


def padded(table: Floats, rows: int) -> Floats:
    """A copy extended to that many rows with zeros."""
    longer = np.zeros((rows, *table.shape[1:]))
    longer[: len(table)] = table
    return longer
