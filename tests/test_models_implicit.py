"""Meshes of implicit surfaces, against closed forms."""

import numpy as np
import pytest

from prehensile.errors import InputError
from prehensile.models.shapes.implicit import (
    cone,
    cut,
    drum,
    polygonize,
    rounded_block,
    slab,
    split,
    union,
)

BOX = ((-0.13, -0.13, -0.13), (0.13, 0.13, 0.13))


def capsule_volume(radius: float, length: float) -> float:
    return np.pi * radius**2 * length + 4.0 / 3.0 * np.pi * radius**3


def test_capsule_has_its_volume_and_normals() -> None:
    field = cone((0, 0, -0.04), (0, 0, 0.04), 0.05, 0.05)
    mesh = polygonize(field, *BOX, 0.006)
    assert mesh.is_closed()
    assert mesh.volume() == pytest.approx(capsule_volume(0.05, 0.08), rel=0.01)
    np.testing.assert_allclose(field(mesh.vertices), 0.0, atol=1e-9)
    nearest = np.clip(mesh.vertices[:, 2], -0.04, 0.04)
    outward = mesh.vertices - np.column_stack([0 * nearest, 0 * nearest, nearest])
    np.testing.assert_allclose(mesh.normals, outward / 0.05, atol=1e-5)


def test_volume_converges_with_the_square_of_the_step() -> None:
    field = cone((0, 0, -0.03), (0, 0.01, 0.03), 0.05, 0.05)
    exact = capsule_volume(0.05, np.hypot(0.06, 0.01))
    errors = [abs(polygonize(field, *BOX, step).volume() / exact - 1) for step in (0.012, 0.006)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.4)


def test_sharp_cylinder_and_block_have_their_values_on_faces() -> None:
    # Signed distances of points off the middle of faces and edges, by hand.
    cylinder = drum((0, 0, 0), (0, 0, 0.2), 0.1, 0.0)
    points = np.array([[0.15, 0, 0.1], [0, 0, 0.25], [0.13, 0, 0.24], [0, 0, 0.1]])
    np.testing.assert_allclose(cylinder(points), [0.05, 0.05, 0.05, -0.1], atol=1e-12)
    block = rounded_block((0, 0, 0), (0.2, 0.4, 0.6), 0.02)
    points = np.array([[0.25, 0.2, 0.3], [0.1, 0.2, -0.1], [0.1, 0.2, 0.3]])
    np.testing.assert_allclose(block(points), [0.05, 0.1, -0.1], atol=1e-12)


def test_blended_union_holds_both_bodies_and_cut_leaves_what_is_outside_the_tool() -> None:
    a = cone((-0.05, 0, 0), (0.05, 0, 0), 0.03, 0.03)
    b = drum((0, 0, -0.06), (0, 0, 0.06), 0.025, 0.005)
    p = np.random.default_rng(0).uniform(-0.1, 0.1, size=(4000, 3))
    joined = union(a, b, blend=0.02)(p)
    assert (joined <= np.minimum(a(p), b(p)) + 1e-12).all()
    assert (joined >= np.minimum(a(p), b(p)) - 0.005 - 1e-12).all()  # a quarter of the blend
    left = cut(a, b, blend=0.0)(p) < 0.0
    np.testing.assert_array_equal(left, (a(p) < 0.0) & ~(b(p) <= 0.0))


def test_slab_lies_between_its_planes() -> None:
    ring = slab(lambda p: np.hypot(p[..., 0], p[..., 2]) - 0.05, 1, 0.01, 0.03, 0.0)
    mesh = polygonize(ring, *BOX, 0.004)
    low, high = mesh.bounds()
    np.testing.assert_allclose([low[1], high[1]], [0.01, 0.03], atol=1e-3)


def test_split_cuts_along_the_curve_and_loses_nothing() -> None:
    field = cone((0, 0, -0.03), (0, 0, 0.03), 0.06, 0.04)

    def side(p: np.ndarray) -> np.ndarray:
        return p[..., 2] - 0.01 - 0.4 * p[..., 0]

    mesh = polygonize(field, *BOX, 0.006)
    below, above = split(mesh, side, field)
    assert below is not None
    assert above is not None
    assert side(below.vertices).max() < 1e-5  # m
    assert side(above.vertices).min() > -1e-5
    assert below.area() + above.area() == pytest.approx(mesh.area(), rel=1e-3)
    np.testing.assert_allclose(field(below.vertices), 0.0, atol=1e-7)
    whole, nothing = split(mesh, lambda p: p[..., 2] - 1.0, field)
    assert nothing is None
    assert whole is not None
    assert len(whole.faces) == len(mesh.faces)


def test_bad_grids_are_refused() -> None:
    ball = cone((0, 0, 0), (0, 0, 0.01), 0.05, 0.05)
    with pytest.raises(InputError, match="too fine"):
        polygonize(ball, *BOX, 1e-4)
    with pytest.raises(InputError, match="no surface"):
        polygonize(ball, (1, 1, 1), (1.1, 1.1, 1.1), 0.02)
    with pytest.raises(InputError):
        polygonize(ball, *BOX, float("nan"))
