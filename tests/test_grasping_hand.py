"""The hand's boxes and collision between boxes, against the model and against a linear program."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import Role
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from prehensile.grasping import WSG50, boxes_overlap
from prehensile.models.registry import find_model, package_map
from prehensile.perception import Box, inside_box


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), parallel=st.booleans())
def test_overlap_of_boxes_is_that_of_a_linear_program(seed: int, parallel: bool) -> None:
    rng = np.random.default_rng(seed)
    R_A = Rotation.random(rng=rng).as_matrix()
    R_B = R_A if parallel else Rotation.random(rng=rng).as_matrix()
    p_A, p_B = rng.uniform(-1, 1, (2, 3))
    a, b = rng.uniform(0.1, 1.6, (2, 3))
    # A common point x, with the largest room t to all faces; overlap if t >= 0.
    rows = np.concatenate([R_A.T, -R_A.T, R_B.T, -R_B.T])
    bounds = np.concatenate(
        [a / 2 + R_A.T @ p_A, a / 2 - R_A.T @ p_A, b / 2 + R_B.T @ p_B, b / 2 - R_B.T @ p_B]
    )
    lp = linprog(
        [0, 0, 0, -1], A_ub=np.column_stack([rows, np.ones(12)]), b_ub=bounds, bounds=(None, None)
    )
    assert lp.success
    if abs(lp.fun) > 1e-9:
        assert boxes_overlap(R_A, p_A, a, R_B, p_B, b) == (-lp.fun > 0)


def test_overlap_broadcasts() -> None:
    p = np.linspace(-2, 2, 9)[:, None] * [1.0, 0, 0]
    hits = boxes_overlap(np.eye(3), p, np.ones(3), np.eye(3), np.zeros(3), np.ones(3))
    np.testing.assert_array_equal(hits, np.abs(p[:, 0]) <= 1)


@pytest.mark.parametrize("width", [0.0, 0.03, 0.107])
def test_the_boxes_cover_the_model_and_the_pads_are_where_they_are_said_to_be(
    width: float,
) -> None:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.001)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.AddModels(url=find_model("wsg50").url)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("body"), RigidTransform())
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    for side, sign in (("left", -1), ("right", 1)):
        joint = plant.GetJointByName(f"{side}_finger_sliding_joint")
        joint.set_translation(plant_context, sign * width / 2)
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    inspector = query.inspector()
    centres, sizes = WSG50.boxes(np.array([width]))
    hand = [Box(RigidTransform(c), s + 0.0005) for c, s in zip(centres[0], sizes[0], strict=True)]
    corners = np.indices((2, 2, 2)).reshape(3, 8).T - 0.5
    pads = []
    for geometry in inspector.GetAllGeometryIds(Role.kProximity):
        obb = inspector.GetObbInGeometryFrame(geometry)
        X_WObb = query.GetPoseInWorld(geometry) @ obb.pose()
        p_G = X_WObb.multiply((2 * corners * obb.half_width()).T).T
        covered = np.any([inside_box(p_G, box) for box in hand], axis=0)
        assert covered.all(), inspector.GetName(geometry)
        if inspector.GetName(geometry).endswith("pad"):
            pads.append(p_G)
    left, right = sorted(pads, key=lambda p: p[:, 0].mean())
    assert right[:, 0].min() - left[:, 0].max() == pytest.approx(
        width + 2 * WSG50.pad_offset, abs=1e-6
    )
    for pad in pads:
        np.testing.assert_allclose(pad[:, 1].mean(), WSG50.p_GPad[1], atol=1e-4)
        np.testing.assert_allclose(np.ptp(pad[:, 2]), WSG50.pad_width, atol=1e-6)


def test_retreat_sweeps_the_hand_backward() -> None:
    still, _ = WSG50.boxes(np.array([0.05]))
    swept, sizes = WSG50.boxes(np.array([0.05]), 0.1)
    _, sizes_still = WSG50.boxes(np.array([0.05]))
    np.testing.assert_allclose(sizes - sizes_still, np.broadcast_to([0, 0.1, 0], sizes.shape))
    np.testing.assert_allclose(swept - still, np.broadcast_to([0, -0.05, 0], swept.shape))
