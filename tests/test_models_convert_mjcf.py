"""Conversion of MJCF: geometry by hand and against Drake's own reader, drives, couplings, files."""

import numpy as np
import pytest
from convert_files import BOX_FACES, Loaded, box_points, write_stl
from pydrake.geometry import Role
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.errors import InputError
from prehensile.models.convert.conversion import convert
from prehensile.models.convert.options import ConvertOptions


def write(folder, text, name="robot.xml"):
    (folder / name).write_text(text)
    return folder / name


def load(folder, text, weld=True, **options):
    done = convert(write(folder, text), folder / "out", ConvertOptions(**options))
    return Loaded(done.path, weld=weld), done


def changes(done, kind):
    return [f"{c.subject}: {c.text}" for c in done.report.changes if c.kind == kind]


def refusal(folder, text):
    with pytest.raises(InputError) as error:
        convert(write(folder, text), folder / "out")
    assert not (folder / "out").exists()
    return error.value


INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'


def test_a_planar_two_link_arm_is_where_trigonometry_says(tmp_path):
    # Hinges about z at (0.1, 0) and, 0.4 further along, the elbow; degrees; the elbow's joint
    # has its zero at 30 degrees, where the forearm is drawn.
    text = f"""<mujoco model="two"><worldbody><body name="upper" pos="0.1 0 0">{INERTIAL}
    <joint name="shoulder" axis="0 0 1" range="-90 90"/>
    <body name="fore" pos="0.4 0 0" euler="0 0 30">{INERTIAL}
    <joint name="elbow" axis="0 0 2" ref="30" range="-60 120"/>
    <body name="tip" pos="0.3 0 0">{INERTIAL}</body></body></body></worldbody></mujoco>"""
    model, _ = load(tmp_path, text)
    for a, b in ((0.0, 0.0), (0.3, -0.5), (1.2, 0.7)):
        model.set(shoulder=a, elbow=b)
        total = a + np.radians(30) + b
        x = 0.1 + 0.4 * np.cos(a) + 0.3 * np.cos(total)
        y = 0.4 * np.sin(a) + 0.3 * np.sin(total)
        np.testing.assert_allclose(model.pose("tip")[:3, 3], [x, y, 0], atol=1e-12)
    shoulder, elbow = (model.plant.GetJointByName(n) for n in ("shoulder", "elbow"))
    assert shoulder.position_upper_limits()[0] == pytest.approx(np.pi / 2)
    limits = [elbow.position_lower_limits()[0], elbow.position_upper_limits()[0]]
    np.testing.assert_allclose(limits, np.radians([-90, 90]))


RICH = """<mujoco model="rich"><compiler angle="radian" eulerseq="ZYX"/>
<default><geom density="500" rgba="0.2 0.4 0.6 1"/><joint damping="0.3" axis="0 1 0"/>
  <default class="light"><geom density="100" type="box" size="0.02 0.03 0.04"/>
    <joint damping="0.3" axis="0 1 0"/><default class="stiff">
    <joint damping="0.3" axis="0 1 0" armature="0.02" range="-1 0.5"/></default></default></default>
<worldbody><body name="base" pos="0 0 0.2" quat="0.8 0 0.6 0"><freejoint/>
  <geom name="hull" type="ellipsoid" size="0.1 0.2 0.3"/>
  <body name="a" pos="0 0 0.3" axisangle="1 2 0.5 0.7" childclass="light">
    <joint name="j1" pos="0.05 0 0.01"/>
    <geom pos="0.1 0 0"/><geom class="main" type="capsule" fromto="0 0 0 0 0.1 0.2" size="0.03"/>
    <body name="b" pos="0.2 0 0" euler="0.3 -0.4 1.1">
      <joint name="j3" type="slide" class="stiff"/><geom type="sphere" size="0.05" mass="2"/>
      <body name="c" xyaxes="0 1 0 -1 0.2 0" pos="0 0.1 0"><joint name="j4" class="stiff"/>
        <geom type="cylinder" size="0.04 0.1" zaxis="1 1 0"/></body></body></body></body>
</worldbody><actuator><motor joint="j4" gear="3" ctrlrange="-2 2"/></actuator></mujoco>"""


