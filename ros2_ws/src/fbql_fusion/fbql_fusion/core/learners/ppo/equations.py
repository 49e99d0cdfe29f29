"""Equations 10 to 15: proximal policy optimization (PPO) with generalized advantage estimation (GAE). Pure functions.

PPO's clipped surrogate objective is from Schulman et al. 2017, Proximal Policy Optimization Algorithms (arXiv 1707.06347);
GAE from Schulman et al. 2016, High-Dimensional Continuous Control Using Generalized Advantage Estimation (arXiv
1506.02438). Policy and critic are linear in tile-coded features (`linear`). A decision is an option that is held for k
steps (Sutton, Precup & Singh 1999): R is the discounted reward of these steps and gamma^k the discount over them, as
in a semi-Markov decision process. Eqs. 11 and 15 are steps of `linear`; docs/fusion.md derives the equations beside
eqs. 5 and 6.

A behavior that may not drive is left out of eq. 10's sum, so that it is neither drawn nor moved by the gradient.

N decisions (T of one episode), n behaviors, F active features per decision.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, inf, log
from typing import NamedTuple

import numpy as np
from fbql_common.core.kernels import kernel, kernel_for
from numpy.typing import NDArray

from fbql_fusion.core.learners.linear import (
    Floats,
    accumulate_td_errors,
    add_shared,
    log_weight_gradient,
    pairwise_sum,
    row_sums,
    value_sums,
)

_TINY = 1e-12


class Batch(NamedTuple):
    """N decisions of whole episodes."""

    active: NDArray[np.int64]
    """The features that the weights depend on, [N, F]."""
    critic_inputs: NDArray[np.int64]
    """Those that V depends on: the same and those of its further inputs, [N, F + F']."""
    drivers: NDArray[np.int64]
    """[N]"""
    masks: NDArray[np.bool_]
    """The behaviors that could have driven, [N, n]."""
    old_probs: Floats
    """The weights by which they were drawn, [N]."""
    advantages: Floats
    """A of eq. 13, [N]: normalized where the weights learn from it."""
    lambda_returns: Floats
    """A + V, the critic's targets, [N]."""

    def in_order(self, order: NDArray[np.int64]) -> Batch:
        """The same decisions in another order, [N]."""
        return Batch(
            self.active[order],
            self.critic_inputs[order],
            self.drivers[order],
            self.masks[order],
            self.old_probs[order],
            self.advantages[order],
            self.lambda_returns[order],
        )


class Rates(NamedTuple):
    """The sizes of the steps."""

    policy: float
    """alpha"""
    critic: float
    """beta"""
    clip: float


def softmax(preferences: Sequence[float], mask: Sequence[bool] | None = None) -> tuple[float, ...]:
    """Eq. 10: w_i = exp(h_i) / sum_j exp(h_j), length n. h_i is the sum of theta_{f,i} over the active features f.

    Args:
        preferences: h, length n.
        mask: which behaviors may drive, at least one; the sum is over them, and w is 0 for all others. None: all.
    """
    if mask is not None:
        preferences = [x if may_drive else -inf for x, may_drive in zip(preferences, mask, strict=True)]
    highest = max(preferences)
    powers = [exp(x - highest) for x in preferences]
    total = sum(powers)
    return tuple([x / total for x in powers])


def _weights_interpreted(theta: Floats, active: NDArray[np.int64], masks: NDArray[np.bool_]) -> Floats:
    h = row_sums(theta, active)
    h[~masks] = -inf
    h -= h.max(axis=1, keepdims=True)
    powers = np.array(list(map(exp, h.ravel().tolist()))).reshape(h.shape)
    return powers / powers.sum(axis=1, keepdims=True)


@kernel_for(_weights_interpreted)
def weights_of(theta: Floats, active: NDArray[np.int64], masks: NDArray[np.bool_]) -> Floats:
    """Eq. 10 for many decisions.

    Args:
        theta: [features, n].
        active: [N, F].
        masks: which behaviors may drive, at least one of each decision's, [N, n].

    Returns:
        w, [N, n].
    """
    weights = row_sums(theta, active)
    n = weights.shape[1]
    for t in range(len(weights)):
        highest = -inf
        for i in range(n):
            if masks[t, i]:
                highest = max(highest, weights[t, i])
        for i in range(n):
            weights[t, i] = exp(weights[t, i] - highest) if masks[t, i] else 0.0
        total = pairwise_sum(weights[t])
        for i in range(n):
            weights[t, i] /= total
    return weights


def _advantages_interpreted(rewards: Floats, discounts: Floats, values: Floats, trace: float) -> Floats:
    return accumulate_td_errors(rewards + discounts * values[1:] - values[:-1], discounts, trace)


@kernel_for(_advantages_interpreted)
def advantages(rewards: Floats, discounts: Floats, values: Floats, trace: float) -> Floats:
    """Eqs. 12 and 13 (GAE): d_t = R_t + gamma^k_t V(s_{t+1}) - V(s_t) and A_t = d_t + gamma^k_t lambda A_{t+1}.

    Args:
        rewards: R of an episode's T decisions, [T].
        discounts: gamma^k, [T].
        values: V(s_0) ... V(s_T), [T + 1]; the last is 0 where the episode terminated.
        trace: lambda.

    Returns:
        A, [T].
    """
    td_errors = np.empty(len(rewards))
    for t in range(len(rewards)):
        td_errors[t] = rewards[t] + discounts[t] * values[t + 1] - values[t]
    return accumulate_td_errors(td_errors, discounts, trace)


def normalised_advantages(values: Floats) -> Floats:
    """Shifted to mean 0 and scaled to standard deviation 1, so that alpha means the same early and late."""
    return (values - values.mean()) / (values.std() + 1e-8)


def _clipped_interpreted(
    weights: Floats, drawn: NDArray[np.int64], old_prob: Floats, advantage: Floats, clip: float
) -> Floats:
    rho = weights[np.arange(len(weights)), drawn] / old_prob
    clipped = ((advantage > 0.0) & (rho > 1.0 + clip)) | ((advantage < 0.0) & (rho < 1.0 - clip))
    return np.where(clipped, 0.0, advantage * rho)[:, None] * log_weight_gradient(weights, drawn)


@kernel_for(_clipped_interpreted)
def clipped_surrogate_step(
    weights: Floats, drawn: NDArray[np.int64], old_prob: Floats, advantage: Floats, clip: float
) -> Floats:
    """Eq. 14: A rho (1[i = drawn] - w_i), and 0 where rho left [1 - clip, 1 + clip] in the direction of A.

    This is the gradient of PPO's clipped surrogate objective, min(rho A, clipped(rho) A), by the preferences.

    Args:
        weights: w of eq. 10 now, [N, n].
        drawn: the behavior that drove, [N].
        old_prob: the weight by which it was drawn then, [N]; rho = w_drawn / old_prob.
        advantage: A, normalized, [N].

    Returns:
        The step of the preferences, [N, n].
    """
    step = log_weight_gradient(weights, drawn)
    for t in range(len(weights)):
        rho = weights[t, drawn[t]] / old_prob[t]
        gain = advantage[t] * rho
        if (advantage[t] > 0.0 and rho > 1.0 + clip) or (advantage[t] < 0.0 and rho < 1.0 - clip):
            gain = 0.0
        for i in range(weights.shape[1]):
            step[t, i] *= gain
    return step


def approx_kl(weights: Floats, drawn: NDArray[np.int64], old_prob: Floats) -> float:
    """Mean of rho - 1 - log rho: an estimate, never below 0, of the KL divergence of the weights at the draw from those now.

    See Schulman 2020, Approximating KL Divergence (joschu.net/blog/kl-approx.html): its estimator k3.
    """
    rho = weights[np.arange(len(weights)), drawn] / old_prob
    logs = np.array(list(map(log, (rho + _TINY).tolist())))  # NumPy's own differs between processors
    return float((rho - 1.0 - logs).mean())


@kernel
def update_critic(value: Floats, inputs: NDArray[np.int64], lambda_return: Floats, rate: float) -> None:
    """Eq. 15's assignment for a minibatch: V's table [features] is changed in place."""
    error = lambda_return - value_sums(value, inputs)
    add_shared(value.reshape((-1, 1)), inputs, error.reshape((-1, 1)), rate)


@kernel
def policy_pass(theta: Floats, value: Floats, batch: Batch, minibatch: int, weights_change: bool, rates: Rates) -> None:
    """One pass over a batch, a minibatch at a time: eqs. 14 and 15, or eq. 15 alone. Both tables change in place."""
    for begin in range(0, len(batch.drivers), minibatch):
        end = min(begin + minibatch, len(batch.drivers))
        if weights_change:
            active = batch.active[begin:end]
            drivers = batch.drivers[begin:end]
            weights = weights_of(theta, active, batch.masks[begin:end])
            step = clipped_surrogate_step(
                weights, drivers, batch.old_probs[begin:end], batch.advantages[begin:end], rates.clip
            )
            add_shared(theta, active, step, rates.policy)
        update_critic(value, batch.critic_inputs[begin:end], batch.lambda_returns[begin:end], rates.critic)


def cloning_pass(
    theta: Floats, value: Floats, batch: Batch, minibatch: int, is_example: NDArray[np.bool_], rates: Rates
) -> None:
    """One pass over guided decisions: eq. 15 for all of them, and eq. 11 for those that are examples, [N]."""
    for begin in range(0, len(batch.drivers), minibatch):
        end = min(begin + minibatch, len(batch.drivers))
        update_critic(value, batch.critic_inputs[begin:end], batch.lambda_returns[begin:end], rates.critic)
        shown = np.flatnonzero(is_example[begin:end]) + begin
        active = batch.active[shown]
        step = log_weight_gradient(weights_of(theta, active, batch.masks[shown]), batch.drivers[shown])
        add_shared(theta, active, step, rates.policy)
