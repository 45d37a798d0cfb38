"""Analytic inverse kinematics against forward kinematics, sampling and definitions."""

import numpy as np
import pytest
from analytic_arms import MEETING, PLANAR, PUMA, SRS, SRS_BENT, UR, Array, Lines
from hypothesis import given, settings
from hypothesis import strategies as st

from prehensile.native.analytic_ik import STATUSES, PieperArm, SrsArm, UrArm

SIX = {
    "UR": (UR, UrArm),
    "PUMA": (PUMA, PieperArm),
    "planar": (PLANAR, PieperArm),
    "meeting": (MEETING, PieperArm),
}
SEVEN = {"iiwa": SRS, "bent": SRS_BENT}
six_joints = pytest.mark.parametrize(("lines", "kind"), SIX.values(), ids=SIX)
seven_joints = pytest.mark.parametrize("lines", SEVEN.values(), ids=SEVEN)

IIWA_LIMITS = np.deg2rad([170, 120, 170, 120, 170, 120, 175])


def _check_poses(lines: Lines, X_WG: Array, q: Array, tolerance: float) -> None:
    """Every row of q (N, 8, n) that is there reaches its pose."""
    there = ~np.isnan(q[:, :, 0])
    assert not np.isnan(q[there]).any()
    which = np.nonzero(there)[0]
    assert np.abs(lines.poses(q[there]) - X_WG[which]).max() < tolerance


def _distance(q: Array, goal: Array) -> float:
    """From the nearest row of q to a goal, largest joint difference by whole turns."""
    difference = np.remainder(q - goal + np.pi, 2 * np.pi) - np.pi
    return float(np.abs(difference).max(axis=-1).min()) if len(q) else np.inf


@six_joints
def test_six_joints_random(lines: Lines, kind: type) -> None:
    rng = np.random.default_rng(1)
    for seed in range(10):
        disguised = lines.disguised(seed)
        arm = disguised.make(kind)
        goal = rng.uniform(-np.pi, np.pi, (5000, 6))
        X_WG = disguised.poses(goal)
        q, status = arm.solve_batch(X_WG)
        assert (status == STATUSES.index("solved")).all()
        _check_poses(disguised, X_WG, q, 1e-11)
        # Among them is the one that the pose was made with, in the row of its branch.
        branches = [arm.branch(row) for row in goal]
        assert np.abs(q[np.arange(len(goal)), branches] - goal).max() < 1e-5
        for row, number in ((row, k) for rows in q[:50] for k, row in enumerate(rows)):
            assert np.isnan(row[0]) or arm.branch(row) == number


@seven_joints
def test_seven_joints_random(lines: Lines) -> None:
    rng = np.random.default_rng(2)
    for seed in range(10):
        disguised = lines.disguised(seed)
        arm = disguised.make(SrsArm)
        goal = rng.uniform(-np.pi, np.pi, (5000, 7))
        X_WG = disguised.poses(goal)
        psi, branches = (np.array(values) for values in zip(*map(arm.arm_angle, goal), strict=True))
        q, status = arm.solve_batch(X_WG, psi)
        assert (status == 0).all()
        assert not np.isnan(q).any()
        _check_poses(disguised, X_WG, q, 1e-11)
        assert np.abs(q[np.arange(len(goal)), branches] - goal).max() < 1e-5
        for row in range(50):
            for k in range(8):
                angle, branch = arm.arm_angle(q[row, k])
                assert branch == k
                assert abs(np.remainder(angle - psi[row] + np.pi, 2 * np.pi) - np.pi) < 1e-7


