"""Ellipsoids on pages and plots: the shapes that are drawn hold what they should."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from pydrake.geometry import Meshcat

from prehensile.viz.ellipsoids import draw_ellipsoid, plot_ellipse, projected


def random_rotation(rng):
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.linalg.det(Q)


@given(st.integers(0, 2**32 - 1))
def test_the_shadow_is_what_the_ellipsoid_covers(seed):
    """Support function: the shadow reaches as far in every direction as the ellipsoid does."""
    rng = np.random.default_rng(seed)
    axes, radii = random_rotation(rng), rng.uniform(0.2, 3, 3)
    shadow = projected(axes, radii, (0, 2))
    angle = np.radians(shadow.angle)
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for direction in rng.normal(size=(5, 2)):
        n = np.array([direction[0], 0, direction[1]])
        far = np.linalg.norm(radii * (axes.T @ n))
        half = 0.5 * np.array([shadow.width, shadow.height])
        assert np.linalg.norm(half * (R.T @ direction)) == pytest.approx(far)


def test_an_ellipse_is_placed_and_scaled():
    plot = Figure().subplots()
    ellipse = plot_ellipse(plot, (1, 2), np.eye(2), (0.5, 0.25), scale=2)
    assert ellipse.get_center() == (1, 2)
    assert (ellipse.width, ellipse.height, ellipse.angle) == pytest.approx((2, 1, 0))
    assert list(plot.patches) == [ellipse]


@pytest.fixture(scope="module")
def meshcat():
    return Meshcat()


def test_ellipsoids_of_any_radii_can_be_drawn(meshcat):
    for radii in [(1, 0.5, 0.1), (1, 0.5, 0), (np.inf, 2, 1), (0, 0, 0), (np.inf,) * 3]:
        draw_ellipsoid(meshcat, "e", (1, 2, 3), np.eye(3)[[1, 2, 0]], radii, scale=0.2)
    assert meshcat.HasPath("/drake/e")


@pytest.mark.parametrize(
    ("change", "argument"),
    [
        ({"radii": (1, -1, 1)}, "radii"),
        ({"radii": (1, np.nan, 1)}, "radii"),
        ({"radii": (1, 1)}, "radii"),
        ({"axes": np.ones((3, 3))}, "axes"),
        ({"axes": np.diag([1.0, 1.0, -1.0])}, "axes"),
        ({"scale": 0.0}, "scale"),
        ({"p_WE": (0.0, np.nan, 0.0)}, "p_WE"),
    ],
)
def test_bad_arguments_are_named(meshcat, change, argument):
    good = {"p_WE": (0, 0, 0), "axes": np.eye(3), "radii": (1, 1, 1), "scale": 1.0}
    with pytest.raises(ValueError, match=f"^{argument}: "):
        draw_ellipsoid(meshcat, "bad", **(good | change))
