"""Depth images of an iiwa by Drake's renderer, and the shapes of its links."""

from functools import cache

import numpy as np
from pydrake.geometry import (
    ClippingRange,
    DepthRange,
    DepthRenderCamera,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from prehensile.models.registry import find_model
from prehensile.perception.body_evidence import Body
from prehensile.perception.camera_model import PosedCamera
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.mesh_file import read_mesh


@cache
def links(first: int = 0) -> tuple[Body, ...]:
    """Shapes of the iiwa's links from one on, each in its own frame."""
    folder = find_model("iiwa7").path.parent
    bodies = []
    for k in range(first, 8):
        mesh = read_mesh(folder / f"link_{k}.gltf")
        # The flange is all that tells of joint 6: its field must be true.
        spacing = 0.004 if k >= 6 else 0.01
        field = DistanceField.from_mesh(mesh, spacing, margin=0.05, signed=False)
        bodies.append(Body.from_mesh(mesh, field, num_samples=150))
    return tuple(bodies)


class ArmScene:
    """An iiwa alone before a camera."""

    def __init__(self) -> None:
        builder = DiagramBuilder()
        self.plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        Parser(self.plant).AddModels(str(find_model("iiwa7").path))
        self.plant.WeldFrames(self.plant.world_frame(), self.plant.GetFrameByName("iiwa_link_0"))
        self.plant.Finalize()
        assert isinstance(scene_graph, SceneGraph)
        scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
        self.scene_graph = scene_graph
        diagram = builder.Build()
        self.context = diagram.CreateDefaultContext()
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        self.frames = [self.plant.GetFrameByName(f"iiwa_link_{k}") for k in range(8)]
        self.limits = (
            self.plant.GetPositionLowerLimits(),
            self.plant.GetPositionUpperLimits(),
        )

    def depth(self, q: np.ndarray, camera: PosedCamera) -> np.ndarray:
        """(H, W) float32; infinite where nothing is."""
        model, X_WC = camera
        # Drake's renderer counts pixels from the image's corner, not from the first one's centre.
        centre = model.cx + 0.5, model.cy + 0.5
        info = CameraInfo(model.width, model.height, model.fx, model.fy, *centre)
        core = RenderCameraCore("vtk", info, ClippingRange(0.05, 10.0), RigidTransform())
        self.plant.SetPositions(self.plant_context, q)
        query = self.scene_graph.get_query_output_port().Eval(
            self.scene_graph.GetMyContextFromRoot(self.context)
        )
        image = query.RenderDepthImage(
            DepthRenderCamera(core, DepthRange(0.1, 5.0)), query.inspector().world_frame_id(), X_WC
        )
        return np.array(image.data[:, :, 0])

    def kinematics(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses (8, 4, 4) and Jacobians (8, 6, 7) of the links; the base does not move."""
        plant, context, world = self.plant, self.plant_context, self.plant.world_frame()
        plant.SetPositions(context, q)
        X = [frame.CalcPoseInWorld(context).GetAsMatrix4() for frame in self.frames]
        J = [
            plant.CalcJacobianSpatialVelocity(
                context, JacobianWrtVariable.kQDot, frame, np.zeros((3, 1)), world, world
            )
            for frame in self.frames
        ]
        return np.array(X), np.array(J)
