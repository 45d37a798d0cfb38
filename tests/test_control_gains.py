"""Joint gains and the PID law against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prehensile.control.gains import JointGains, gains_for_bandwidth, pid_torque

positive = st.floats(0.01, 100.0)


@given(inertia=positive, bandwidth=positive, zeta=st.floats(0.1, 3.0), rate=st.floats(0.0, 50.0))
def test_the_closed_loop_has_the_poles_asked_for(inertia, bandwidth, zeta, rate):
    gains = gains_for_bandwidth(inertia, bandwidth, damping_ratio=zeta, integral_rate=rate)
    # I s^3 + kd s^2 + kp s + ki against (s^2 + 2 zeta w s + w^2)(s + p).
    made = np.array([inertia, gains.kd[0], gains.kp[0], gains.ki[0]]) / inertia
    wanted = np.polymul([1.0, 2.0 * zeta * bandwidth, bandwidth**2], [1.0, rate])
    np.testing.assert_allclose(made, wanted, rtol=1e-9)


def test_one_joint_follows_the_step_response_of_its_poles():
    inertia, omega = 2.5, 8.0
    gains = gains_for_bandwidth(inertia, omega)
    dt, q, v = 1e-5, 0.0, 0.0
    for _ in range(50_000):
        v += dt * pid_torque(gains, [q], [v], [1.0], [0.0])[0] / inertia
        q += dt * v
    assert q == pytest.approx(1.0 - np.exp(-omega * 0.5) * (1.0 + omega * 0.5), abs=1e-4)


def test_pid_torque_of_many_joints_at_once():
    gains = JointGains([1.0, 2.0], [0.1, 0.2], [10.0, 20.0])
    tau = pid_torque(gains, np.zeros((3, 2)), np.ones((3, 2)), [1.0, -1.0], [0.0, 3.0], [0.5, 0.0])
    np.testing.assert_allclose(tau, np.tile([1.0 - 0.1 + 5.0, -2.0 + 0.4], (3, 1)))


@pytest.mark.parametrize(
    ("values", "word"),
    [
        ({"inertia": 0.0}, "inertia"),
        ({"inertia": [1.0, np.nan]}, "inertia"),
        ({"bandwidth": -1.0}, "bandwidth"),
        ({"damping_ratio": 0.0}, "damping_ratio"),
        ({"integral_rate": -1.0}, "integral_rate"),
    ],
)
def test_values_out_of_range_are_named(values, word):
    with pytest.raises(ValueError, match=word):
        gains_for_bandwidth(**{"inertia": 1.0, "bandwidth": 1.0, **values})


def test_gains_of_other_sizes_or_signs_are_named():
    with pytest.raises(ValueError, match="kd"):
        JointGains([1.0, 1.0], [1.0], [0.0, 0.0])
    with pytest.raises(ValueError, match="ki"):
        JointGains([1.0], [1.0], [-1.0])
