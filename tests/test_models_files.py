"""Faults in SDF, URDF and MJCF files are found before Drake sees them."""

from pathlib import Path

import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from prehensile.errors import Finding
from prehensile.models.model_file import ModelFileReader
from prehensile.models.packages import find_packages
from prehensile.models.registry import DATA, find_model, list_models

SHARED = Path(__file__).parents[1].parent / "shared" / "drake_models"

SDF = """<?xml version="1.0"?>
<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="thing">
    <link name="base_link">
      <inertial>
        <mass>{mass}</mass>
        <inertia><ixx>{ixx}</ixx><iyy>1</iyy><izz>1</izz></inertia>
      </inertial>
      <visual name="seen">
        <pose>{pose}</pose>
        <geometry><mesh><uri>{mesh}</uri></mesh></geometry>
      </visual>
      <collision name="touched">
        <geometry><sphere><radius>{radius}</radius></sphere></geometry>
        <drake:proximity_properties>
          <drake:mesh_resolution_hint>{hint}</drake:mesh_resolution_hint>
          <drake:hydroelastic_modulus>{modulus}</drake:hydroelastic_modulus>
          <drake:mu_static>{mu}</drake:mu_static>
        </drake:proximity_properties>
      </collision>
    </link>
    <link name="other"/>
    <joint name="hinge" type="revolute">
      <parent>base_link</parent>
      <child>other</child>
      <axis><xyz>0 0 1</xyz><limit><lower>{lower}</lower><upper>1</upper></limit></axis>
    </joint>
    {more}
  </model>
</sdf>
"""
SOUND = {
    "mass": "1",
    "ixx": "1",
    "pose": "0 0 0 0 0 0",
    "mesh": "cube.obj",
    "radius": "0.1",
    "hint": "0.01",
    "modulus": "1e7",
    "mu": "0.5",
    "lower": "-1",
    "more": "",
}


def findings_of(folder: Path, text: str, name: str = "thing.sdf") -> list[Finding]:
    (folder / name).write_text(text)
    (folder / "cube.obj").write_text("v 0 0 0\n")
    findings: list[Finding] = []
    ModelFileReader(find_packages(), findings).read(folder / name, folder)
    return findings


def test_a_sound_file_has_no_findings_and_tells_its_names(tmp_path):
    findings: list[Finding] = []
    (tmp_path / "cube.obj").write_text("v 0 0 0\n")
    (tmp_path / "thing.sdf").write_text(SDF.format(**SOUND))
    model = ModelFileReader({}, findings).read(tmp_path / "thing.sdf", tmp_path)
    assert findings == []
    assert not model.opaque
    assert {"base_link", "other"} <= model.frames
    assert model.joints == {"hinge": 1}


@pytest.mark.parametrize(
    ("field", "value", "line", "said"),
    [
        ("mass", "-1", 6, "mass of link 'base_link' is -1 kg"),
        ("mass", "nan", 6, "NaN"),
        ("mass", "inf", 6, "mass of link 'base_link' is inf kg"),
        ("mass", "heavy", 6, "not a number: 'heavy'"),
        ("ixx", "-0.1", 7, "ixx of link 'base_link' is -0.1"),
        ("pose", "0 0 nan 0 0 0", 10, "NaN"),
        ("mesh", "gone.obj", 11, "there is no file 'gone.obj'"),
        ("mesh", "../../../../etc/passwd", 11, "leaves its package"),
        ("mesh", "package://nobody/cube.obj", 11, "unknown package 'nobody'"),
        ("radius", "-0.1", 14, "radius of a sphere on link 'base_link' is -0.1"),
        ("hint", "1e-7", 16, "absurd"),
        ("hint", "-1", 16, "must be > 0"),
        ("modulus", "0", 17, "must be > 0"),
        ("mu", "-0.5", 18, "at least 0"),
        ("lower", "2", 26, "the wrong way round"),
        ("more", "<include><uri>thing.sdf</uri></include>", 28, "includes itself"),
        ("more", "<include><uri>gone.sdf</uri></include>", 28, "there is no file"),
        ("more", "<broken>", 29, "not valid XML"),
    ],
)
def test_each_fault_is_found_in_its_line(tmp_path, field, value, line, said):
    findings = findings_of(tmp_path, SDF.format(**SOUND | {field: value}))
    assert findings
    assert said in str(findings[0])
    assert findings[0].file == str(tmp_path / "thing.sdf")
    assert findings[0].line == line


def test_all_faults_are_found_at_once(tmp_path):
    faults = {"mass": "-1", "mesh": "gone.obj", "hint": "1e-7", "lower": "2"}
    findings = findings_of(tmp_path, SDF.format(**SOUND | faults))
    assert [f.line for f in findings] == [6, 11, 16, 26]