@seven_joints
def test_arm_angle_is_where_the_elbow_is(lines: Lines) -> None:
    """psi by its definition: the elbow's direction from line SW, counted from axis 1."""
    arm = lines.make(SrsArm)
    rng = np.random.default_rng(3)
    S, W = lines.points[0], np.array([0, 0, 1.14])
    E = lines.points[3] * [1, 0, 1]
    for q in rng.uniform(-3, 3, (200, 7)):
        W_q, E_q = lines.moved(q, W, 4), lines.moved(q, E, 3)
        d = (W_q - S) / np.linalg.norm(W_q - S)
        reference = lines.axes[0] - d * (d @ lines.axes[0])
        elbow = (E_q - S) - d * (d @ (E_q - S))
        expected = np.arctan2(d @ np.cross(reference, elbow), reference @ elbow)
        assert arm.arm_angle(q)[0] == pytest.approx(expected, abs=1e-9)


def test_branches_by_definition() -> None:
    rng = np.random.default_rng(4)
    arm = UR.make(UrArm)
    P = np.array([0.8, 0.0, 0.0])
    P += [0, 0.1, 0.06]  # Axis 5 passes at y = 0.1, axis 6 at height 0.06.
    for q in rng.uniform(-3, 3, (200, 6)):
        axis2 = UR.turned(q, UR.axes[1], 1)
        ahead = np.cross(UR.axes[0], axis2) @ UR.moved(q, P, 6)
        upper = UR.moved(q, [0.425, 0, 0.16], 2) - UR.moved(q, [0, 0, 0.16], 1)
        fore = UR.moved(q, [0.8, 0, 0.16], 3) - UR.moved(q, [0.425, 0, 0.16], 2)
        bend = axis2 @ np.cross(upper, fore)
        axis5, axis6 = UR.turned(q, UR.axes[4], 4), UR.turned(q, UR.axes[5], 5)
        flip = axis5 @ np.cross(axis2, axis6)
        assert arm.branch(q) == 4 * (ahead < 0) + 2 * (bend < 0) + (flip < 0)


SINGULAR = st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi])
NEARLY = st.sampled_from([1e-15, 1e-13, -1e-11, 1e-10, 1e-9, -1e-7, 1e-5, np.pi - 1e-9])
ANYWHERE = st.integers(-314, 314).map(lambda number: number / 100)


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(sorted(SIX)), st.lists(SINGULAR | ANYWHERE, min_size=6, max_size=6))
def test_six_joints_contain(name: str, joints: list[float]) -> None:
    """Singular or not: q is among the solutions where joints that are free are asked to be so."""
    lines, kind = SIX[name]
    arm, q = lines.make(kind, -4.0, 4.0), np.array(joints)
    X_WG = lines.poses(q)
    found = arm.solve(X_WG[0], q_near=q).q
    assert np.abs(lines.poses(found) - X_WG).max() < 1e-9
    assert _distance(found, q) < 1e-6


@settings(max_examples=400, deadline=None)
@given(
    st.sampled_from(sorted(SIX)),
    st.lists(SINGULAR | NEARLY | ANYWHERE, min_size=6, max_size=6),
    st.lists(ANYWHERE, min_size=6, max_size=6),
)
def test_six_joints_reach(name: str, joints: list[float], near: list[float]) -> None:
    lines, kind = SIX[name]
    X_WG = lines.poses(joints)
    found = lines.make(kind, -4.0, 4.0).solve(X_WG[0], q_near=near).q
    assert len(found) > 0
    assert not np.isnan(found).any()
    assert np.abs(lines.poses(found) - X_WG).max() < 1e-9


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(sorted(SEVEN)), st.lists(SINGULAR | ANYWHERE, min_size=7, max_size=7))
def test_seven_joints_contain(name: str, joints: list[float]) -> None:
    lines = SEVEN[name]
    arm, q = lines.make(SrsArm, -4.0, 4.0), np.array(joints)
    X_WG = lines.poses(q)
    found = arm.solve(X_WG[0], arm.arm_angle(q)[0], q_near=q).q
    assert np.abs(lines.poses(found) - X_WG).max() < 1e-9
    assert _distance(found, q) < 1e-6


