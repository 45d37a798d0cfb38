"""One step of differential inverse kinematics, iiwa, 7 joints, per call from Python.

Every case is one problem given to all of its contenders, at 256 random states. Contenders leave
their answers in the folder; ours, in the next round, compares them with its own where the problem
is the same.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.framework import Contender, Results, Samples

TITLE = "Differential inverse kinematics, one step, iiwa (7 joints)"
COUNT = 256
PERIOD = 0.01
DAMPING = 1e-3
# For the comparison of optima: so short a way that all definitions of a pose's error agree, so low
# a speed that limits are active nonetheless, and so much damping that solvers are exact.
TINY = 4e-6
SLOW = 4e-4
FIRM = 3e-2

QP = "QP with bounds alone, J or H given"
GIVEN = "direction kept, limits of q, v; J given"
GIVEN_FAST = "the same, limits of dv/dt too, V beyond the limits"
POSE = "direction kept, towards a pose; from q"
FRAME = "least squares towards a near pose; from q"
FRAME_FAR = "the same towards a pose beyond the limits"
SYSTEM = "Drake System towards a pose, per update"


def prepare(folder: Path) -> None:
    """Writes states, tasks and limits, and the arm's kinematics as URDF for the peers."""
    from prehensile.kinematics.differential_ik import JointLimits

    plant, tree = _iiwa()
    limits = JointLimits.of_tree(tree)
    rng = np.random.default_rng(0)
    q = rng.uniform(0.9 * limits.lower, 0.9 * limits.upper, (COUNT, 7))
    way = rng.normal(size=q.shape)
    change = limits.acceleration * PERIOD
    np.savez(
        folder / "problem.npz",
        q=q,
        # So slow that rest is within reach of the limits of acceleration.
        v=rng.uniform(-0.5, 0.5, q.shape) * change,
        J=tree.tree.jacobians(q),
        V=rng.normal(size=(COUNT, 6)) * 0.1,
        V_fast=rng.normal(size=(COUNT, 6)) * 0.3,
        X_near=tree.tree.poses(q + 0.002 * way),
        X_far=tree.tree.poses(q + 0.02 * way),
        X_tiny=tree.tree.poses(q + TINY * way),
        lower=limits.lower,
        upper=limits.upper,
        velocity=limits.velocity,
        acceleration=limits.acceleration,
    )
    (folder / "iiwa.urdf").write_text(_urdf(plant))


def _kernel(J: np.ndarray) -> np.ndarray:
    """The kernel of J (6, 7) as Drake scales it, by LU decomposition with full pivoting."""
    U, order = np.array(J), np.arange(7)
    for k in range(6):
        i, j = np.unravel_index(np.argmax(np.abs(U[k:, k:])), (6 - k, 7 - k))
        U[[k, i + k]] = U[[i + k, k]]
        U[:, [k, j + k]] = U[:, [j + k, k]]
        order[[k, j + k]] = order[[j + k, k]]
        U[k + 1 :] -= np.outer(U[k + 1 :, k] / U[k, k], U[k])
    kernel = np.empty(7)
    kernel[order] = np.append(np.linalg.solve(U[:, :6], -U[:, 6]), 1.0)
    return kernel


def _iiwa():
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    from prehensile.kinematics.tree import tree_from_plant
    from prehensile.models.registry import package_map

    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.AddModels(url="package://prehensile/iiwa7/iiwa7.sdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"))
    plant.Finalize()
    return plant, tree_from_plant(plant, [plant.GetFrameByName("iiwa_link_7")])


