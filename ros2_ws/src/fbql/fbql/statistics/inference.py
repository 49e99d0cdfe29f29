"""Confidence intervals and tests over runs: statements about the mean over seeds, not about one lucky seed.

Bootstraps and permutation tests draw from a generator with a fixed seed, so that a table repeats bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, sqrt
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
