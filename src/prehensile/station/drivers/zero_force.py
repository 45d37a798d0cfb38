"""No driver at all: the joints of the model move freely."""

import numpy as np
from pydrake.manipulation import ZeroForceDriver
from pydrake.systems.primitives import ConstantVectorSource

from prehensile.station.drivers.site import Driver, Site


def _simulate(site: Site) -> None:
    for model, instance in zip(site.models, site.instances, strict=True):
        zero = site.builder.AddNamedSystem(
            f"{model}.zero_force",
            ConstantVectorSource(np.zeros(site.plant.num_actuators(instance))),
        )
        site.builder.Connect(zero.get_output_port(), site.plant.get_actuation_input_port(instance))


DRIVER = Driver(ZeroForceDriver, _simulate)
