"""Outlier removal beside its definition, written out."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from prehensile.perception.cloud import PointCloud
from prehensile.perception.outliers import radius_outliers, statistical_outliers


def noisy_sheet(count=400, strays=15, seed=0):
    rng = np.random.default_rng(seed)
    sheet = rng.uniform(-1, 1, (count, 3)) * [1, 1, 0.01]
    return np.concatenate([sheet, rng.uniform(-1, 1, (strays, 3)) + [0, 0, 2]])


@pytest.mark.parametrize(("neighbors", "ratio"), [(2, 0.5), (20, 2.0), (1000, 1.0)])
def test_statistical_outliers_by_full_search(neighbors, ratio):
    points = noisy_sheet()
    nearest = np.sort(cdist(points, points), axis=1)[:, :neighbors]
    means = nearest.mean(axis=1)
    expected = means <= means.mean() + ratio * means.std(ddof=1)
    mask = statistical_outliers(PointCloud(points), neighbors, ratio)
    np.testing.assert_array_equal(mask, expected)
    two = statistical_outliers(PointCloud(points), neighbors, ratio, num_threads=2)
    np.testing.assert_array_equal(mask, two)


def test_strays_go_and_the_sheet_stays():
    mask = statistical_outliers(PointCloud(noisy_sheet()), 20, 2.0)
    assert mask[:400].mean() > 0.98
    assert mask[400:].mean() < 0.1


@pytest.mark.parametrize(("radius", "least"), [(0.1, 1), (0.2, 4), (0.2, 30), (5.0, 500)])
def test_radius_outliers_by_full_search(radius, least):
    points = noisy_sheet()
    others = (cdist(points, points) <= radius).sum(axis=1) - 1
    mask = radius_outliers(PointCloud(points), radius, least)
    np.testing.assert_array_equal(mask, others >= least)


def test_few_points_and_points_at_one_place():
    empty, one = PointCloud(np.zeros((0, 3))), PointCloud(np.ones((1, 3)))
    same = PointCloud(np.ones((30, 3)))
    assert statistical_outliers(empty).shape == (0,)
    assert radius_outliers(empty, 1.0, 1).shape == (0,)
    assert not statistical_outliers(one).any()
    assert not radius_outliers(one, 1.0, 1).any()
    assert not statistical_outliers(same, 5).any()
    assert radius_outliers(same, 1.0, 29).all()
    assert not radius_outliers(same, 1.0, 30).any()
    pair = PointCloud([[0, 0, 0], [1, 0, 0]])
    assert statistical_outliers(pair).all()


def test_bad_arguments_are_named():
    cloud = PointCloud(noisy_sheet())
    with pytest.raises(ValueError, match="neighbors"):
        statistical_outliers(cloud, 1)
    for ratio in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="std_ratio"):
            statistical_outliers(cloud, 5, ratio)
    for radius in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="radius"):
            radius_outliers(cloud, radius, 3)
    with pytest.raises(ValueError, match="min_neighbors"):
        radius_outliers(cloud, 1.0, 0)
    with pytest.raises(ValueError, match="num_threads"):
        radius_outliers(cloud, 1.0, 1, num_threads=0)
