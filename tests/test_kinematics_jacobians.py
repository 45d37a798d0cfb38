"""Measures of Jacobians: closed forms of planar arms, definitions, the iiwa's singularities."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from iiwa_plant import make_iiwa

from prehensile.kinematics.jacobians import (
    condition_number,
    force_ellipsoid,
    manipulability,
    rank,
    singular_values,
    singularity_along,
    task_rows,
    velocity_ellipsoid,
)
from prehensile.kinematics.tree import tree_from_plant


def planar(q, l1=0.5, l2=0.3):
    """Translational Jacobian of a planar arm with two links."""
    a, b = q[0], q[0] + q[1]
    return np.array(
        [
            [-l1 * np.sin(a) - l2 * np.sin(b), -l2 * np.sin(b)],
            [l1 * np.cos(a) + l2 * np.cos(b), l2 * np.cos(b)],
        ]
    )


@pytest.fixture(scope="module")
def iiwa():
    plant = make_iiwa()
    return tree_from_plant(plant, [plant.GetFrameByName("iiwa_link_7")]).tree


@given(st.floats(-3.1, 3.1), st.floats(-3.1, 3.1))
def test_planar_arm_in_closed_form(q1, q2):
    J = planar((q1, q2))
    # Yoshikawa 1985: l1 l2 |sin q2|.
    assert manipulability(J) == pytest.approx(0.5 * 0.3 * abs(np.sin(q2)), abs=1e-12)
    sigma = singular_values(J)
    trace = np.sum(J**2)
    det = np.linalg.det(J) ** 2
    larger = trace / 2 + np.sqrt(max(trace**2 / 4 - det, 0))
    assert sigma[0] == pytest.approx(np.sqrt(larger), abs=1e-9)
    if abs(np.sin(q2)) > 1e-6:
        assert rank(J) == 2
        assert condition_number(J) == pytest.approx(sigma[0] / sigma[1])


def test_isotropic_place_of_the_planar_arm():
    """Salisbury and Craig 1982: l1 = √2 l2 and q2 = 3π/4 make the condition number 1."""
    J = planar((0.4, 0.75 * np.pi), np.sqrt(2.0), 1.0)
    assert condition_number(J) == pytest.approx(1.0)


def test_singular_and_thin_matrices():
    J = planar((0.3, 0.0))
    assert rank(J) == 1
    assert condition_number(J) > 1e14
    assert rank(np.zeros((6, 7))) == 0
    assert condition_number(np.zeros((2, 6, 7))).tolist() == [np.inf, np.inf]
    thin = np.eye(6)[:, :2]
    assert (rank(thin), manipulability(thin), condition_number(thin)) == (2, 0.0, np.inf)
    assert rank(np.diag([1.0, 1e-4])) == 2
    assert rank(np.diag([1.0, 1e-4]), tolerance=1e-3) == 1


@given(st.integers(0, 2**32 - 1))
def test_ellipsoids_hold_what_the_joints_can_do(seed):
    rng = np.random.default_rng(seed)
    J, speeds, efforts = rng.normal(size=(3, 7)), rng.uniform(0.5, 3, 7), rng.uniform(1, 9, 7)
    e = velocity_ellipsoid(J, joint_speeds=speeds)
    np.testing.assert_allclose(e.axes.T @ e.axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(e.axes) == pytest.approx(1.0)
    v = rng.normal(size=(7, 1000))
    V = J @ (speeds[:, None] * v / np.linalg.norm(v, axis=0))
    assert np.max(np.linalg.norm((e.axes.T @ V) / e.radii[:, None], axis=0)) <= 1 + 1e-12
    for u in rng.normal(size=(5, 3)):
        # Its surface is reached, by the joint velocity that is smallest among those for it.
        V = e.axes @ (e.radii * u / np.linalg.norm(u))
        assert np.linalg.norm(np.linalg.pinv(J * speeds) @ V) == pytest.approx(1.0)
    f = force_ellipsoid(J, joint_efforts=efforts)
    for u in rng.normal(size=(5, 3)):
        F = f.axes @ (f.radii * u / np.linalg.norm(u))
        assert np.linalg.norm(J.T @ F / efforts) == pytest.approx(1.0)


def test_a_stretched_arm_holds_any_force_along_itself():
    J = planar((0.0, 0.0))
    velocity, force = velocity_ellipsoid(J), force_ellipsoid(J)
    assert velocity.radii[1] == 0
    assert np.isinf(force.radii[1])
    np.testing.assert_allclose(np.abs(force.axes[:, 1]), [1, 0], atol=1e-12)


def test_parts_and_their_units():
    J = np.arange(42.0).reshape(6, 7)
    np.testing.assert_array_equal(task_rows(J, "rotational"), J[:3])
    np.testing.assert_array_equal(task_rows(J, "translational"), J[3:])
    both = task_rows(J, "both", length=0.5)
    np.testing.assert_array_equal(both[:3], J[:3])
    np.testing.assert_array_equal(both[3:], 2 * J[3:])
    assert J[5, 6] == 41  # untouched
    # Manipulability of both scales with L⁻³, its rotational part not at all.
    rng = np.random.default_rng(0)
    stack = rng.normal(size=(4, 6, 7))
    one, two = (manipulability(task_rows(stack, "both", length=L)) for L in (1.0, 2.0))
    np.testing.assert_allclose(one, 8 * two)


def test_singularities_of_the_iiwa(iiwa):
    """Elbow stretched; and wrist straight with q5 at a right angle."""
    q = np.array([0.3, 0.7, -0.4, -1.2, 0.5, 0.9, 0.1])
    assert rank(iiwa.jacobian(q)) == 6
    q[3] = 0.0
    assert rank(iiwa.jacobian(q), tolerance=1e-12) == 5
    q[3], q[5], q[4] = -1.2, 0.0, np.pi / 2
    assert rank(iiwa.jacobian(q), tolerance=1e-12) == 5


def test_closest_singularity_along_a_path(iiwa):
    """The elbow passes through zero at one waypoint; what is lost there is to move outward."""
    path = np.tile([0.3, 0.7, 0.0, 0.0, 0.0, 0.9, 0.1], (101, 1))
    path[:, 3] = np.linspace(-1.0, 0.5, 101)
    path[:, 3] -= path[np.argmin(np.abs(path[:, 3])), 3]
    found = singularity_along(iiwa, path, part="both", length=0.8)
    assert path[found.closest, 3] == 0
    assert found.distances.shape == (101,)
    assert found.distances[found.closest] < 1e-12
    J = task_rows(iiwa.jacobian(path[found.closest]), "both", length=0.8)
    assert np.linalg.norm(found.lost @ J) < 1e-12
    # Distance to the nearest matrix of lower rank (Eckart and Young), at another waypoint.
    J = task_rows(iiwa.jacobian(path[0]), "both", length=0.8)
    U, s, Vt = np.linalg.svd(J)
    nearest = J - s[-1] * np.outer(U[:, -1], Vt[5])
    assert np.linalg.matrix_rank(nearest, tol=1e-12) == 5
    assert np.linalg.norm(J - nearest, 2) == pytest.approx(found.distances[0])


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: task_rows(np.eye(3), "both", length=1), "J"),
        (lambda: task_rows(np.eye(6), "both"), "length"),
        (lambda: task_rows(np.eye(6), "both", length=0), "length"),
        (lambda: task_rows(np.eye(6), "linear"), "part"),  # pyright: ignore[reportArgumentType]
        (lambda: velocity_ellipsoid(np.eye(3), joint_speeds=[1, 2]), "joint_speeds"),
        (lambda: force_ellipsoid(np.eye(3), joint_efforts=[1, 0, 1]), "joint_efforts"),
        (lambda: velocity_ellipsoid(np.ones(3)), "J"),
        (lambda: velocity_ellipsoid(np.full((3, 3), np.nan)), "J"),
        (lambda: velocity_ellipsoid(np.ones(3), joint_speeds=[1, 2, 3]), "J"),
        (lambda: singular_values([1, 2]), "J"),
        (lambda: manipulability(np.full((3, 3), np.inf)), "J"),
        (lambda: rank(np.ones((2, 3, 3))), "J"),
        (lambda: rank(np.eye(3), tolerance=np.nan), "tolerance"),
    ],
)
def test_bad_arguments_are_named(call, argument):
    with pytest.raises(ValueError, match=f"^{argument}: "):
        call()


def test_an_empty_path_is_refused(iiwa):
    with pytest.raises(ValueError, match="^path: "):
        singularity_along(iiwa, np.empty((0, 7)))
