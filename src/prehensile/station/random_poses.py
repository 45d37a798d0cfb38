"""Draws the random poses that a scenario asks for.

Drake's poses can be distributions (``rotation: !Uniform {}``, ``translation: !UniformVector
{min: ..., max: ...}``), but its directives take fixed ones only.
"""

from pydrake.common import RandomGenerator
from pydrake.common.schema import Transform
from pydrake.multibody.parsing import ModelDirective


def draw_poses(directives: list[ModelDirective], seed: int) -> None:
    """Replaces every random pose in a list of directives by one drawn from it.

    Poses in other files that the directives add are left as they are.

    Args:
        directives: the directives, changed in place.
        seed: of the draws; the same seed gives the same poses.
    """
    generator = RandomGenerator(seed)

    def drawn(pose: Transform) -> Transform:
        if pose.IsDeterministic():
            return pose
        fixed = Transform(pose.Sample(generator))
        fixed.base_frame = pose.base_frame
        return fixed

    for directive in directives:
        if directive.add_weld and directive.add_weld.X_PC is not None:
            directive.add_weld.X_PC = drawn(directive.add_weld.X_PC)
        elif directive.add_frame:
            directive.add_frame.X_PF = drawn(directive.add_frame.X_PF)
        elif directive.add_model:
            poses = directive.add_model.default_free_body_pose
            directive.add_model.default_free_body_pose = {
                body: drawn(pose) for body, pose in poses.items()
            }
