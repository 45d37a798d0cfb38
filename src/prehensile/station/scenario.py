"""The schema of a scenario: Drake's own configuration structs, and our further keys.

A scenario written for Drake's hardware simulation or for the ``manipulation`` package is one of
ours too. :mod:`prehensile.station.scenario_file` reads and validates files;
:mod:`prehensile.station.build` makes a Drake diagram of a scenario.
"""

import dataclasses as dc
import math
from pathlib import Path
from typing import Any

from pydrake.geometry import SceneGraphConfig
from pydrake.lcm import DrakeLcmParams
from pydrake.multibody.parsing import ModelDirective
from pydrake.multibody.plant import MultibodyPlantConfig
from pydrake.systems.analysis import SimulatorConfig
from pydrake.systems.sensors import CameraConfig
from pydrake.visualization import VisualizationConfig

from prehensile.perception.depth_noise import DepthNoiseConfig


def _simulator_config() -> SimulatorConfig:
    return SimulatorConfig(
        max_step_size=0.01, use_error_control=False, accuracy=1e-2, target_realtime_rate=1.0
    )


@dc.dataclass(frozen=True)
class Scenario:
    """Everything that a station is built from, validated.

    Attributes:
        random_seed: seed of every random choice of the scenario (>= 0).
        simulation_duration: seconds of simulated time that ``prehensile run`` lasts (> 0).
        simulator_config: Drake's simulator settings.
        plant_config: Drake's plant settings: time step, contact model and solver.
        scene_graph_config: Drake's geometry settings: default proximity properties.
        directives: Drake's model directives, in order.
        lcm_buses: LCM buses by name.
        model_drivers: driver configuration by model instance name; the type is what the
            driver registry (:mod:`prehensile.station.drivers`) holds for its YAML tag.
        cameras: Drake's camera settings by key.
        camera_ids: serial numbers of the real cameras by the same keys (hardware only).
        depth_noise: our key: what the depth images of simulated cameras get wrong, by the cameras'
            keys; a camera that is not named is ideal (simulation only).
        visualization: Drake's visualization settings.
        packages: our key: further model folders, package name to absolute path.
        file: where it was read from (None if it was made in Python).
    """

    random_seed: int = 0
    simulation_duration: float = math.inf
    simulator_config: SimulatorConfig = dc.field(default_factory=_simulator_config)
    plant_config: MultibodyPlantConfig = dc.field(default_factory=MultibodyPlantConfig)
    scene_graph_config: SceneGraphConfig = dc.field(default_factory=SceneGraphConfig)
    directives: list[ModelDirective] = dc.field(default_factory=list)
    lcm_buses: dict[str, DrakeLcmParams] = dc.field(
        default_factory=lambda: {"default": DrakeLcmParams()}
    )
    model_drivers: dict[str, Any] = dc.field(default_factory=dict)
    cameras: dict[str, CameraConfig] = dc.field(default_factory=dict)
    camera_ids: dict[str, str] = dc.field(default_factory=dict)
    depth_noise: dict[str, DepthNoiseConfig] = dc.field(default_factory=dict)
    visualization: VisualizationConfig = dc.field(default_factory=VisualizationConfig)
    packages: dict[str, str] = dc.field(default_factory=dict)
    file: Path | None = None
