"""Linear functions of binary features: their value is the sum of a table's rows over the active features.

With tile coding (Sutton & Barto, Reinforcement Learning, 2nd ed., 9.5.4) every situation has F active features.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from fbql_common.core.kernels import kernel, kernel_for
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


def _row_sums_interpreted(table: Floats, active: NDArray[np.int64]) -> Floats:
    return table.take(active.T, axis=0).sum(axis=0)  # whole columns at a time: the same sums, several times as fast


@kernel_for(_row_sums_interpreted)
def row_sums(table: Floats, active: NDArray[np.int64]) -> Floats:
    """The sum of the active rows for each decision, [N, n].

    Args:
        table: [features, n].
        active: [N, F].
    """
    decisions, features = active.shape
    n = table.shape[1]
    sums = np.zeros((decisions, n))
    for t in range(decisions):
        for f in range(features):
            row = active[t, f]
            for i in range(n):
                sums[t, i] += table[row, i]
    return sums


def _value_sums_interpreted(table: Floats, active: NDArray[np.int64]) -> Floats:
    return table[active].sum(axis=1)


@kernel_for(_value_sums_interpreted)
def value_sums(table: Floats, active: NDArray[np.int64]) -> Floats:
    """The sum of the active values for each decision, [N].

    Args:
        table: [features].
        active: [N, F].
    """
    decisions, features = active.shape
    sums = np.empty(decisions)
    values = np.empty(features)
    for t in range(decisions):
        for f in range(features):
            values[f] = table[active[t, f]]
        sums[t] = pairwise_sum(values)
    return sums


def _sum_interpreted(values: Floats) -> float:
    return np.add.reduce(values)


@kernel_for(_sum_interpreted)
def pairwise_sum(values: Floats) -> float:
    """The sum of values [n], in the order in which NumPy adds them up: eight at a time, and long ones in halves."""
    n = len(values)
    if n < 8:
        total = 0.0
        for i in range(n):
            total += values[i]
        return total
    if n > 128:
        half = n // 2
        half -= half % 8
        return pairwise_sum(values[:half]) + pairwise_sum(values[half:])
    part = values[:8].copy()
    whole = n - n % 8
    for i in range(8, whole, 8):
        for j in range(8):
            part[j] += values[i + j]
    total = ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]))
    for i in range(whole, n):
        total += values[i]
    return total


def _meetings_interpreted(active: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.bincount(active.ravel())[active].sum(axis=1)


@kernel_for(_meetings_interpreted)
def meetings(active: NDArray[np.int64]) -> NDArray[np.int64]:
    """How often each decision's features occur in all of them, its own included, [N, F] -> [N]."""
    decisions, features = active.shape
    highest = 0
    for t in range(decisions):
        for f in range(features):
            highest = max(highest, active[t, f])
    counts = np.zeros(highest + 1, dtype=np.int32)
    for t in range(decisions):
        for f in range(features):
            counts[active[t, f]] += 1
    found = np.zeros(decisions, dtype=np.int64)
    for t in range(decisions):
        for f in range(features):
            found[t] += counts[active[t, f]]
    return found


def _add_to_rows_interpreted(table: Floats, active: NDArray[np.int64], shares: Floats) -> None:
    every, features = active.ravel(), active.shape[1]
    for column, share in zip(table.T, shares.T, strict=True):
        np.add.at(column, every, np.repeat(share, features))


@kernel_for(_add_to_rows_interpreted)
def add_to_rows(table: Floats, active: NDArray[np.int64], shares: Floats) -> None:
    """Adds each decision's share [N, n] to the rows of its features, [features, n]."""
    decisions, features = active.shape
    for t in range(decisions):
        for f in range(features):
            row = active[t, f]
            for i in range(table.shape[1]):
                table[row, i] += shares[t, i]


def _shares_interpreted(steps: Floats, moved: NDArray[np.int64], share: float) -> Floats:
    return steps / np.maximum(moved * share, 1.0).reshape((-1, 1)) * share


@kernel_for(_shares_interpreted)
def shares_of(steps: Floats, moved: NDArray[np.int64], share: float) -> Floats:
    """The share of a decision's step that each of its features takes, [N, n]."""
    shares = np.empty(steps.shape)
    for t in range(len(steps)):
        largest = max(moved[t] * share, 1.0)
        for i in range(steps.shape[1]):
            shares[t, i] = steps[t, i] / largest * share
    return shares


@kernel
def add_shared(table: Floats, active: NDArray[np.int64], steps: Floats, rate: float) -> None:
    """The assignment of eqs. 14, 15 and 20, a minibatch's gradient steps: each of the F features of a decision takes rate / F of its step.

    Decisions that share features move each other: by L times its step, if all of them step alike. Where L > 1 (a robot
        that stands still makes the same decision over and over) the step is divided by L, so that nothing overshoots
        its target.

    Args:
        table: [features, n]; changed in place.
        active: [N, F].
        steps: [N, n].
    """
    decisions, features = active.shape
    if decisions == 0 or features == 0:
        return
    share = rate / features
    add_to_rows(table, active, shares_of(steps, meetings(active), share))


def _accumulate_interpreted(td_errors: Floats, discounts: Floats, trace: float) -> Floats:
    own = td_errors.tolist()
    decay = (discounts * trace).tolist()
    later = 0.0
    for t in range(len(own) - 1, -1, -1):
        own[t] = later = own[t] + decay[t] * later
    return np.array(own)


@kernel_for(_accumulate_interpreted)
def accumulate_td_errors(td_errors: Floats, discounts: Floats, trace: float) -> Floats:
    """Each TD error and, decayed, those after it: A_t = d_t + gamma^k_t lambda A_{t+1}, [T].

    Added to the value of s_t it gives the lambda-return (Sutton & Barto, 12.1).

    Args:
        td_errors: d, [T].
        discounts: gamma^k, [T].
        trace: lambda.
    """
    result = np.empty(len(td_errors))
    later = 0.0
    for t in range(len(td_errors) - 1, -1, -1):
        later = td_errors[t] + discounts[t] * trace * later
        result[t] = later
    return result


def _log_weight_gradient_interpreted(weights: Floats, driver: NDArray[np.int64]) -> Floats:
    step = -weights
    step[np.arange(len(step)), driver] += 1.0
    return step


@kernel_for(_log_weight_gradient_interpreted)
def log_weight_gradient(weights: Floats, driver: NDArray[np.int64]) -> Floats:
    """Eq. 11, and a part of eqs. 14 and 20: 1[i = driver] - w_i, [N, n].

    It is the gradient of log w_driver by the preferences of a softmax: alone, the step of behavioral cloning.

    Args:
        weights: w, [N, n].
        driver: [N].
    """
    step = np.empty(weights.shape)
    for t in range(len(weights)):
        for i in range(weights.shape[1]):
            step[t, i] = -weights[t, i]
        step[t, driver[t]] += 1.0
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
