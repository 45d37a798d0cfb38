"""Conversion of URDF and SDF files: what must be kept, what is mended, what is refused."""

import json
import subprocess
import sys

import numpy as np
import pytest
from convert_files import BOX_FACES, Loaded, box_points, urdf_inertial, write_stl
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import Role

from prehensile.errors import InputError
from prehensile.models.convert.conversion import convert
from prehensile.models.convert.mass import nearest_possible
from prehensile.models.convert.options import ConvertOptions
from prehensile.models.registry import list_models

ARM = """<robot name="arm">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="base">{inertial}<visual><geometry><box size="0.2 0.2 0.1"/></geometry>
    <material name="red"/></visual></link>
  <link name="upper">{inertial}<collision><origin xyz="0 0 0.15"/>
    <geometry><cylinder radius="0.03" length="0.3"/></geometry></collision></link>
  <link name="lower">{inertial}</link>
  <link name="finger">{inertial}</link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0.1 0.2" rpy="0.3 -0.2 1.1"/><axis xyz="0 1 1"/>
    <limit lower="-2" upper="2" effort="30" velocity="1.5"/><dynamics damping="0.4" friction="1"/>
  </joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 0.3" rpy="0 1.5707963267948966 0.4"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="2" effort="20" velocity="2"/></joint>
  <joint name="grip" type="prismatic"><parent link="lower"/><child link="finger"/>
    <origin xyz="0.1 0 0"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.05" effort="5" velocity="1"/>
    <mimic joint="elbow" multiplier="0.02" offset="0.01"/></joint>
  {more}
</robot>"""


def arm(folder, more="", name="arm.urdf", inertial=None, edit=()):
    text = ARM.format(inertial=inertial or urdf_inertial(), more=more)
    for old, new in edit:
        assert old in text
        text = text.replace(old, new)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)
    return folder / name


def changes(done, kind):
    return [f"{c.subject}: {c.text}" for c in done.report.changes if c.kind == kind]


def refusal(file, out, **options):
    with pytest.raises(InputError) as error:
        convert(file, out, ConvertOptions(**options))
    assert not out.exists()
    assert [p for p in out.parent.iterdir() if p.name.startswith(f".{out.name}")] == []
    return error.value


# What is kept


def test_forward_kinematics_is_that_of_the_source(tmp_path):
    source = arm(tmp_path)
    done = convert(source, tmp_path / "out")
    before, after = Loaded(source), Loaded(done.path)
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = dict(zip(("shoulder", "elbow", "grip"), rng.uniform(-1, 1, 3), strict=True))
        before.set(**q)
        after.set(**q)
        for body in ("upper", "lower", "finger"):
            np.testing.assert_allclose(after.pose(body), before.pose(body), atol=1e-12)


def test_limits_damping_and_couplings_are_kept(tmp_path):
    after = Loaded(convert(arm(tmp_path), tmp_path / "out").path)
    shoulder = after.plant.GetJointByName("shoulder")
    assert shoulder.position_upper_limits()[0] == 2
    assert shoulder.velocity_upper_limits()[0] == 1.5
    assert shoulder.default_damping() == 0.4
    after.set(elbow=0.5, grip=0.02 * 0.5 + 0.01)
    after.simulate(0.4)
    assert abs(after.position("elbow") - 0.5) > 0.05
    wanted = 0.02 * after.position("elbow") + 0.01
    assert after.position("grip") == pytest.approx(wanted, abs=1e-4)


def test_the_folder_is_a_package_that_the_registry_lists(tmp_path, monkeypatch):
    convert(arm(tmp_path), tmp_path / "my_arm", ConvertOptions(name="my_arm"))
    monkeypatch.setenv("PREHENSILE_MODEL_PATH", str(tmp_path / "my_arm"))
    (found,) = [m for m in list_models() if m.name == "my_arm"]
    assert found.url == "package://my_arm/my_arm.urdf"
    names = {p.name for p in (tmp_path / "my_arm").iterdir()}
    assert names == {"my_arm.urdf", "model.yaml", "report.md", "report.json"}
    report = json.loads((tmp_path / "my_arm" / "report.json").read_text())
    assert report["summary"]["moving joints"] == 3


