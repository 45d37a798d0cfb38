"""Reachability maps: Drake's forward kinematics on the same configurations, files, pictures."""

import contextlib
import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from iiwa_plant import make_iiwa
from PIL import Image
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable

from prehensile.cli.main import main
from prehensile.errors import InputError
from prehensile.kinematics.jacobians import manipulability, singular_values, task_rows
from prehensile.kinematics.reachability import (
    ReachabilityConfig,
    fibonacci_directions,
    load_map,
    reachability_map,
    save_map,
)
from prehensile.kinematics.tree import joints_that_move, tree_from_plant
from prehensile.models.registry import package_map
from prehensile.native.reachability import sample_configurations

ARRAYS = ("counts", "reached", "manipulability", "singular_value")


@pytest.fixture(scope="module")
def iiwa():
    plant = make_iiwa()
    return tree_from_plant(plant, [plant.GetFrameByName("iiwa_link_7")])


def planar(lower=-math.pi, upper=math.pi, kind="revolute"):
    """Two links of 0.5 and 0.3 m about z."""
    plant = MultibodyPlant(0.0)
    limits = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'
    if kind == "continuous":
        limits = ""
    Parser(plant).AddModelsFromString(
        f"""<robot name="r"><link name="a"/><link name="b"/><link name="tip"/>
        <joint name="j" type="{kind}"><parent link="world"/><child link="a"/>
          <axis xyz="0 0 1"/>{limits}</joint>
        <joint name="k" type="{kind}"><parent link="a"/><child link="b"/>
          <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>{limits}</joint>
        <joint name="f" type="fixed"><parent link="b"/><child link="tip"/>
          <origin xyz="0.3 0 0"/></joint></robot>""",
        "urdf",
    )
    plant.Finalize()
    return tree_from_plant(plant, [plant.GetFrameByName("tip")])


def test_drake_finds_the_same_in_the_same_configurations(iiwa):
    config = ReachabilityConfig(
        num_samples=2000, voxel_size=0.2, num_directions=26, axis=(0, 1, 1), length=0.7, seed=5
    )
    reach = reachability_map(iiwa, config)
    plant = make_iiwa()
    context = plant.CreateDefaultContext()
    F, W = plant.GetFrameByName("iiwa_link_7"), plant.world_frame()
    counts, seen = {}, {}
    best_w, best_s = {}, {}
    for q in sample_configurations(iiwa.lower, iiwa.upper, 2000, seed=5):
        plant.SetPositions(context, q)
        X_WF = F.CalcPoseInWorld(context)
        voxel = tuple(np.floor(X_WF.translation() / 0.2).astype(int) - reach.first)
        a_W = X_WF.rotation().matrix() @ [0, math.sqrt(0.5), math.sqrt(0.5)]
        J = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, F, [0, 0, 0], W, W)
        J = task_rows(J, "both", length=0.7)
        counts[voxel] = counts.get(voxel, 0) + 1
        seen.setdefault(voxel, set()).add(int(np.argmax(reach.directions @ a_W)))
        best_w[voxel] = max(best_w.get(voxel, 0), float(manipulability(J)))
        best_s[voxel] = max(best_s.get(voxel, 0), float(singular_values(J)[-1]))
    assert {tuple(map(int, at)) for at in np.argwhere(reach.counts)} == set(counts)
    index = reach.index()
    for voxel, count in counts.items():
        assert reach.counts[voxel] == count
        assert index[voxel] == pytest.approx(len(seen[voxel]) / 26)
        assert {d for d in range(26) if int(reach.reached[voxel]) >> d & 1} == seen[voxel]
        assert reach.manipulability[voxel] == pytest.approx(best_w[voxel], rel=1e-9, abs=1e-12)
        assert reach.singular_value[voxel] == pytest.approx(best_s[voxel], rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("part", ["both", "rotational", "translational"])
def test_threads_do_not_change_a_bit(iiwa, part):
    config = ReachabilityConfig(num_samples=70_000, part=part, voxel_size=0.1)
    one = reachability_map(iiwa, config)
    three = reachability_map(iiwa, config, num_threads=3)
    assert one.first == three.first
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(three, name))