def test_files_that_include_each_other_are_caught(tmp_path):
    text = (
        '<sdf version="1.9"><model name="{0}"><include><uri>{1}.sdf</uri></include></model></sdf>'
    )
    (tmp_path / "b.sdf").write_text(text.format("b", "c"))
    (tmp_path / "c.sdf").write_text(text.format("c", "a"))
    findings = findings_of(tmp_path, text.format("a", "b"), "a.sdf")
    assert [f.file for f in findings] == [str(tmp_path / "c.sdf")]
    assert "includes itself" in findings[0].message


def test_a_world_that_includes_itself_is_caught(tmp_path):
    text = '<sdf version="1.9"><world name="w"><include><uri>w.sdf</uri></include></world></sdf>'
    assert "includes itself" in str(findings_of(tmp_path, text, "w.sdf"))


def test_an_mjcf_file_that_includes_itself_is_caught(tmp_path):
    text = '<mujoco model="m"><include file="m.xml"/><worldbody/></mujoco>'
    assert "includes itself" in str(findings_of(tmp_path, text, "m.xml"))


def test_entities_are_not_expanded(tmp_path):
    lines = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 20))
    text = f'<!DOCTYPE sdf [<!ENTITY e0 "x">{lines}]><sdf version="1.9">&e19;</sdf>'
    assert "entities" in str(findings_of(tmp_path, text))


def test_nesting_is_bounded(tmp_path):
    assert "nested" in str(findings_of(tmp_path, "<sdf>" * 5000 + "</sdf>" * 5000))


def test_a_gltf_whose_buffer_is_missing_is_found(tmp_path):
    (tmp_path / "part.gltf").write_text('{"buffers": [{"uri": "gone.bin"}]}')
    findings = findings_of(tmp_path, SDF.format(**SOUND | {"mesh": "part.gltf"}))
    assert "there is no file 'gone.bin'" in findings[0].message


def test_urdf_faults_are_found(tmp_path):
    text = """<robot name="r">
  <link name="a">
    <inertial><mass value="-2"/></inertial>
    <collision>
      <geometry><cylinder radius="0.1" length="1"/></geometry>
      <drake:proximity_properties xmlns:drake="http://drake.mit.edu">
        <drake:mesh_resolution_hint value="1e-6"/>
      </drake:proximity_properties>
    </collision>
    <visual><geometry><mesh filename="gone.obj"/></geometry></visual>
  </link>
  <link name="b"/>
  <joint name="j" type="revolute">
    <parent link="a"/><child link="b"/>
    <limit lower="1" upper="-1" velocity="1" effort="1"/>
  </joint>
</robot>"""
    findings = findings_of(tmp_path, text, "r.urdf")
    assert sorted(f.line for f in findings) == [3, 7, 10, 15]


def test_a_comment_with_dashes_and_a_late_declaration_are_forgiven_as_by_drake(tmp_path):
    text = '\n<?xml version="1.0"?>\n<!-- -- -->\n<sdf version="1.9"><model name="a"/></sdf>'
    assert findings_of(tmp_path, text) == []


def test_our_own_models_are_sound():
    findings: list[Finding] = []
    reader = ModelFileReader(find_packages(), findings)
    for info in list_models():
        assert not reader.read(info.path, DATA).opaque
    assert findings == []


def test_the_names_are_those_that_drake_gives():
    for name in ("iiwa7", "wsg50", "d415", "cupboard", "foam_brick"):
        info = find_model(name)
        model = ModelFileReader(find_packages(), []).read(info.path, DATA)
        plant = MultibodyPlant(0.0)
        (instance,) = Parser(plant).AddModels(info.path)
        names = {plant.get_body(i).name() for i in plant.GetBodyIndices(instance)}
        names |= {plant.get_frame(i).name() for i in plant.GetFrameIndices(instance)}
        assert names <= model.frames
        joints = (plant.get_joint(i) for i in plant.GetJointIndices(instance))
        assert {j.name(): j.num_positions() for j in joints} == model.joints


@pytest.mark.skipif(not SHARED.is_dir(), reason="Drake's model files are not beside the checkout")
def test_drakes_models_are_found_sound():
    findings: list[Finding] = []
    reader = ModelFileReader(find_packages({"drake_models": SHARED}), findings)
    files = [p for p in SHARED.rglob("*") if p.suffix in (".sdf", ".urdf")]
    for path in files:
        reader.read(path, SHARED)
    assert len(files) > 20
    # Of the copy at hand, one mesh has lost its buffer.
    assert {f.message for f in findings} <= {
        "the mesh 'package://drake_models/wsg_50_description/meshes/bubble_finger.gltf': "
        "there is no file 'bubble_finger.bin'"
    }