def test_an_sdf_keeps_its_poses_springs_and_drake_tags(tmp_path):
    body = (
        "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"
    )
    source = tmp_path / "lever.sdf"
    source.write_text(
        f"""<sdf version="1.7" xmlns:drake="http://drake.mit.edu"><model name="lever">
        <link name="a">{body}<sensor name="s" type="camera"/></link>
        <link name="b"><pose>0.1 0.2 0.3 0.4 0.5 0.6</pose>{body}</link>
        <joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz>
        <limit><effort>7</effort></limit><dynamics><spring_stiffness>3</spring_stiffness>
        <spring_reference>0.2</spring_reference></dynamics></axis>
        <drake:rotor_inertia>0.01</drake:rotor_inertia></joint></model></sdf>"""
    )
    done = convert(source, tmp_path / "out")
    before, after = Loaded(source), Loaded(done.path)
    for model in (before, after):
        model.set(j=0.7)
    np.testing.assert_allclose(after.pose("b"), before.pose("b"), atol=1e-12)
    potential = [m.plant.CalcPotentialEnergy(m.context) for m in (before, after)]
    assert potential[0] == pytest.approx(potential[1])
    assert after.plant.get_joint_actuator(
        after.plant.GetJointActuatorIndices()[0]
    ).default_rotor_inertia() == pytest.approx(0.01)
    assert any("sensor" in text for text in changes(done, "dropped"))


def test_sdf_s_own_mimic_becomes_a_coupling(tmp_path):
    body = "<inertial><pose>0.1 0 0 0 0 0</pose><mass>1</mass></inertial>"
    limit = "<limit><lower>-3</lower><upper>3</upper></limit>"
    source = tmp_path / "pair.sdf"
    source.write_text(
        f"""<sdf version="1.11"><model name="pair"><link name="a">{body}</link>
        <link name="b">{body}</link><link name="c">{body}</link>
        <joint name="j" type="revolute"><parent>a</parent><child>b</child>
        <axis><xyz>0 1 0</xyz>{limit}</axis></joint>
        <joint name="k" type="revolute"><parent>b</parent><child>c</child><axis><xyz>0 1 0</xyz>
        {limit}<mimic joint="j"><multiplier>2</multiplier><offset>0.5</offset>
        <reference>0.1</reference></mimic></axis></joint></model></sdf>"""
    )
    after = Loaded(convert(source, tmp_path / "out").path)
    after.set(j=0.1, k=0.5)
    after.simulate(0.3)
    assert abs(after.position("j") - 0.1) > 0.05
    wanted = 2 * (after.position("j") - 0.1) + 0.5
    assert after.position("k") == pytest.approx(wanted, abs=1e-3)


# What is mended


def test_joints_without_transmissions_are_driven(tmp_path):
    done = convert(arm(tmp_path), tmp_path / "out")
    assert Loaded(done.path).efforts() == {"shoulder": 30.0, "elbow": 20.0}
    assert changes(done, "actuator")


def test_transmissions_say_which_joints_are_driven(tmp_path):
    more = (
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type>'
        '<joint name="elbow"/><actuator name="motor"/></transmission>'
    )
    source = arm(tmp_path, more)
    done = convert(source, tmp_path / "a")
    assert Loaded(done.path).efforts() == {"elbow": 20.0}
    assert any("shoulder" in text for text in changes(done, "actuator"))
    done = convert(source, tmp_path / "b", ConvertOptions(actuators="all"))
    assert Loaded(done.path).efforts() == {"elbow": 20.0, "shoulder": 30.0}


def test_an_effort_or_velocity_of_zero_is_no_limit(tmp_path):
    edit = [
        ('effort="30" velocity="1.5"', 'effort="0" velocity="0"'),
        ('effort="20"', 'effort="0"'),
        ('effort="5"', 'effort="0"'),
    ]
    after = Loaded(convert(arm(tmp_path, edit=edit), tmp_path / "out").path)
    assert after.efforts() == {"shoulder": np.inf, "elbow": np.inf}
    assert after.plant.GetJointByName("shoulder").velocity_upper_limits()[0] == np.inf