def test_configurations_are_uniform_and_each_stands_alone():
    Q = sample_configurations([-1.0, 2.0], [3.0, 2.5], 100_000, seed=9, num_threads=2)
    assert (Q.min(axis=0) >= [-1, 2]).all()
    assert (Q.max(axis=0) < [3, 2.5]).all()
    u = (Q - [-1, 2]) / [4, 0.5]
    # Kolmogorov and Smirnov: 1.95 / sqrt(N) is passed by chance once in a thousand.
    for column in np.sort(u, axis=0).T:
        assert np.max(np.abs(column - np.arange(100_000) / 1e5)) < 1.95 / math.sqrt(1e5)
    assert abs(np.corrcoef(u.T)[0, 1]) < 0.012
    part = sample_configurations([-1.0, 2.0], [3.0, 2.5], 10, seed=9, first=4321)
    np.testing.assert_array_equal(part, Q[4321:4331])
    other = sample_configurations([-1.0, 2.0], [3.0, 2.5], 10, seed=10)
    assert not np.isin(other, Q[:10]).any()


def test_planar_arm_reaches_its_ring():
    """Between 0.2 and 0.8 m, in the plane z = 0; its manipulability is l1 l2 at best."""
    reach = reachability_map(
        planar(), ReachabilityConfig(num_samples=400_000, voxel_size=0.02, part="translational")
    )
    p_WVs, _ = reach.occupied()
    r = np.linalg.norm(p_WVs[:, :2], axis=1)
    diagonal = 0.02 / math.sqrt(2)
    assert 0.2 - diagonal < r.min() < 0.2 + diagonal
    assert 0.8 - diagonal < r.max() < 0.8 + diagonal
    assert reach.counts.shape[2] == 1
    area = reach.volume() / 0.02
    assert area == pytest.approx(math.pi * (0.8**2 - 0.2**2), rel=0.05)
    # The translational rows have rank 2 of 3: nothing in space.
    assert reach.manipulability.max() == 0
    # The tip's z stays up: one direction of them all.
    assert np.unique(reach.reached[reach.counts > 0]).size == 1
    up = int(np.argmax(reach.directions[:, 2]))
    assert reach.reached.max() == 1 << up


def test_what_keep_refuses_does_not_count():
    left = reachability_map(
        planar(), ReachabilityConfig(num_samples=10_000), keep=lambda Q: Q[:, 0] > 0
    )
    Q = sample_configurations([-math.pi] * 2, [math.pi] * 2, 10_000, seed=0)
    assert left.num_samples == np.count_nonzero(Q[:, 0] > 0)
    assert left.counts.sum() == left.num_samples
    nothing = reachability_map(
        planar(), ReachabilityConfig(num_samples=10), keep=lambda Q: np.zeros(len(Q), bool)
    )
    assert (nothing.num_samples, nothing.volume()) == (0, 0)


def test_progress_goes_up_to_the_number_of_samples():
    done = []
    reachability_map(planar(), ReachabilityConfig(num_samples=200_001), on_progress=done.append)
    assert len(done) > 2
    assert done == sorted(set(done))
    assert done[-1] == 200_001


def test_joints_without_limits():
    ring = reachability_map(planar(kind="continuous"), ReachabilityConfig(num_samples=20_000))
    same = reachability_map(planar(), ReachabilityConfig(num_samples=20_000))
    np.testing.assert_array_equal(ring.counts, same.counts)
    free = dataclasses.replace(planar(), upper=np.full(2, np.inf), prismatic=np.array([True, True]))
    with pytest.raises(ValueError, match="^compiled: .*no limits"):
        reachability_map(free)


