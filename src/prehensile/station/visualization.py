"""The station's geometry in the browser."""

from pydrake.geometry import Meshcat, MeshcatVisualizer, MeshcatVisualizerParams, Role, SceneGraph
from pydrake.systems.framework import DiagramBuilder
from pydrake.visualization import VisualizationConfig


def add_visualization(
    config: VisualizationConfig,
    builder: DiagramBuilder,
    scene_graph: SceneGraph,
    meshcat: Meshcat,
) -> None:
    """Shows the scene graph's geometry in Meshcat, collision geometry hidden to begin with.

    Args:
        config: which geometry, and how often. Inertias are never drawn.
        builder: the diagram.
        scene_graph: the scene graph.
        meshcat: the browser view.
    """
    roles = []
    if config.publish_illustration:
        roles.append((Role.kIllustration, "illustration", config.default_illustration_color))
    if config.publish_proximity:
        roles.append((Role.kProximity, "proximity", config.default_proximity_color))
    for role, prefix, color in roles:
        params = MeshcatVisualizerParams(
            role=role,
            prefix=prefix,
            publish_period=config.publish_period,
            default_color=color,
            delete_on_initialization_event=config.delete_on_initialization_event,
            visible_by_default=role == Role.kIllustration,
            show_hydroelastic=role == Role.kProximity,
        )
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, params)