def test_limits_the_wrong_way_round_are_none(tmp_path):
    source = arm(tmp_path, edit=[('lower="-2" upper="2"', 'lower="0" upper="-1"')])
    joint = Loaded(convert(source, tmp_path / "out").path).plant.GetJointByName("shoulder")
    assert joint.position_lower_limits()[0] == -np.inf


def test_a_mass_without_inertia_gets_that_of_its_shape(tmp_path):
    source = tmp_path / "rod.urdf"
    source.write_text(
        '<robot name="rod"><link name="rod"><inertial><origin xyz="0 0 0" rpy="0 1.2 0"/>'
        '<mass value="3"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
        '<collision><geometry><cylinder radius="0.1" length="0.8"/></geometry></collision>'
        "</link></robot>"
    )
    inertia = Loaded(convert(source, tmp_path / "out").path, weld=False).inertia("rod")
    across = 3 * (3 * 0.1**2 + 0.8**2) / 12
    expected = np.diag([across, across, 3 * 0.1**2 / 2])
    np.testing.assert_allclose(
        inertia.CalcRotationalInertia().CopyToFullMatrix3(), expected, rtol=1e-9, atol=1e-12
    )


def test_links_have_mass_where_physics_needs_it_and_nowhere_else(tmp_path):
    link = '<link name="{}">{}</link>'
    box = '<collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>'
    joint = '<joint name="{0}{1}" type="{2}"><parent link="{0}"/><child link="{1}"/></joint>'
    links = [("root", box), ("between", ""), ("body", urdf_inertial(2)), ("frame", "")]
    links += [("tip", ""), ("pad", box), ("end", "")]
    joints = [("root", "between", "continuous"), ("between", "body", "continuous")]
    joints += [("body", "frame", "fixed"), ("body", "tip", "continuous"), ("tip", "pad", "fixed")]
    joints += [("body", "end", "continuous")]
    source = tmp_path / "chain.urdf"
    text = "".join(link.format(*row) for row in links) + "".join(joint.format(*j) for j in joints)
    source.write_text(f'<robot name="chain">{text}</robot>')
    options = ConvertOptions(density=500)
    model = Loaded(convert(source, tmp_path / "out", options).path, weld=False)
    masses = {name: model.inertia(name).get_mass() for name, _ in links}
    block = 500 * 0.1 * 0.2 * 0.3
    token = 500 * 4 / 3 * np.pi * 0.01**3
    wanted = {"root": block, "between": 0, "body": 2, "frame": 0, "tip": 0, "pad": block}
    assert masses == pytest.approx(wanted | {"end": token})
    fixed = ConvertOptions(density=500, base="fixed")
    done = convert(source, tmp_path / "fixed", fixed)
    assert Loaded(done.path, weld=False).inertia("root").get_mass() == 0


def test_an_impossible_inertia_becomes_the_nearest_possible(tmp_path):
    source = arm(tmp_path, inertial=urdf_inertial(1, (1, 1, 3)))
    done = convert(source, tmp_path / "out")
    inertia = Loaded(done.path).inertia("upper").CalcRotationalInertia()
    # Second moments (1.5, 1.5, -0.5) become (1.5, 1.5, 0).
    np.testing.assert_allclose(inertia.CopyToFullMatrix3(), np.diag([1.5, 1.5, 3.0]), rtol=1e-12)
    assert len(changes(done, "inertia")) == 4


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-2, 2), min_size=6, max_size=6))
def test_nearest_possible_is_a_projection(values):
    inertia = np.zeros((3, 3))
    inertia[np.triu_indices(3)] = values
    inertia = inertia + np.triu(inertia, 1).T
    possible = nearest_possible(inertia)
    a, b, c = np.linalg.eigvalsh(possible)
    assert a >= -1e-5
    assert a + b >= c - 1e-5
    np.testing.assert_allclose(nearest_possible(possible), possible, atol=1e-9)


def test_overlapping_links_never_collide(tmp_path):
    # Next neighbours Drake keeps apart itself; these are neighbours but one.
    ball = '<collision><geometry><sphere radius="0.2"/></geometry></collision>'
    text = "".join(f'<link name="l{i}">{urdf_inertial()}{ball}</link>' for i in range(3))
    for i in range(2):
        text += (
            f'<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
            '<origin xyz="0.1 0 0"/></joint>'
        )
    (tmp_path / "beads.urdf").write_text(f'<robot name="beads">{text}</robot>')
    done = convert(tmp_path / "beads.urdf", tmp_path / "out")
    model = Loaded(done.path)
    query = model.plant.get_geometry_query_input_port().Eval(model.context)
    assert not query.ComputePointPairPenetration()
    assert changes(done, "contact") == [
        "l0 and l2: overlap where the joints rest: they never collide with one another"
    ]


