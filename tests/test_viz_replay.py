"""Replays: complete files, nothing fetched, and in a real browser something moves."""

import base64
import gzip
import io
import json
import re
from pathlib import Path

import browser
import numpy as np
import pytest
from PIL import Image
from pydrake.geometry import (
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
)
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from prehensile.errors import InputError
from prehensile.viz.meshcat import start_meshcat
from prehensile.viz.replay import Recorder, pack_page

# A cube that slides 1 m/s along y, without gravity.
_SDF = """<sdf version="1.7"><model name="sled"><link name="cube">
<inertial><mass>1</mass></inertial>
<visual name="v"><geometry><mesh><uri>{mesh}</uri></mesh></geometry></visual>
</link></model></sdf>"""


def write_textured_quad(path: Path) -> None:
    """A 0.4 m square in the yz plane, seen from both sides, with a red embedded texture."""
    corners = np.array([[0, -0.2, -0.2], [0, 0.2, -0.2], [0, 0.2, 0.2], [0, -0.2, 0.2]], np.float32)
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    triangles = np.array([0, 1, 2, 0, 2, 3, 0, 2, 1, 0, 3, 2], np.uint16)
    # glTF is y up and Drake z up: (x, y, z) of Drake is (x, z, -y) of the file.
    corners = np.stack([corners[:, 0], corners[:, 2], -corners[:, 1]], axis=1)
    blob = corners.tobytes() + uvs.tobytes() + triangles.tobytes()
    texture = io.BytesIO()
    Image.new("RGB", (8, 8), (255, 0, 0)).save(texture, format="PNG")

    def uri(kind: str, data: bytes) -> str:
        return f"data:{kind};base64,{base64.b64encode(data).decode()}"

    path.write_text(
        json.dumps(
            {
                "asset": {"version": "2.0"},
                "scene": 0,
                "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0}],
                "meshes": [
                    {
                        "primitives": [
                            {
                                "attributes": {"POSITION": 0, "TEXCOORD_0": 1},
                                "indices": 2,
                                "material": 0,
                            }
                        ]
                    }
                ],
                "materials": [
                    {
                        "pbrMetallicRoughness": {
                            "baseColorTexture": {"index": 0},
                            "metallicFactor": 0,
                        },
                        "emissiveTexture": {"index": 0},
                        "emissiveFactor": [1, 1, 1],
                    }
                ],
                "textures": [{"source": 0}],
                "images": [{"uri": uri("image/png", texture.getvalue())}],
                "buffers": [
                    {"byteLength": len(blob), "uri": uri("application/octet-stream", blob)}
                ],
                "bufferViews": [
                    {"buffer": 0, "byteOffset": 0, "byteLength": 48},
                    {"buffer": 0, "byteOffset": 48, "byteLength": 32},
                    {"buffer": 0, "byteOffset": 80, "byteLength": 24},
                ],
                "accessors": [
                    {
                        "bufferView": 0,
                        "componentType": 5126,
                        "count": 4,
                        "type": "VEC3",
                        "min": corners.min(axis=0).tolist(),
                        "max": corners.max(axis=0).tolist(),
                    },
                    {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
                    {"bufferView": 2, "componentType": 5123, "count": 12, "type": "SCALAR"},
                ],
            }
        )
    )


def sliding_station(folder: Path, meshcat: Meshcat) -> Simulator:
    """A textured square that slides along y at 0.5 m/s from y = -0.5 on."""
    mesh = folder / "quad.gltf"
    write_textured_quad(mesh)
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.01)
    Parser(plant).AddModelsFromString(_SDF.format(mesh=mesh.as_uri()), "sdf")
    plant.gravity_field().set_gravity_vector([0, 0, 0])
    plant.Finalize()
    MeshcatVisualizer.AddToBuilder(
        builder, scene_graph, meshcat, MeshcatVisualizerParams(publish_period=1 / 32)
    )
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(context, [1, 0, 0, 0, 0.4, -0.5, 0.3])
    plant.SetVelocities(context, [0, 0, 0, 0, 0.5, 0])
    return simulator


def unpack(page: str) -> str:
    packed = re.search(r'const packed = "([A-Za-z0-9+/=]+)"', page)
    assert packed is not None
    return gzip.decompress(base64.b64decode(packed.group(1))).decode()


def test_pack_page_round_trip_and_repeatable() -> None:
    html = "<html>" + "ü{}" * 10_000 + "</html>"
    page = pack_page(html)
    assert unpack(page) == html
    assert len(page) < len(html) / 10
    assert page == pack_page(html)


def test_replay_holds_the_motion_and_the_texture(tmp_path: Path) -> None:
    meshcat = start_meshcat()
    simulator = sliding_station(tmp_path, meshcat)
    with Recorder(meshcat, tmp_path / "replay.html"):
        simulator.AdvanceTo(2.0)
    html = unpack((tmp_path / "replay.html").read_text())
    assert "quad.gltf" in html, "the mesh is inside"
    messages = map(base64.b64decode, re.findall(r"base64,([A-Za-z0-9+/=]+)", html))
    (recording,) = (m for m in messages if b"set_animation" in m)
    # Two seconds: a key of position and one of orientation at frames 0 to 64.
    assert recording.count(b"\xa4time") == pytest.approx(2 * 65, abs=2)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["quad.gltf", "replay.html"]


def test_interrupt_leaves_a_partial_replay(tmp_path: Path) -> None:
    meshcat = start_meshcat()
    simulator = sliding_station(tmp_path, meshcat)
    path = tmp_path / "replay.html"

    def interrupted_run() -> None:
        with Recorder(meshcat, path):
            simulator.AdvanceTo(0.5)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted_run()
    assert "quad.gltf" in unpack(path.read_text())


def test_path_is_checked_before_the_run(tmp_path: Path) -> None:
    meshcat = start_meshcat()
    with pytest.raises(InputError, match="is a folder"):
        Recorder(meshcat, tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        Recorder(meshcat, tmp_path / "file" / "replay.html")


@pytest.mark.slow
@pytest.mark.skipif(browser.CHROMIUM is None, reason="needs Chromium")
def test_replay_moves_in_a_browser_without_network(tmp_path: Path) -> None:
    meshcat = start_meshcat()
    meshcat.SetCameraPose([3.0, 0, 0.3], [0, 0, 0.3])
    simulator = sliding_station(tmp_path, meshcat)
    path = tmp_path / "replay.html"
    with Recorder(meshcat, path):
        simulator.AdvanceTo(4.0)
    (tmp_path / "quad.gltf").unlink()
    del meshcat

    def red_at(page: browser.Browser) -> float | None:
        image = page.screenshot(tmp_path / "page.png").astype(int)
        _, columns = np.nonzero(image[:, :, 0] > image[:, :, 2] + 80)
        return float(columns.mean()) if columns.size > 200 else None

    with browser.Browser(path.as_uri()) as page:
        page.call("Network.emulateNetworkConditions", offline=True, latency=0,
                  downloadThroughput=0, uploadThroughput=0)  # fmt: skip
        page.wait_for("typeof viewer !== 'undefined'")
        places: list[float] = []
        for _ in range(60):
            place = red_at(page)
            if place is not None:
                places.append(place)
            if places and max(places) - min(places) > 50:
                break
        assert places, "the textured square is in view"
        assert max(places) - min(places) > 50, "it moves"
        assert not page.errors
        outside = [u for u in page.requests if not u.startswith(("file:", "data:", "blob:"))]
        assert not outside, "nothing is fetched"