def test_a_prismatic_joint_and_a_map_far_from_the_origin():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(
        """<robot name="r"><link name="a"/>
        <joint name="j" type="prismatic"><parent link="world"/><child link="a"/>
          <origin xyz="-70.02 3 5"/><axis xyz="0 0 -1"/>
          <limit lower="-0.5" upper="2" effort="1" velocity="1"/></joint></robot>""",
        "urdf",
    )
    plant.Finalize()
    rail = tree_from_plant(plant, [plant.GetFrameByName("a")])
    reach = reachability_map(rail, ReachabilityConfig(num_samples=5000, voxel_size=0.1))
    x, y, z = reach.centers()
    np.testing.assert_allclose((x, y), [[-70.05], [3.05]])
    assert (z[0], z[-1]) == pytest.approx((3.05, 5.45))
    at, inside = reach.elements([[-70.02, 3.01, 4.0], [0, 0, 0]])
    assert inside.tolist() == [True, False]
    assert reach.counts[tuple(at[0])] > 100


def test_directions_are_spread_evenly():
    for count in (1, 2, 26, 64):
        u = fibonacci_directions(count)
        np.testing.assert_allclose(np.linalg.norm(u, axis=1), 1.0)
    random = np.random.default_rng(0).normal(size=(20_000, 3))
    nearest = np.argmax(random @ u.T, axis=1)
    share = np.bincount(nearest, minlength=64) / 20_000
    assert share.min() > 0.7 / 64
    assert share.max() < 1.4 / 64


def test_only_the_joints_on_the_way_move_a_frame():
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    for model in ("iiwa7", "wsg50"):
        parser.AddModels(url=f"package://prehensile/{model}/{model}.sdf")
    plant.WeldFrames(plant.GetFrameByName("iiwa_link_7"), plant.GetFrameByName("body"))
    plant.Finalize()
    names = [joint.name() for joint in joints_that_move(plant, plant.GetFrameByName("body"))]
    assert names == [f"iiwa_joint_{i}" for i in range(1, 8)]
    assert joints_that_move(plant, plant.world_frame()) == []
    assert len(joints_that_move(plant, plant.GetFrameByName("left_finger"))) == 8


@pytest.fixture(scope="module")
def small(iiwa):
    return reachability_map(iiwa, ReachabilityConfig(num_samples=5000, voxel_size=0.1))


def test_a_saved_map_comes_back(small, tmp_path):
    path = tmp_path / "folder" / "map.npz"
    save_map(path, small)
    back = load_map(path)
    for field in dataclasses.fields(small):
        np.testing.assert_array_equal(getattr(back, field.name), getattr(small, field.name))
    assert [p.name for p in path.parent.iterdir()] == ["map.npz"]


def changed(small, **values):
    """The arrays of a map's file, with some of them changed or (None) left out."""
    arrays = {field.name: getattr(small, field.name) for field in dataclasses.fields(small)}
    return {name: value for name, value in (arrays | values).items() if value is not None}


@pytest.mark.parametrize(
    "values",
    [
        {"counts": None},
        {"counts": np.zeros((2, 2, 2), np.uint32)},
        {"reached": "text"},
        {"voxel_size": -1.0},
        {"voxel_size": np.nan},
        {"voxel_size": np.array([0.1])},
        {"first": np.array([0.5, 0, 0])},
        {"directions": np.ones((3, 3))},
        {"directions": np.zeros((0, 3))},
        {"num_samples": 7},
        {"frame": np.array([1.0])},
        {"directions": fibonacci_directions(5)},
        {"counts": np.array([object()])},
    ],
    ids=lambda values: next(iter(values)),
)
def test_files_that_are_no_maps_are_refused(small, tmp_path, values):
    path = tmp_path / "map.npz"
    np.savez(path, **changed(small, **values))
    with pytest.raises(InputError, match=r"map\.npz: "):
        load_map(path)


