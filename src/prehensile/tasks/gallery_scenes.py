"""Scenes of the gallery: the scenario of robots side by side, each under a controller."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RollPitchYaw
from pydrake.trajectories import Trajectory

from prehensile.control.joint_controller import ControllerKind, actuators_of
from prehensile.errors import Finding, InputError
from prehensile.station.scenario_file import loads_scenario
from prehensile.tasks.gallery import Show, Track
from prehensile.tasks.gallery_motions import swing, wave
from prehensile.tasks.gallery_robots import Robot, gallery_robots

_BANDWIDTH = 20.0  # rad/s of arms; the mechanics of real ones allow about that much
_HAND_BANDWIDTH = 40.0  # rad/s of fingers
_TILE = 4.0  # m, side of the model of the floor


def arms(
    controller: ControllerKind = "inverse-dynamics", names: Sequence[str] | None = None
) -> Show:
    """Every arm of the registry swings its joints.

    Args:
        controller: of all arms.
        names: of the models wanted; default: all.
    """
    eye, target = (2.3, -0.9, 1.4), (-0.3, 0.0, 0.35)
    return _show(gallery_robots("arm", names), controller, swing, eye, target)


def hands(names: Sequence[str] | None = None) -> Show:
    """Every hand of the registry closes, opens and waves its fingers.

    Args:
        names: of the models wanted; default: all.
    """
    eye, target = (0.7, 0.0, 0.6), (-0.2, 0.05, 0.27)
    return _show(gallery_robots("hand", names), "stiffness", wave, eye, target)


def _show(
    robots: Sequence[Robot],
    controller: ControllerKind,
    motion: Callable[[Robot], Trajectory],
    eye: Sequence[float],
    target: Sequence[float],
) -> Show:
    """Robots side by side in a scene of their own."""
    if not any(robot.joints for robot in robots):
        names = ", ".join(robot.info.name for robot in robots)
        raise InputError(Finding(f"nothing moves in {names}", "add a model with a motor"))
    text = scenario_text(robots, controller, "Robots of the gallery side by side.")
    return Show(
        scenario=loads_scenario(text),
        tracks=[Track(robot.info.name, motion(robot)) for robot in robots if robot.joints],
        eye=eye,
        target=target,
        still=[robot.info.name for robot in robots if not robot.joints],
        controller=controller,
        text=text,
    )


def scenario_text(robots: Sequence[Robot], controller: ControllerKind, title: str) -> str:
    """The YAML text of a scenario with robots on a floor, each under a controller.

    Args:
        robots: the robots.
        controller: kind of controller of all of them; fingers are always driven by stiffness,
            as a sampled controller is no match for parts of a few grams.
        title: first line of the text, a comment.
    """
    places = np.array([robot.X_WB.translation() for robot in robots])
    lines = [
        f"# {title}",
        "",
        "plant_config:",
        "  time_step: 0.002",
        "  contact_model: hydroelastic_with_fallback",
        "  discrete_contact_approximation: sap",
        "",
        "simulator_config:",
        "  integration_scheme: explicit_euler  # the plant is discrete; only controllers integrate",
        "",
        "visualization:",
        "  publish_contacts: false",
        "",
        "directives:",
    ]
    for k, (x, y) in enumerate(_tiles(places)):
        lines += [
            "- add_model:",
            f"    name: floor{k}",
            "    file: package://prehensile/floor/floor.sdf",
            f"- add_weld: {{parent: world, child: 'floor{k}::base_link', "
            f"X_PC: {{translation: [{x:g}, {y:g}, 0.0]}}}}",
        ]
    for robot in robots:
        lines += _directives(robot)
    drivers = [(robot.info.name, _driver(robot, controller)) for robot in robots if robot.joints]
    lines += ["", "model_drivers:", *(f"  {name}: {driver}" for name, driver in drivers)]
    return "\n".join(lines) + "\n"


def _tiles(places: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Centres of tiles of floor that reach 1 m beyond all places."""
    low, high = places[:, :2].min(axis=0) - 1.0, places[:, :2].max(axis=0) + 1.0
    counts = np.ceil((high - low) / _TILE).astype(int)
    first = 0.5 * (low + high) - 0.5 * _TILE * (counts - 1)
    return [tuple(first + _TILE * np.array(k)) for k in np.ndindex(*counts)]


def _directives(robot: Robot) -> list[str]:
    """A model and where it stands."""
    name = robot.info.name
    x, y, z = robot.X_WB.translation() + 0.0
    roll, pitch, yaw = np.rad2deg(RollPitchYaw(robot.X_WB.rotation()).vector()) + 0.0
    plant = robot.plant
    joints = [plant.get_joint(i) for i in plant.GetJointIndices(robot.instance)]
    joints = [joint for joint in joints if joint.num_positions() == 1]
    lines = ["- add_model:", f"    name: {name}", f"    file: {robot.info.url}"]
    if joints:
        lines.append("    default_joint_positions:")
    for joint in joints:
        lines.append(f"      {joint.name()}: [{robot.q[joint.position_start()]:.4f}]")
    return [
        *lines,
        "- add_weld:",
        "    parent: world",
        f"    child: {name}::{robot.base.name()}",
        "    X_PC:",
        f"      translation: [{x:g}, {y:g}, {z:g}]",
        f"      rotation: !Rpy {{ deg: [{roll:g}, {pitch:g}, {yaw:g}] }}",
    ]


def _driver(robot: Robot, controller: ControllerKind) -> str:
    """A driver's YAML."""
    if robot.info.category == "hand":
        return f"!JointStiffnessDriver {{ bandwidth: {_HAND_BANDWIDTH:g} }}"
    bandwidth = f"bandwidth: {_BANDWIDTH:g}"
    if controller == "stiffness":
        return f"!JointStiffnessDriver {{ {bandwidth} }}"
    if controller == "gravity-compensation":
        return f"!JointPidDriver {{ {bandwidth} }}"
    if controller == "pid":
        more = f"gravity_compensation: false, integral_rate: {0.25 * _BANDWIDTH:g}"
        return f"!JointPidDriver {{ {bandwidth}, {more} }}"
    gains = f"{{ kp: {_BANDWIDTH**2:g}, ki: 0, kd: {2 * _BANDWIDTH:g} }}"
    actuators = actuators_of(robot.plant, [robot.instance])
    each = ", ".join(f"{actuator.name()}: {gains}" for actuator in actuators)
    return f"!InverseDynamicsDriver {{ gains: {{ {each} }} }}"
