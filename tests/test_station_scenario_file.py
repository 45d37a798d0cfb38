"""Scenario files: what loads, how files and overrides combine, and every fault that is found."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.common.yaml import yaml_load_typed
from pydrake.manipulation import IiwaDriver, SchunkWsgDriver, ZeroForceDriver
from pydrake.multibody.parsing import ModelDirectives
from pydrake.systems.sensors import CameraConfig

from prehensile.errors import Finding, InputError
from prehensile.models.registry import DATA
from prehensile.station.scenario import Scenario
from prehensile.station.scenario_file import list_scenarios, load_scenario, loads_scenario

SHARED = Path(__file__).parents[1].parent / "shared" / "drake_models"

ARM = """\
directives:
- add_model:
    name: iiwa
    file: package://prehensile/iiwa7/iiwa7.sdf
    default_joint_positions:
      iiwa_joint_2: [0.1]
- add_weld:
    parent: world
    child: iiwa::iiwa_link_0
- add_model: {name: wsg, file: package://prehensile/wsg50/wsg50.sdf}
- add_weld:
    parent: iiwa::iiwa_link_7
    child: wsg::body
    X_PC:
      translation: [0, 0, 0.09]
      rotation: !Rpy { deg: [90, 0, 90] }
cameras:
  camera0:
    name: camera0
    width: 320
    focal: !FovDegrees { y: 45 }
    X_PB:
      base_frame: wsg::body
model_drivers:
  iiwa: !IiwaDriver
    hand_model_name: wsg
  wsg: !SchunkWsgDriver {}
"""


def findings_of(text: str) -> list[Finding]:
    with pytest.raises(InputError) as error:
        loads_scenario(text)
    return list(error.value.findings)


# What loads


@pytest.mark.parametrize("name", list_scenarios())
def test_the_shipped_scenarios_load_and_are_made_of_our_models(name):
    scenario = load_scenario(name)
    assert scenario.file is not None
    files = [d.add_model.file for d in scenario.directives if d.add_model]
    assert files
    assert all(file.startswith("package://prehensile/") for file in files)
    assert scenario.plant_config.time_step <= 0.005


def test_the_scenarios_of_the_documentation_ship():
    assert {"bimanual", "iiwa_wsg", "pick_brick", "planar", "two_bins"} <= set(list_scenarios())


def test_sections_become_drakes_structs_as_drake_reads_them():
    scenario = loads_scenario(ARM)
    drakes = yaml_load_typed(schema=ModelDirectives, data=ARM[: ARM.index("cameras:")]).directives
    assert len(scenario.directives) == len(drakes) == 4
    for ours, theirs in zip(scenario.directives, drakes, strict=True):
        assert repr(ours) == repr(theirs)
    weld = scenario.directives[3].add_weld
    assert weld is not None
    assert weld.X_PC is not None
    X_PC = weld.X_PC.GetDeterministicValue()
    # The hand's y, to the finger tips, is the flange's z.
    np.testing.assert_allclose(X_PC.rotation().matrix()[:, 1], [0, 0, 1], atol=1e-12)
    assert isinstance(scenario.model_drivers["iiwa"], IiwaDriver)
    assert isinstance(scenario.model_drivers["wsg"], SchunkWsgDriver)
    camera = scenario.cameras["camera0"]
    assert isinstance(camera.focal, CameraConfig.FovDegrees)
    assert (camera.width, camera.height) == (320, 480)


def test_an_empty_text_is_the_default_scenario():
    scenario = loads_scenario("")
    default = Scenario()
    assert scenario.directives == []
    assert scenario.simulation_duration == float("inf")
    assert scenario.simulator_config.max_step_size == default.simulator_config.max_step_size


def test_numbers_that_yaml_takes_for_text_are_numbers():
    scenario = loads_scenario("simulation_duration: 1e1\nplant_config: {time_step: 1e-3}")
    assert scenario.simulation_duration == 10.0
    assert scenario.plant_config.time_step == 0.001


def test_infinity_is_a_duration_and_nothing_else():
    assert loads_scenario("simulation_duration: .inf").simulation_duration == float("inf")
    (finding,) = findings_of("simulator_config: {max_step_size: .inf}")
    assert "infinite" in finding.message


def test_anchors_and_merge_keys_work():
    scenario = loads_scenario(
        "_common: &c {width: 100, height: 50}\n"
        "cameras:\n  a: {<<: *c, name: a}\n  b: {<<: *c, name: b, height: 60}\n"
    )
    assert (scenario.cameras["a"].width, scenario.cameras["a"].height) == (100, 50)
    assert (scenario.cameras["b"].width, scenario.cameras["b"].height) == (100, 60)


def test_random_poses_are_drawn_by_the_seed():
    text = """\
random_seed: {0}
directives:
- add_model:
    name: brick
    file: package://prehensile/foam_brick/foam_brick.sdf
    default_free_body_pose:
      base_link:
        base_frame: world
        translation: !UniformVector {{ min: [1, 2, 3], max: [2, 3, 4] }}
        rotation: !Uniform {{}}
"""

    def pose(seed: int):
        (directive,) = loads_scenario(text.format(seed)).directives
        assert directive.add_model is not None
        return directive.add_model.default_free_body_pose["base_link"]

    p = np.asarray(pose(3).GetDeterministicValue().translation())
    assert pose(3).base_frame == "world"
    assert (p >= [1, 2, 3]).all()
    assert (p <= [2, 3, 4]).all()
    assert pose(3).GetDeterministicValue().IsExactlyEqualTo(pose(3).GetDeterministicValue())
    assert not np.array_equal(p, pose(4).GetDeterministicValue().translation())


# How files and overrides combine


def test_one_scenario_of_several_is_picked_by_name(tmp_path):
    file = tmp_path / "several.yaml"
    file.write_text("One: {random_seed: 1}\nTwo: {random_seed: 2}\n")
    assert load_scenario(file, scenario_name="Two").random_seed == 2
    with pytest.raises(InputError, match="One, Two"):
        load_scenario(file)
    with pytest.raises(InputError, match="no scenario 'Tow'"):
        load_scenario(file, scenario_name="Tow")


def test_data_is_laid_on_top_maps_merged_lists_and_scalars_replaced(tmp_path):
    file = tmp_path / "arm.yaml"
    file.write_text(ARM)
    scenario = load_scenario(
        file,
        data="random_seed: 7\ncameras: {camera0: {width: 99}}\nplant_config: {time_step: 0.002}",
    )
    assert scenario.random_seed == 7
    assert scenario.cameras["camera0"].width == 99
    assert scenario.cameras["camera0"].name == "camera0"
    assert len(scenario.directives) == 4
    with pytest.raises(InputError, match="no directive adds a model 'iiwa'"):
        load_scenario(file, data="directives: []")


def test_an_override_with_another_tag_replaces(tmp_path):
    file = tmp_path / "arm.yaml"
    file.write_text(ARM)
    scenario = load_scenario(
        file,
        data="model_drivers: {iiwa: !ZeroForceDriver {}}\n"
        "cameras: {camera0: {focal: !FocalLength {x: 500}}}",
    )
    assert isinstance(scenario.model_drivers["iiwa"], ZeroForceDriver)
    assert isinstance(scenario.model_drivers["wsg"], SchunkWsgDriver)
    assert isinstance(scenario.cameras["camera0"].focal, CameraConfig.FocalLength)


def test_packages_are_relative_to_the_file(tmp_path):
    models = tmp_path / "models"
    models.mkdir()
    (models / "a.sdf").write_text(
        '<sdf version="1.9"><model name="a"><link name="l"/></model></sdf>'
    )
    file = tmp_path / "s.yaml"
    file.write_text(
        "packages: {mine: models}\n"
        "directives:\n- add_model: {name: a, file: package://mine/a.sdf}\n"
        "- add_weld: {parent: world, child: a::l}\n"
    )
    assert load_scenario(file).packages == {"mine": str(models)}


def test_unknown_scenario_names_what_comes_close():
    with pytest.raises(InputError, match="unknown scenario 'two_bin'") as error:
        load_scenario("two_bin")
    assert "'two_bins'" in error.value.findings[0].mend


# Faults


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "said"),
    [
        (
            "    name: iiwa\n",
            "    nam: iiwa\n",
            3,
            "directives[0].add_model.nam",
            "did you mean 'name'",
        ),
        ("iiwa7/iiwa7.sdf", "iiwa8/iiwa8.sdf", 4, "directives[0].add_model.file", "no file"),
        ("prehensile/wsg50", "prehensil/wsg50", 10, "directives[2].add_model.file", "unknown pack"),
        (
            "prehensile/wsg50",
            "prehensile/../../wsg50",
            10,
            "directives[2].add_model.file",
            "leaves",
        ),
        ("package://prehensile/wsg50/", "", 10, "directives[2].add_model.file", "not a model URL"),
        ("iiwa_joint_2: [0.1]", "iiwa_joint_8: [0.1]", 6, None, "no joint 'iiwa_joint_8'"),
        ("iiwa_joint_2: [0.1]", "iiwa_joint_2: [0.1, 1]", 6, None, "2 positions stand where"),
        ("iiwa_joint_2: [0.1]", "iiwa_joint_2: [.nan]", 6, None, "NaN"),
        ("iiwa_joint_2: [0.1]", "iiwa_joint_2: [.inf]", 6, None, "infinite"),
        ("child: iiwa::iiwa_link_0", "child: iiwa::link_0", 9, None, "no frame 'link_0'"),
        ("parent: world", "parent: wrld", 8, "directives[1].add_weld.parent", "no frame 'wrld'"),
        ("parent: iiwa::", "parent: iiwi::", 12, None, "adds a model 'iiwi'"),
        ("deg: [90, 0, 90]", "deg: [90, 0]", 16, None, "2 numbers stand where 3 belong"),
        ("!Rpy", "!Rpz", 16, None, "unknown type !Rpz"),
        ("width: 320", "width: 3200000", 20, "cameras.camera0.width", "out of range"),
        ("width: 320", "width: 320.5", 20, "cameras.camera0.width", "whole number"),
        ("width: 320", "width: wide", 20, "cameras.camera0.width", "not a number"),
        ("{ y: 45 }", "{ y: 190 }", 21, "cameras.camera0.focal.y", "out of range"),
        ("base_frame: wsg::body", "base_frame: wsg::bod", 23, None, "did you mean 'body'"),
        ("  iiwa: !IiwaDriver", "  iiwo: !IiwaDriver", 25, "model_drivers.iiwo", "adds a model"),
        ("!IiwaDriver", "!IiwDriver", 25, "model_drivers.iiwa", "did you mean '!IiwaDriver'"),
        ("!SchunkWsgDriver {}", "!SchunkWsgDriver", 27, "model_drivers.wsg", "!SchunkWsgDriver {}"),
        ("!SchunkWsgDriver {}", "{}", 27, "model_drivers.wsg", "type of the driver"),
        ("hand_model_name: wsg", "desired_kp_gains: [1, 2]", 26, None, "2 gains stand where 7"),
        ("hand_model_name: wsg", "hand_model_name: wsh", 26, None, "adds a model 'wsh'"),
        ("model_drivers:", "cameras:", 24, "cameras", "second time"),
        ("name: wsg, file", "name: iiwa, file", 10, None, "model 'iiwa' already"),
        ("      rotation:", "\trotation:", 16, "", "not valid YAML"),
    ],
)
def test_each_fault_is_reported_with_line_key_and_words(old, new, line, key, said):
    assert old in ARM
    findings = findings_of(ARM.replace(old, new, 1))
    assert said in " ".join(str(f) for f in findings)
    finding = next(f for f in findings if said in str(f))
    assert finding.line == line
    assert finding.file == "text"
    if key is not None:
        assert finding.key == key


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[1, 2]", "not a map"),
        ("random_seed: -1", "out of range"),
        ("random_seed: 1\nrandom_seed: 2", "second time"),
        ("random_sed: 1", "did you mean 'random_seed'"),
        ("simulation_duration: .nan", "NaN"),
        ("simulation_duration: 0", "out of range"),
        ("simulator_config: {target_realtime_rate: -1}", "out of range"),
        ("plant_config: {time_step: 0}", "out of range"),
        ("plant_config: {time_step: 5}", "out of range"),
        ("plant_config: {contact_model: pont}", "did you mean 'point'"),
        ("plant_config: {discrete_contact_approximation: spa}", "did you mean 'sap'"),
        ("scene_graph_config: {default_proximity_properties: {resolution_hint: 1e-9}}", "range"),
        ("scene_graph_config: {default_proximity_properties: {hydroelastic_modulus: 0}}", "range"),
        ("cameras: {a: {z_near: 3, z_far: 2}}", "not less than z_far"),
        ("cameras: {a: {width: 64, center_x: 70}}", "outside of the image"),
        ("cameras: {a: {fps: 0}}", "out of range"),
        ("cameras: {a: {name: x}, b: {name: x}}", "two cameras are called 'x'"),
        ("cameras: {a: {lcm_bus: nobus}}", "unknown LCM bus 'nobus'"),
        ("camera_ids: {a: '123'}", "there is no camera 'a'"),
        ("packages: {mine: /nowhere/at/all}", "does not exist"),
        ("directives:", "not a list"),
        ("directives: [{add_model: }]", "add_model is empty"),
        ("directives: [{}]", "a directive has one key"),
        ("directives: [{add_weld: {parent: world}}]", "needs 'child'"),
        ("directives: [{add_weld: {parent: a, child: a}}]", "welded to itself"),
        ("directives: [{add_frame: {name: f, X_PF: {}}}]", "base_frame"),
        ("directives: [{add_model: {name: a, file: 'file://x.sdf'}}]", "not absolute"),
        ("directives: [{add_directives: {file: 'package://prehensile/no.dmd.yaml'}}]", "no file"),
        ("a: &a [*a]", "contains itself"),
        ("{1: 2}", "not text"),
    ],
)
def test_further_faults(text, said):
    assert said in " ".join(str(f) for f in findings_of(text))


def test_all_findings_come_at_once_in_the_order_of_lines():
    text = ARM.replace("0.1", ".nan").replace("wsg::body", "wsg::bdy").replace("320", "0")
    findings = findings_of(text + "bogus: 1\n")
    assert [f.line for f in findings] == [6, 13, 20, 23, 28]
    assert all(f.mend or f.message for f in findings)


def test_an_absurd_default_resolution_names_the_shape():
    text = ARM + "scene_graph_config: {default_proximity_properties: {resolution_hint: 0.0002}}\n"
    (finding,) = findings_of(text)
    assert "absurd" in finding.message
    assert finding.key.endswith("resolution_hint")


def test_faults_in_model_files_name_that_file(tmp_path):
    model = (DATA / "foam_brick" / "foam_brick.sdf").read_text()
    start = model.index("<mass>") + len("<mass>")
    broken = model[:start] + "-" + model[start:]
    (tmp_path / "brick.sdf").write_text(broken)
    text = f"""\
packages: {{mine: {tmp_path}}}
directives:
- add_model: {{name: brick, file: package://mine/brick.sdf}}
"""
    findings = findings_of(text)
    mass = next(f for f in findings if "mass" in f.message)
    assert mass.file == str(tmp_path / "brick.sdf")
    assert mass.line == broken[:start].count("\n") + 1


# Directive files


@pytest.fixture
def package(tmp_path) -> Path:
    """A package with a directive file ``arm.dmd.yaml``; returns its folder."""
    end = ARM.index("cameras:")
    (tmp_path / "arm.dmd.yaml").write_text(ARM[:end])
    return tmp_path


def add(name: str, more: str = "") -> str:
    return f"directives:\n- add_directives: {{file: package://mine/{name}.dmd.yaml{more}}}\n"


def load(text: str, package: Path) -> Scenario:
    return loads_scenario(text, packages={"mine": package})


def test_names_of_directive_files_are_known(package):
    drivers = "model_drivers: {iiwa: !IiwaDriver {}}\n"
    assert load(add("arm") + drivers, package).model_drivers.keys() == {"iiwa"}


def test_namespaces_are_known(package):
    text = (
        "directives:\n- add_model_instance: {name: left}\n"
        "- add_directives: {file: package://mine/arm.dmd.yaml, model_namespace: left}\n"
        "model_drivers: {left::iiwa: !IiwaDriver {}}\n"
    )
    assert load(text, package).model_drivers.keys() == {"left::iiwa"}
    with pytest.raises(InputError, match="no model instance 'right'"):
        load(add("arm", ", model_namespace: right"), package)


def test_frames_that_are_added_are_known(package):
    text = add("arm") + (
        "- add_frame: {name: tip, X_PF: {base_frame: wsg::body}}\n"
        "cameras: {c: {X_PB: {base_frame: tip}}, d: {name: d, X_PB: {base_frame: wsg::tip}}}\n"
    )
    assert len(load(text, package).cameras) == 2


def test_a_directive_file_that_adds_itself_is_caught(package):
    (package / "a.dmd.yaml").write_text(add("a"))
    with pytest.raises(InputError, match="adds itself") as error:
        load(add("a"), package)
    (finding,) = error.value.findings
    assert finding.file == str(package / "a.dmd.yaml")
    assert finding.line == 2
    assert finding.key == "directives[0].add_directives.file"


def test_directive_files_that_add_each_other_are_caught(package):
    for one, next_one in ("ab", "bc", "ca"):
        (package / f"{one}.dmd.yaml").write_text(add(next_one))
    with pytest.raises(InputError, match="adds itself through other files") as error:
        load(add("a"), package)
    assert error.value.findings[0].file == str(package / "c.dmd.yaml")


def test_directive_files_that_multiply_are_bounded(package):
    for i in range(12):
        twice = add(f"f{i + 1}") + add(f"f{i + 1}").removeprefix("directives:\n") * 3
        (package / f"f{i}.dmd.yaml").write_text(twice)
    (package / "f12.dmd.yaml").write_text("directives: []\n")
    with pytest.raises(InputError, match="more than") as error:
        load(add("f0"), package)
    assert len(error.value.findings) == 1


def test_faults_in_directive_files_name_that_file(package):
    file = package / "arm.dmd.yaml"
    file.write_text(file.read_text().replace("0.1", ".nan") + "cameras: {}\n")
    with pytest.raises(InputError) as error:
        load(add("arm"), package)
    assert [(f.file, f.line) for f in error.value.findings] == [(str(file), 6), (str(file), 17)]


# The schema of others


@pytest.mark.skipif(not SHARED.is_dir(), reason="Drake's model files are not beside the checkout")
def test_scenarios_with_drakes_public_models_load():
    text = """\
directives:
- add_model:
    name: iiwa_left
    file: package://drake_models/iiwa_description/sdf/iiwa7_no_collision.sdf
    default_joint_positions:
        iiwa_joint_1: [-1.57]
        iiwa_joint_4: [-1.2]
- add_weld:
    parent: world
    child: iiwa_left::iiwa_link_0
- add_model:
    name: wsg_left
    file: package://drake_models/wsg_50_description/sdf/schunk_wsg_50_with_tip.sdf
- add_weld:
    parent: iiwa_left::iiwa_link_7
    child: wsg_left::body
    X_PC:
        translation: [0, 0, 0.114]
        rotation: !Rpy { deg: [90.0, 0.0, 68.0 ]}
- add_model:
    name: brick
    file: package://drake_models/manipulation_station/061_foam_brick.sdf
    default_free_body_pose:
        base_link:
            translation: [0.6, 0, 0.2]
- add_model:
    name: allegro
    file: package://drake_models/allegro_hand_description/sdf/allegro_hand_description_right.sdf
- add_frame:
    name: camera_origin
    X_PF:
        base_frame: world
        rotation: !Rpy { deg: [-120.0, 0.0, 180.0]}
        translation: [0, 0.8, 0.5]
cameras:
    main_camera:
        name: camera0
        depth: True
        X_PB:
            base_frame: camera_origin
camera_ids:
    main_camera: '0001'
model_drivers:
    iiwa_left: !IiwaDriver
        control_mode: position_only
        hand_model_name: wsg_left
    wsg_left: !SchunkWsgDriver {}
    allegro: !InverseDynamicsDriver
        gains:
            joint_0: {kp: 100, ki: 1, kd: 20}
lcm_buses:
    default: {lcm_url: "memq://null"}
"""
    scenario = loads_scenario(text, packages={"drake_models": SHARED})
    assert set(scenario.model_drivers) == {"iiwa_left", "wsg_left", "allegro"}
    assert scenario.lcm_buses["default"].lcm_url == "memq://null"
    assert scenario.camera_ids == {"main_camera": "0001"}
    with pytest.raises(InputError, match="not on this machine"):
        loads_scenario(text)