def test_a_conversion_falls_but_gains_no_energy(tmp_path):
    energies = Loaded(convert(arm(tmp_path), tmp_path / "out").path).simulate(1.0)
    assert np.isfinite(energies).all()
    assert energies.max() <= energies[0] + 1e-3


def test_the_base_can_be_fixed_and_freed(tmp_path):
    fixed = convert(arm(tmp_path), tmp_path / "fixed", ConvertOptions(base="fixed"))
    assert Loaded(fixed.path, weld=False).plant.num_positions() == 3
    freed = convert(fixed.path, tmp_path / "freed", ConvertOptions(base="free"))
    assert Loaded(freed.path, weld=False).plant.num_positions() == 3 + 7


def test_a_color_of_two_meanings_stays_what_it_is(tmp_path):
    visual = (
        '<visual><geometry><sphere radius="0.1"/></geometry>'
        '<material name="paint"><color rgba="{} 1"/></material></visual>'
    )
    links = f'<link name="a">{visual.format("0 1 0")}{visual.format("0 0 1")}</link>'
    (tmp_path / "two.urdf").write_text(f'<robot name="two">{links}</robot>')
    model = Loaded(convert(tmp_path / "two.urdf", tmp_path / "out").path, weld=False)
    seen = [
        model.inspector.GetIllustrationProperties(g).GetProperty("phong", "diffuse").rgba
        for g in model.shapes("a", Role.kIllustration)
    ]
    np.testing.assert_allclose(sorted(map(tuple, seen)), [(0, 0, 1, 1), (0, 1, 0, 1)])


# Where files are


def robot_of(mesh: str) -> str:
    shape = f'<geometry><mesh filename="{mesh}"/></geometry>'
    return f'<robot name="r"><link name="a"><visual>{shape}</visual></link></robot>'


@pytest.mark.parametrize("manifest", [True, False])
def test_a_package_is_found_upwards(tmp_path, manifest):
    root = tmp_path / ("anything" if manifest else "my_robot")
    write_stl(root / "meshes" / "box.stl", box_points((0.1, 0.1, 0.1)), BOX_FACES)
    (root / "urdf").mkdir()
    (root / "urdf" / "r.urdf").write_text(robot_of("package://my_robot/meshes/box.stl"))
    if manifest:
        (root / "package.xml").write_text("<package><name>my_robot</name></package>")
    assert convert(root / "urdf" / "r.urdf", tmp_path / "out").path.is_file()


def test_a_package_is_found_where_the_user_and_ros_say(tmp_path, monkeypatch):
    write_stl(tmp_path / "elsewhere" / "box.stl", box_points((0.1, 0.1, 0.1)), BOX_FACES)
    (tmp_path / "r.urdf").write_text(robot_of("package://far/box.stl"))
    error = refusal(tmp_path / "r.urdf", tmp_path / "out")
    assert "--package far=PATH" in error.findings[0].mend
    assert error.findings[0].line == 1
    options = ConvertOptions(packages={"far": tmp_path / "elsewhere"})
    convert(tmp_path / "r.urdf", tmp_path / "a", options)
    share = tmp_path / "prefix" / "share"
    share.mkdir(parents=True)
    (tmp_path / "elsewhere" / "package.xml").write_text("<package><name>far</name></package>")
    (tmp_path / "elsewhere").rename(share / "far")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "prefix"))
    convert(tmp_path / "r.urdf", tmp_path / "b")


