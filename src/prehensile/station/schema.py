"""Checks YAML against the types of a schema: Drake's structs and our dataclasses.

Both kinds tell their fields (Drake's by ``__fields__``), so that the check needs no list of its
own of what a camera or a plant may hold; only the valid ranges, which the types do not tell, stand
here in a table. The check finds everything at once; building the structs is left to Drake.
"""

import dataclasses as dc
import math
import types
import typing
from typing import Any

import numpy as np
from pydrake.common import pretty_class_name

from prehensile.errors import Finding
from prehensile.yaml_lines import Node, close_to, number


@dc.dataclass(frozen=True)
class Range:
    """The valid range of a number.

    Attributes:
        low: least value.
        high: greatest value.
        open_low: ``low`` itself is not valid.
        infinite: infinity is valid as well.
        unit: unit, for messages.
    """

    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False
    infinite: bool = False
    unit: str = ""

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        above = "greater than" if self.open_low else "at least"
        if math.isinf(self.high):
            return f"{above} {self.low:g}{unit}"
        return f"{above} {self.low:g} and at most {self.high:g}{unit}"

    def holds(self, value: float) -> bool:
        """Says whether a value lies in the range."""
        if math.isinf(value):
            return self.infinite and value > 0
        return self.low <= value <= self.high and not (self.open_low and value == self.low)


_POSITIVE = Range(0, open_low=True)
_NOT_NEGATIVE = Range(0)
_ANY = Range()
_PIXELS = Range(1, 8192, unit="pixels")
_FOCAL = Range(0, 1e6, open_low=True, unit="pixels")
_DISTANCE = Range(0, 1e4, open_low=True, unit="m")
_DEGREES = Range(0, 180, open_low=True, unit="degrees")

