"""A pendulum moved by a motor through a gearbox: the smallest robot with reflected inertia.

Seen from the joint, a rotor of inertia I_m behind a gearbox of ratio N counts N^2 times (Tedrake,
Robotic Manipulation, section 2.2.1). With link inertia m l^2::

    (m l^2 + N^2 I_m) q'' + (b + N^2 b_m) q' + m g l sin q = N u
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from prehensile.control.gains import JointGains, gains_for_bandwidth, pid_torque


@dataclass(frozen=True)
class GearedPendulum:
    """A point mass on a massless rod, its joint driven by a motor through a gearbox.

    The angle q is zero where the mass hangs straight down.

    Attributes:
        mass: m in kg (> 0).
        length: l in m (> 0).
        damping: b of the joint's bearing, N m s/rad (>= 0).
        rotor_inertia: I_m of the motor about its own axis, kg m^2 (>= 0).
        rotor_damping: b_m of the motor's bearing, N m s/rad (>= 0).
        gear_ratio: N, turns of the motor for one turn of the joint (> 0); 1 is a direct drive.
        gravity: g in m/s^2.
    """

    mass: float = 1.0
    length: float = 0.5
    damping: float = 0.1
    rotor_inertia: float = 2e-4
    rotor_damping: float = 0.0
    gear_ratio: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        for name in ("mass", "length", "gear_ratio"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name}: must be finite and positive, not {getattr(self, name)}")
        for name in ("damping", "rotor_inertia", "rotor_damping"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(
                    f"{name}: must be finite and not negative, not {getattr(self, name)}"
                )
        if not np.isfinite(self.gravity):
            raise ValueError(f"gravity: must be finite, not {self.gravity}")

    @property
    def link_inertia(self) -> float:
        """Inertia m l^2 of the link about the joint, kg m^2."""
        return self.mass * self.length**2

    @property
    def reflected_inertia(self) -> float:
        """Inertia N^2 I_m that the joint feels of the motor, kg m^2."""
        return self.gear_ratio**2 * self.rotor_inertia

    @property
    def inertia(self) -> float:
        """Inertia that the joint moves, link and motor, kg m^2."""
        return self.link_inertia + self.reflected_inertia

    @property
    def total_damping(self) -> float:
        """Damping b + N^2 b_m at the joint, N m s/rad."""
        return self.damping + self.gear_ratio**2 * self.rotor_damping


def pendulum_dynamics(
    pendulum: GearedPendulum, x: ArrayLike, motor_torque: ArrayLike
) -> NDArray[np.float64]:
    """State-space dynamics x' = f(x, u).

    Args:
        pendulum: the pendulum.
        x: (…, 2) states [q, q'] in rad and rad/s.
        motor_torque: (…) u, torque of the motor before the gearbox, N m.

    Returns:
        (…, 2) [q', q''].
    """
    x = np.asarray(x, float)
    q, v = x[..., 0], x[..., 1]
    weight = pendulum.mass * pendulum.gravity * pendulum.length * np.sin(q)
    effort = pendulum.gear_ratio * np.asarray(motor_torque, float)
    acceleration = (effort - weight - pendulum.total_damping * v) / pendulum.inertia
    return np.stack([v, acceleration], axis=-1)


@dataclass(frozen=True)
class PendulumMotion:
    """A pendulum's motion.

    Attributes:
        t: (T,) times in s.
        q: (T,) angles in rad.
        v: (T,) velocities in rad/s.
        torque: (T,) torques of the motor, before the gearbox, in N m.
    """

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    torque: NDArray[np.float64]


def position_control(
    pendulum: GearedPendulum, bandwidth: float, *, damping_ratio: float = 1.0
) -> JointGains:
    """PD gains at the joint as its inertia is with its motor, gravity left to be a disturbance."""
    return gains_for_bandwidth(pendulum.inertia, bandwidth, damping_ratio=damping_ratio)


def simulate_pendulum(
    pendulum: GearedPendulum,
    gains: JointGains,
    q_desired: Callable[[float], float] | float,
    *,
    duration: float = 3.0,
    q_start: float = 0.0,
    samples: int = 301,
) -> PendulumMotion:
    """Simulates a pendulum under position control by its motor, from rest.

    The controller knows neither gravity nor the link: the torque at the joint is that of
    :func:`~prehensile.control.gains.pid_torque` with q_d' = 0, and the motor gives 1/N of it.

    Args:
        pendulum: the pendulum.
        gains: kp, kd and ki of the one joint, in N m at the joint.
        q_desired: desired angle in rad, constant or as a function of time.
        duration: of the simulation in s (> 0).
        q_start: angle at the start in rad.
        samples: number of times in the result, evenly spaced (> 1).

    Raises:
        ValueError: gains of another number of joints, no duration, fewer than two samples, or
            angles that are not finite.
    """
    if gains.size != 1:
        raise ValueError(f"gains: of {gains.size} joints, the pendulum has one")
    if not 0.0 < duration < np.inf:
        raise ValueError(f"duration: must be finite and positive, not {duration}")
    if samples < 2:
        raise ValueError(f"samples: must be at least 2, not {samples}")
    if not np.isfinite(q_start):
        raise ValueError(f"q_start: must be finite, not {q_start}")
    if not callable(q_desired) and not np.isfinite(q_desired):
        raise ValueError(f"q_desired: must be finite, not {q_desired}")
    target = q_desired if callable(q_desired) else lambda t: q_desired

    def torque(t: float, x: NDArray[np.float64]) -> float:
        return pid_torque(gains, x[0], x[1], target(t), 0.0, x[2])[0] / pendulum.gear_ratio

    def derivative(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.append(pendulum_dynamics(pendulum, x[:2], torque(t, x)), target(t) - x[0])

    t = np.linspace(0.0, duration, samples)
    solution = solve_ivp(
        derivative, (0.0, duration), [q_start, 0.0, 0.0], t_eval=t, rtol=1e-8, atol=1e-10,
        method="LSODA",
    )  # fmt: skip
    torques = np.array([torque(*item) for item in zip(t, solution.y.T, strict=True)])
    return PendulumMotion(t, solution.y[0], solution.y[1], torques)
