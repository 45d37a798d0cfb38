"""Reflected inertia: the geared pendulum against closed forms and Drake, arms against Drake."""

import dataclasses as dc

import numpy as np
import pytest
from iiwa_plant import make_iiwa
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia, UnitInertia
from scipy.integrate import solve_ivp

from prehensile.control.gains import gains_for_bandwidth, pid_torque
from prehensile.control.inertia import (
    joint_inertia,
    random_configurations,
    reflected_inertia,
)
from prehensile.control.pendulum import (
    GearedPendulum,
    pendulum_dynamics,
    position_control,
    simulate_pendulum,
)
from prehensile.models.registry import find_model

GEARED = GearedPendulum(gear_ratio=100.0, rotor_damping=1e-5)
DIRECT = dc.replace(GEARED, gear_ratio=1.0)


def drake_pendulum(pendulum: GearedPendulum) -> MultibodyPlant:
    """The same pendulum in Drake."""
    plant = MultibodyPlant(0.0)
    p_BoBcm = np.array([0.0, 0.0, -pendulum.length])
    body = plant.AddRigidBody(
        "mass",
        SpatialInertia(pendulum.mass, p_BoBcm, UnitInertia.PointMass(p_BoBcm)),
    )
    damping = pendulum.damping + pendulum.gear_ratio**2 * pendulum.rotor_damping
    joint = plant.AddJoint(
        RevoluteJoint("hinge", plant.world_frame(), body.body_frame(), [0.0, 1.0, 0.0], damping)
    )
    actuator = plant.AddJointActuator("motor", joint)
    actuator.set_default_rotor_inertia(pendulum.rotor_inertia)
    actuator.set_default_gear_ratio(pendulum.gear_ratio)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -pendulum.gravity])
    plant.Finalize()
    return plant


@pytest.fixture(scope="module")
def iiwa():
    return make_iiwa()


@pytest.mark.parametrize("pendulum", [DIRECT, GEARED])
def test_dynamics_agree_with_drake(pendulum):
    plant = drake_pendulum(pendulum)
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(0)
    for q, v, u in rng.uniform(-2.0, 2.0, (20, 3)):
        plant.SetPositionsAndVelocities(context, [q, v])
        # Drake's actuation is the torque at the joint.
        plant.get_actuation_input_port().FixValue(context, [pendulum.gear_ratio * u])
        wanted = plant.EvalTimeDerivatives(context).CopyToVector()
        np.testing.assert_allclose(pendulum_dynamics(pendulum, [q, v], u), wanted, rtol=1e-10)
    assert plant.CalcMassMatrix(context)[0, 0] == pytest.approx(pendulum.inertia)
    assert reflected_inertia(plant)[0] == pytest.approx(pendulum.reflected_inertia)


def test_dynamics_of_many_states_at_once():
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (4, 5, 2))
    u = np.linspace(-1.0, 1.0, 5)
    each = pendulum_dynamics(GEARED, x, u)
    assert each.shape == (4, 5, 2)
    np.testing.assert_array_equal(each[2, 3], pendulum_dynamics(GEARED, x[2, 3], u[3]))


def test_motor_coordinates_give_the_same_motion():
    # (I_m + m l^2 / N^2) q_m'' = u - tau_g / N - damping, with q_m = N q: the notes' form.
    p = dc.replace(GEARED, damping=0.0, rotor_damping=0.0)
    u = 0.03
    x = np.array([0.4, 0.0])
    inertia = p.rotor_inertia + p.link_inertia / p.gear_ratio**2
    weight = p.mass * p.gravity * p.length * np.sin(x[0])
    motor_acceleration = (u - weight / p.gear_ratio) / inertia
    assert motor_acceleration / p.gear_ratio == pytest.approx(pendulum_dynamics(p, x, u)[1])


@pytest.mark.parametrize("pendulum", [DIRECT, GEARED])
def test_simulation_agrees_with_drake(pendulum):
    gains = position_control(pendulum, 10.0)
    motion = simulate_pendulum(pendulum, gains, 1.0, duration=1.0, samples=11)
    plant = drake_pendulum(pendulum)

    def derivative(t, x):
        context.SetTime(t)
        plant.SetPositionsAndVelocities(context, x)
        plant.get_actuation_input_port().FixValue(
            context, pid_torque(gains, x[:1], x[1:], 1.0, 0.0)
        )
        return plant.EvalTimeDerivatives(context).CopyToVector()

    context = plant.CreateDefaultContext()
    wanted = solve_ivp(derivative, (0.0, 1.0), [0.0, 0.0], t_eval=motion.t, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(motion.q, wanted.y[0], atol=1e-6)
    np.testing.assert_allclose(motion.v, wanted.y[1], atol=1e-5)
    tau = pid_torque(gains, wanted.y[:1].T, wanted.y[1:].T, 1.0, 0.0)[:, 0]
    np.testing.assert_allclose(motion.torque, tau / pendulum.gear_ratio, atol=1e-3)


def test_the_geared_pendulum_is_linear_and_rests_where_it_is_told():
    """The same law and bandwidth: gravity bends the direct drive's answer, not the geared one's."""
    target, omega = 1.0, 10.0
    t = np.linspace(0.0, 3.0, 301)
    ideal = target * (1.0 - np.exp(-omega * t) * (1.0 + omega * t))
    sags = []
    for pendulum in (DIRECT, GEARED):
        gains = position_control(pendulum, omega)
        motion = simulate_pendulum(pendulum, gains, target)
        # At rest kp (target - q) = m g l sin q.
        weight = pendulum.mass * pendulum.gravity * pendulum.length
        assert gains.kp[0] * (target - motion.q[-1]) == pytest.approx(
            weight * np.sin(motion.q[-1]), rel=1e-3
        )
        sags.append(np.max(np.abs(motion.q - ideal)))
    # Sag is m g l sin q / kp, and kp grows with the inertia: 2.25 against 0.25 kg m^2.
    assert sags[1] < sags[0] / 6.0


def test_one_set_of_gains_does_for_a_geared_joint_whatever_it_carries():
    """Gains made for 1 kg, then 3 kg: the direct drive swings, the geared one hardly notices."""
    overshoots = []
    for gear_ratio in (1.0, 160.0):
        light = GearedPendulum(gear_ratio=gear_ratio, damping=0.0, gravity=0.0)
        heavy = dc.replace(light, mass=3.0)
        gains = position_control(light, 10.0)
        motion = simulate_pendulum(heavy, gains, 1.0)
        overshoots.append(motion.q.max() - 1.0)
        # Second order: damping ratio sqrt(I_light / I_heavy) of what was critical.
        zeta = np.sqrt(light.inertia / heavy.inertia)
        # With no rate in the command kd acts as damping alone: the classical overshoot.
        wanted = np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))
        assert overshoots[-1] == pytest.approx(wanted, abs=2e-3)
    assert overshoots[0] > 0.1
    assert overshoots[1] < 0.01