# (struct, field): range. The limits are wide: they stop slips of the unit and values that would
# take gigabytes or for ever, not unusual wishes.
RANGES: dict[tuple[str, str], Range] = {
    ("Scenario", "random_seed"): Range(0, 2**32 - 1),
    ("Scenario", "simulation_duration"): Range(0, open_low=True, infinite=True, unit="s"),
    ("SimulatorConfig", "max_step_size"): Range(1e-7, 10, unit="s"),
    ("SimulatorConfig", "accuracy"): Range(0, 1, open_low=True),
    ("SimulatorConfig", "target_realtime_rate"): Range(0, 1e6),
    ("MultibodyPlantConfig", "time_step"): Range(1e-6, 0.1, unit="s"),
    ("MultibodyPlantConfig", "penetration_allowance"): Range(0, 1, open_low=True, unit="m"),
    ("MultibodyPlantConfig", "stiction_tolerance"): Range(0, 1, open_low=True, unit="m/s"),
    ("MultibodyPlantConfig", "sap_near_rigid_threshold"): _NOT_NEGATIVE,
    ("DefaultProximityProperties", "hydroelastic_modulus"): Range(0, 1e12, True, unit="Pa"),
    ("DefaultProximityProperties", "resolution_hint"): Range(1e-4, 10, unit="m"),
    ("DefaultProximityProperties", "slab_thickness"): _POSITIVE,
    ("DefaultProximityProperties", "margin"): Range(0, 1, unit="m"),
    ("DefaultProximityProperties", "dynamic_friction"): Range(0, 100),
    ("DefaultProximityProperties", "static_friction"): Range(0, 100),
    ("DefaultProximityProperties", "hunt_crossley_dissipation"): _NOT_NEGATIVE,
    ("DefaultProximityProperties", "relaxation_time"): _NOT_NEGATIVE,
    ("DefaultProximityProperties", "point_stiffness"): _POSITIVE,
    ("CameraConfig", "width"): _PIXELS,
    ("CameraConfig", "height"): _PIXELS,
    ("CameraConfig", "center_x"): Range(0, 8192, open_low=True, unit="pixels"),
    ("CameraConfig", "center_y"): Range(0, 8192, open_low=True, unit="pixels"),
    ("CameraConfig", "clipping_near"): _DISTANCE,
    ("CameraConfig", "clipping_far"): _DISTANCE,
    ("CameraConfig", "z_near"): _DISTANCE,
    ("CameraConfig", "z_far"): _DISTANCE,
    ("CameraConfig", "fps"): Range(0, 1000, open_low=True, unit="Hz"),
    ("CameraConfig", "capture_offset"): Range(0, 1e4, unit="s"),
    ("CameraConfig", "output_delay"): Range(0, 1e4, unit="s"),
    ("FocalLength", "x"): _FOCAL,
    ("FocalLength", "y"): _FOCAL,
    ("FovDegrees", "x"): Range(0, 179.9, open_low=True, unit="degrees"),
    ("FovDegrees", "y"): Range(0, 179.9, open_low=True, unit="degrees"),
    ("Rgba", "rgba"): Range(0, 1),
    ("VisualizationConfig", "publish_period"): Range(1e-4, 1e4, unit="s"),
    ("VisualizationConfig", "initial_proximity_alpha"): Range(0, 1),
    ("IiwaDriver", "ext_joint_filter_tau"): Range(0, 100, open_low=True, unit="s"),
    ("IiwaDriver", "desired_kp_gains"): _NOT_NEGATIVE,
    ("IiwaDriver", "lcm_status_period"): Range(0, 100, open_low=True, unit="s"),
    ("SchunkWsgDriver", "pid_gains"): _NOT_NEGATIVE,
    ("JointPidControllerGains", "kp"): _NOT_NEGATIVE,
    ("JointPidControllerGains", "ki"): _NOT_NEGATIVE,
    ("JointPidControllerGains", "kd"): _NOT_NEGATIVE,
    ("JointPdControllerGains", "kp"): _NOT_NEGATIVE,
    ("JointPdControllerGains", "kd"): _NOT_NEGATIVE,
    ("JointPidGains", "kp"): _NOT_NEGATIVE,
    ("JointPidGains", "ki"): _NOT_NEGATIVE,
    ("JointPidGains", "kd"): _NOT_NEGATIVE,
    ("JointPidDriver", "bandwidth"): Range(0, 1e4, unit="rad/s"),
    ("JointPidDriver", "integral_rate"): Range(0, 1e4, unit="rad/s"),
    ("JointStiffnessDriver", "bandwidth"): Range(0, 1e4, unit="rad/s"),
    ("SuctionDriver", "radius"): Range(0, 1, open_low=True, unit="m"),
    ("SuctionDriver", "vacuum"): Range(0, 1e5, open_low=True, unit="Pa"),
    ("SuctionDriver", "reach"): Range(0, 0.1, open_low=True, unit="m"),
    ("SuctionDriver", "response"): Range(0, 100, open_low=True, unit="s"),
    ("SuctionDriver", "period"): Range(1e-4, 1, unit="s"),
    ("DepthNoiseConfig", "seed"): Range(0, 2**32 - 1),
    ("DepthNoiseConfig", "baseline"): Range(0, 10, open_low=True, unit="m"),
    ("DepthNoiseConfig", "disparity_noise"): Range(0, 100, unit="pixels"),
    ("DepthNoiseConfig", "disparity_step"): Range(0, 100, unit="pixels"),
    ("DepthNoiseConfig", "edge_jitter"): Range(0, 100, unit="pixels"),
    ("DepthNoiseConfig", "flying_probability"): Range(0, 1),
    ("DepthNoiseConfig", "edge_missed"): Range(0, 1),
    ("DepthNoiseConfig", "edge_step"): Range(0, 1000, open_low=True, unit="pixels"),
    ("DepthNoiseConfig", "missed"): Range(0, 1),
    ("DepthNoiseConfig", "grazing_angle"): Range(0, math.pi / 2, unit="rad"),
    ("DepthNoiseConfig", "grazing_spread"): Range(0, 10, open_low=True, unit="rad"),
    ("DepthNoiseConfig", "dark_level"): Range(0, 1),
    ("DepthNoiseConfig", "dark_spread"): Range(0, 10, open_low=True),
    ("DepthNoiseConfig", "glare_level"): Range(0, 2),
    ("DepthNoiseConfig", "glare_spread"): Range(0, 10, open_low=True),
    ("DepthNoiseConfig", "min_depth"): _DISTANCE,
    ("DepthNoiseConfig", "max_depth"): _DISTANCE,
    ("RenderEngineVtkParams", "shadow_map_size"): Range(1, 8192, unit="pixels"),
    ("LightParameter", "intensity"): _NOT_NEGATIVE,
    ("LightParameter", "cone_angle"): Range(0, 90, unit="degrees"),
}

