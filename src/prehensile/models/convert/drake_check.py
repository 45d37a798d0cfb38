"""The converted model as Drake sees it: it loads, and its parts rest apart from one another."""

import logging
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from prehensile.errors import Finding, InputError
from prehensile.models.model_file import ModelFileReader

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant

_OVERLAP = 1e-4  # m; less is touching


@dataclass(frozen=True)
class Loaded:
    """What Drake made of a model.

    Attributes:
        summary: numbers of links, joints, actuators, constraints; mass in kg.
        overlaps: pairs of links (scoped names) whose shapes are in one another at rest.
        off_zero: joints whose limits exclude zero, where Drake puts them by default.
        warnings: what Drake said while loading.
    """

    summary: Mapping[str, Any]
    overlaps: list[tuple[str, str]]
    off_zero: list[str]
    warnings: list[str]


class _Listener(logging.Handler):
    """Collects what Drake logs while it loads a file."""

    def __init__(self, path: Path) -> None:
        super().__init__(logging.WARNING)
        self._path = path
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(self.plain(record.getMessage()))

    def plain(self, text: str) -> str:
        """Without the folder, which is gone when somebody reads it, and on one line."""
        text = " ".join(text.split()).replace(f"{self._path.parent}/", "")
        return re.sub(r"^(warning|error): ", "", text)[:500]


def load(path: Path) -> Loaded:
    """Loads a model that has been converted.

    Args:
        path: its SDF or URDF file; all it refers to is beside it.

    Returns:
        What Drake made of it.

    Raises:
        InputError: Drake refuses it.
    """
    from pydrake.multibody.parsing import Parser
    from pydrake.planning import RobotDiagramBuilder

    findings: list[Finding] = []
    ModelFileReader({}, findings).read(path, path.parent)
    if findings:
        raise InputError(*(Finding(f.message, f.mend, key="converted model") for f in findings))
    builder = RobotDiagramBuilder(time_step=0.002)
    plant: Any = builder.plant()
    said = _Listener(path)
    logger = logging.getLogger("drake")
    logger.addHandler(said)
    logger.propagate, propagate = False, logger.propagate
    try:
        (instance,) = Parser(plant).AddModels(path)[:1]
        plant.Finalize()
        diagram: Any = builder.Build()
        context = diagram.CreateDefaultContext()
        plant_context = plant.GetMyMutableContextFromRoot(context)
        off_zero = _rest(plant, plant_context)
        mass = plant.CalcTotalMass(plant_context)
        overlaps = _overlaps(plant, diagram, context)
    except (Exception, SystemExit) as error:  # a failed DRAKE_DEMAND is a SystemExit
        message = f"Drake refuses the converted model: {said.plain(str(error))}"
        raise InputError(Finding(message)) from None
    finally:
        logger.removeHandler(said)
        logger.propagate = propagate
    joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
    moving = [j for j in joints if j.num_velocities() and "floating" not in j.type_name()]
    free = any("floating" in j.type_name() for j in joints)
    summary = {
        "model": plant.GetModelInstanceName(instance),
        "links": plant.num_bodies() - 1,
        "moving joints": len(moving),
        "actuators": plant.num_actuators(),
        "couplings": plant.num_constraints(),
        "mass": f"{mass:.4g} kg",
        "base": "free (weld it where you use it)" if free else "fixed to the world",
    }
    return Loaded(summary, overlaps, off_zero, said.texts)


def _rest(plant: "MultibodyPlant", context: Any) -> list[str]:
    """Puts every joint at zero, or at its limit nearest to it; names the latter."""
    names = []
    q = plant.GetPositions(context)
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if joint.num_positions() != 1:
            continue
        lower, upper = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
        if not lower <= 0 <= upper and math.isfinite(lower + upper):
            q[joint.position_start()] = min(max(0.0, lower), upper)
            names.append(joint.name())
    plant.SetPositions(context, q)
    return names


def _overlaps(plant: "MultibodyPlant", diagram: Any, context: Any) -> list[tuple[str, str]]:
    query = plant.get_geometry_query_input_port().Eval(plant.GetMyContextFromRoot(context))
    inspector = query.inspector()

    def link(geometry: Any) -> str:
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        return body.scoped_name().get_full()

    pairs = {
        tuple(sorted((link(hit.id_A), link(hit.id_B))))
        for hit in query.ComputePointPairPenetration()
        if hit.depth > _OVERLAP
    }
    return sorted((a, b) for a, b in pairs if a != b)