@settings(max_examples=400, deadline=None)
@given(
    st.sampled_from(sorted(SEVEN)),
    st.lists(SINGULAR | NEARLY | ANYWHERE, min_size=7, max_size=7),
    ANYWHERE,
)
def test_seven_joints_reach(name: str, joints: list[float], psi: float) -> None:
    lines = SEVEN[name]
    X_WG = lines.poses(joints)
    arm = lines.make(SrsArm, -4.0, 4.0)
    found = arm.solve(X_WG[0], psi)
    assert found.status == "solved"
    assert not np.isnan(found.q).any()
    assert np.abs(lines.poses(found.q) - X_WG).max() < 1e-9
    assert arm.closest(X_WG[0], joints).status == "solved"


def test_on_the_boundary_and_beyond() -> None:
    arm = UR.make(UrArm)
    stretched = np.array([0.3, -0.4, 0.0, 0.2, 1.0, 0.5])
    X_WG = UR.poses(stretched)[0]
    away = np.array(X_WG[:3, 3])
    out = UR.turned(stretched, [1, 0, 0], 2)
    assert len(arm.solve(X_WG)) > 0
    side = arm.branch(stretched) & 5
    for step in (1e-12, 1e-3, 5.0):
        X_WG[:3, 3] = away + step * out
        found = arm.solve(X_WG)
        assert np.isfinite(found.q).all()
        assert all(np.abs(UR.poses(q) - X_WG).max() < 1e-9 for q in found.q)
        # A millimetre farther only other branches of shoulder and wrist may reach.
        assert any(k & 5 == side for k in found.branch) == (step < 1e-6)
    assert (found.status, len(found)) == ("too far", 0)
    X_WG = np.eye(4)
    X_WG[:3, 3] = [0.05, 0.1, 0.3]  # P cannot come nearer to axis 1 than 0.1.
    assert arm.solve(X_WG).status == "too near"


def test_iiwa_boundary() -> None:
    arm = SRS.make(SrsArm)
    for bend, status in ((0.0, "solved"), (1.0, "solved")):
        X_WG = SRS.poses([0.3, 0.7, 0.2, bend, 0.4, 1.0, 0.3])[0]
        found = arm.solve(X_WG, 0.5)
        assert (found.status, len(found)) == (status, 8)
    X_WG = SRS.poses([0.3, 0.7, 0.2, 0.0, 0.4, 0.0, 0.3])[0]
    direction = X_WG[:3, 2].copy()
    X_WG[:3, 3] += 1e-11 * direction
    found = arm.solve(X_WG, 0.5).q
    assert np.abs(SRS.poses(found) - X_WG).max() < 1e-9
    X_WG[:3, 3] += 1e-3 * direction
    assert arm.solve(X_WG, 0.5).status == "too far"
    equal = Lines(SRS.axes, SRS.points - 0.01 * np.outer(np.arange(7) == 3, [0, 0, 1]), SRS.X_WG0)
    X_WG = equal.poses([0.3, 0.7, 0.2, np.pi, 0.4, 0.0, 0.3])[0]  # The wrist in the shoulder.
    assert equal.make(SrsArm).solve(X_WG, 0.1).status == "too near"
    short = Lines(SRS.axes, SRS.points - 0.1 * np.outer(np.arange(7) == 3, [0, 0, 1]), SRS.X_WG0)
    X_WG = short.poses([0.3, 0.7, 0.2, np.pi, 0.4, 0.0, 0.3])[0]
    assert short.make(SrsArm).solve(X_WG, 0.1).status == "solved"
    towards = short.moved([0.3, 0.7], short.points[0], 2) - short.moved(
        [0.3, 0.7, 0.2, np.pi], [0, 0, 1.14], 4
    )
    X_WG[:3, 3] += 1e-3 * towards / np.linalg.norm(towards)
    assert short.make(SrsArm).solve(X_WG, 0.1).status == "too near"


