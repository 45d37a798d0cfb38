"""What grasp selection is told and what it answers."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.errors import Finding, InputError


@dataclass(frozen=True)
class GraspConfig:
    """Settings of grasp selection."""

    # Surface points from which candidates are made; 1 or more.
    num_seeds: int = 120
    # Rounds of sampling before giving up; each has fresh seeds, the first success ends it; >= 1.
    rounds: int = 3
    # Edge of the voxels of the cloud [m]; above 0.
    voxel_size: float = 0.004
    # Largest angle between the approach and straight down [rad]; 0 to pi/2.
    max_tilt: float = float(np.deg2rad(50))
    # Step of the approach angles about the closing axis [rad]; above 0.
    tilt_step: float = float(np.deg2rad(20))
    # How far past the seed the pads' centre is put along the approach [m]; any number of values.
    depths: tuple[float, ...] = (-0.012, -0.002, 0.01, 0.024)
    # Free space wished for between finger and object while it goes down [m]; 0 or more.
    clearance: float = 0.005
    # The least of it, and that to neighbours behind the finger [m]; 0 to clearance.
    min_clearance: float = 0.002
    # Distance that the rest of the hand keeps from points of the cloud [m]; 0 or more.
    margin: float = 0.003
    # Distance that the hand keeps from obstacles such as walls and floor [m]; 0 or more.
    obstacle_margin: float = 0.004
    # Length of the straight approach that must be free of obstacles [m]; 0 or more.
    approach: float = 0.08
    # Points within this of the first touched one count as contact [m]; above 0.
    contact_depth: float = 0.004
    # Largest angle between a pad's normal and the mean contact normal [rad]; 0 to pi/2.
    max_contact_angle: float = float(np.deg2rad(35))
    # Quality (0 to 1) ascribed to a side of the object that no camera saw.
    unseen_side: float = 0.25
    # Weights of the penalties, each against a contact quality of 0 to 1; 0 or more:
    # tilt of the approach (times 1 - cos),
    weight_tilt: float = 1.0
    # horizontal distance to the object's centre (per 0.1 m),
    weight_offset: float = 0.5
    # opening (as a share of the largest),
    weight_opening: float = 0.1
    # share of points between the pads that belong to another object,
    weight_mixed: float = 0.5
    # less room beside the object than wished for,
    weight_tight: float = 0.1
    # other things seen to rest on the object (1 for plenty).
    weight_burden: float = 0.3
    # Grasps closer than this [m] and min_angle to a better one are left out; 0 or more.
    min_distance: float = 0.015
    # Grasps closer than this [rad] and min_distance to a better one are left out; 0 to pi.
    min_angle: float = float(np.deg2rad(20))
    # Longest list that is returned; 1 or more.
    max_grasps: int = 30

    def __post_init__(self) -> None:
        """Checks the ranges.

        Raises:
            InputError: with every field that is out of its range.
        """
        positive = ("num_seeds", "rounds", "voxel_size", "tilt_step", "contact_depth", "max_grasps")
        angles = {"max_tilt": np.pi / 2, "max_contact_angle": np.pi / 2, "min_angle": np.pi}
        faults = []
        for f in fields(self):
            value = getattr(self, f.name)
            if f.name == "depths":
                if len(value) == 0 or not np.isfinite(value).all():
                    faults.append(Finding(f"{value} is no list of numbers", key=f.name))
                continue
            high = angles.get(f.name, 1.0 if f.name == "unseen_side" else np.inf)
            low_ok = value > 0 if f.name in positive else value >= 0
            if not (low_ok and value <= high and np.isfinite(value)):
                faults.append(Finding(f"{value} is out of range", key=f.name))
        if self.min_clearance > self.clearance:
            faults.append(Finding("it is larger than clearance", key="min_clearance"))
        if faults:
            raise InputError(*faults)


class GraspStatus(Enum):
    """Why there is a grasp or none."""

    FOUND = "found"
    NO_POINTS = "the cloud is empty"
    NO_SIDES = "no surface is steep enough to close on"
    TOO_WIDE = "everything is too wide for the hand, or has no room beside it for the fingers"
    NOT_ANTIPODAL = "no two opposite surfaces face the pads squarely"
    HITS_CLOUD = "the hand would hit other things"
    HITS_OBSTACLES = "the hand would hit the bin or other known obstacles"


@dataclass(frozen=True)
class Grasp:
    """One grasp: where the hand goes, how far it opens before, how good it is.

    Attributes:
        X_WG: pose of the hand's frame G.
        width: opening command for the approach [m].
        span: extent of the object between the pads [m].
        score: the higher the better; 1 is flawless.
        breakdown: the terms that add up to the score, by name.
    """

    X_WG: RigidTransform
    width: float
    span: float
    score: float
    breakdown: Mapping[str, float]

    def flipped(self) -> "Grasp":
        """The same grasp with the hand turned by half a turn about its approach axis."""
        turn = RigidTransform(RotationMatrix.MakeYRotation(np.pi))
        return Grasp(self.X_WG @ turn, self.width, self.span, self.score, self.breakdown)


@dataclass(frozen=True)
class GraspResult:
    """What grasp selection found.

    Attributes:
        status: FOUND, or what stood in the way of most candidates.
        grasps: the grasps, best first, no two alike.
        counts: the number of candidates by what became of them.
    """

    status: GraspStatus
    grasps: tuple[Grasp, ...] = ()
    counts: Mapping[GraspStatus, int] = field(default_factory=dict)

    @property
    def success(self) -> bool:
        """Whether there is at least one grasp."""
        return self.status is GraspStatus.FOUND