def test_it_agrees_with_drake_s_own_reader(tmp_path):
    source = write(tmp_path, RICH)
    model, original = Loaded(convert(source, tmp_path / "out").path), Loaded(source)
    rng = np.random.default_rng(1)
    for _ in range(10):
        q = dict(zip(("j1", "j3", "j4"), rng.uniform(-0.5, 0.5, 3), strict=True))
        model.set(**q)
        original.set(**q)
        X = original.pose("base") @ np.linalg.inv(model.pose("base"))
        for body in ("a", "b", "c"):
            np.testing.assert_allclose(X @ model.pose(body), original.pose(body), atol=1e-9)
    for body in ("base", "a", "b", "c"):
        mine, theirs = model.inertia(body), original.inertia(body)
        assert mine.get_mass() == pytest.approx(theirs.get_mass())
        np.testing.assert_allclose(
            mine.CopyToFullMatrix6(), theirs.CopyToFullMatrix6(), rtol=1e-9, atol=1e-12
        )
    for name in ("j1", "j3", "j4"):
        mine, theirs = (m.plant.GetJointByName(name) for m in (model, original))
        assert mine.default_damping() == theirs.default_damping()
        np.testing.assert_allclose(mine.position_lower_limits(), theirs.position_lower_limits())


def test_a_nested_class_inherits_what_it_does_not_say(tmp_path):
    text = f"""<mujoco><default><joint axis="0 1 0" damping="0.3"/><default class="light">
    <geom size="0.1"/><default class="stiff"><joint damping="2"/></default></default></default>
    <worldbody><body name="a" childclass="light">{INERTIAL}<joint name="j"/><body name="b">
    {INERTIAL}<joint name="k" class="stiff"/></body></body></worldbody></mujoco>"""
    model, _ = load(tmp_path, text)
    for name, damping in (("j", 0.3), ("k", 2.0)):
        joint = model.plant.GetJointByName(name)
        np.testing.assert_array_equal(joint.revolute_axis(), [0, 1, 0])
        assert joint.default_damping() == damping


def test_several_joints_of_a_body_turn_one_after_the_other(tmp_path):
    # Each about its axis and point in the body, as the joints before it have turned that.
    text = f"""<mujoco><compiler angle="radian"/><worldbody><body name="a" pos="1 2 3"
    axisangle="0 0 1 0.7">{INERTIAL}<joint name="x" axis="1 0 0" pos="0 0.1 0"/>
    <joint name="s" type="slide" axis="0 0 1"/><joint name="y" axis="0 1 0" pos="0 0 0.2"/></body>
    </worldbody></mujoco>"""
    model, _ = load(tmp_path, text)
    model.set(x=0.4, s=0.3, y=-0.8)

    def move(p=(0, 0, 0), turn=None):
        return RigidTransform(turn or RotationMatrix(), p)

    x, y = RotationMatrix.MakeXRotation, RotationMatrix.MakeYRotation
    X = move((1, 2, 3), RotationMatrix.MakeZRotation(0.7))
    X = X @ move((0, 0.1, 0)) @ move(turn=x(0.4)) @ move((0, -0.1, 0))
    X = X @ move((0, 0, 0.3))
    X = X @ move((0, 0, 0.2)) @ move(turn=y(-0.8)) @ move((0, 0, -0.2))
    np.testing.assert_allclose(model.pose("a"), X.GetAsMatrix4(), atol=1e-12)