# (struct, field): number of elements of a vector.
SIZES: dict[tuple[str, str], tuple[int, ...]] = {
    ("Transform", "translation"): (3,),
    ("Rpy", "deg"): (3,),
    ("AngleAxis", "axis"): (3,),
    ("Rgba", "rgba"): (3, 4),
    ("SchunkWsgDriver", "pid_gains"): (3,),
    ("LightParameter", "attenuation_values"): (3,),
    ("LightParameter", "position"): (3,),
    ("LightParameter", "direction"): (3,),
    ("RenderEngineVtkParams", "default_clear_color"): (3,),
}

# (struct, field): the words that are valid.
CHOICES: dict[tuple[str, str], tuple[str, ...]] = {
    ("MultibodyPlantConfig", "contact_model"): (
        "point",
        "hydroelastic",
        "hydroelastic_with_fallback",
    ),
    ("MultibodyPlantConfig", "discrete_contact_approximation"): (
        "tamsi",
        "sap",
        "similar",
        "lagged",
    ),
    ("MultibodyPlantConfig", "contact_surface_representation"): ("triangle", "polygon"),
    ("DefaultProximityProperties", "compliance_type"): ("undefined", "rigid", "compliant"),
    ("SimulatorConfig", "integration_scheme"): (
        "bogacki_shampine3",
        "explicit_euler",
        "implicit_euler",
        "radau1",
        "radau3",
        "runge_kutta2",
        "runge_kutta3",
        "runge_kutta5",
        "semi_explicit_euler",
        "velocity_implicit_euler",
    ),
    ("IiwaDriver", "control_mode"): ("position_only", "position_and_torque", "torque_only"),
    ("LightParameter", "type"): ("point", "spot", "directional"),
    ("LightParameter", "frame"): ("world", "camera"),
}

_MAX_ITEMS = 10_000


def check(
    node: Node, schema: Any, findings: list[Finding], where: tuple[str, str] = ("", "")
) -> None:
    """Checks a YAML node, and everything below it, against a type.

    Args:
        node: the node.
        schema: a dataclass, a Drake struct with ``__fields__``, ``float``, ``int``, ``str``,
            ``bool``, ``numpy.ndarray``, or a list, dict, Optional or Union of such.
        findings: what is wrong is appended here: unknown keys, wrong types, NaN, values out of
            range.
        where: struct and field that the node is the value of, for its range.
    """
    _check(node, schema, where, findings)


def struct_fields(schema: Any) -> dict[str, Any] | None:
    """The fields of a struct and their types.

    Args:
        schema: a type.

    Returns:
        Field name to type; None if the type is not a struct.
    """
    if dc.is_dataclass(schema) and isinstance(schema, type):
        hints = typing.get_type_hints(schema)
        return {field.name: hints[field.name] for field in dc.fields(schema)}
    fields = getattr(schema, "__fields__", None)
    return None if fields is None else {field.name: field.type for field in fields}


def _check(node: Node, schema: Any, where: tuple[str, str], findings: list[Finding]) -> None:
    origin, args = typing.get_origin(schema), typing.get_args(schema)
    if origin in (typing.Union, types.UnionType):
        if node.value is None and type(None) in args:
            return
        _check_union(node, [a for a in args if a is not type(None)], where, findings)
        return
    if node.tag:
        findings.append(node.finding(f"the tag {node.tag} does not belong here", "remove it"))
        return
    if schema in (bool, int, float, str):
        _check_scalar(node, schema, where, findings)
    elif schema is np.ndarray:
        _check_vector(node, where, findings)
    elif origin is list:
        if not isinstance(node.value, list):
            findings.append(node.finding(f"{_said(node)} is not a list", "begin each item with -"))
            return
        if len(node.value) > _MAX_ITEMS:
            findings.append(node.finding(f"the list has more than {_MAX_ITEMS} items"))
            return
        for child in node.value:
            _check(child, args[0], where, findings)
    elif struct_fields(schema) is not None:
        _check_struct(node, schema, findings)
    elif args and issubclass(origin, typing.Mapping):
        if not isinstance(node.value, dict):
            findings.append(node.finding(f"{_said(node)} is not a map of names", "write NAME: ..."))
            return
        for child in node.value.values():
            _check(child, args[1], where, findings)