def test_free_joint_of_a_stretched_wrist() -> None:
    """Axes 4 and 6 parallel: joint 6 takes the asked value, or the nearest that reaches."""
    arm = UR.make(UrArm)
    q = np.array([0.4, -0.8, 0.3, 0.7, 0.0, 0.6])
    X_WG = UR.poses(q)
    for wanted in np.linspace(-3, 3, 25):
        near = q.copy()
        near[5] = wanted
        found = arm.solve(X_WG[0], q_near=near).q
        assert len(found) > 0
        assert np.abs(UR.poses(found) - X_WG).max() < 1e-9
    # Nearly stretched: most values of joint 6 leave axis 4 out of reach.
    q[2] = 0.05
    X_WG = UR.poses(q)
    for wanted in np.linspace(-3, 3, 25):
        near = q.copy()
        near[5] = wanted
        found = arm.solve(X_WG[0], q_near=near).q
        assert len(found) > 0
        assert np.abs(UR.poses(found) - X_WG).max() < 1e-9


@six_joints
def test_limits(lines: Lines, kind: type) -> None:
    """Exactly those solutions that have an equivalent within the limits: that nearest to q_near."""
    rng = np.random.default_rng(5)
    lower, upper = np.full(6, -2.0), np.full(6, 1.5)
    lower[0], upper[0], lower[5], upper[5] = -7.0, 8.0, 3.5, 6.0
    free, limited = lines.make(kind), lines.make(kind, lower, upper)
    turns = 2 * np.pi * np.arange(-3, 4)
    for q in rng.uniform(-3, 3, (300, 6)):
        X_WG = lines.poses(q)[0]
        near = rng.uniform(-6, 6, 6)
        expected = []
        for row in free.solve(X_WG).q:
            options = [angle + turns for angle in row]
            options = [
                o[(o >= a) & (o <= b)] for o, a, b in zip(options, lower, upper, strict=True)
            ]
            if all(map(len, options)):
                nearest = [o[np.abs(o - n).argmin()] for o, n in zip(options, near, strict=True)]
                expected.append(nearest)
        found = limited.solve(X_WG, q_near=near)
        assert len(found) == len(expected)
        if expected:
            assert np.abs(found.q - expected).max() < 1e-9
            assert (found.q >= lower).all()
            assert (found.q <= upper).all()
        else:
            assert found.status == "limits"
        assert len(limited.solve(X_WG, limits=False)) == len(free.solve(X_WG))


def _within(psi: Array, intervals: Array, margin: float) -> tuple[Array, Array]:
    """Whether each psi is in an interval by more than the margin; is out of all by more."""
    inside = np.zeros(len(psi), dtype=bool)
    near = np.zeros(len(psi), dtype=bool)
    for begin, end in intervals:
        offset = np.remainder(psi - begin, 2 * np.pi)
        inside |= (offset > margin) & (offset < end - begin - margin)
        near |= (offset < end - begin + margin) | (offset > 2 * np.pi - margin)
    return inside, ~near


@pytest.mark.parametrize("case", range(4))
def test_arm_angle_intervals(case: int) -> None:
    """By dense sampling of psi: all that is in an interval is feasible, all else is not."""
    rng = np.random.default_rng(case)
    lines = (SRS, SRS_BENT, SRS.disguised(7), SRS_BENT.disguised(8))[case]
    middle = np.zeros(7) if case == 0 else rng.uniform(-1, 1, 7)
    half = IIWA_LIMITS if case == 0 else rng.uniform(1.0, 3.5, 7)
    arm = lines.make(SrsArm, middle - half, middle + half)
    psi = np.linspace(-np.pi, np.pi, 2000, endpoint=False)
    seen = set()
    for q in middle + rng.uniform(-0.98, 0.98, (60, 7)) * half:
        X_WG = np.repeat(lines.poses(q), len(psi), axis=0)
        feasible = ~np.isnan(arm.solve_batch(X_WG, psi)[0][:, :, 0])
        for branch in range(8):
            intervals = arm.arm_angle_intervals(X_WG[0], branch)
            seen.add(len(intervals))
            assert (intervals[:, 0] < intervals[:, 1]).all()
            assert (np.diff(intervals[:, 0]) > 0).all()
            inside, outside = _within(psi, intervals, 1e-7)
            assert feasible[inside, branch].all()
            assert not feasible[outside, branch].any()
        here, branch = arm.arm_angle(q)
        inside, outside = _within(np.array([here]), arm.arm_angle_intervals(X_WG[0], branch), 1e-7)
        assert not outside[0]
    assert {0, 1, 2} <= seen


