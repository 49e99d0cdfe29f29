"""Intervals and tests against numbers that are known without them."""

from itertools import product

import numpy as np
import pytest
from fbql.statistics.inference import (
    RESAMPLES,
    Resamples,
    Sums,
    clustered_ratio,
    mean_interval,
    paired_p_value,
    ratio_of_sums,
    wilson_interval,
)


def test_ratio_of_sums_weighs_runs_by_their_goals():
    assert ratio_of_sums([100.0, 900.0], [1.0, 9.0]).estimate == 100.0
    assert ratio_of_sums([100.0, 100.0], [1.0, 4.0]).estimate == 40.0


def test_interval_of_equal_runs_has_no_width():
    assert mean_interval([3.0] * 7) == (3.0, 3.0, 3.0)


def test_interval_of_the_mean_covers_the_truth_about_as_often_as_it_says():
    rng = np.random.default_rng(5)
    covered = 0
    for _ in range(60):
        interval = mean_interval(rng.normal(10.0, 2.0, size=30).tolist())
        covered += interval.low <= 10.0 <= interval.high
    assert 50 <= covered <= 60


def test_p_value_is_that_of_all_sign_flips():
    ours, theirs = [1.0, 2.5, 0.5, 4.0, 2.0, 3.0], [0.0, 2.0, 1.0, 2.0, 1.0, 2.5]
    differences = np.array(ours) - np.array(theirs)
    flips = [abs(np.mean(differences * signs)) for signs in product((-1, 1), repeat=6)]
    exact = np.mean([flip >= abs(differences.mean()) - 1e-12 for flip in flips])
    assert paired_p_value(ours, theirs) == pytest.approx(exact, abs=0.02)


def test_p_value_of_no_difference_is_one_and_is_never_zero():
    assert paired_p_value([1.0, 2.0], [1.0, 2.0]) == 1.0
    assert paired_p_value([float(i) for i in range(40)], [100.0] * 40) == pytest.approx(1 / (RESAMPLES + 1))


def test_the_same_runs_give_the_same_numbers():
    steps, goals = [310.0, 700.0, 520.0], [1.0, 2.0, 1.0]
    assert ratio_of_sums(steps, goals) == ratio_of_sums(steps, goals)
    assert paired_p_value(steps, goals) == paired_p_value(steps, goals)


def test_clustered_ratio_is_the_ratio_of_sums_and_of_equal_runs_has_no_width():
    assert clustered_ratio(Sums([100.0, 900.0], [1.0, 9.0]), [1, 2]).estimate == 100.0
    twice = clustered_ratio(Sums([200.0, 1800.0], [1.0, 9.0]), [1, 2], Sums([100.0, 900.0], [1.0, 9.0]))
    assert twice == (2.0, 2.0, 2.0)


def test_one_run_alone_has_no_interval():
    estimate, low, high = clustered_ratio(Sums([300.0], [3.0]), [1])
    assert estimate == 100.0 and np.isnan(low) and np.isnan(high)


def test_runs_of_few_clusters_say_less_than_as_many_independent_ones():
    values = [1.0, 1.1, 0.9, 1.0, 2.0, 2.1, 1.9, 2.0, 3.0, 3.1, 2.9, 3.0]
    ones = [1.0] * len(values)
    clustered = clustered_ratio(Sums(values, ones), [k // 4 for k in range(12)])
    independent = clustered_ratio(Sums(values, ones), list(range(12)))
    assert clustered.high - clustered.low > 1.5 * (independent.high - independent.low)
    assert independent == pytest.approx(mean_interval(values), abs=0.02)


def test_a_resample_draws_as_many_runs_as_its_clusters_have():
    counts = Resamples([7, 7, 9, 9, 9]).counts
    sizes = {tuple(row) for row in np.stack([counts[:, :2].sum(axis=1), counts[:, 2:].sum(axis=1)], axis=1).tolist()}
    assert sizes == {(4.0, 0.0), (2.0, 3.0), (0.0, 6.0)}
    assert counts.mean(axis=0) == pytest.approx([1.0] * 5, abs=0.05)


def test_band_of_one_point_is_the_interval_of_the_mean_and_leaves_out_what_is_not_there():
    values = np.array([[1.0, 1.0], [2.0, np.nan], [4.0, 3.0]])
    band = Resamples([1, 2, 3]).mean_band(values)
    assert band[0] == pytest.approx([7 / 3, 2.0])
    assert band[:, 1].tolist() == [2.0, 1.0, 3.0]
    assert band[:, 0] == pytest.approx(clustered_ratio(Sums([1.0, 2.0, 4.0], [1.0] * 3), [1, 2, 3]))


def test_one_run_or_pair_alone_has_no_interval_and_no_p():
    assert mean_interval([3.0]).estimate == 3.0
    assert np.isnan([*mean_interval([3.0])[1:], *ratio_of_sums([3.0], [1.0])[1:], paired_p_value([3.0], [2.0])]).all()


def test_the_interval_of_a_share_is_wilsons() -> None:
    share, *ends = wilson_interval(8, 10)
    assert share == 0.8
    assert ends == pytest.approx((0.490162, 0.943318), abs=1e-6)  # Wilson 1927, by hand
    assert wilson_interval(0, 5).low == pytest.approx(0.0, abs=1e-12)
    assert wilson_interval(5, 5).high == 1.0