def test_an_integral_takes_the_sag_away():
    gains = gains_for_bandwidth(DIRECT.inertia, 10.0, integral_rate=5.0)
    motion = simulate_pendulum(DIRECT, gains, lambda t: 1.0, duration=4.0)
    assert motion.q[-1] == pytest.approx(1.0, abs=1e-4)


def test_wrong_pendulums_are_named():
    for name in ("mass", "length", "gear_ratio"):
        with pytest.raises(ValueError, match=name):
            GearedPendulum(**{name: 0.0})
    with pytest.raises(ValueError, match="rotor_inertia"):
        GearedPendulum(rotor_inertia=-1.0)


def test_inertia_of_an_arm_is_drakes_with_and_without_motors(iiwa):
    Q = random_configurations(iiwa, 5, seed=2)
    assert np.all(iiwa.GetPositionLowerLimits() <= Q)
    assert np.all(iiwa.GetPositionUpperLimits() >= Q)
    found = joint_inertia(iiwa, Q)
    assert found.names == tuple(f"iiwa_joint_{k}" for k in range(1, 8))
    bare = MultibodyPlant(0.0)
    Parser(bare).AddModels(str(find_model("iiwa7").path))
    bare.WeldFrames(bare.world_frame(), bare.GetFrameByName("iiwa_link_0"))
    for index in bare.GetJointActuatorIndices():
        bare.get_joint_actuator(index).set_default_rotor_inertia(0.0)
    bare.Finalize()
    context, full = bare.CreateDefaultContext(), iiwa.CreateDefaultContext()
    for k, q in enumerate(Q):
        bare.SetPositions(context, q)
        np.testing.assert_allclose(found.link[k], np.diag(bare.CalcMassMatrix(context)), atol=1e-9)
        iiwa.SetPositions(full, q)
        M = iiwa.CalcMassMatrix(full)
        np.testing.assert_allclose(found.total[k], np.diag(M), atol=1e-9)
        normalized = np.abs(M) / np.sqrt(np.outer(np.diag(M), np.diag(M)))
        assert found.coupling[k, 3] == pytest.approx(np.delete(normalized[3], 3).max())


def test_motors_even_out_the_inertia_of_an_arm(iiwa):
    found = joint_inertia(iiwa, random_configurations(iiwa, 200))
    assert np.all(found.total_ratio <= found.link_ratio)
    assert found.link_ratio.max() > 10.0
    assert found.total_ratio.max() < 3.5
    assert np.all(found.coupling < 1.0)


def test_configurations_of_another_plant_are_refused(iiwa):
    with pytest.raises(ValueError, match="configurations"):
        joint_inertia(iiwa, np.empty((0, 7)))
    with pytest.raises(ValueError, match="configurations"):
        joint_inertia(iiwa, np.zeros(6))


def test_random_configurations_leave_the_base_where_it_is():
    """A floating arm: its quaternion stays one, its joints get about."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(find_model("iiwa7").path))
    plant.Finalize()
    Q = random_configurations(plant, 50)
    assert Q.shape == (50, 14)
    base = plant.GetJointByName("iiwa_link_0").position_start()
    np.testing.assert_array_equal(
        Q[:, base : base + 7], np.tile(plant.GetDefaultPositions()[base : base + 7], (50, 1))
    )
    joint = plant.GetJointByName("iiwa_joint_1").position_start()
    assert np.ptp(Q[:, joint]) > 4.0


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"duration": np.inf}, "duration"),
        ({"samples": 1}, "samples"),
        ({"q_start": np.nan}, "q_start"),
        ({"q_desired": np.nan}, "q_desired"),
    ],
)
def test_simulations_out_of_range_are_named(arguments, name):
    arguments = {"q_desired": 1.0, **arguments}
    with pytest.raises(ValueError, match=f"^{name}: "):
        simulate_pendulum(GEARED, position_control(GEARED, 5.0), **arguments)