@pytest.mark.parametrize(
    "mesh",
    ["../secret.stl", "/etc/passwd", "package://r/../secret.stl", "file:///etc/passwd", "link.stl"],
)
def test_files_outside_of_the_tree_are_not_read(tmp_path, mesh):
    write_stl(tmp_path / "secret.stl", box_points((1, 1, 1)), BOX_FACES)
    folder = tmp_path / "r"
    folder.mkdir()
    (folder / "link.stl").symlink_to(tmp_path / "secret.stl")
    (folder / "r.urdf").write_text(robot_of(mesh))
    error = refusal(folder / "r.urdf", tmp_path / "out")
    assert "leaves" in str(error)
    if "package" not in mesh and "etc" not in mesh:
        convert(folder / "r.urdf", tmp_path / "wider", ConvertOptions(root=tmp_path))


def test_all_missing_meshes_are_told_at_once_or_left_out(tmp_path):
    shape = '<{0}><geometry><mesh filename="{1}.stl"/></geometry></{0}>'
    link = "\n".join(shape.format("visual", name) for name in ("one", "two"))
    (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="a">\n{link}</link></robot>')
    error = refusal(tmp_path / "r.urdf", tmp_path / "out")
    assert [f.line for f in error.findings] == [2, 3]
    assert all("--skip-missing" in f.mend for f in error.findings)
    done = convert(tmp_path / "r.urdf", tmp_path / "out", ConvertOptions(skip_missing=True))
    assert len(changes(done, "dropped")) == 2


# What is refused


BOMB = '<?xml version="1.0"?><!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><robot name="&b;"/>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, "entities"),
        ('<robot xmlns:xacro="x"><xacro:include filename="a"/></robot>', "xacro"),
        ('<robot name="r"><link name="${prefix}a"/></robot>', "xacro"),
        ("<robot", "XML"),
        ("", "XML"),
        ("<html/>", "robot"),
        ('<robot name="r"/>', "no links"),
        ('<robot name="r"><link name="a"/><link name="a"/></robot>', "two links"),
        ('<robot name="r"><link/></robot>', "no name"),
        (
            '<robot name="r"><link name="a"/><joint name="j" type="fixed"><parent link="a"/>'
            '<child link="b"/></joint></robot>',
            "unknown child 'b'",
        ),
        (
            '<robot name="r"><link name="a"><visual><geometry><mesh filename="x.exe"/></geometry>'
            "</visual></link></robot>",
            "x.exe",
        ),
        (ARM.format(inertial="", more="").replace('xyz="0 1 1"', 'xyz="0 0 0"'), "axis"),
        (ARM.format(inertial="", more="").replace('xyz="0 1 1"', 'xyz="0 nan 1"'), "3 numbers"),
        (ARM.format(inertial="", more="").replace('lower="-2"', 'lower="low"'), "lower limit"),
        (ARM.format(inertial="", more="").replace('size="0.2 0.2 0.1"', 'size="-1 1 1"'), ""),
    ],
)
def test_what_cannot_be_mended_is_told_and_nothing_is_written(tmp_path, text, said):
    (tmp_path / "bad.urdf").write_text(text)
    error = refusal(tmp_path / "bad.urdf", tmp_path / "out")
    assert said in str(error)


def test_loops_of_joints_are_refused_by_drake_as_input_errors(tmp_path):
    more = '<joint name="loop" type="fixed"><parent link="finger"/><child link="upper"/></joint>'
    assert "loop" in str(refusal(arm(tmp_path, more), tmp_path / "out"))


@pytest.mark.parametrize("name", ["robot.xacro", "robot.urdf.xacro", "robot.step", "absent.urdf"])
def test_other_files_are_refused(tmp_path, name):
    if name != "absent.urdf":
        (tmp_path / name).write_text("x")
    assert name in str(refusal(tmp_path / name, tmp_path / "out"))


def test_names_cannot_leave_the_folder_or_mark_up_the_report(tmp_path):
    source = tmp_path / "r.urdf"
    nasty = "../../evil&lt;script&gt;|"
    source.write_text(f'<robot name="../../x"><link name="{nasty}"/></robot>')
    done = convert(source, tmp_path / "out", ConvertOptions(name="../../../etc/x"))
    assert done.path.parent == tmp_path / "out"
    assert done.path.name == "etc_x.urdf"
    assert "<script" not in (tmp_path / "out" / "report.md").read_text()


