"""Equations 10 to 15: proximal policy optimisation (PPO) with generalised advantage estimation (GAE). Pure functions.

PPO's clipped surrogate objective is from Schulman et al. 2017, Proximal Policy Optimization Algorithms (arXiv 1707.06347);
GAE from Schulman et al. 2016, High-Dimensional Continuous Control Using Generalized Advantage Estimation (arXiv
1506.02438). Policy and critic are linear in tile-coded features (`linear`). A decision is an option that is held for k
steps (Sutton, Precup & Singh 1999): R is the discounted reward of these steps and gamma^k the discount over them, as
in a semi-Markov decision process. Eqs. 11 and 15 are steps of `linear`; docs/fusion.md derives the equations beside
eqs. 5 and 6.

N decisions (T of one episode), n behaviors, F active features per decision.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp

import numpy as np
from numpy.typing import NDArray

from fbql_fusion.core.learners.linear import Floats, accumulate_td_errors, log_weight_gradient

_TINY = 1e-12


def softmax(preferences: Sequence[float]) -> tuple[float, ...]:
    """Eq. 10: w_i = exp(h_i) / sum_j exp(h_j), length n. h_i is the sum of theta_{f,i} over the active features f."""
    highest = max(preferences)
    powers = [exp(x - highest) for x in preferences]
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
    """Eqs. 12 and 13 (GAE): d_t = R_t + gamma^k_t V(s_{t+1}) - V(s_t) and A_t = d_t + gamma^k_t lambda A_{t+1}.

    Args:
        rewards: R of an episode's T decisions, [T].
        discounts: gamma^k, [T].
        values: V(s_0) ... V(s_T), [T + 1]; the last is 0 where the episode terminated.
        trace: lambda.

    Returns:
        A, [T].
    """
    td_errors = rewards + discounts * values[1:] - values[:-1]
    return accumulate_td_errors(td_errors, discounts, trace)


def normalised_advantages(values: Floats) -> Floats:
    """Shifted to mean 0 and scaled to standard deviation 1, so that alpha means the same early and late."""
    return (values - values.mean()) / (values.std() + 1e-8)


def clipped_surrogate_step(
    weights: Floats, drawn: NDArray[np.int64], old_prob: Floats, advantage: Floats, clip: float
) -> Floats:
    """Eq. 14: A rho (1[i = drawn] - w_i), and 0 where rho left [1 - clip, 1 + clip] in the direction of A.

    This is the gradient of PPO's clipped surrogate objective, min(rho A, clipped(rho) A), by the preferences.

    Args:
        weights: w of eq. 10 now, [N, n].
        drawn: the behavior that drove, [N].
        old_prob: the weight by which it was drawn then, [N]; rho = w_drawn / old_prob.
        advantage: A, normalised, [N].

    Returns:
        The step of the preferences, [N, n].
    """
    rho = weights[np.arange(len(weights)), drawn] / old_prob
    clipped = ((advantage > 0.0) & (rho > 1.0 + clip)) | ((advantage < 0.0) & (rho < 1.0 - clip))
    return np.where(clipped, 0.0, advantage * rho)[:, None] * log_weight_gradient(weights, drawn)


def approx_kl(weights: Floats, drawn: NDArray[np.int64], old_prob: Floats) -> float:
    """Mean of rho - 1 - log rho: an estimate, never below 0, of the KL divergence of the weights at the draw from those now.

    See Schulman 2020, Approximating KL Divergence (joschu.net/blog/kl-approx.html): its estimator k3.
    """
    rho = weights[np.arange(len(weights)), drawn] / old_prob
    return float((rho - 1.0 - np.log(rho + _TINY)).mean())
