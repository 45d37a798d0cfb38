"""A scenario to a Drake diagram: the station, simulated or over the wires of a real one.

Ports of an arm driven by ``IiwaDriver``, named ``iiwa`` in the scenario::

    iiwa.position (7), iiwa.feedforward_torque (7),           ┌─────────┐  iiwa.position_commanded,
    iiwa.command_time (1): inputs, all may be unconnected ──► │         │  iiwa.position_measured,
    wsg.position (1: width), wsg.force_limit (1) ───────────► │ station │  iiwa.velocity_estimated,
                                                              │         │  iiwa.torque_commanded,
    cheat.applied_spatial_force,                              │         │  iiwa.torque_measured,
    cheat.applied_generalized_force ────────────────────────► │         │  iiwa.torque_external,
                                                              │         │  iiwa.state_estimated,
                                                              │         │  iiwa.guard_status;
                                                              │         │  wsg.state_measured (2),
                                                              │         │  wsg.force_measured (1),
                                                              │         │  wsg.guard_status;
                                                              │         │  camera0.rgb_image,
                                                              │         │  camera0.depth_image,
                                                              │         │  camera0.label_image,
                                                              │         │  camera0.point_cloud,
                                                              │         │  camera0.X_WC; cheat.*
                                                              └─────────┘

Every command passes the guard (:mod:`prehensile.station.guard`).
"""

from pydrake.geometry import Meshcat, SceneGraph
from pydrake.multibody.meshcat import ContactVisualizer, ContactVisualizerParams
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.framework import Diagram, DiagramBuilder

from prehensile.station.cameras import add_cameras
from prehensile.station.drivers import Site, driver_of
from prehensile.station.hardware import build_interface
from prehensile.station.robot_plant import add_models, finalize
from prehensile.station.scenario import Scenario
from prehensile.station.visualization import add_visualization


def build(scenario: Scenario, *, meshcat: Meshcat | None = None, hardware: bool = False) -> Diagram:
    """Builds a station.

    Args:
        scenario: what is in it.
        meshcat: the browser view to show it in; without one nothing is visualized.
        hardware: build the interface to a real station instead, with the same command and
            measurement ports over LCM and none under ``cheat.``; see
            :mod:`prehensile.station.hardware`.

    Returns:
        A diagram with the ports listed above. A simulated one (a ``RobotDiagram``) has the
        subsystems ``plant`` and ``scene_graph``.

    Raises:
        InputError: the scenario names models, frames or drivers that do not fit together.
    """
    if hardware:
        return build_interface(scenario, meshcat=meshcat)
    robot_builder = RobotDiagramBuilder(time_step=scenario.plant_config.time_step)
    builder, plant = robot_builder.builder(), robot_builder.plant()
    scene_graph = robot_builder.scene_graph()
    scene_graph.set_config(scenario.scene_graph_config)
    add_models(scenario, plant)
    drivers = [
        (
            driver_of(config, f"model_drivers.{name}"),
            Site(name=name, config=config, scenario=scenario, builder=builder, plant=plant),
        )
        for name, config in scenario.model_drivers.items()
    ]
    finalize(scenario, plant)
    for driver, site in drivers:
        driver.simulate(site)
    add_cameras(scenario, builder, plant, scene_graph)
    _export_cheat_ports(builder, plant, scene_graph)
    if meshcat is not None:
        add_visualization(scenario.visualization, builder, scene_graph, meshcat)
        if scenario.visualization.publish_contacts:
            ContactVisualizer.AddToBuilder(
                builder,
                plant,
                meshcat,
                ContactVisualizerParams(publish_period=scenario.visualization.publish_period),
            )
    diagram = robot_builder.Build()
    diagram.set_name("station")
    return diagram


def _export_cheat_ports(
    builder: DiagramBuilder, plant: MultibodyPlant, scene_graph: SceneGraph
) -> None:
    """Exports what only a simulation knows or allows, under ``cheat.``."""
    for name, port in (
        ("applied_spatial_force", plant.get_applied_spatial_force_input_port()),
        ("applied_generalized_force", plant.get_applied_generalized_force_input_port()),
    ):
        if not builder.IsConnectedOrExported(port):  # a driver may hand on what comes in
            builder.ExportInput(port, f"cheat.{name}")
    for name, port in (
        ("plant_state", plant.get_state_output_port()),
        ("body_poses", plant.get_body_poses_output_port()),
        ("body_spatial_velocities", plant.get_body_spatial_velocities_output_port()),
        ("contact_results", plant.get_contact_results_output_port()),
        ("reaction_forces", plant.get_reaction_forces_output_port()),
        ("query_object", scene_graph.get_query_output_port()),
    ):
        builder.ExportOutput(port, f"cheat.{name}")
    for i in range(plant.num_model_instances()):
        instance = ModelInstanceIndex(i)
        if plant.num_multibody_states(instance) > 0:
            name = plant.GetModelInstanceName(instance)
            builder.ExportOutput(plant.get_state_output_port(instance), f"cheat.{name}.state")