def test_several_joints_of_a_body_do_not_make_its_parent_touch_it(tmp_path):
    ball = '<geom size="0.2"/>'
    text = f"""<mujoco><worldbody><body name="a">{ball}<body name="b" pos="0.1 0 0">
    <joint name="x" axis="1 0 0"/><joint name="y" axis="0 1 0"/>{ball}</body></body></worldbody>
    </mujoco>"""
    model, _ = load(tmp_path, text)
    query = model.plant.get_geometry_query_input_port().Eval(model.context)
    assert not query.ComputePointPairPenetration()


def test_drives_become_actuators_with_their_limits(tmp_path):
    names = ["motor", "general", "servo", "free", "ranged", "twice", "passive"]
    bodies = "".join(
        f'<body name="b_{n}">{INERTIAL}<joint name="{n}"'
        + (' actuatorfrcrange="-1 1"' if n == "ranged" else ' armature="0.1"')
        + "/></body>"
        for n in names
    )
    text = f"""<mujoco><default><position kp="50"/><default class="strong">
    <position forcerange="-9 9"/></default></default><worldbody>{bodies}</worldbody><actuator>
    <motor joint="motor" gear="-3" ctrlrange="-2 1"/>
    <general joint="general" gainprm="4" ctrlrange="-1 2" ctrllimited="true"/>
    <position class="strong" joint="servo"/><position joint="free" ctrlrange="-1 1"/>
    <motor joint="ranged"/><motor joint="twice" ctrlrange="-1 1"/>
    <motor joint="twice" ctrlrange="-5 5"/><muscle joint="passive"/></actuator></mujoco>"""
    model, done = load(tmp_path, text)
    assert model.efforts() == {
        "motor": 6, "general": 8, "servo": 9, "free": np.inf, "ranged": 1, "twice": 5,
    }  # fmt: skip
    said = changes(done, "dropped")
    assert any("muscle" in text for text in said)
    assert any("armature" in text and "passive" in text for text in said)
    actuator = model.plant.GetJointActuatorByName("motor")
    assert actuator.default_rotor_inertia() == pytest.approx(0.1)


def test_equalities_couple_joints_and_close_loops(tmp_path):
    box = '<geom type="box" size="0.05 0.01 0.01" pos="0.05 0 0" contype="0" conaffinity="0"/>'
    text = f"""<mujoco><worldbody>
    <body name="a"><joint name="ja" axis="0 1 0"/>{box}</body>
    <body name="b" pos="0 1 0"><joint name="jb" axis="0 1 0"/>{box}</body>
    <body name="c" pos="0 2 0"><joint name="jc" axis="0 1 0"/>{box}
      <body name="d" pos="0.1 0 0"><joint name="jd" axis="0 1 0"/>{box}
        <body name="e" pos="0.1 0 0"><joint name="je" axis="0 1 0"/>{box}</body></body></body>
    <body name="post" pos="0.3 2 0"><geom size="0.01" contype="0" conaffinity="0"/></body>
    </worldbody><equality><joint joint1="jb" joint2="ja" polycoef="0.1 -2 0 0 0"/>
    <connect body1="e" body2="post" anchor="0.1 0 0"/><weld body1="a" body2="b" active="false"/>
    <weld body1="d" body2="e"/></equality></mujoco>"""
    model, done = load(tmp_path, text)
    model.set(ja=0.0, jb=0.1)
    model.simulate(0.3)
    assert abs(model.position("ja")) > 0.1
    wanted = 0.1 - 2 * model.position("ja")
    assert model.position("jb") == pytest.approx(wanted, abs=1e-3)
    tip = model.pose("e") @ [0.1, 0, 0, 1]
    np.testing.assert_allclose(tip[:3], [0.3, 2, 0], atol=2e-3)
    assert len([text for text in changes(done, "dropped") if "weld" in text]) == 1