def test_choice_of_arm_angle() -> None:
    """Against all branches at every degree of arm angle."""
    rng = np.random.default_rng(6)
    arm = SRS.make(SrsArm, -IIWA_LIMITS, IIWA_LIMITS)
    psi = np.linspace(-np.pi, np.pi, 1440, endpoint=False)
    for q in rng.uniform(-1, 1, (60, 7)) * IIWA_LIMITS:
        X_WG = np.repeat(SRS.poses(q), len(psi), axis=0)
        near = rng.uniform(-1, 1, 7) * IIWA_LIMITS
        all_q = arm.solve_batch(X_WG, psi)[0].reshape(-1, 7)
        all_q = all_q[~np.isnan(all_q[:, 0])]

        closest = arm.closest(X_WG[0], near)
        best = np.linalg.norm(all_q - near, axis=1).min()
        assert np.linalg.norm(closest.q - near) <= best + 1e-9
        assert np.linalg.norm(arm.closest(X_WG[0], q).q - q) < 1e-6

        middle = arm.farthest_from_limits(X_WG[0])
        worst = np.abs(all_q / IIWA_LIMITS).max(axis=1).min()
        assert np.abs(middle.q / IIWA_LIMITS).max() <= worst + 1e-9

        widest = arm.widest_interval(X_WG[0])
        intervals = [arm.arm_angle_intervals(X_WG[0], k) for k in range(8)]
        width = max(np.ptp(rows, axis=1).max(initial=0.0) for rows in intervals)
        own = intervals[widest.branch]
        row = own[np.ptp(own, axis=1).argmax()]
        assert np.ptp(row) == pytest.approx(width)
        assert np.cos(widest.psi - row.mean()) == pytest.approx(1.0)

        for choice in (closest, middle, widest):
            assert choice.status == "solved"
            assert np.abs(SRS.poses(choice.q) - X_WG[0]).max() < 1e-9
            angle, branch = arm.arm_angle(choice.q)
            assert branch == choice.branch
            assert np.cos(angle - choice.psi) == pytest.approx(1.0, abs=1e-12)
            assert (np.abs(choice.q) <= IIWA_LIMITS).all()


def test_no_arm_angle() -> None:
    arm = SRS.make(SrsArm, -IIWA_LIMITS, IIWA_LIMITS)
    X_WG = np.eye(4)
    X_WG[:3, 3] = 3.0
    assert arm.arm_angle_intervals(X_WG, 0).shape == (0, 2)
    for choice in (arm.closest(X_WG, np.zeros(7)), arm.widest_interval(X_WG)):
        assert (choice.q, choice.status) == (None, "too far")
    folded = SRS.poses([0, 0.5, 0, 2.9, 0, 0.5, 0])[0]  # Joint 4 is limited to 120°.
    assert arm.solve(folded, 0.3).status == "limits"
    assert arm.farthest_from_limits(folded).status == "limits"


def test_threads_do_not_matter() -> None:
    rng = np.random.default_rng(8)
    X_WG = SRS.poses(rng.uniform(-3, 3, (1000, 7)))
    psi = rng.uniform(-3, 3, 1000)
    arm = SRS.make(SrsArm, -IIWA_LIMITS, IIWA_LIMITS)
    near = rng.uniform(-1, 1, (1000, 7))
    one = arm.solve_batch(X_WG, psi, near)
    three = arm.solve_batch(X_WG, psi, near, num_threads=3)
    assert one[0].tobytes() == three[0].tobytes()
    assert one[1].tobytes() == three[1].tobytes()
    for k in range(100):
        single = arm.solve(X_WG[k], psi[k], near[k])
        assert np.array_equal(one[0][k][single.branch], single.q)
        assert STATUSES[one[1][k]] == single.status


