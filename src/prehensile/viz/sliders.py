"""Sliders of the Meshcat page: declared in Python, moved in the browser, read as an array."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, JointIndex, PrismaticJoint


@dataclass(frozen=True)
class Slider:
    """One slider.

    Attributes:
        name: its label, unique on the page.
        lower, upper: its range (lower < upper).
        step: smallest change (> 0).
        value: where it starts.
        decrease, increase: codes of the keys that move it by one step, such as "KeyA"
            (the UI Events specification lists them); "" for none.
    """

    name: str
    lower: float
    upper: float
    step: float
    value: float
    decrease: str = ""
    increase: str = ""

    @property
    def label(self) -> str:
        """The name with its keys: "x (A, D)"."""
        if not self.decrease:
            return self.name
        keys = (k.removeprefix("Key").removeprefix("Digit") for k in (self.decrease, self.increase))
        return f"{self.name} ({', '.join(keys)})"


def add_sliders(meshcat: Meshcat, sliders: Sequence[Slider]) -> None:
    """Puts sliders on the page.

    Args:
        meshcat: the page.
        sliders: in the order in which they are shown; their labels must be new.
    """
    for s in sliders:
        meshcat.AddSlider(
            s.label, s.lower, s.upper, s.step, s.value,
            decrement_keycode=s.decrease, increment_keycode=s.increase,
        )  # fmt: skip


def read_sliders(meshcat: Meshcat, sliders: Sequence[Slider]) -> NDArray[np.float64]:
    """The values of sliders now.

    Args:
        meshcat: the page.
        sliders: those to read.

    Returns:
        (n,) values, in the order of ``sliders``.
    """
    return np.array([meshcat.GetSliderValue(s.label) for s in sliders])


def remove_sliders(meshcat: Meshcat, sliders: Sequence[Slider]) -> None:
    """Takes sliders off the page; those that are not there are no error."""
    for s in sliders:
        meshcat.DeleteSlider(s.label, strict=False)


def joint_sliders(
    plant: MultibodyPlant, positions: NDArray[np.float64]
) -> list[tuple[Joint, Slider]]:
    """A slider for each joint of one degree of freedom.

    Args:
        plant: a finalized plant.
        positions: (num_positions,) where the sliders start.

    Returns:
        Joints and their sliders in the plant's order. The label is the joint's name, after the
        model's where two share it; joints without limits get half a turn, or half a metre, to
        each side.
    """
    joints = [plant.get_joint(JointIndex(index)) for index in plant.GetJointIndices()]
    joints = [joint for joint in joints if joint.num_positions() == 1]
    count = Counter(joint.name() for joint in joints)
    found = []
    for joint in joints:
        value = float(positions[joint.position_start()])
        wide = 0.5 if joint.type_name() == PrismaticJoint.kTypeName else np.pi
        lower, upper = joint.position_lower_limit(), joint.position_upper_limit()
        lower = lower if np.isfinite(lower) else value - wide
        upper = upper if np.isfinite(upper) else value + wide
        model = plant.GetModelInstanceName(joint.model_instance())
        name = joint.name() if count[joint.name()] == 1 else f"{model} {joint.name()}"
        found.append((joint, Slider(name, lower, upper, 1e-3, value)))
    return found
