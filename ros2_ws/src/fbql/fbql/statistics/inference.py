"""Confidence intervals and tests over runs: statements about the mean over seeds, not about one lucky seed.

Bootstraps and permutation tests draw from a generator with a fixed seed, so that a table repeats bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan, nan, pi, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

RESAMPLES = 10_000
SEED = 20_261_122
_Z = 1.959964
"""Normal quantile of a 95 % interval."""


class Interval(NamedTuple):
    """An estimate and its 95 % confidence interval."""

    estimate: float
    low: float
    high: float


def ratio_of_sums(numerators: Sequence[float], denominators: Sequence[float]) -> Interval:
    """sum(numerators) / sum(denominators) over runs, with the percentile bootstrap over the runs.

    A method's cost/goal is such a ratio: steps and goals are summed before they are divided, so that a run with few goals
    does not count as much as one with many. NaN where the denominators sum to 0; a single run has no interval (NaN ends).

    Source: Efron & Tibshirani, An Introduction to the Bootstrap (1993), section 13.3 (the percentile interval).
    """
    pairs = np.array([numerators, denominators], dtype=np.float64)
    rng = np.random.default_rng(SEED)
    chosen = rng.integers(pairs.shape[1], size=(RESAMPLES, pairs.shape[1]))
    sums = pairs[:, chosen].sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = sums[0] / sums[1]
        estimate = float(pairs[0].sum() / pairs[1].sum())
        low, high = np.percentile(ratios, [2.5, 97.5]) if len(numerators) > 1 else (nan, nan)
    return Interval(estimate, float(low), float(high))


class Sums(NamedTuple):
    """The terms of a ratio of sums, run by run."""

    numerators: Sequence[float]
    denominators: Sequence[float]


def clustered_ratio(ours: Sums, clusters: Sequence[int], theirs: Sums | None = None) -> Interval:
    """The ratio of sums, or that of ours over theirs, with a two-stage bootstrap: over clusters, then over runs in them.

    Runs on the same trees are alike: five seeds on each of five tree sets say less than 25 independent runs. So tree sets
    are drawn first, then runs of each. The runs of ours and theirs are paired, and are drawn together.

    Source: Davison & Hinkley, Bootstrap Methods and their Application (1997), section 3.8 (hierarchical data).

    Args:
        clusters: the tree set of each run. A single run has no interval (NaN ends).
    """
    resamples = Resamples(clusters)
    whole = np.ones((1, len(clusters)))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios, estimate = _ratios(resamples.counts, ours), _ratios(whole, ours)
        if theirs is not None:
            ratios, estimate = ratios / _ratios(resamples.counts, theirs), estimate / _ratios(whole, theirs)
    low, high = _bounds(ratios) if len(clusters) > 1 else (nan, nan)
    return Interval(float(estimate[0]), low, high)


def _bounds(values: npt.NDArray[np.float64]) -> tuple[float, float]:
    """The 95 % percentile interval of resampled values, without those that are 0 / 0."""
    known = values[~np.isnan(values)]
    if not len(known):
        return float("nan"), float("nan")
    with np.errstate(invalid="ignore"):  # between infinite values
        low, high = np.percentile(known, [2.5, 97.5])
    return float(low), float(high)


def _ratios(counts: npt.NDArray[np.float64], sums: Sums) -> npt.NDArray[np.float64]:
    """The ratio of sums of each resample, [resamples]; `counts` [resamples, runs] is how often a run was drawn."""
    return (counts @ np.array(sums.numerators, dtype=np.float64)) / (
        counts @ np.array(sums.denominators, dtype=np.float64)
    )


class Resamples:
    """Two-stage bootstrap resamples of runs: clusters are drawn with replacement, then as many runs of each as it has.

    Args:
        clusters: the cluster of each run.
    """

    def __init__(self, clusters: Sequence[int]) -> None:
        rng = np.random.default_rng(SEED)
        members = [np.flatnonzero(np.array(clusters) == each) for each in sorted(set(clusters))]
        self.counts = np.zeros((RESAMPLES, len(clusters)))
        """How often each run was drawn, [RESAMPLES, runs]."""
        rows = np.arange(RESAMPLES)
        for _ in members:
            chosen = rng.integers(len(members), size=RESAMPLES)
            for k, runs in enumerate(members):
                here = rows[chosen == k]
                drawn = runs[rng.integers(len(runs), size=(len(here), len(runs)))]
                np.add.at(self.counts, (here[:, None], drawn), 1.0)

    def mean_band(self, values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The mean over runs at each point, and its 95 % interval, [3, points]; that of one run has no width.

        Args:
            values: [runs, points]; NaN where a run has no value, and is left out.
        """
        there = ~np.isnan(values)
        return self.ratio_band(np.where(there, values, 0.0), there.astype(np.float64))

    def ratio_band(
        self, numerators: npt.NDArray[np.float64], denominators: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """The ratio of sums over runs at each point, and its 95 % interval, [3, points]; NaN where nothing is
        known. That of one run has no width.

        Args:
            numerators: [runs, points].
            denominators: [runs, points].
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = (self.counts @ numerators) / (self.counts @ denominators)
            estimate = numerators.sum(axis=0) / denominators.sum(axis=0)
        return np.vstack([estimate, np.array([_bounds(own) for own in ratios.T]).T])


def interquartile_mean(values: Sequence[float], clusters: Sequence[int]) -> Interval:
    """The mean over runs without the lowest and the highest quarter of them, with the two-stage bootstrap (`Resamples`).

    One bad run moves it less than the mean, and it is less noisy than the median. Of n runs, floor(n / 4) are left out at
    either end, as by SciPy's `trim_mean`.

    Source: Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice (2021), section 4.3. Their
    bootstrap is stratified: over the runs of each task, which are fixed. Here tree sets are the strata; they are a
    sample themselves, and are drawn as well.

    Args:
        clusters: the tree set of each run. A single run has no interval (NaN ends).
    """
    scores = np.array(values, dtype=np.float64)
    order = np.argsort(scores, kind="stable")
    estimate = _trimmed_means(np.ones((1, len(scores))), scores[order])[0]
    low, high = nan, nan
    if len(scores) > 1:
        low, high = _bounds(_trimmed_means(Resamples(clusters).counts[:, order], scores[order]))
    return Interval(float(estimate), low, high)


def _trimmed_means(counts: npt.NDArray[np.float64], ordered: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The interquartile mean of each resample, [resamples], of values in ascending order.

    Args:
        counts: how often each value was drawn, [resamples, values].
    """
    after = np.cumsum(counts, axis=1)
    drawn = after[:, -1:]
    cut = np.floor(drawn / 4)
    kept = np.diff(np.clip(after, cut, drawn - cut), axis=1, prepend=cut)
    with np.errstate(invalid="ignore"):  # an infinite value that is not kept
        return np.where(kept > 0, kept * ordered, 0.0).sum(axis=1) / kept.sum(axis=1)


def probability_of_improvement(ours: Sequence[float], theirs: Sequence[float], clusters: Sequence[int]) -> Interval:
    """The probability that a run of ours costs less than one of theirs on the same tree set; equal ones count half.

    Within a tree set it is the share of all pairs of a run of ours and one of theirs (the Mann-Whitney U statistic); over
    tree sets it is the mean. The interval is that of the two-stage bootstrap (`Resamples`): tree sets are drawn, then runs, ours
    and theirs together, because they are paired.

    Source: Agarwal et al. (2021), section 4.3, with tree sets for tasks, and cost for the negative of a score.

    Args:
        ours, theirs: the cost of each run, paired.
        clusters: the tree set of each pair. A single pair has no interval (NaN ends).
    """
    mine, others = np.array(ours, dtype=np.float64), np.array(theirs, dtype=np.float64)
    wins = (mine[:, None] < others) + 0.5 * (mine[:, None] == others)
    kinds = np.array(clusters)
    parts = [np.flatnonzero(kinds == each) for each in sorted(set(clusters))]
    shares = [float(wins[np.ix_(part, part)].mean()) for part in parts]
    estimate = sum(shares) / len(shares)
    if len(mine) < 2:
        return Interval(estimate, nan, nan)
    counts = Resamples(clusters).counts
    total = np.zeros(len(counts))
    for part in parts:
        drawn = counts[:, part]
        runs = drawn.sum(axis=1)
        pairs = np.einsum("ri,ij,rj->r", drawn, wins[np.ix_(part, part)], drawn, optimize=True)
        # runs / len(part) is how often the tree set was drawn
        total += np.divide(pairs, runs * len(part), out=np.zeros(len(counts)), where=runs > 0)
    return Interval(estimate, *_bounds(total / len(parts)))


def mean_interval(values: Sequence[float]) -> Interval:
    """The mean over runs, with the percentile bootstrap over the runs; a single run has no interval (NaN ends)."""
    return ratio_of_sums(values, [1.0] * len(values))


def wilson_interval(successes: int, n: int) -> Interval:
    """The share of successes among n > 0 independent trials, with the score interval.

    Source: Wilson, Probable Inference, the Law of Succession, and Statistical Inference (1927).
    """
    share, z2 = successes / n, _Z * _Z
    middle = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = _Z / (1 + z2 / n) * sqrt(share * (1 - share) / n + z2 / (4 * n * n))
    return Interval(share, max(middle - half, 0.0), min(middle + half, 1.0))


def paired_p_value(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """Two-sided p of the paired sign-flip permutation test that the mean difference is 0.

    The two of a pair have the same tree set and seed. With B = RESAMPLES random sign flips, p = (1 + #{|mean| at least the
    observed one}) / (B + 1), so that the smallest p is 1 / (B + 1). A single pair says nothing: NaN.

    Sources: Good, Permutation, Parametric and Bootstrap Tests of Hypotheses (2005), chapter 3; for counting the observed
    one, Phipson & Smyth, Permutation P-values Should Never Be Zero (2010).
    """
    if len(ours) < 2:
        return nan
    differences = np.array(ours, dtype=np.float64) - np.array(theirs, dtype=np.float64)
    observed = abs(differences.mean())
    rng = np.random.default_rng(SEED)
    signs: npt.NDArray[np.float64] = rng.choice([-1.0, 1.0], size=(RESAMPLES, len(differences)))
    means = np.abs((signs * differences).mean(axis=1))
    # Equal means may differ in the last bit, hence the tolerance.
    return float((1 + (means >= observed * (1 - 1e-12)).sum()) / (RESAMPLES + 1))


def clustered_p_value(ours: Sequence[float], theirs: Sequence[float], clusters: Sequence[int]) -> float:
    """Two-sided p that ours and theirs cost the same, with one number per tree set: runs on the same trees are alike.

    The number is the mean over the tree set's runs of log(ours / theirs), both above 0; the test is Student's t test that its
    mean over tree sets is 0. Where all runs are of one tree set, it says nothing about others: NaN.

    Source: Hayes & Moulton, Cluster Randomised Trials (2017), section 10.3 (analysis of cluster summaries).
    """
    logs = np.log(np.array(ours, dtype=np.float64) / np.array(theirs, dtype=np.float64))
    kinds = np.array(clusters)
    means = np.array([logs[kinds == each].mean() for each in sorted(set(clusters))])
    n = len(means)
    if n < 2:
        return nan
    spread = float(means.std(ddof=1))
    if spread <= 1e-12 * abs(means).max():
        return 0.0 if abs(means).max() else 1.0  # tree sets that agree to the last bit
    return student_p_value(float(means.mean()) / (spread / sqrt(n)), n - 1)


def student_p_value(t: float, degrees: int) -> float:
    """Two-sided p of Student's t with a whole number of degrees of freedom.

    Source: Abramowitz & Stegun, Handbook of Mathematical Functions (1964), 26.7.3 and 26.7.4.
    """
    sine, cosine2 = abs(t) / sqrt(degrees + t * t), degrees / (degrees + t * t)
    # 1 + 1 / 2 c^2 + (1 3) / (2 4) c^4 + ...; with odd degrees 1 + 2 / 3 c^2 + (2 4) / (3 5) c^4 + ...
    odd = degrees % 2
    total = term = 1.0 if degrees > 1 else 0.0
    for k in range(1, (degrees - odd) // 2):
        term *= cosine2 * (2 * k - 1 + odd) / (2 * k + odd)
        total += term
    if odd:
        return max(1.0 - 2.0 / pi * (atan(abs(t) / sqrt(degrees)) + sine * sqrt(cosine2) * total), 0.0)
    return max(1.0 - sine * total, 0.0)


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """The p values of a family of tests, adjusted so that the chance of any false one below .05 is at most .05.

    Source: Holm, A Simple Sequentially Rejective Multiple Test Procedure (1979).

    Args:
        p_values: of each test; None where none was made, which does not count.
    """
    made = sorted((p, place) for place, p in enumerate(p_values) if p is not None)
    adjusted: list[float | None] = [None] * len(p_values)
    largest = 0.0
    for rank, (p, place) in enumerate(made):
        largest = max(largest, min((len(made) - rank) * p, 1.0))
        adjusted[place] = largest
    return adjusted
