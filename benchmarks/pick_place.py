"""Simulated seconds of one pick and place, there and home again, against a rule of thumb.

The rule is that of the course notes (chapter 3) and of the ``manipulation`` package: keyframes of
the gripper in straight lines, 10 s for each metre, 2 s for each approach and retreat and for each
opening and closing of the hand. It ends above the goal; ours goes home and is counted to its end.
"""

from pathlib import Path

import numpy as np

from benchmarks.framework import Contender, Results, Samples

TITLE = "Pick and place, ten random starts and goals"
CASE = "simulated time of a trip"
SEEDS = range(10)
SECONDS_PER_METRE = 10.0
PAUSE = 2.0  # s
PREGRASP = 0.09  # m above the grasp
CLEARANCE = 0.3  # m above the middle between both pregrasps, toward the robot's side


def prepare(folder: Path) -> None:
    """Nothing: starts and goals come from the seeds."""


def ours(folder: Path) -> Results:
    """Simulated on the shipped scenario, all errors within the task's tolerances."""
    from prehensile.tasks.pick_place import choose_poses
    from prehensile.tasks.pick_place_run import run_pick_place

    durations = []
    for seed in SEEDS:
        report = run_pick_place(*choose_poses(seed), seed=seed)
        if not report.success:
            raise RuntimeError(f"seed {seed}: {report.reason or 'missed its goal'}")
        durations.append(report.trips[0].duration)
    return {CASE: Samples(durations, "simulated s")}


def rule_of_thumb(folder: Path) -> Results:
    """The rule on the same starts and goals, for the same first pose of the gripper."""
    from prehensile.planning.arm import ArmModel
    from prehensile.station.robot_plant import make_robot_diagram
    from prehensile.station.scenario_file import load_scenario
    from prehensile.tasks.pick_place import X_BrickG, choose_poses

    arm = ArmModel(make_robot_diagram(load_scenario("pick_brick")))
    p_first = arm.pose(arm.q_default).translation()
    up = np.array([0.0, 0.0, PREGRASP])
    durations = []
    for seed in SEEDS:
        pick, place = ((X_WB @ X_BrickG).translation() for X_WB in choose_poses(seed))
        prepick, preplace = pick + up, place + up
        clearance = 0.5 * (prepick + preplace) + [0.0, 0.0, CLEARANCE]
        # first, prepick, (pick, close, up), clearance, preplace, (place, open, up).
        corners = (p_first, prepick), (prepick, clearance), (clearance, preplace)
        length = sum(float(np.linalg.norm(b - a)) for a, b in corners)
        durations.append(SECONDS_PER_METRE * length + 6 * PAUSE)
    return {CASE: Samples(durations, "simulated s")}


CONTENDERS = (Contender("prehensile", ours), Contender("10 s per metre", rule_of_thumb))
