"""Kinematic trees: what Drake's plant says of bodies and joints, and boxes that do not overlap."""

import xml.etree.ElementTree as ElementTree
from itertools import combinations

import numpy as np
import pytest
from PIL import Image
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia

from prehensile.errors import InputError
from prehensile.models.registry import package_map
from prehensile.viz.kinematic_tree import (
    kinematic_tree_image,
    kinematic_tree_picture,
    read_kinematic_tree,
    save_kinematic_tree,
)


@pytest.fixture(scope="module")
def plant() -> MultibodyPlant:
    """An iiwa with a WSG hand, and a brick that is free."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    for model in ("iiwa7", "wsg50", "foam_brick"):
        parser.AddModels(url=f"package://prehensile/{model}/{model}.sdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"))
    plant.WeldFrames(plant.GetFrameByName("iiwa_link_7"), plant.GetFrameByName("body"))
    plant.Finalize()
    return plant


def test_every_body_hangs_from_the_body_of_its_joint(plant):
    tree = read_kinematic_tree(plant)
    assert len(tree) == plant.num_bodies()
    assert (tree[0].name, tree[0].parent) == ("world", -1)
    for i, body in enumerate(tree[1:], 1):
        assert body.parent < i
        joint = (
            plant.GetJointByName(body.joint, plant.GetBodyByName(body.name).model_instance())
            if body.kind in ("revolute", "prismatic")
            else plant.GetJointByName(body.joint)
        )
        assert joint.child_body().name() == body.name
        assert joint.parent_body().name() == tree[body.parent].name
        assert body.q == (joint.position_start(), joint.position_start() + joint.num_positions())
        assert body.v == (joint.velocity_start(), joint.velocity_start() + joint.num_velocities())


def test_positions_and_velocities_are_shared_out_without_rest(plant):
    tree = read_kinematic_tree(plant)
    for spans, number in (
        ([b.q for b in tree], plant.num_positions()),
        ([b.v for b in tree], plant.num_velocities()),
    ):
        owned = [i for first, end in spans for i in range(first, end)]
        assert sorted(owned) == list(range(number))
    kinds = {b.name: b.kind for b in tree}
    assert kinds["iiwa_link_0"] == kinds["body"] == "weld"
    assert kinds["iiwa_link_3"] == "revolute"
    assert kinds["left_finger"] == "prismatic"
    assert kinds["base_link"] == "quaternion_floating"


def test_a_joint_given_backwards_hangs_the_other_way():
    plant = MultibodyPlant(0.0)
    body = plant.AddRigidBody("body", SpatialInertia.SolidCubeWithDensity(1.0, 1.0))
    joint = RevoluteJoint("hinge", body.body_frame(), plant.world_frame(), [0, 0, 1])
    plant.AddJoint(joint)
    plant.Finalize()
    tree = read_kinematic_tree(plant)
    assert [(b.name, b.joint) for b in tree] == [("world", ""), ("body", "hinge")]


def test_boxes_and_labels_do_not_overlap_and_are_in_the_picture(plant):
    picture = kinematic_tree_picture(read_kinematic_tree(plant))
    # A box for each body and a label for each joint.
    assert len(picture.rects) == 2 * plant.num_bodies() - 1
    for a, b in combinations(picture.rects, 2):
        apart = a.x + a.w <= b.x or b.x + b.w <= a.x or a.y + a.h <= b.y or b.y + b.h <= a.y
        assert apart
    for r in picture.rects:
        assert r.x >= 0
        assert r.y >= 0
        assert r.x + r.w <= picture.width
        assert r.y + r.h <= picture.height
    for line in picture.lines:  # from one box to the next, downward
        ys = [y for _, y in line.points]
        assert ys == sorted(ys)


def test_files_say_the_names_and_indices(plant, tmp_path):
    svg = save_kinematic_tree(plant, tmp_path / "tree.svg")
    texts = {e.text for e in ElementTree.parse(svg).iter("{http://www.w3.org/2000/svg}text")}
    assert {"iiwa_joint_1", "revolute  q[0]  v[0]", "weld"} <= texts
    assert "floating, quaternion  q[9:16]  v[9:15]" in texts
    png = Image.open(save_kinematic_tree(plant, tmp_path / "tree.png"))
    image = kinematic_tree_image(plant)
    assert image.dtype == np.uint8
    assert (png.height, png.width, 3) == image.shape


def test_clear_errors(plant, tmp_path):
    with pytest.raises(InputError, match="no kinematic tree is written as '.html'"):
        save_kinematic_tree(plant, tmp_path / "tree.html")
    with pytest.raises(ValueError, match="plant must be finalized"):
        read_kinematic_tree(MultibodyPlant(0.0))
