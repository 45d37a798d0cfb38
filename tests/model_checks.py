"""What the tests of the models share: one model in a scene, and its shapes as points."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import FrameId, GeometryId, Role
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from prehensile.models.registry import find_model, package_map


@dataclass
class Scene:
    """A diagram of one model, at its default configuration."""

    diagram: Diagram
    plant: MultibodyPlant
    root: Context
    context: Context
    _shapes: dict[str, tuple[FrameId, set[GeometryId]]] = field(default_factory=dict)

    @property
    def query(self) -> Any:
        return self.plant.get_geometry_query_input_port().Eval(self.context)

    def shapes(self, body: str) -> tuple[FrameId, set[GeometryId]]:
        """The frame of a body and its collision shapes."""
        if body not in self._shapes:
            frame = self.plant.GetBodyFrameIdOrThrow(self.plant.GetBodyByName(body).index())
            shapes = set(self.query.inspector().GetGeometries(frame, Role.kProximity))
            self._shapes[body] = frame, shapes
        return self._shapes[body]

    def distance(self, body: str, p_B: np.ndarray) -> float:
        """Signed distance of a point, given in the frame of a body, from its collision shapes."""
        frame, shapes = self.shapes(body)
        hits = self.query.ComputeSignedDistanceToPoint(self.query.GetPoseInWorld(frame) @ p_B)
        return min(hit.distance for hit in hits if hit.id_G in shapes)

    def surface_points(self, body: str, rng: np.random.Generator, count: int) -> np.ndarray:
        """Points (N, 3) on the collision shapes of a body, in its frame; none in other bodies."""
        frame, shapes = self.shapes(body)
        inspector = self.query.inspector()
        X_WB = self.query.GetPoseInWorld(frame)
        reach = 0.3 + max(np.linalg.norm(inspector.GetPoseInFrame(g).translation()) for g in shapes)
        points = []
        for p_B in rng.uniform(-reach, reach, size=(count, 3)):
            hits = self.query.ComputeSignedDistanceToPoint(X_WB @ p_B)
            nearest = min((h for h in hits if h.id_G in shapes), key=lambda h: h.distance)
            p_BN = inspector.GetPoseInFrame(nearest.id_G) @ nearest.p_GN
            others = self.query.ComputeSignedDistanceToPoint(X_WB @ p_BN)
            if all(h.id_G in shapes or h.distance > 0.003 for h in others):
                points.append(p_BN)
        return np.array(points).reshape(-1, 3)


def scene(name: str, *, weld: str | None = None, time_step: float = 0.002) -> Scene:
    """Loads an embedded model, one of its bodies welded to the world if wanted."""
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=time_step,
        contact_model="hydroelastic_with_fallback",
        discrete_contact_approximation="sap",
    )
    plant, _ = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.AddModelsFromUrl(find_model(name).url)
    if weld:
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(weld))
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    return Scene(diagram, plant, root, plant.GetMyMutableContextFromRoot(root))


def visual_files(name: str) -> dict[str, Path]:
    """Body name to the glTF file of its visual, read from the SDF itself."""
    import xml.etree.ElementTree as ET

    info = find_model(name)
    return {
        link.attrib["name"]: info.path.parent / uri.text
        for link in ET.parse(info.path).iter("link")
        if (uri := link.find("visual/geometry/mesh/uri")) is not None and uri.text
    }
