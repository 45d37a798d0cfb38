"""An iiwa alone, its base fixed to the world."""

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from prehensile.models.registry import find_model


def make_iiwa() -> MultibodyPlant:
    """The plant of an iiwa7, finalized."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(find_model("iiwa7").path))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"))
    plant.Finalize()
    return plant