def test_a_tendon_s_range_limits_the_sum_of_its_joints(tmp_path):
    rod = '<geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/>'
    text = f"""<mujoco><compiler angle="radian"/><worldbody><body name="a">
    <joint name="j1" axis="0 1 0"/>{rod}<body name="b" pos="0.3 0 0"><joint name="j2" axis="0 1 0"/>
    {rod}</body></body></worldbody><tendon><fixed range="-1 0.4"><joint joint="j1" coef="1"/>
    <joint joint="j2" coef="1"/></fixed><spatial/></tendon></mujoco>"""
    model, done = load(tmp_path, text)
    highest = 0.0
    for _ in range(4):
        model.simulate(0.25)
        model.root.SetTime(0)
        highest = max(highest, model.position("j1") + model.position("j2"))
    assert highest == pytest.approx(0.4, abs=0.02)
    assert any("spatial" in text for text in changes(done, "dropped"))


def test_who_touches_whom(tmp_path):
    # a and b may by their bits, but are excluded; c touches neither; d touches all.
    def body(name, bits, x):
        return f'<body name="{name}" pos="{x} 0 0"><freejoint/><geom size="0.1" {bits}/></body>'

    bits = {"a": 'contype="1" conaffinity="1"', "c": 'contype="2" conaffinity="4"'}
    bits |= {"b": bits["a"], "d": 'contype="7" conaffinity="7"'}
    bodies = "".join(body(n, bits[n], x) for n, x in zip("abcd", range(4), strict=True))
    text = f"""<mujoco><worldbody>{bodies}</worldbody>
    <contact><exclude body1="a" body2="b"/></contact></mujoco>"""
    model, _ = load(tmp_path, text, weld=False)
    for name in "abcd":
        body = model.plant.GetBodyByName(name)
        model.plant.SetFreeBodyPose(model.context, body, RigidTransform())
    query = model.plant.get_geometry_query_input_port().Eval(model.context)
    name_of = {model.shapes(n)[0]: n for n in "abcd"}
    pairs = {
        "".join(sorted((name_of[h.id_A], name_of[h.id_B])))
        for h in query.ComputePointPairPenetration()
    }
    assert pairs == {"ad", "bd", "cd"}


def test_masses_are_settled_and_bounded(tmp_path):
    ball = '<geom size="0.1"/>'
    text = f"""<mujoco><compiler inertiafromgeom="true" settotalmass="10"/><worldbody>
    <body name="a">{INERTIAL}{ball}<body name="b" pos="1 0 0"><joint name="j"/>{ball}</body></body>
    </worldbody></mujoco>"""
    model, _ = load(tmp_path, text)
    masses = [model.inertia(n).get_mass() for n in "ab"]
    np.testing.assert_allclose(masses, [5, 5])
    moment = model.inertia("a").CalcRotationalInertia().CopyToFullMatrix3()
    np.testing.assert_allclose(moment, 0.4 * 5 * 0.1**2 * np.eye(3), rtol=1e-9, atol=1e-12)


def test_meshes_of_files_and_points(tmp_path):
    write_stl(tmp_path / "assets" / "box.stl", box_points((100, 200, 300), (10, 0, 0)), BOX_FACES)
    points = " ".join(f"{v:g}" for v in box_points((0.2, 0.2, 0.2)).ravel())
    text = f"""<mujoco><compiler meshdir="assets"/><default><mesh scale="0.001 0.001 0.001"/>
    </default><asset><mesh file="box.stl" refpos="0.01 0 0"/>
    <mesh name="cube" scale="1 1 1" vertex="{points}"/><mesh name="unused" file="none.stl"/></asset>
    <worldbody><body name="base_link"><geom type="mesh" mesh="box" pos="0 0 1"/></body>
    <body name="other"><freejoint/><geom mesh="cube"/></body></worldbody></mujoco>"""
    model, _ = load(tmp_path, text)
    low, high = model.extents("base_link")
    np.testing.assert_allclose([low, high], [(-0.05, -0.1, 0.85), (0.05, 0.1, 1.15)], atol=1e-6)
    assert model.inertia("base_link").get_mass() == pytest.approx(6.0, rel=1e-5)
    assert model.inertia("other").get_mass() == pytest.approx(8.0, rel=1e-9)


