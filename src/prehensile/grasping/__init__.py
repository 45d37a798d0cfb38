"""From clouds to grasps: candidates, their scores, and the choice among them."""

from prehensile.grasping.candidates import Candidates, antipodal_candidates
from prehensile.grasping.collision import boxes_overlap
from prehensile.grasping.grasp import Grasp, GraspConfig, GraspResult, GraspStatus
from prehensile.grasping.gripper import WSG50, HandBox, ParallelGripper
from prehensile.grasping.scoring import Evaluation, evaluate
from prehensile.grasping.selection import select_grasps

__all__ = [
    "WSG50",
    "Candidates",
    "Evaluation",
    "Grasp",
    "GraspConfig",
    "GraspResult",
    "GraspStatus",
    "HandBox",
    "ParallelGripper",
    "antipodal_candidates",
    "boxes_overlap",
    "evaluate",
    "select_grasps",
]
