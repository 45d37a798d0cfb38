"""Joint gains: the PID law, and gains for a wanted bandwidth from the inertia at a joint."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class JointGains:
    """Gains of n joints that are controlled one by one.

    The units are those of an effort (N m for an angle in rad, N for a distance in m), or of an
    acceleration where a controller multiplies by the mass matrix itself (inverse dynamics).

    Attributes:
        kp: (n,) position gains, effort per rad or m (>= 0).
        kd: (n,) velocity gains, effort per rad/s or m/s (>= 0).
        ki: (n,) integral gains, effort per rad s or m s (>= 0).
    """

    kp: NDArray[np.float64]
    kd: NDArray[np.float64]
    ki: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("kp", "kd", "ki"):
            values = np.atleast_1d(np.asarray(getattr(self, name), float))
            object.__setattr__(self, name, values)
            if values.ndim != 1 or len(values) != len(np.atleast_1d(self.kp)):
                raise ValueError(f"{name}: {values.shape} where kp has {np.shape(self.kp)}")
            if not (np.isfinite(values) & (values >= 0.0)).all():
                raise ValueError(f"{name}: gains are finite and not negative, not {values}")

    @property
    def size(self) -> int:
        """Number of joints."""
        return len(self.kp)


def gains_for_bandwidth(
    inertia: ArrayLike,
    bandwidth: float,
    *,
    damping_ratio: float = 1.0,
    integral_rate: float = 0.0,
) -> JointGains:
    """Gains that give joints of known inertia the same wanted closed-loop poles.

    For I q'' = u under u = -kp q - kd q' - ki ∫q the characteristic polynomial becomes
    (s^2 + 2 ζ ω s + ω^2) (s + p)::

        kp = I (ω^2 + 2 ζ ω p),   kd = I (2 ζ ω + p),   ki = I p ω^2

    With p = 0 this is the PD law kp = I ω^2, kd = 2 ζ ω I. Where the true inertia is less than I,
    as that of an arm in another posture, a PD joint is faster and better damped than asked for.
    (Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems, chapter 4.)

    Args:
        inertia: (n,) inertia that each joint moves, reflected inertia included (kg m^2 or kg; > 0).
        bandwidth: ω in rad/s (> 0).
        damping_ratio: ζ (> 0); 1 is critical damping.
        integral_rate: p in rad/s (>= 0), the pole of the integral; 0 for none.

    Raises:
        ValueError: a value is out of its range.
    """
    values = np.atleast_1d(np.asarray(inertia, float))
    if not (np.isfinite(values) & (values > 0.0)).all():
        raise ValueError(f"inertia: must be finite and positive, not {values}")
    for name, value in (("bandwidth", bandwidth), ("damping_ratio", damping_ratio)):
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name}: must be finite and positive, not {value}")
    if not (np.isfinite(integral_rate) and integral_rate >= 0.0):
        raise ValueError(f"integral_rate: must be finite and not negative, not {integral_rate}")
    spread = 2.0 * damping_ratio * bandwidth
    return JointGains(
        kp=values * (bandwidth**2 + spread * integral_rate),
        kd=values * (spread + integral_rate),
        ki=values * integral_rate * bandwidth**2,
    )


def pid_torque(
    gains: JointGains,
    q: ArrayLike,
    v: ArrayLike,
    q_desired: ArrayLike,
    v_desired: ArrayLike,
    integral: ArrayLike = 0.0,
) -> NDArray[np.float64]:
    """The PID law: kp (q_d - q) + kd (v_d - v) + ki ∫(q_d - q) dt.

    Args:
        gains: of n joints.
        q: (…, n) positions.
        v: (…, n) velocities.
        q_desired: (…, n) desired positions.
        v_desired: (…, n) desired velocities.
        integral: (…, n) integral of the position error so far, in rad s or m s.

    Returns:
        (…, n) efforts.
    """
    error = np.asarray(q_desired, float) - np.asarray(q, float)
    rate = np.asarray(v_desired, float) - np.asarray(v, float)
    return gains.kp * error + gains.kd * rate + gains.ki * np.asarray(integral, float)
