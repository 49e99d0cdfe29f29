"""Equations 16 to 20: the paper's method repaired by learning action values. Pure functions.

It is TD(lambda) for the values of behaviors, as a dueling sum of U and theta (Wang et al. 2016, arXiv 1511.06581), under a
policy that is a softmax of the values mixed with a uniform one. docs/fusion.md derives the equations beside eqs. 5 and 6.

N decisions (T of one episode), n behaviors, F active features per decision, m features. A table of values is [m, n +
1]: its row f is theta_{f,1} ... theta_{f,n} and U_f. A decision is held for k steps: R is the discounted reward of
these steps and gamma^k the discount over them, as in a semi-Markov decision process (Sutton, Precup & Singh 1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp

import numpy as np
from numpy.typing import NDArray

from fbql_fusion.core.learners.linear import Floats, accumulate_td_errors, add_shared, log_weight_gradient


def soft_weights(
    theta: Sequence[float], temperature: float, exploration: float, mask: Sequence[bool] | None = None
) -> tuple[float, ...]:
    """Eq. 16: w_i = (1 - eps) exp(theta_i / tau) / sum_j exp(theta_j / tau) + eps / n, length n.

    theta_i(s) is sum_f theta_{f,i} over the active features f. By eq. 17 exp(Q_i / tau) in its place gives the same w.

    Args:
        theta: length n.
        mask: which behaviors may drive, at least one; sum and n are of them, and w is 0 for all others. None: all.
    """
    if mask is not None:
        some = iter(soft_weights([x for x, may in zip(theta, mask, strict=True) if may], temperature, exploration))
        return tuple([next(some) if may else 0.0 for may in mask])
    highest = max(theta)
    powers = [exp((x - highest) / temperature) for x in theta]
    share = (1.0 - exploration) / sum(powers)
    least = exploration / len(theta)
    return tuple([share * x + least for x in powers])


def values_of(theta: Sequence[float], shared: float, weights: Sequence[float]) -> tuple[float, ...]:
    """Eq. 17: Q(s, B_i) = U(s) + theta_i(s) - sum_j w(s, B_j) theta_j(s), length n.

    So U is the value of the state, sum_j w(s, B_j) Q(s, B_j) = U(s), and theta the value of a behavior relative to the
    others. U(s) is sum_f U_f over the active features f.
    """
    base = shared - sum([w * x for w, x in zip(weights, theta, strict=True)])
    return tuple([x + base for x in theta])


def soft_weights_of_all(theta: Floats, temperature: float, exploration: float, masks: NDArray[np.bool_]) -> Floats:
    """Eq. 16 for many situations: theta_i(s) [N, n] and which behaviors may drive [N, n] give w, [N, n]."""
    theta = np.where(masks, theta, -np.inf)
    powers = np.exp((theta - theta.max(axis=1, keepdims=True)) / temperature)
    least = exploration / masks.sum(axis=1, keepdims=True)
    return np.where(masks, (1.0 - exploration) * powers / powers.sum(axis=1, keepdims=True) + least, 0.0)


def values_of_all(theta: Floats, shared: Floats, weights: Floats) -> Floats:
    """Eq. 17 for many situations: theta_i(s) [N, n], U(s) [N] and w [N, n] give Q, [N, n]."""
    return theta + (shared - (weights * theta).sum(axis=1))[:, None]


def decayed(first: float, last: float, halving: float, episodes: float) -> float:
    """Eq. 18, a hyperbolic schedule: x_last + (x_first - x_last) / (1 + e / e_half) after e episodes, halfway at e_half."""
    return last + (first - last) / (1.0 + episodes / halving)


def lambda_returns(
    rewards: Floats, discounts: Floats, drivers: NDArray[np.int64], q: Floats, weights: Floats, trace: float
) -> Floats:
    """Eqs. 19 and 20: the learning target of Q(s_t, B_a), a lambda-return, for each decision of an episode.

    The TD error is d_t = R_t + gamma^k_t sum_j w(s_{t+1}, B_j) Q(s_{t+1}, B_j) - Q(s_t, B_a): eq. 5's bootstrap, but
    with the whole reward, and only for the behavior that drove. Errors count for the decisions before them, decayed by
    gamma^k lambda from decision to decision: G_t = Q(s_t, B_a) + E_t with E_t = d_t + gamma^k_t lambda E_{t+1}.

    Args:
        rewards: R of an episode's T decisions, [T].
        discounts: gamma^k, [T].
        drivers: a, the behavior that drove, [T].
        q: Q(s_0) ... Q(s_T), [T + 1, n]; the last row is 0 where the episode terminated.
        weights: w(s_0) ... w(s_T), [T + 1, n].
        trace: lambda.

    Returns:
        G, [T].
    """
    own = q[np.arange(len(drivers)), drivers]
    later = (weights[1:] * q[1:]).sum(axis=1)
    return own + accumulate_td_errors(rewards + discounts * later - own, discounts, trace)


def move_towards(
    table: Floats,
    active: NDArray[np.int64],
    drivers: NDArray[np.int64],
    weights: Floats,
    targets: Floats,
    rate: float,
    shared_rate: float,
) -> None:
    """Eq. 20's assignment, down the gradient of (G - Q(s, B_a))^2 / 2 with w held, for the active features f:

    theta_{f,i} += alpha / F (1[i = a] - w_i) (G - Q(s, B_a)) for every i, U_f += beta / F (G - Q(s, B_a)).

    Args:
        table: [m, n + 1]; changed in place.
        active: [N, F].
        drivers: a, [N].
        weights: w of eq. 17, [N, n].
        targets: G, [N].
        rate: alpha.
        shared_rate: beta, above 0.
    """
    total = table[active].sum(axis=1)
    gradient = log_weight_gradient(weights, drivers)
    td_error = targets - total[:, -1] - (gradient * total[:, :-1]).sum(axis=1)
    # One assignment of both, so that add_shared keeps them from overshooting together.
    rates = np.column_stack([gradient * rate, np.full(len(targets), shared_rate)]) / (rate + shared_rate)
    add_shared(table, active, rates * td_error[:, None], rate + shared_rate)
