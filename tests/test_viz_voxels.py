"""Voxels drawn as cubes and as slices."""

import numpy as np
import pytest
from pydrake.geometry import Meshcat

from prehensile.viz.voxels import draw_voxels, plot_slices


class Page:
    """Keeps what is put on a page, which Meshcat does not give back."""

    def __init__(self):
        self.meshes = {}
        self.real = Meshcat()

    def Delete(self, path):
        self.meshes = {k: v for k, v in self.meshes.items() if not k.startswith(path)}

    def SetObject(self, path, mesh, color):
        self.real.SetObject(path, mesh, color)
        self.meshes[path] = mesh


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_cubes_close_to_the_volume_they_stand_for(share):
    """By the divergence theorem: holds if every outer face is there, turned outward, and once."""
    rng = np.random.default_rng(0)
    values = np.where(rng.random((5, 6, 7)) < share, rng.random((5, 6, 7)), np.nan)
    page = Page()
    draw_voxels(page, "v", values, (-3, 10, 2), 0.1)  # pyright: ignore[reportArgumentType]
    corners = np.concatenate(
        [
            np.array(mesh.vertices())[[triangle.vertex(i) for i in range(3)]]
            for mesh in page.meshes.values()
            for triangle in mesh.triangles()
        ]
    ).reshape(-1, 3, 3)
    volume = np.linalg.det(corners).sum() / 6
    assert volume == pytest.approx(0.001 * np.isfinite(values).sum())
    present = np.argwhere(np.isfinite(values)) + (-3, 10, 2)
    np.testing.assert_allclose(corners.min(axis=(0, 1)), 0.1 * present.min(axis=0))
    np.testing.assert_allclose(corners.max(axis=(0, 1)), 0.1 * (present.max(axis=0) + 1))


def test_drawing_again_replaces_what_was_there():
    page = Page()
    values = np.linspace(0, 1, 27).reshape(3, 3, 3)
    draw_voxels(page, "v", values, (0, 0, 0), 1.0)  # pyright: ignore[reportArgumentType]
    assert len(page.meshes) > 5
    draw_voxels(page, "v", np.full((1, 1, 1), np.nan), (0, 0, 0), 1.0)  # pyright: ignore
    assert not page.meshes


def test_slices_show_the_voxels_at_the_cut():
    values = np.arange(24.0).reshape(2, 3, 4)
    figure = plot_slices(values, (-1, 2, 0), 0.5, label="n", at=(1.7, 1.2))
    upright, level = figure.axes[:2]
    # y = 1.7 is in voxel 3, the second of those from 2 on; z = 1.2 in voxel 2.
    np.testing.assert_array_equal(upright.get_images()[0].get_array(), values[:, 1, :].T)
    np.testing.assert_array_equal(level.get_images()[0].get_array(), values[:, :, 2].T)
    assert tuple(upright.get_images()[0].get_extent()) == (-0.5, 0.5, 0.0, 2.0)
    assert tuple(level.get_images()[0].get_extent()) == (-0.5, 0.5, 1.0, 2.5)
    outside = plot_slices(values, (-1, 2, 0), 0.5, label="n", at=(-9, 99))
    np.testing.assert_array_equal(outside.axes[0].get_images()[0].get_array(), values[:, 0, :].T)


def test_values_must_be_a_box():
    with pytest.raises(ValueError, match="^values: "):
        plot_slices(np.zeros((2, 2)), (0, 0, 0), 1.0, label="")
    with pytest.raises(ValueError, match="^values: "):
        plot_slices(np.zeros((0, 2, 2)), (0, 0, 0), 1.0, label="")
    with pytest.raises(ValueError, match="^voxel_size: "):
        plot_slices(np.zeros((2, 2, 2)), (0, 0, 0), 0.0, label="")
    with pytest.raises(ValueError, match="^at: "):
        plot_slices(np.zeros((2, 2, 2)), (0, 0, 0), 1.0, label="", at=(np.nan, 0.0))
