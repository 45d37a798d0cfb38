"""The native kinematic tree: closed forms, its Jacobian against differences, bad input."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prehensile.native.kinematic_tree import KinematicTree


def pose(p=(0, 0, 0), R=None):
    X = np.eye(4)
    X[:3, 3] = p
    if R is not None:
        X[:3, :3] = R
    return X


def two_link(l1=0.5, l2=0.3):
    """A planar arm about z, its tip frame 0, and frame 1 fixed in the world."""
    X_PJ = np.stack([pose(), pose((l1, 0, 0))])
    X_PF = np.stack([pose((l2, 0, 0)), pose((1, 2, 3))])
    return KinematicTree([-1, 0], X_PJ, [[0, 0, 1]] * 2, [0, 0], [1, -1], X_PF)


def random_rotation(rng):
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.linalg.det(Q)


def random_tree(rng, n=8, m=3):
    order = rng.permutation(n)  # A joint hangs on one that is earlier in it.
    parent = np.full(n, -1)
    for i in range(1, n):
        parent[order[i]] = order[rng.integers(i)] if rng.random() < 0.9 else -1
    X = [pose(rng.normal(size=3), random_rotation(rng)) for _ in range(n + m)]
    return KinematicTree(
        parent,
        np.stack(X[:n]),
        rng.normal(size=(n, 3)),
        rng.random(n) < 0.3,
        rng.integers(-1, n, m),
        np.stack(X[n:]),
    )


def test_planar_arm_in_closed_form():
    tree = two_link()
    for q1, q2 in [(0, 0), (0.3, -1.2), (2.9, 3.1), (-7.0, 40.0)]:
        c1, s1, c12, s12 = np.cos(q1), np.sin(q1), np.cos(q1 + q2), np.sin(q1 + q2)
        X = pose((0.5 * c1 + 0.3 * c12, 0.5 * s1 + 0.3 * s12, 0))
        X[:2, :2] = [[c12, -s12], [s12, c12]]
        np.testing.assert_allclose(tree.pose([q1, q2]), X, atol=1e-14)
        J = np.zeros((6, 2))
        J[2] = 1
        J[3] = -0.5 * s1 - 0.3 * s12, -0.3 * s12
        J[4] = 0.5 * c1 + 0.3 * c12, 0.3 * c12
        np.testing.assert_allclose(tree.jacobian([q1, q2]), J, atol=1e-14)


def test_a_frame_of_the_world_stays():
    tree = two_link()
    np.testing.assert_array_equal(tree.pose([1.0, 2.0], 1), pose((1, 2, 3)))
    np.testing.assert_array_equal(tree.jacobian([1.0, 2.0], 1), np.zeros((6, 2)))


@pytest.mark.parametrize("x", [1e4, 99999.9, 123456.7, -1e9])
def test_angles_of_many_turns(x):
    X = two_link(0.0, 1.0).pose([x, 0.0])
    np.testing.assert_allclose(X[:2, 3], [np.cos(x), np.sin(x)], atol=2e-16)


def test_sine_and_cosine_to_the_last_place():
    tree = two_link(0.0, 1.0)
    x = np.concatenate([np.linspace(-10, 10, 20001), np.arange(-40, 41) * np.pi / 4])
    p = tree.poses(np.stack([x, 0 * x], axis=1))[:, :2, 3]
    assert np.max(np.abs(p[:, 0] - np.cos(x))) <= 2.3e-16
    assert np.max(np.abs(p[:, 1] - np.sin(x))) <= 2.3e-16


@given(st.integers(0, 2**32 - 1))
def test_jacobian_is_the_derivative_of_the_pose(seed):
    rng = np.random.default_rng(seed)
    tree = random_tree(rng)
    q, v, h = rng.uniform(-2, 2, 8), rng.normal(size=8), 1e-6
    for frame in range(3):
        X, J = tree.pose_and_jacobian(q, frame)
        dX = (tree.pose(q + h * v, frame) - tree.pose(q - h * v, frame)) / (2 * h)
        V = J @ v
        np.testing.assert_allclose(dX[:3, 3], V[3:], atol=1e-7)
        w = V[:3]
        W = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        np.testing.assert_allclose(dX[:3, :3], W @ X[:3, :3], atol=1e-7)
        np.testing.assert_allclose(X[:3, :3] @ X[:3, :3].T, np.eye(3), atol=1e-13)


@given(st.integers(0, 2**32 - 1))
def test_relative_jacobian_is_the_derivative_of_the_relative_pose(seed):
    rng = np.random.default_rng(seed)
    tree = random_tree(rng)
    q, v, h = rng.uniform(-2, 2, 8), rng.normal(size=8), 1e-6

    def X_AF(q):
        return np.linalg.solve(tree.pose(q, 1), tree.pose(q, 0))

    J = tree.relative_jacobian(q, 0, measured_in=1, expressed_in=1)
    dX = (X_AF(q + h * v) - X_AF(q - h * v)) / (2 * h)
    np.testing.assert_allclose(dX[:3, 3], J[3:] @ v, atol=1e-7)
    S = dX[:3, :3] @ X_AF(q)[:3, :3].T
    np.testing.assert_allclose([S[2, 1], S[0, 2], S[1, 0]], J[:3] @ v, atol=1e-7)
    # Another frame to express it in turns it only.
    R_WA, R_WE = tree.pose(q, 1)[:3, :3], tree.pose(q, 2)[:3, :3]
    J_E = tree.relative_jacobian(q, 0, measured_in=1, expressed_in=2)
    np.testing.assert_allclose(R_WE @ J_E[3:], R_WA @ J[3:], atol=1e-13)
    np.testing.assert_array_equal(
        tree.relative_jacobian(q, 0, measured_in=-1, expressed_in=-1), tree.jacobian(q, 0)
    )


def test_batches_are_the_single_calls_whatever_the_threads():
    rng = np.random.default_rng(1)
    tree = random_tree(rng)
    Q = rng.uniform(-3, 3, (2001, 8))
    X, J = tree.poses(Q, 2), tree.jacobians(Q, 2)
    for i in (0, 999, 2000):
        np.testing.assert_array_equal(X[i], tree.pose(Q[i], 2))
        np.testing.assert_array_equal(J[i], tree.jacobian(Q[i], 2))
    np.testing.assert_array_equal(tree.poses(Q, 2, num_threads=3), X)
    np.testing.assert_array_equal(tree.jacobians(Q, 2, num_threads=3), J)
    assert tree.poses(np.empty((0, 8))).shape == (0, 4, 4)


def test_a_chain_longer_than_the_stack_room():
    n = 50
    X_PJ = np.tile(pose((0.1, 0, 0)), (n, 1, 1))
    tree = KinematicTree(np.arange(-1, n - 1), X_PJ, [[0, 0, 1]] * n, [0] * n, [n - 1], [pose()])
    q = np.random.default_rng(0).uniform(-1, 1, n)
    angles = np.concatenate([[0], np.cumsum(q)[:-1]])
    p = 0.1 * np.array([np.cos(angles).sum(), np.sin(angles).sum(), 0])
    X, J = tree.pose_and_jacobian(q)
    np.testing.assert_allclose(X[:3, 3], p, atol=1e-13)
    np.testing.assert_allclose(J[3:, 0], [-p[1], p[0] - 0.1, 0], atol=1e-13)


def test_lists_and_other_number_types_are_taken():
    tree = two_link()
    expected = tree.pose(np.array([1.0, 2.0]))
    for q in ([1, 2], np.array([1, 2]), np.array([1, 2], dtype=np.float32), (1.0, 2.0)):
        np.testing.assert_array_equal(tree.pose(q), expected)
    strided = np.array([1.0, 9.0, 2.0, 9.0])[::2]
    np.testing.assert_array_equal(tree.pose(strided), expected)


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda t: t.pose([0.0]), "q"),
        (lambda t: t.pose([[0.0, 0.0]]), "q"),
        (lambda t: t.pose([0.0, np.nan]), "q"),
        (lambda t: t.jacobian([np.inf, 0.0]), "q"),
        (lambda t: t.pose("ab"), "q"),
        (lambda t: t.pose(np.zeros(2, complex)), "q"),
        (lambda t: t.pose([0.0, 0.0], 2), "frame"),
        (lambda t: t.pose([0.0, 0.0], -1), "frame"),
        (lambda t: t.relative_jacobian([0.0, 0.0], 0, -2, 0), "measured_in"),
        (lambda t: t.poses([0.0, 0.0]), "Q"),
        (lambda t: t.poses([[0.0, np.nan]]), "Q"),
        (lambda t: t.jacobians([[0.0, 0.0]], num_threads=0), "num_threads"),
    ],
)
def test_bad_calls_name_the_argument(call, argument):
    with pytest.raises(ValueError, match=f"^{argument}: "):
        call(two_link())


@pytest.mark.parametrize(
    ("change", "argument"),
    [
        ({"parents": [1, 0]}, "joints"),
        ({"parents": [0, 0]}, "joints"),
        ({"parents": [-1, 2]}, r"joints\[1\]"),
        ({"parents": [-1, np.nan]}, "parents"),
        ({"parents": [-1, 0.5]}, "parents"),
        ({"parents": [-1, 1e300]}, "parents"),
        ({"axes": [[0, 0, 1], [0, 0, 0]]}, r"joints\[1\]"),
        ({"axes": [[0, 0, 1]]}, "axes"),
        ({"X_PJ": np.stack([2 * np.eye(4)] * 2)}, r"joints\[0\]"),
        ({"frame_parents": [2]}, r"frames\[0\]"),
        ({"X_PF": [np.diag([1.0, 1, -1, 1])]}, r"frames\[0\]"),
    ],
)
def test_bad_trees_name_the_argument(change, argument):
    good = {
        "parents": [-1, 0],
        "X_PJ": np.stack([np.eye(4)] * 2),
        "axes": [[0, 0, 1]] * 2,
        "prismatic": [0, 1],
        "frame_parents": [1],
        "X_PF": [np.eye(4)],
    }
    KinematicTree(**good)
    with pytest.raises(ValueError, match=f"^{argument}: "):
        KinematicTree(**(good | change))