@pytest.mark.parametrize("straight", [[1], [3], [5], [1, 3], [1, 5], [3, 5], [1, 3, 5], range(7)])
def test_closest_of_a_singular_configuration_is_itself(straight: list[int]) -> None:
    arm, rng = SRS.make(SrsArm), np.random.default_rng(9)
    for _ in range(20):
        q = rng.uniform(-2.0, 2.0, 7)
        q[list(straight)] = 0.0
        np.testing.assert_allclose(arm.closest(arm.pose(q), q).q, q, atol=1e-6)


@six_joints
def test_no_pose_is_near_that_is_far(lines: Lines, kind: type) -> None:
    arm = lines.make(kind)
    for far in (1e4, 1e160, 1.7e308):
        X_WG = np.eye(4)
        X_WG[:3, 3] = [0.3 * far, -far, 0.1 * far]
        assert arm.solve(X_WG, limits=False).status == "too far"


def test_bad_input() -> None:
    arm = UR.make(UrArm)
    X_WG = np.eye(4)
    X_WG[0, 0] = 1.1
    for bad in (X_WG, np.diag([1.0, 1, -1, 1]), np.full((4, 4), np.nan), np.eye(3), "pose"):
        with pytest.raises((ValueError, TypeError)):
            arm.solve(bad)
    with pytest.raises(ValueError, match="pose 1: X_WG"):
        arm.solve_batch(np.stack([np.eye(4), X_WG]))
    with pytest.raises(ValueError, match="q_near"):
        arm.solve(np.eye(4), q_near=np.zeros(5))
    with pytest.raises(ValueError, match="q_near"):
        arm.solve(np.eye(4), q_near=np.full(6, np.nan))
    with pytest.raises(ValueError, match="q_near: .* 1e6"):
        arm.solve(np.eye(4), q_near=np.full(6, 1e7))
    with pytest.raises(ValueError, match="num_threads"):
        arm.solve_batch(np.eye(4)[None], num_threads=0)
    with pytest.raises(ValueError, match="psi"):
        SRS.make(SrsArm).solve(np.eye(4), np.nan)
    with pytest.raises(ValueError, match="branch"):
        SRS.make(SrsArm).arm_angle_intervals(np.eye(4), 8)
    # Rows, columns or strides, float32 or lists: all the same.
    X_WG = UR.poses(np.arange(6.0) / 3)[0]
    expected = arm.solve(X_WG).q
    wide = np.zeros((8, 8))
    wide[::2, ::2] = X_WG
    for same in (np.asfortranarray(X_WG), wide[::2, ::2], X_WG.tolist()):
        assert np.array_equal(arm.solve(same).q, expected)


@pytest.mark.parametrize(
    ("kind", "lines", "message"),
    [
        (SrsArm, UR, "has 7 joints, not 6"),
        (UrArm, PUMA, "axes 2 and 4 are not parallel"),
        (PieperArm, UR, "axis 4 does not pass through"),
    ],
)
def test_other_arms_are_refused(kind: type, lines: Lines, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        lines.make(kind)


def test_panda_is_refused() -> None:
    """Its wrist is 88 mm from being spherical."""
    points = SRS.points.copy()
    points[6] += [0.088, 0, 0]
    with pytest.raises(ValueError, match=r"axis 7 does not pass .*0\.088"):
        Lines(SRS.axes, points, SRS.X_WG0).make(SrsArm)
    axes = SRS.axes.copy()
    axes[1] = [0, np.cos(0.01), np.sin(0.01)]
    with pytest.raises(ValueError, match="axes 1 and 2 are not perpendicular"):
        Lines(axes, SRS.points, SRS.X_WG0).make(SrsArm)
