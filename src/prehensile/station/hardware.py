"""The interface to a real station: the ports of the simulated one, over LCM.

A diagram with the same guard in front of the same commands. The measured joint positions move a
copy of the scenario's fixed models (loose objects are left out: where they are is for perception
to find out) in a scene graph, for poses of cameras on moving links and for the browser view.
Images are taken from Drake's camera channel, ``DRAKE_RGBD_CAMERA_IMAGES_NAME``, of the camera's
``lcm_bus``.
"""

import numpy as np
from drake import lcmt_image_array
from pydrake.geometry import Meshcat, SceneGraph
from pydrake.lcm import DrakeLcm, DrakeLcmInterface
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.lcm import LcmBuses, LcmInterfaceSystem, LcmSubscriberSystem
from pydrake.systems.primitives import AffineSystem, ConstantVectorSource, Multiplexer
from pydrake.systems.rendering import MultibodyPositionToGeometryPose
from pydrake.systems.sensors import LcmImageArrayToImages

from prehensile.errors import Finding, InputError
from prehensile.station.cameras import add_camera_ports, add_sensor
from prehensile.station.drivers import Site, driver_of
from prehensile.station.robot_plant import add_part, fixed_models
from prehensile.station.scenario import Scenario
from prehensile.station.visualization import add_visualization


def build_interface(
    scenario: Scenario, *, meshcat: Meshcat | None = None, lcm_buses: LcmBuses | None = None
) -> Diagram:
    """Builds the interface to a real station.

    Starting its simulator waits for the first status message of every driver (at most 10 s).
    Run it at a real-time rate of 1.

    Args:
        scenario: what the station is like.
        meshcat: the browser view to show it in.
        lcm_buses: the buses to talk over; those that the scenario describes by default.

    Returns:
        A diagram with the ports listed in :mod:`prehensile.station.build`, without those under
        ``cheat.``, and the subsystem ``scene_graph``.

    Raises:
        InputError: the scenario names models, frames, drivers or buses that do not fit together,
            or a driver that exists in simulation only.
    """
    builder = DiagramBuilder()
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph(scenario.scene_graph_config))
    plant = MultibodyPlant(scenario.plant_config.time_step)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    add_part(scenario, plant, fixed_models(scenario))
    plant.Finalize()
    if lcm_buses is None:
        # By hand: a subscriber on a bus that ApplyLcmBusConfig made crashes with Drake 1.58.
        buses = LcmBuses()
        for name, params in scenario.lcm_buses.items():
            lcm = DrakeLcm(params)
            builder.AddNamedSystem(f"lcm.{name}", LcmInterfaceSystem(lcm))
            buses.Add(name, lcm)
        lcm_buses = buses

    measured: list[OutputPort] = []
    gains: list[np.ndarray] = []
    for name, config in scenario.model_drivers.items():
        driver = driver_of(config, f"model_drivers.{name}")
        if driver.connect is None:
            mend = "run this scenario simulated, or give the model a driver that has hardware"
            message = f"{driver.tag} exists in simulation only"
            raise InputError(_finding(scenario, f"model_drivers.{name}", message, mend))
        bus = _find_bus(scenario, lcm_buses, f"model_drivers.{name}.lcm_bus", config.lcm_bus)
        site = Site(name, config, scenario, builder, plant, bus)
        port, gain = driver.connect(site)
        measured.append(port)
        rows = np.zeros((plant.num_positions(), gain.shape[1]))
        for i in range(gain.shape[1]):
            q = np.zeros(plant.num_positions())
            plant.SetPositionsInArray(site.instance, gain[:, i], q)
            rows[:, i] = q
        gains.append(rows)
    poses = builder.AddNamedSystem("poses", MultibodyPositionToGeometryPose(plant))
    builder.Connect(_positions(builder, plant, measured, gains), poses.get_input_port())
    builder.Connect(
        poses.get_output_port(), scene_graph.get_source_pose_port(plant.get_source_id())
    )

    for key, config in scenario.cameras.items():
        bus = _find_bus(scenario, lcm_buses, f"cameras.{key}.lcm_bus", config.lcm_bus)
        subscriber = builder.AddNamedSystem(
            f"{config.name}.subscriber",
            LcmSubscriberSystem.Make(
                channel=f"DRAKE_RGBD_CAMERA_IMAGES_{config.name}",
                lcm_type=lcmt_image_array,
                lcm=bus,
                use_cpp_serializer=True,
            ),
        )
        images = builder.AddNamedSystem(f"{config.name}.images", LcmImageArrayToImages())
        builder.Connect(subscriber.get_output_port(), images.image_array_t_input_port())
        # A sensor that renders nothing: it knows where the camera is.
        sensor = add_sensor(scenario, key, builder, plant, scene_graph)
        add_camera_ports(
            builder,
            config,
            rgb=images.color_image_output_port(),
            depth=images.depth_image_output_port(),
            label=images.label_image_output_port(),
            pose=sensor.body_pose_in_world_output_port(),
        )
    if meshcat is not None:
        add_visualization(scenario.visualization, builder, scene_graph, meshcat)
    diagram = builder.Build()
    diagram.set_name("station")
    return diagram


def _positions(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    measured: list[OutputPort],
    gains: list[np.ndarray],
) -> OutputPort:
    """Adds what computes the plant's positions: measured ones where there are, else defaults."""
    default = plant.GetPositions(plant.CreateDefaultContext())
    if not measured:
        return builder.AddSystem(ConstantVectorSource(default)).get_output_port()
    mux = builder.AddNamedSystem("measured", Multiplexer([port.size() for port in measured]))
    for i, port in enumerate(measured):
        builder.Connect(port, mux.get_input_port(i))
    gain = np.hstack(gains)
    default[np.any(gain != 0, axis=1)] = 0.0
    positions = builder.AddNamedSystem("positions", AffineSystem(D=gain, y0=default))
    builder.Connect(mux.get_output_port(0), positions.get_input_port())
    return positions.get_output_port()


def _find_bus(scenario: Scenario, buses: LcmBuses, key: str, name: str) -> DrakeLcmInterface:
    if name not in buses.GetAllBusNames():
        known = ", ".join(buses.GetAllBusNames())
        raise InputError(_finding(scenario, key, f"no LCM bus '{name}'", f"lcm_buses has {known}"))
    return buses.Find(key, name)


def _finding(scenario: Scenario, key: str, message: str, mend: str) -> Finding:
    return Finding(message, mend, file=str(scenario.file or ""), key=key)
