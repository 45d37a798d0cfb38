"""A small station for the tests of planning: arm, hand, table and two bins, and nothing loose."""

from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.planning import RobotDiagram, RobotDiagramBuilder

from prehensile.models.registry import package_map
from prehensile.planning.arm import ArmModel

BIN0 = (0.55, -0.28)
BIN1 = (0.0, -0.6)


def make_diagram() -> RobotDiagram:
    """iiwa7 with wsg50 at the origin, and two bins on a table within its reach."""
    builder = RobotDiagramBuilder(time_step=0.0)
    parser = builder.parser()
    parser.package_map().AddMap(package_map())
    plant = builder.plant()

    def add(model: str, name: str):
        parser.SetAutoRenaming(True)
        (instance,) = parser.AddModels(url=f"package://prehensile/{model}/{model}.sdf")
        plant.RenameModelInstance(instance, name)
        return instance

    W = plant.world_frame()
    iiwa, wsg = add("iiwa7", "iiwa"), add("wsg50", "wsg")
    plant.WeldFrames(W, plant.GetFrameByName("iiwa_link_0", iiwa))
    X_7G = RigidTransform(RollPitchYaw(1.5707963267948966, 0, 1.5707963267948966), [0, 0, 0.09])
    plant.WeldFrames(
        plant.GetFrameByName("iiwa_link_7", iiwa), plant.GetFrameByName("body", wsg), X_7G
    )
    for name, (x, y) in (("bin0", BIN0), ("bin1", BIN1)):
        bin_ = add("bin", name)
        turn = RollPitchYaw(0, 0, 1.5707963267948966 if name == "bin0" else 0.0)
        plant.WeldFrames(
            W, plant.GetFrameByName("base_link", bin_), RigidTransform(turn, [x, y, 0])
        )
    for joint, q in (("iiwa_joint_1", -0.8), ("iiwa_joint_2", 0.3), ("iiwa_joint_4", -1.4)):
        plant.GetJointByName(joint, iiwa).set_default_angle(q)
    plant.GetJointByName("iiwa_joint_6", iiwa).set_default_angle(1.4)
    plant.Finalize()
    return builder.Build()


def make_arm() -> ArmModel:
    """The planner's model of that station."""
    return ArmModel(make_diagram())