def _urdf(plant) -> str:
    """The chain of links 0 to 7, with unit inertias and no geometry."""
    from pydrake.math import RollPitchYaw

    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.zeros(7))
    inertia = (
        '<inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    text = "".join(f'<link name="iiwa_link_{i}">{inertia}</link>' for i in range(8))
    for i in range(1, 8):
        joint = plant.GetJointByName(f"iiwa_joint_{i}")
        parent = plant.GetFrameByName(f"iiwa_link_{i - 1}").CalcPoseInWorld(context)
        child = plant.GetFrameByName(f"iiwa_link_{i}").CalcPoseInWorld(context)
        X = parent.inverse() @ child
        axis = child.rotation().inverse() @ (
            joint.frame_on_parent().CalcPoseInWorld(context).rotation() @ joint.revolute_axis()
        )
        rpy = RollPitchYaw(X.rotation()).vector()
        text += (
            f'<joint name="iiwa_joint_{i}" type="revolute">'
            f'<parent link="iiwa_link_{i - 1}"/><child link="iiwa_link_{i}"/>'
            f'<origin xyz="{_words(X.translation())}" rpy="{_words(rpy)}"/>'
            f'<axis xyz="{_words(axis)}"/>'
            f'<limit lower="{joint.position_lower_limit()}" upper="{joint.position_upper_limit()}"'
            f' velocity="{joint.velocity_upper_limit()}" effort="100"/></joint>'
        )
    return f'<robot name="iiwa">{text}</robot>'


def _words(values) -> str:
    return " ".join(repr(float(value)) for value in values)


def _time(step: Callable[[int], object], repeats: int = 15) -> Samples:
    """Microseconds of processor time per step, the mean over all problems, several times."""
    means = []
    for _ in range(repeats + 1):
        start = time.process_time()
        for i in range(COUNT):
            step(i)
        means.append((time.process_time() - start) / COUNT * 1e6)
    return Samples(means[1:], "µs")


def _answers(step: Callable[[int], np.ndarray]) -> np.ndarray:
    return np.array([np.array(step(i)) for i in range(COUNT)])


def ours(folder: Path) -> Results:
    """Compiled steps, the velocities read from each."""
    from dataclasses import replace

    from prehensile.kinematics.differential_ik import (
        DifferentialIkConfig,
        FrameTask,
        JointLimits,
        compile_frame_ik,
        compile_ik,
    )
    from prehensile.kinematics.systems import DifferentialInverseKinematics

    p = np.load(folder / "problem.npz")
    _, tree = _iiwa()
    limits = JointLimits(p["lower"], p["upper"], p["velocity"], p["acceleration"])
    q, v, J, V, fast = (list(p[name]) for name in ("q", "v", "J", "V", "V_fast"))
    near, far = list(p["X_near"]), list(p["X_far"])
    zero = np.zeros(7)

    free = np.full(7, np.inf)
    bounds = JointLimits(-free, free, p["velocity"], free)
    boxed = compile_ik(DifferentialIkConfig(period=PERIOD, damping=DAMPING), bounds)

    def qp(i: int) -> np.ndarray:
        return boxed.step(zero, zero, J[i], fast[i]).v

    direction = DifferentialIkConfig(
        period=PERIOD,
        formulation="direction",
        centering="nullspace",
        nominal_position=(0.0,) * 7,
    )
    still = JointLimits(p["lower"], p["upper"], p["velocity"], free)
    given_ik = compile_ik(direction, still)
    fast_ik = compile_ik(direction, limits)

    def given(i: int) -> np.ndarray:
        return given_ik.step(q[i], v[i], J[i], V[i]).v

    def given_fast(i: int) -> np.ndarray:
        return fast_ik.step(q[i], v[i], J[i], fast[i]).v

    task = FrameTask(gain=1 / PERIOD)
    pose_ik = compile_frame_ik(direction, still, tree, [task])

    def pose(i: int) -> np.ndarray:
        return pose_ik.step(q[i], v[i], near[i]).v

    least = DifferentialIkConfig(period=PERIOD, damping=DAMPING)
    frame_ik = compile_frame_ik(least, still, tree, [task])

    def frame(i: int) -> np.ndarray:
        return frame_ik.step(q[i], v[i], near[i]).v

    def frame_far(i: int) -> np.ndarray:
        return frame_ik.step(q[i], v[i], far[i]).v

    slow = replace(still, velocity=SLOW * still.velocity)
    slow_ik, tiny = (
        compile_frame_ik(replace(least, damping=FIRM), slow, tree, [task]),
        list(p["X_tiny"]),
    )

    def system():
        return DifferentialInverseKinematics(tree, [task], direction, default_position=q[0])

    def same_weight(i: int, limits: JointLimits, V: np.ndarray) -> np.ndarray:
        # Drake's P is not normalized.
        config = replace(direction, direction_weight=100 / float(np.sum(_kernel(J[i]) ** 2)))
        step = compile_ik(config, limits).step(q[i], v[i], J[i], V)
        # Drake does not see to it that joints can stop; its solver is inexact at times.
        theirs = answers[i]
        clear = (np.minimum(p["upper"] - q[i], q[i] - p["lower"]) > brake).all()
        exact = (theirs < step.upper + 1e-9).all() and (theirs > step.lower - 1e-9).all()
        return step.v if clear and exact else theirs

    brake = p["velocity"] ** 2 / p["acceleration"]
    for name, answer in (
        ("qp", qp),
        ("direction", lambda i: same_weight(i, still, V[i])),
        ("direction_fast", lambda i: same_weight(i, limits, fast[i])),
        ("tiny", lambda i: slow_ik.step(q[i], zero, tiny[i]).v),
    ):
        for path in folder.glob(f"{name}.*.npy"):
            answers = np.load(path)
            worst = np.nanmax(np.abs(answers - _answers(answer)))
            if worst > 1e-6:
                raise AssertionError(f"{path.stem}: another optimum, by {worst}")
    return {
        QP: _time(qp),
        GIVEN: _time(given),
        GIVEN_FAST: _time(given_fast),
        POSE: _time(pose),
        FRAME: _time(frame),
        FRAME_FAR: _time(frame_far),
        SYSTEM: _time_system(system(), "iiwa_link_7.pose", "estimated_state", near[0], q[0]),
    }


def drake(folder: Path) -> Results:
    """``DoDifferentialInverseKinematics`` with J, and with plant and context; its integrator."""
    from pydrake.math import RigidTransform
    from pydrake.multibody.inverse_kinematics import (
        DifferentialInverseKinematicsIntegrator,
        DifferentialInverseKinematicsParameters,
        DifferentialInverseKinematicsStatus,
        DoDifferentialInverseKinematics,
    )

    p = np.load(folder / "problem.npz")
    plant, _ = _iiwa()
    context = plant.CreateDefaultContext()
    frame = plant.GetFrameByName("iiwa_link_7")

    def with_limits():
        parameters = DifferentialInverseKinematicsParameters(7, 7)
        parameters.set_time_step(PERIOD)
        parameters.set_joint_position_limits((p["lower"], p["upper"]))
        parameters.set_joint_velocity_limits((-p["velocity"], p["velocity"]))
        parameters.set_nominal_joint_position(np.zeros(7))
        parameters.set_joint_centering_gain(np.eye(7))
        return parameters

    parameters, accelerating = with_limits(), with_limits()
    accelerating.set_joint_acceleration_limits((-p["acceleration"], p["acceleration"]))
    q, v, J, V, fast = (list(p[name]) for name in ("q", "v", "J", "V", "V_fast"))
    X = [RigidTransform(T) for T in p["X_near"]]

    def given(i: int):
        return DoDifferentialInverseKinematics(q[i], v[i], V[i], J[i], parameters)

    def given_fast(i: int):
        return DoDifferentialInverseKinematics(q[i], v[i], fast[i], J[i], accelerating)

    def pose(i: int):
        plant.SetPositions(context, q[i])
        plant.SetVelocities(context, v[i])
        return DoDifferentialInverseKinematics(plant, context, X[i], frame, parameters)

    # Where it calls itself stuck its answer is not the optimum of its program.
    found = DifferentialInverseKinematicsStatus.kSolutionFound
    for name, step in (("direction", given), ("direction_fast", given_fast)):
        steps = [step(i) for i in range(COUNT)]
        answers = [r.joint_velocities if r.status == found else np.full(7, np.nan) for r in steps]
        np.save(folder / f"{name}.drake.npy", answers)

    integrator = DifferentialInverseKinematicsIntegrator(
        plant, frame, PERIOD, parameters, None, True
    )
    return {
        GIVEN: _time(given),
        GIVEN_FAST: _time(given_fast),
        POSE: _time(pose),
        SYSTEM: _time_system(integrator, "X_AE_desired", "robot_state", p["X_near"][0], q[0]),
    }


def _time_system(system, pose: str, state: str, X_WD: np.ndarray, q: np.ndarray) -> Samples:
    from pydrake.math import RigidTransform
    from pydrake.systems.analysis import Simulator

    context = system.CreateDefaultContext()
    system.GetInputPort(pose).FixValue(context, RigidTransform(X_WD))
    system.GetInputPort(state).FixValue(context, np.concatenate([q, np.zeros(7)]))
    simulator = Simulator(system, context)
    simulator.Initialize()
    means = []
    for k in range(1, 8):
        start = time.process_time()
        simulator.AdvanceTo(k * 100 * PERIOD)
        means.append((time.process_time() - start) / 100 * 1e6)
    return Samples(means[1:], "µs")


def mink(folder: Path) -> Results:
    """``mink.solve_ik`` with daqp."""
    import mink  # pyright: ignore[reportMissingImports]
    import mujoco  # pyright: ignore[reportMissingImports]

    p = np.load(folder / "problem.npz")
    model = mujoco.MjModel.from_xml_path(str(folder / "iiwa.urdf"))
    configuration = mink.Configuration(model)
    speeds = {f"iiwa_joint_{i + 1}": speed for i, speed in enumerate(p["velocity"])}
    position = mink.ConfigurationLimit(model, gain=1.0)
    limits = [position, mink.VelocityLimit(model, speeds)]
    slow = [
        position,
        mink.VelocityLimit(model, {name: SLOW * speed for name, speed in speeds.items()}),
    ]
    task = mink.FrameTask("iiwa_link_7", "body", position_cost=1.0, orientation_cost=1.0)
    near, far, tiny = (
        [mink.SE3.from_matrix(T) for T in p[name]] for name in ("X_near", "X_far", "X_tiny")
    )
    q = list(p["q"])

    def frame(i: int, targets=near, limits=limits, damping=DAMPING, **settings: float):
        configuration.update(q[i])
        task.set_target(targets[i])
        return mink.solve_ik(
            configuration,
            [task],
            PERIOD,
            solver="daqp",
            damping=damping**2,
            limits=limits,
            **settings,
        )

    np.save(
        folder / "tiny.mink.npy", _answers(lambda i: frame(i, tiny, slow, FIRM, primal_tol=1e-12))
    )
    return {FRAME: _time(frame), FRAME_FAR: _time(lambda i: frame(i, far))}


def oink(folder: Path) -> Results:
    """``Oink.solveIk`` of RoboPlan with limits of position and velocity."""
    from roboplan import core, optimal_ik  # pyright: ignore[reportMissingImports]

    p = np.load(folder / "problem.npz")
    urdf = (folder / "iiwa.urdf").read_text()
    scene = core.Scene("iiwa", core.loadUrdfSceneDescriptionFromXml(urdf))
    near, far, tiny = (
        [np.asfortranarray(T) for T in p[name]] for name in ("X_near", "X_far", "X_tiny")
    )
    q, step = list(p["q"]), np.zeros(7)

    def stepper(solver, speed: np.ndarray, damping: float):
        goal = core.CartesianConfiguration("iiwa_link_0", "iiwa_link_7", near[0])
        tasks = [optimal_ik.FrameTask(solver, scene, goal)]
        limits = [
            optimal_ik.PositionLimit(solver, gain=1.0),
            optimal_ik.VelocityLimit(solver, PERIOD, speed),
        ]

        def frame(i: int, targets) -> np.ndarray:
            tasks[0].setTargetFrameTransform(targets[i])
            solver.solveIk(q[i], tasks, limits, step, damping**2)
            return step

        return frame

    frame = stepper(optimal_ik.Oink(scene), p["velocity"], DAMPING)
    settings = optimal_ik.OinkSettings()
    settings.eps_abs = 1e-13
    exact = stepper(optimal_ik.Oink(scene, settings), SLOW * p["velocity"], FIRM)
    np.save(folder / "tiny.oink.npy", _answers(lambda i: exact(i, tiny)) / PERIOD)
    return {FRAME: _time(lambda i: frame(i, near)), FRAME_FAR: _time(lambda i: frame(i, far))}


def _box_qp(folder: Path):
    """H, f and bounds of min ½ x^T H x + f^T x, formed beforehand."""
    p = np.load(folder / "problem.npz")
    H = [np.asarray(J.T @ J + DAMPING**2 * np.eye(7)) for J in p["J"]]
    f = [np.asarray(-J.T @ V) for J, V in zip(p["J"], p["V_fast"], strict=True)]
    return H, f, p["velocity"]


def daqp(folder: Path) -> Results:
    """``daqp.solve``."""
    import ctypes

    import daqp  # pyright: ignore[reportMissingImports]

    H, f, speed = _box_qp(folder)
    A, sense = np.zeros((0, 7)), np.zeros(7, dtype=ctypes.c_int)

    def qp(i: int, **settings: float):
        return daqp.solve(H[i], f[i], A, speed, -speed, sense, **settings)[0]

    # By default it may violate bounds by 1e-6.
    np.save(folder / "qp.daqp.npy", _answers(lambda i: qp(i, primal_tol=1e-9)))
    return {QP: _time(qp)}


def quadprog(folder: Path) -> Results:
    """``quadprog.solve_qp``, the method of Goldfarb and Idnani."""
    import quadprog  # pyright: ignore[reportMissingImports]

    H, f, speed = _box_qp(folder)
    C, b = np.hstack([np.eye(7), -np.eye(7)]), -np.concatenate([speed, speed])
    minus_f = [-each for each in f]

    def qp(i: int):
        return quadprog.solve_qp(H[i], minus_f[i], C, b)[0]

    np.save(folder / "qp.quadprog.npy", _answers(qp))
    return {QP: _time(qp)}


def proxqp(folder: Path) -> Results:
    """``proxsuite.proxqp.dense.QP`` with box constraints, started warm."""
    import proxsuite  # pyright: ignore[reportMissingImports]

    H, f, speed = _box_qp(folder)
    solver = proxsuite.proxqp.dense.QP(7, 0, 0, True)
    solver.settings.eps_abs = 1e-9
    solver.init(H[0], f[0], None, None, None, None, None, -speed, speed)

    def qp(i: int):
        solver.update(H=H[i], g=f[i])
        solver.solve()
        return solver.results.x

    return {QP: _time(qp)}


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("Drake", drake),
    Contender(
        "mink", mink, requirements=("mink==1.3.0", "qpsolvers[daqp]==4.13.0", "daqp==0.11.0")
    ),
    Contender("RoboPlan Oink", oink, requirements=("roboplan==0.7.0",)),
    Contender("daqp", daqp, requirements=("daqp==0.11.0", "numpy")),
    Contender("quadprog", quadprog, requirements=("quadprog==0.1.13", "numpy")),
    Contender("ProxQP", proxqp, requirements=("proxsuite", "numpy")),
)
