"""Small robots and meshes that the tests of the converter write for themselves."""

import struct
from pathlib import Path

import numpy as np
from pydrake.geometry import Role
from pydrake.multibody.parsing import Parser
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.analysis import Simulator

BOX_FACES = np.array(
    [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4)]
    + [(1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)]
)


def box_points(size, middle=(0, 0, 0)):
    x, y, z = np.asarray(size) / 2
    low = [(-x, -y, -z), (x, -y, -z), (x, y, -z), (-x, y, -z)]
    return np.array(low + [(a, b, z) for a, b, _ in low]) + middle


def prism(radius, length, n):
    """A closed prism of n sides about z, outward faces."""
    turn = 2 * np.pi * np.arange(n) / n
    ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    low = np.column_stack([ring, np.full(n, -length / 2)])
    points = np.vstack([low, low + [0, 0, length], [[0, 0, -length / 2], [0, 0, length / 2]]])
    faces = []
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j, n + j), (i, n + j, n + i), (2 * n, j, i), (2 * n + 1, n + i, n + j)]
    return points, np.array(faces)


def ball(radius, n):
    """A closed polyhedron with vertices on a sphere."""
    points, faces = [(0, 0, -radius)], []
    for k in range(1, n):
        a = np.pi * k / n - np.pi / 2
        for i in range(2 * n):
            t = np.pi * i / n
            points.append(
                radius * np.array([np.cos(a) * np.cos(t), np.cos(a) * np.sin(t), np.sin(a)])
            )
    points.append((0, 0, radius))
    m = 2 * n
    for i in range(m):
        j = (i + 1) % m
        faces.append((0, 1 + j, 1 + i))
        for k in range(n - 2):
            p, q = 1 + k * m, 1 + (k + 1) * m
            faces += [(p + i, p + j, q + j), (p + i, q + j, q + i)]
        faces.append((len(points) - 1, 1 + (n - 2) * m + i, 1 + (n - 2) * m + j))
    return np.array(points, float), np.array(faces)


def write_stl(path: Path, points, faces) -> Path:
    rows = []
    for face in faces:
        rows.append(struct.pack("<12fH", 0, 0, 0, *np.asarray(points)[face].ravel(), 0))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows))
    return path


def write_dae(path: Path, points, faces, unit: float, color="0.8 0.1 0.1 1") -> Path:
    positions = " ".join(f"{v:g}" for v in np.asarray(points).ravel())
    indices = " ".join(str(i) for i in np.asarray(faces).ravel())
    path.write_text(
        f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>
<unit name="u" meter="{unit}"/><up_axis>Z_UP</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><phong>
<diffuse><color>{color}</color></diffuse></phong></technique></profile_COMMON></effect>
</library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="{3 * len(points)}">{positions}</float_array>
<technique_common><accessor source="#pa" count="{len(points)}" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{len(faces)}" material="m"><input semantic="VERTEX" source="#v" offset="0"/>
<p>{indices}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g">
<bind_material><technique_common><instance_material symbol="m" target="#m"/></technique_common>
</bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
    )
    return path


def urdf_inertial(mass=1.0, moments=(0.01, 0.01, 0.01)) -> str:
    x, y, z = moments
    return (
        f'<inertial><mass value="{mass}"/>'
        f'<inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


class Loaded:
    """A model in Drake, its root welded to the world if it is free."""

    def __init__(self, path: Path, weld: bool = True) -> None:
        builder = RobotDiagramBuilder(time_step=1e-3)
        self.plant = builder.plant()
        (self.instance,) = Parser(self.plant).AddModels(path)
        probe = RobotDiagramBuilder(time_step=1e-3)
        Parser(probe.plant()).AddModels(path)
        probe.plant().Finalize()
        if weld:
            for index in probe.plant().GetFloatingBaseBodies():
                frame = self.plant.GetFrameByName(probe.plant().get_body(index).name())
                self.plant.WeldFrames(self.plant.world_frame(), frame)
        self.plant.Finalize()
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        self.inspector = self.diagram.scene_graph().model_inspector()

    def pose(self, body: str) -> np.ndarray:
        X = self.plant.GetBodyByName(body).EvalPoseInWorld(self.context)
        return X.GetAsMatrix4()

    def inertia(self, body: str):
        return self.plant.GetBodyByName(body).default_spatial_inertia()

    def set(self, **positions: float) -> None:
        for name, value in positions.items():
            joint = self.plant.GetJointByName(name)
            self.plant.SetPositions(self.context, self._put(joint, value))

    def _put(self, joint, value):
        q = self.plant.GetPositions(self.context)
        q[joint.position_start()] = value
        return q

    def position(self, joint: str) -> float:
        return self.plant.GetPositions(self.context)[
            self.plant.GetJointByName(joint).position_start()
        ]

    def simulate(self, duration: float) -> np.ndarray:
        """Lets the model fall; gives its energies on the way."""
        simulator, energies = Simulator(self.diagram, self.root), []
        for k in range(11):
            simulator.AdvanceTo(duration * k / 10)
            kinetic = self.plant.CalcKineticEnergy(self.context)
            energies.append(kinetic + self.plant.CalcPotentialEnergy(self.context))
        return np.array(energies)

    def efforts(self) -> dict[str, float]:
        actuators = map(self.plant.get_joint_actuator, self.plant.GetJointActuatorIndices())
        return {a.joint().name(): a.effort_limit() for a in actuators}

    def shapes(self, body: str, role=Role.kProximity) -> list:
        frame = self.plant.GetBodyFrameIdOrThrow(self.plant.GetBodyByName(body).index())
        return sorted(self.inspector.GetGeometries(frame, role), key=lambda g: g.get_value())

    def extents(self, body: str, role=Role.kProximity) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner, in the body's frame, of the boxes around its shapes."""
        corners = []
        for geometry in self.shapes(body, role):
            box = self.inspector.GetObbInGeometryFrame(geometry)
            X = self.inspector.GetPoseInFrame(geometry) @ box.pose()
            signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1)
            corners.append((X @ (signs * box.half_width()[:, None])).T)
        points = np.concatenate(corners)
        return points.min(axis=0), points.max(axis=0)