def test_damaged_files_are_refused(small, tmp_path):
    path = tmp_path / "map.npz"
    save_map(path, small)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(40):
        data = bytearray(whole)
        for at in rng.integers(len(data), size=3):
            data[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(data if rng.random() < 0.7 else data[: rng.integers(len(data))])
        with contextlib.suppress(InputError):  # And nothing else; an unread byte may be hit.
            load_map(path)
    with pytest.raises(InputError, match="no such file"):
        load_map(tmp_path / "none.npz")


@pytest.mark.parametrize(
    ("values", "argument"),
    [
        ({"num_samples": 0}, "num_samples"),
        ({"num_samples": math.nan}, "num_samples"),
        ({"num_directions": 3.5}, "num_directions"),
        ({"axis": (0.0, 1.0)}, "axis"),
        ({"voxel_size": 0.0}, "voxel_size"),
        ({"voxel_size": math.nan}, "voxel_size"),
        ({"num_directions": 65}, "num_directions"),
        ({"axis": (0.0, 0.0, 0.0)}, "axis"),
        ({"part": "all"}, "part"),
        ({"length": math.inf}, "length"),
        ({"seed": -1}, "seed"),
    ],
)
def test_bad_configurations_name_the_field(values, argument):
    with pytest.raises(ValueError, match=f"^{argument}: "):
        ReachabilityConfig(**values)


def test_bad_arguments_are_named(iiwa):
    with pytest.raises(ValueError, match="^frame: "):
        reachability_map(iiwa, frame=1)
    with pytest.raises(ValueError, match="^voxel_size: "):
        reachability_map(iiwa, ReachabilityConfig(voxel_size=1e-4))
    with pytest.raises(ValueError, match="^num_threads: "):
        reachability_map(iiwa, num_threads=0)
    few = ReachabilityConfig(num_samples=10)
    for kept in (np.ones(3, bool), np.ones(10)):
        with pytest.raises(ValueError, match="^keep: "):
            reachability_map(iiwa, few, keep=lambda Q, kept=kept: kept)
    with pytest.raises(ValueError, match="^p_WPs: "):
        reachability_map(iiwa, few).elements(np.zeros(6))
    with pytest.raises(ValueError, match="^count: "):
        fibonacci_directions(0)
    with pytest.raises(ValueError, match="^upper: "):
        sample_configurations([0.0], [-1.0], 1, seed=0)


def test_command_makes_and_shows_maps(tmp_path: Path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["reach", "iiwa7", "--samples", "3e3", "--voxel", "0.1"]) == 0
    assert "iiwa7_reach.npz" in capsys.readouterr().out
    reach = load_map(tmp_path / "iiwa7_reach.npz")
    assert (reach.frame, reach.num_samples) == ("iiwa_link_7", 3000)
    picture = tmp_path / "picture.png"
    assert main(["reach", "iiwa7_reach.npz", "--picture", str(picture), "--value", "count"]) == 0
    colors = np.asarray(Image.open(picture).convert("RGB")).reshape(-1, 3)
    assert len(np.unique(colors, axis=0)) > 50  # From the dark to the bright end of the scale.
    arguments = ["iiwa7_reach.npz", "--view", "--no-browser", "--duration", "0.2"]
    assert main(["reach", *arguments]) == 0
    assert "look at http://localhost" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["iiwa7", "--frame", "iiwa_link_77"], "did you mean"),
        (["iiwa7", "--frame", "iiwa_link_0"], "no joint moves"),
        (["wsg50"], "there is no single last link"),
        (["iiwa7", "--samples", "0"], "--samples"),
        (["iiwa7", "--voxel", "0"], "voxel_size"),
        (["iiwa7", "--threads", "0"], "--threads"),
        (["iiwa7", "-o", "map.txt"], "does not end in .npz"),
        (["nothing.npz"], "no such file"),
        (["nothing.npz", "--at", "nan", "0"], "--at"),
        (["iiwa7", "--samples", "10", "-o", f"{__file__}/map.npz"], f"{__file__}"),
        (["iiwa77"], "iiwa7"),
    ],
)
def test_command_refuses_in_words(arguments, message, capsys):
    assert main(["reach", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
