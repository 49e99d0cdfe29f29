"""Intervals and tests against numbers that are known without them."""

from itertools import product

import numpy as np
import pytest
from fbql.statistics.inference import (
    RESAMPLES,
    Resamples,
    Sums,
    clustered_p_value,
    clustered_ratio,
    holm,
    interquartile_mean,
    mean_interval,
    paired_p_value,
    probability_of_improvement,
    ratio_of_sums,
    student_p_value,
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


def test_the_interquartile_mean_leaves_out_a_quarter_at_either_end() -> None:
    assert interquartile_mean([9.0, 1.0, 3.0, 2.0], [1, 1, 2, 2]).estimate == 2.5
    assert interquartile_mean([9.0, 1.0, 3.0], [1, 1, 2]).estimate == pytest.approx(13 / 3)  # a quarter of 3 is no run
    assert interquartile_mean([float("inf"), 1.0, 3.0, 2.0, 4.0], [1] * 5).estimate == 3.0
    stats = pytest.importorskip("scipy.stats")
    values = np.random.default_rng(3).lognormal(size=37).tolist()
    assert interquartile_mean(values, [0] * 37).estimate == pytest.approx(stats.trim_mean(values, 0.25))


def test_the_interval_of_the_interquartile_mean_is_that_of_resampled_runs() -> None:
    values = np.random.default_rng(4).normal(10.0, 2.0, size=24)
    clusters = [k // 6 for k in range(24)]
    one_by_one = [
        np.sort(np.repeat(values, row))[runs // 4 : runs - runs // 4].mean()
        for row in Resamples(clusters).counts.astype(int)
        for runs in [row.sum()]
    ]
    _, low, high = interquartile_mean(values.tolist(), clusters)
    assert (low, high) == pytest.approx(np.percentile(one_by_one, [2.5, 97.5]))


def test_improvement_is_the_share_of_pairs_within_tree_sets_and_equal_costs_count_half() -> None:
    # tree set 1: of 4 pairs ours is less in 3; tree set 2: less in 0, equal in 1 of 4
    ours, theirs = [1.0, 3.0, 9.0, 8.0], [2.0, 4.0, 8.0, 7.0]
    assert probability_of_improvement(ours, theirs, [1, 1, 2, 2]).estimate == pytest.approx((3 / 4 + 0.5 / 4) / 2)
    assert probability_of_improvement(theirs, ours, [1, 1, 2, 2]).estimate == pytest.approx((1 / 4 + 3.5 / 4) / 2)
    assert probability_of_improvement([1.0] * 4, [2.0] * 4, [1, 1, 2, 2]) == (1.0, 1.0, 1.0)
    assert probability_of_improvement([2.0] * 4, [2.0] * 4, [1, 1, 2, 2]) == (0.5, 0.5, 0.5)


def test_improvement_within_one_tree_set_is_the_mann_whitney_statistic() -> None:
    stats = pytest.importorskip("scipy.stats")
    rng = np.random.default_rng(6)
    ours, theirs = rng.integers(0, 9, size=12).astype(float), rng.integers(1, 10, size=12).astype(float)
    found = probability_of_improvement(ours.tolist(), theirs.tolist(), [0] * 12)
    assert found.estimate == pytest.approx(stats.mannwhitneyu(theirs, ours).statistic / 144)
    assert found.low < found.estimate < found.high


def test_tree_sets_that_disagree_widen_the_interval_of_an_improvement() -> None:
    ours, theirs = [1.0] * 6 + [3.0] * 6, [2.0] * 12
    clustered = probability_of_improvement(ours, theirs, [0] * 6 + [1] * 6)
    independent = probability_of_improvement(ours, theirs, list(range(12)))
    assert clustered == (0.5, 0.0, 1.0)
    assert (independent.low, independent.high) == pytest.approx((0.25, 0.75), abs=0.06)


def test_one_pair_alone_has_no_interval_of_improvement_and_one_run_none_of_the_interquartile_mean() -> None:
    assert probability_of_improvement([1.0], [2.0], [1])[0] == 1.0
    assert interquartile_mean([3.0], [1])[0] == 3.0
    assert np.isnan([*probability_of_improvement([1.0], [2.0], [1])[1:], *interquartile_mean([3.0], [1])[1:]]).all()


@pytest.mark.parametrize(
    ("t", "degrees", "p"),
    [
        (12.706, 1, 0.05), (4.303, 2, 0.05), (3.182, 3, 0.05), (2.776, 4, 0.05), (2.571, 5, 0.05), (2.228, 10, 0.05),
        (-4.604, 4, 0.01), (63.657, 1, 0.01), (0.0, 3, 1.0), (0.0, 4, 1.0),
    ],
)  # fmt: skip
def test_p_of_students_t_is_that_of_the_printed_tables(t: float, degrees: int, p: float) -> None:
    assert student_p_value(t, degrees) == pytest.approx(p, rel=1e-3)


def test_p_over_tree_sets_counts_tree_sets_and_not_runs() -> None:
    # logarithms of the ratios -1, -2, -3: t = -2 / (1 / sqrt 3), with 2 degrees
    costs = np.exp([-1.0, -2.0, -3.0]).tolist()
    assert clustered_p_value(costs, [1.0] * 3, [1, 2, 3]) == pytest.approx(1 - np.sqrt(12) / np.sqrt(14))
    many = clustered_p_value(costs * 8, [1.0] * 24, [1, 2, 3] * 8)
    assert many == pytest.approx(clustered_p_value(costs, [1.0] * 3, [1, 2, 3]))
    assert paired_p_value(costs * 8, [1.0] * 24) < many / 100
    stats = pytest.importorskip("scipy.stats")
    logs = [0.3, -0.1, 0.5, 0.25]
    assert clustered_p_value(np.exp(logs).tolist(), [1.0] * 4, [1, 2, 3, 4]) == pytest.approx(
        stats.ttest_1samp(logs, 0.0).pvalue
    )


def test_p_over_tree_sets_is_not_known_from_one_and_is_sharp_where_all_agree() -> None:
    assert np.isnan(clustered_p_value([1.0, 2.0], [2.0, 3.0], [7, 7]))
    assert clustered_p_value([1.0, 1.0], [2.0, 2.0], [1, 2]) == 0.0
    assert clustered_p_value([2.0, 2.0], [2.0, 2.0], [1, 2]) == 1.0


def test_holm_multiplies_each_p_by_the_tests_that_are_left_and_keeps_their_order() -> None:
    assert holm([0.01, 0.04, 0.03, None, 0.005]) == pytest.approx([0.03, 0.06, 0.06, None, 0.02])
    assert holm([0.5, 0.6]) == [1.0, 1.0]
    assert holm([]) == [] and holm([None]) == [None]