def _check_union(node: Node, options: list, where: tuple[str, str], findings: list) -> None:
    """A tag chooses the type; without one it is the first, as in Drake."""
    by_tag = {f"!{pretty_class_name(o).split('[')[0]}": o for o in options}
    by_tag = {tag: o for tag, o in by_tag.items() if struct_fields(o) is not None}
    if node.tag:
        if node.tag in by_tag:
            bare = dc.replace(node, tag="")
            _check(bare, by_tag[node.tag], where, findings)
        elif not node.tag.startswith("!_"):
            findings.append(node.finding(f"unknown type {node.tag}", close_to(node.tag, by_tag)))
        return
    if isinstance(node.value, str) and str in options:
        return
    if len(options) > 1 and isinstance(node.value, dict) and options[0] is str:
        findings.append(node.finding("the type is not named", close_to("", by_tag)))
        return
    _check(node, options[0], where, findings)


def _check_struct(node: Node, schema: Any, findings: list[Finding]) -> None:
    fields = struct_fields(schema) or {}
    name = pretty_class_name(schema).split(".")[-1].split("[")[0]
    if not isinstance(node.value, dict):
        findings.append(
            node.finding(f"{_said(node)} is not a map", f"its keys are {', '.join(fields)}")
        )
        return
    for key, child in node.value.items():
        if key in fields:
            _check(child, fields[key], (name, key), findings)
        else:
            findings.append(child.finding(f"unknown key '{key}'", close_to(key, fields)))


def _check_scalar(node: Node, schema: type, where: tuple[str, str], findings: list) -> None:
    value = node.value
    if schema is str:
        if not isinstance(value, str):
            findings.append(node.finding(f"{_said(node)} is not text", "put it in quotes"))
        elif where in CHOICES and value not in CHOICES[where]:
            findings.append(
                node.finding(f"'{value}' is not a choice here", close_to(value, CHOICES[where]))
            )
        return
    if schema is bool:
        if value not in (True, False, "true", "false") or isinstance(value, int | float) != (
            isinstance(value, bool)
        ):
            findings.append(node.finding(f"{_said(node)} is not true or false"))
        return
    found = number(value)
    if found is None:
        findings.append(node.finding(f"{_said(node)} is not a number"))
    elif schema is int and not (math.isfinite(found) and found == int(found)):
        findings.append(node.finding(f"{_said(node)} is not a whole number"))
    else:
        _check_range(node, found, where, findings)


def _check_vector(node: Node, where: tuple[str, str], findings: list[Finding]) -> None:
    if not isinstance(node.value, list):
        findings.append(node.finding(f"{_said(node)} is not a list of numbers", "write [1, 2]"))
        return
    if len(node.value) > _MAX_ITEMS:
        findings.append(node.finding(f"the list has more than {_MAX_ITEMS} items"))
        return
    sizes = SIZES.get(where)
    if sizes and len(node.value) not in sizes:
        wanted = " or ".join(str(size) for size in sizes)
        findings.append(node.finding(f"{len(node.value)} numbers stand where {wanted} belong"))
    for child in node.value:
        found = number(child.value)
        if found is None:
            findings.append(child.finding(f"{_said(child)} is not a number"))
        else:
            _check_range(child, found, where, findings)


def _check_range(node: Node, value: float, where: tuple[str, str], findings: list) -> None:
    valid = RANGES.get(where, _ANY)
    if math.isnan(value):
        findings.append(node.finding("the value is NaN (not a number)", "write a number"))
    elif not valid.holds(value):
        if math.isinf(value):
            findings.append(node.finding("the value is infinite", "write a finite number"))
        else:
            findings.append(node.finding(f"{value:g} is out of range", f"it must be {valid}"))


def _said(node: Node) -> str:
    """How a message names a value of the wrong type."""
    if isinstance(node.value, dict):
        return "a map"
    if isinstance(node.value, list):
        return "a list"
    if node.value is None:
        return "nothing"
    text = str(node.value)
    return f"'{text[:40]}...'" if len(text) > 40 else f"'{text}'"
