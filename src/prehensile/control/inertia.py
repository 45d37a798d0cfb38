"""What a joint has to move: the inertia of links beside the reflected inertia of motors.

The mass matrix M(q) of a geared arm is that of its links plus the diagonal matrix of reflected
inertias N^2 I_m. The links' part changes with the posture and couples the joints; the motors' part
does neither. The more of the inertia is the motors', the better one set of constant gains for each
joint alone does in every posture (Tedrake, Robotic Manipulation, section 2.2.1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.multibody.plant import MultibodyPlant


@dataclass(frozen=True)
class JointInertia:
    """Inertia at each of n velocities of a plant over K configurations, in kg m^2 or kg.

    Attributes:
        names: n names of joints, ``MODEL::JOINT`` if there are several models.
        reflected: (n,) reflected inertias N^2 I_m; 0 where there is no motor.
        link: (K, n) diagonals of the links' part of the mass matrix.
        coupling: (K, n) the strongest coupling of each joint with another one, the greatest
            |M_ij| / sqrt(M_ii M_jj) over j ≠ i: from 0 (no other is felt) to 1.
    """

    names: tuple[str, ...]
    reflected: NDArray[np.float64]
    link: NDArray[np.float64]
    coupling: NDArray[np.float64]

    @property
    def total(self) -> NDArray[np.float64]:
        """(K, n) diagonals of the mass matrix."""
        return self.link + self.reflected

    @property
    def largest(self) -> NDArray[np.float64]:
        """(n,) greatest inertia of each joint over the configurations."""
        return self.total.max(axis=0)

    @property
    def link_ratio(self) -> NDArray[np.float64]:
        """(n,) greatest by least inertia over the configurations, of the links alone."""
        return self.link.max(axis=0) / self.link.min(axis=0)

    @property
    def total_ratio(self) -> NDArray[np.float64]:
        """(n,) greatest by least inertia over the configurations, motors included."""
        return self.total.max(axis=0) / self.total.min(axis=0)


def reflected_inertia(plant: MultibodyPlant) -> NDArray[np.float64]:
    """Reflected inertia N^2 I_m at each velocity of a plant.

    Args:
        plant: a finalized plant.

    Returns:
        (nv,) kg m^2, or kg for a sliding joint; 0 where there is no motor.
    """
    reflected = np.zeros(plant.num_velocities())
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        if actuator.joint().num_velocities() == 1:
            reflected[actuator.joint().velocity_start()] += actuator.default_reflected_inertia()
    return reflected


def joint_inertia(plant: MultibodyPlant, configurations: ArrayLike) -> JointInertia:
    """Inertia at each joint of a plant over configurations, links and motors told apart.

    Args:
        plant: a finalized plant.
        configurations: (K, nq) or (nq,) positions, K >= 1.

    Raises:
        ValueError: the configurations do not fit the plant.
    """
    Q = np.atleast_2d(np.asarray(configurations, float))
    nq = plant.num_positions()
    if Q.ndim != 2 or len(Q) == 0 or Q.shape[1] != nq or not np.isfinite(Q).all():
        raise ValueError(f"configurations: K >= 1 of {nq} finite numbers, got {Q}")
    context = plant.CreateDefaultContext()
    reflected = reflected_inertia(plant)
    link, coupling = [], []
    for q in Q:
        plant.SetPositions(context, q)
        M = plant.CalcMassMatrix(context)
        diagonal = np.diag(M)
        link.append(diagonal - reflected)
        normalized = np.abs(M) / np.sqrt(np.outer(diagonal, diagonal))
        coupling.append((normalized - np.eye(len(M))).max(axis=1, initial=0.0))
    return JointInertia(_velocity_names(plant), reflected, np.array(link), np.array(coupling))


def random_configurations(
    plant: MultibodyPlant, count: int, *, seed: int = 0
) -> NDArray[np.float64]:
    """Configurations uniformly within the position limits; ±π where there is no limit.

    Args:
        plant: a finalized plant. Joints of several degrees of freedom, as those of bodies that
            float, stay at their default positions.
        count: K, how many.
        seed: of the choice.

    Returns:
        (K, nq).
    """
    lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
    lower = np.where(np.isfinite(lower), lower, -np.pi)
    upper = np.where(np.isfinite(upper), upper, np.pi)
    Q = np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))
    default = plant.GetDefaultPositions()
    for joint in (plant.get_joint(index) for index in plant.GetJointIndices()):
        if joint.num_positions() > 1:
            stay = slice(joint.position_start(), joint.position_start() + joint.num_positions())
            Q[:, stay] = default[stay]
    return Q


def _velocity_names(plant: MultibodyPlant) -> tuple[str, ...]:
    """A name for each velocity: that of its joint, with its model if there are several."""
    joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
    moving = [joint for joint in joints if joint.num_velocities() > 0]
    several = len({joint.model_instance() for joint in moving}) > 1
    names = [""] * plant.num_velocities()
    for joint in moving:
        model = plant.GetModelInstanceName(joint.model_instance())
        for k in range(joint.num_velocities()):
            suffix = f"[{k}]" if joint.num_velocities() > 1 else ""
            scope = f"{model}::" if several else ""
            names[joint.velocity_start() + k] = f"{scope}{joint.name()}{suffix}"
    return tuple(names)