def test_a_folder_that_is_there_stays(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    source = arm(tmp_path)
    for replace in (False, True):
        with pytest.raises(InputError, match="there already"):
            convert(source, out, replace=replace)
    assert [p.name for p in out.iterdir()] == ["mine.txt"]
    done = convert(source, tmp_path / "again")
    with pytest.raises(InputError, match="--replace"):
        convert(source, tmp_path / "again")
    source.write_text("<robot")
    with pytest.raises(InputError):
        convert(source, tmp_path / "again", replace=True)
    assert done.path.is_file()
    convert(arm(tmp_path), tmp_path / "again", replace=True)


@pytest.mark.parametrize(
    "options",
    [{"scale": 0}, {"density": -1}, {"mass": float("nan")}, {"collision": "x"}, {"base": "x"}],
)
def test_options_out_of_range_are_refused(options):
    with pytest.raises(InputError):
        ConvertOptions(**options)


def test_the_command_prints_what_was_changed(tmp_path):
    source = arm(tmp_path)
    command = [sys.executable, "-m", "prehensile", "models", "convert"]
    done = subprocess.run(
        [*command, str(source), "-o", str(tmp_path / "out"), "--fixed-base"],
        capture_output=True,
        text=True,
        env={"COLUMNS": "200", "TERM": "dumb", "HOME": str(tmp_path)},
    )
    assert done.returncode == 0, done.stderr
    assert "welded to the world" in done.stdout
    assert str(tmp_path / "out" / "arm.urdf") in done.stdout
    wrong = subprocess.run(
        [*command, str(source), "-o", str(tmp_path / "b"), "--package", "x"],
        capture_output=True,
        text=True,
    )
    assert wrong.returncode == 2
    assert "NAME=PATH" in wrong.stderr


def test_a_loop_of_an_sdf_is_closed_by_constraints(tmp_path):
    # A parallelogram hanging from the world: the coupler stays level wherever it swings.
    def link(name, x, z, size):
        inertia = "<ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz>"
        return (
            f'<link name="{name}"><pose>{x} 0 {z} 0 0 0</pose><inertial><pose>{size} 0 0</pose>'
            f"<mass>1</mass><inertia>{inertia}</inertia></inertial></link>"
        )

    def hinge(name, parent, child, x=0.0, z=0.0):
        return (
            f'<joint name="{name}" type="revolute"><pose>{x} 0 {z} 0 0 0</pose>'
            f"<parent>{parent}</parent><child>{child}</child><axis><xyz>0 1 0</xyz>"
            "<limit><effort>0</effort></limit></axis></joint>"
        )

    text = link("left", 0, 0, "0 0 -0.2 0") + link("right", 0.5, 0, "0 0 -0.2 0")
    text += link("bar", 0, -0.4, "0.4 0 0 0") + hinge("a", "world", "left")
    text += hinge("b", "world", "right") + hinge("c", "left", "bar")
    text += hinge("d", "right", "bar", x=0.5)
    source = tmp_path / "swing.sdf"
    source.write_text(f'<sdf version="1.7"><model name="swing">{text}</model></sdf>')
    done = convert(source, tmp_path / "out")
    model = Loaded(done.path)
    model.set(a=0.6, b=0.6, c=-0.6)
    energies = model.simulate(0.5)
    assert abs(model.position("a") - 0.6) > 0.3
    np.testing.assert_allclose(model.pose("bar")[:3, :3], np.eye(3), atol=2e-3)
    pin = model.pose("right") @ [0, 0, -0.4, 1]
    np.testing.assert_allclose(model.pose("bar") @ [0.5, 0, 0, 1], pin, atol=1e-3)
    assert energies.max() <= energies[0] + 1e-2


def test_a_long_chain_is_converted_and_an_endless_one_refused(tmp_path):
    def chain(count):
        links = "".join(f'<link name="l{i}"/>' for i in range(count))
        joints = "".join(
            f'<joint name="j{i}" type="fixed"><parent link="l{i}"/><child link="l{i + 1}"/></joint>'
            for i in range(count - 1)
        )
        (tmp_path / "chain.urdf").write_text(f'<robot name="chain">{links}{joints}</robot>')
        return tmp_path / "chain.urdf"

    assert "links" in str(refusal(chain(3000), tmp_path / "out"))
    done = convert(chain(300), tmp_path / "out")
    # Nothing in it has mass: its first link gets some.
    assert len(changes(done, "inertia")) == 1