def test_files_are_included_with_their_lines(tmp_path):
    write(tmp_path, '<mujocoinclude><joint name="j" axis="0 1 0"/></mujocoinclude>', "part.xml")
    text = f"""<mujoco><worldbody><body name="a">{INERTIAL}<include file="part.xml"/></body>
    </worldbody></mujoco>"""
    model, _ = load(tmp_path, text)
    assert model.plant.HasJointNamed("j")
    write(tmp_path, '<mujocoinclude>\n<joint axis="0 0"/></mujocoinclude>', "part.xml")
    (tmp_path / "out").rename(tmp_path / "old")
    (finding,) = refusal(tmp_path, text).findings
    assert (finding.file, finding.line) == (str(tmp_path / "part.xml"), 2)


def body_with(inner: str) -> str:
    return f'<mujoco><worldbody><body name="a">{inner}</body></worldbody></mujoco>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (body_with('<include file="robot.xml"/>'), "includes itself"),
        (body_with('<include file="../../etc/passwd"/>'), "leaves"),
        (body_with('<include file="/etc/passwd"/>'), "leaves"),
        (body_with('<geom mesh="none"/>'), "unknown mesh"),
        (body_with('<geom type="box" size="0.1 0.1"/>'), "3 numbers"),
        (body_with('<geom type="box" size="0.1 0.1 nan"/>'), "3 numbers"),
        (body_with('<geom type="box" size="0.1 0.1 -1"/>'), "not > 0"),
        (body_with('<geom type="star"/>'), "unknown geom"),
        (body_with('<geom size="0.1" class="none"/>'), "default class"),
        (body_with('<geom size="0.1" quat="0 0 0 0"/>'), "zero"),
        (body_with(f'{INERTIAL}<joint axis="0 0 0"/>'), "axis"),
        (body_with('<body><freejoint/><geom size="1"/></body>'), "free joint"),
        (body_with('<replicate count="999999999"><geom size="0.1"/></replicate>'), "replicate"),
        ('<mujoco><compiler eulerseq="abc"/><worldbody/></mujoco>', "axes"),
        ("<mujoco><worldbody/></mujoco>", "no links"),
        ('<!DOCTYPE m [<!ENTITY a "b">]><mujoco model="&a;"/>', "entities"),
        (
            '<mujoco><compiler meshdir="../.."/><asset><mesh file="etc/passwd.stl"/></asset>'
            '<worldbody><body><geom mesh="passwd"/></body></worldbody></mujoco>',
            "leaves",
        ),
    ],
)
def test_what_cannot_be_read_is_told(tmp_path, text, said):
    assert said in str(refusal(tmp_path, text))


def test_names_that_sdf_cannot_have_twice_are_made_different(tmp_path):
    text = f"""<mujoco><worldbody><body name="arm">{INERTIAL}<joint name="arm"/>
    <site name="arm" pos="0 0 0.1"/><body name="x::y"/></body></worldbody></mujoco>"""
    model, done = load(tmp_path, text)
    assert model.plant.HasJointNamed("arm_joint")
    assert model.plant.HasFrameNamed("arm_site")
    assert len(changes(done, "frame")) >= 2


def test_what_is_shown_and_what_touches(tmp_path):
    text = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
    <body name="a"><geom size="0.1" contype="0" conaffinity="0" group="1"/><geom size="0.2"/>
    <geom size="0.3" group="3"/></body><body name="b"><geom size="0.1"/></body></worldbody>
    </mujoco>"""
    model, done = load(tmp_path, text)
    counts = {
        (n, role): len(model.shapes(n, role))
        for n in "ab"
        for role in (Role.kIllustration, Role.kProximity)
    }
    # The ball that does not touch is there to be seen, so the other is not.
    assert list(counts.values()) == [1, 2, 1, 1]
    assert any("plane" in text for text in changes(done, "dropped"))
