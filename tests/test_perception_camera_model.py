"""Cameras: their rays against librealsense's formulas written out, and against Drake's camera."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.sensors import CameraInfo

from prehensile.errors import InputError
from prehensile.perception import CameraModel, Distortion

# As large as the distortion of a D455's colour camera.
LENS = (-0.057, 0.067, -0.0008, 0.0006, -0.021)
CAMERA = CameraModel(640, 480, 382.0, 381.0, 321.5, 238.7)
LENSES = [Distortion.BROWN_CONRADY, Distortion.MODIFIED_BROWN_CONRADY]
LENSES += [Distortion.INVERSE_BROWN_CONRADY]


def imaged(model: Distortion, x: float, y: float) -> tuple[float, float]:
    """The slopes at which a ray is imaged, as librealsense's documentation has it."""
    k1, k2, p1, p2, k3 = LENS
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    s, t = (x, y) if model is Distortion.BROWN_CONRADY else (x * radial, y * radial)
    return (
        x * radial + 2 * p1 * s * t + p2 * (r2 + 2 * s**2),
        y * radial + 2 * p2 * s * t + p1 * (r2 + 2 * t**2),
    )


@pytest.mark.parametrize("model", LENSES)
@settings(max_examples=30, deadline=None)
@given(x=st.floats(-0.8, 0.8), y=st.floats(-0.6, 0.6), z=st.floats(0.1, 5.0))
def test_projection_is_the_written_out_formula(
    model: Distortion, x: float, y: float, z: float
) -> None:
    camera = dc.replace(CAMERA, distortion=model, coefficients=LENS)
    a, b = imaged(model, x, y)
    expected = [382.0 * a + 321.5, 381.0 * b + 238.7]
    np.testing.assert_allclose(camera.project([x * z, y * z, z]), expected, rtol=1e-12)
    # ... and the way back.
    np.testing.assert_allclose(camera.unproject(expected, z), [x * z, y * z, z], atol=1e-10)


def test_a_small_known_value() -> None:
    # By hand: k1 = 0.1 alone at x = 0.5, y = 0: 0.5 (1 + 0.1 * 0.25) = 0.5125.
    camera = CameraModel(2, 2, 100.0, 100.0, 0.0, 0.0, Distortion.BROWN_CONRADY, (0.1, 0, 0, 0, 0))
    np.testing.assert_allclose(camera.project([0.5, 0.0, 1.0]), [51.25, 0.0])
    np.testing.assert_allclose(camera.unproject([51.25, 0.0], 2.0), [1.0, 0.0, 2.0])


@pytest.mark.parametrize("model", [Distortion.NONE, *LENSES])
def test_rays_of_all_pixels_go_back_to_them(model: Distortion) -> None:
    coefficients = (0.0,) * 5 if model is Distortion.NONE else LENS
    camera = dc.replace(CAMERA, distortion=model, coefficients=coefficients)
    rays = camera.rays
    assert rays.shape == (2, 480, 640)
    assert rays.dtype == np.float32
    p = np.stack([*rays.astype(float), np.ones((480, 640))], axis=-1)
    v, u = np.mgrid[0:480, 0:640]
    np.testing.assert_allclose(camera.project(p), np.stack([u, v], axis=-1), atol=2e-4)


def test_the_pinhole_is_that_of_K_and_of_drake() -> None:
    info = CameraInfo(width=320, height=200, focal_x=300.0, focal_y=290.0, center_x=155, center_y=9)
    camera = CameraModel.from_drake(info)
    np.testing.assert_array_equal(camera.K, info.intrinsic_matrix())
    assert camera == CameraModel.from_K(info.intrinsic_matrix(), 320, 200)
    p = np.array([[0.1, -0.2, 0.9], [0.0, 0.3, 2.0]])
    image = p @ info.intrinsic_matrix().T
    np.testing.assert_allclose(camera.project(p), image[:, :2] / image[:, 2:])


def test_a_lens_without_coefficients_is_a_pinhole() -> None:
    assert dc.replace(CAMERA, distortion="brown_conrady") == CAMERA


def test_what_is_behind_the_camera_is_nowhere() -> None:
    assert np.isnan(CAMERA.project([[0.1, 0.1, -1.0], [0.1, 0.1, 0.0]])).all()


def test_pixels_that_no_ray_reaches_have_none() -> None:
    # With k1 = -0.3, x (1 - 0.3 x^2) is 0.70 at most, at x = 1.05.
    camera = CameraModel(2, 2, 100.0, 100.0, 0.0, 0.0, Distortion.BROWN_CONRADY, (-0.3, 0, 0, 0, 0))
    assert np.isnan(camera.unproject([80.0, 0.0])[:2]).all()
    assert np.isfinite(camera.unproject([65.0, 0.0])).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "width"),
        ({"height": 2.5}, "height"),
        ({"fx": -1.0}, "fx"),
        ({"fy": np.nan}, "fy"),
        ({"cx": np.inf}, "cx"),
        ({"coefficients": (1.0, 2.0)}, "coefficients"),
        ({"coefficients": (np.nan, 0, 0, 0, 0)}, "coefficients"),
        ({"distortion": "fisheye"}, "'fisheye' is unknown; there are none, brown_conrady"),
    ],
)
def test_wrong_numbers_are_named(change: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        dc.replace(CAMERA, **change)


def test_wrong_shapes_are_named() -> None:
    with pytest.raises(InputError, match="skew"):
        CameraModel.from_K(np.eye(3) + np.eye(3, k=1), 2, 2)
    with pytest.raises(InputError, match="K has shape"):
        CameraModel.from_K(np.eye(4), 2, 2)
    with pytest.raises(InputError, match="p_C"):
        CAMERA.project([1.0, 2.0])
    with pytest.raises(InputError, match="pixels"):
        CAMERA.unproject([1.0, 2.0, 3.0])
