"""Noise of depth cameras: against the model that it states, and in a station."""

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.sensors import ImageDepth32F
from scipy.special import ndtr

from prehensile.errors import InputError
from prehensile.perception.depth_noise import (
    DepthNoiseConfig,
    add_depth_noise,
    axial_sigma,
    incidence,
)
from prehensile.perception.depth_noise_system import DepthNoise
from prehensile.station import build, load_scenario

H, W = 240, 320
K = np.array([[600.0, 0, 160], [0, 600.0, 120], [0, 0, 1]])
# Nothing but the noise of the disparity.
BARE = DepthNoiseConfig(
    disparity_step=0, edge_jitter=0, flying_probability=0, edge_missed=0, missed=0
)
BAND = 70  # columns on the left that the right imager may not see


def measure(depth, config=BARE, seed=0, color=None):
    return add_depth_noise(depth, K, config, np.random.default_rng(seed), color)


def plane(z):
    return np.full((H, W), z, dtype=np.float32)


def test_the_noise_grows_with_the_square_of_the_range():
    ranges = np.array([0.6, 0.8, 1.0, 1.2, 1.4])
    sigma = []
    for z in ranges:
        errors = [measure(plane(z), seed=seed)[:, BAND:] - z for seed in range(3)]
        sigma.append(np.std(errors))
        assert abs(np.mean(errors)) < 0.03 * sigma[-1] + z * 1e-4
    exponent, _ = np.polyfit(np.log(ranges), np.log(sigma), 1)
    assert exponent == pytest.approx(2.0, abs=0.06)
    # 0.08 pixels at 1 m, focal length 600 and baseline 55 mm: 2.4 mm.
    assert sigma[2] == pytest.approx(0.08 / (600 * 0.055), rel=0.04)
    np.testing.assert_allclose(axial_sigma(ranges, K, BARE), sigma, rtol=0.05)


def test_neighbours_err_together_within_the_matching_window():
    noise = measure(plane(1.0))[:, BAND:] - 1.0

    def correlation(shift):
        return np.corrcoef(noise[:, shift:].ravel(), noise[:, : noise.shape[1] - shift].ravel())[
            0, 1
        ]

    # Windows of 5 x 5 that lie k columns apart share (5 - k) / 5 of their pixels.
    for k in range(6):
        assert correlation(k) == pytest.approx((5 - k) / 5, abs=0.04)


def test_disparities_come_in_steps():
    measured = measure(plane(0.9), DepthNoiseConfig(missed=0))[:, BAND:]
    steps = 600 * 0.055 / measured * 32
    np.testing.assert_allclose(steps, np.rint(steps), atol=2e-3)
    assert len(np.unique(np.rint(steps))) > 5


@pytest.mark.parametrize("degrees", [60, 74, 78, 82])
def test_returns_are_missed_at_grazing_angles(degrees):
    # A plane turned about the image's horizontal axis: n = (0, sin, -cos), through (0, 0, 0.6).
    tilt = np.deg2rad(degrees)
    v, u = np.mgrid[:H, :W]
    rays = np.stack([(u - 160) / 600, (v - 120) / 600, np.ones((H, W))], axis=-1)
    n = np.array([0, np.sin(tilt), -np.cos(tilt)])
    with np.errstate(divide="ignore"):
        depth = -0.6 * np.cos(tilt) / (rays @ n)
    cosine = -(rays @ n) / np.linalg.norm(rays, axis=-1)
    angle = np.arccos(cosine)
    seen = (depth > 0.35) & (depth < 1.3)
    np.testing.assert_allclose(incidence(1 / depth, K)[seen], angle[seen], atol=2e-3)
    wanted = ndtr((angle - BARE.grazing_angle) / BARE.grazing_spread)
    at = seen & (u > 100)
    missed = np.mean([measure(depth.astype(np.float32), seed=s)[at] == 0 for s in range(4)])
    assert missed == pytest.approx(wanted[at].mean(), abs=0.02)


def test_the_right_imager_does_not_see_beside_the_left_edge_of_what_is_near():
    depth = plane(1.2)
    depth[60:180, 200:260] = 0.6
    missed = measure(depth) == 0
    width = 600 * 0.055 * (1 / 0.6 - 1 / 1.2)
    rows = missed[70:170]
    assert np.all(rows[:, int(202 - width) : 199])
    assert not rows[:, BAND : int(198 - width)].any()
    assert not rows[:, 201:].any()
    assert not missed[:55, BAND:].any()
    # Nor what would lie left of its image: columns up to the disparity.
    assert np.all(missed[:, : int(600 * 0.055 / 1.2) - 1])
    assert not missed[200:, int(600 * 0.055 / 1.2) + 2 :].any()


def test_beyond_its_range_it_says_too_near_or_too_far():
    for z, wanted in ((0.2, 0.0), (0.0, 0.0), (2.0, np.inf), (np.inf, np.inf)):
        measured = measure(plane(z))
        assert np.all(measured[:, 250:] == wanted)
    # Missed is 0, "nothing is known", even where the truth is too far.
    half = measure(plane(2.0), DepthNoiseConfig(missed=0.5))
    assert np.mean(half[:, BAND:] == 0) == pytest.approx(0.5, abs=0.03)
    assert np.all(np.isinf(half[half != 0]))


def test_dark_and_glaring_pixels_are_missed():
    color = np.full((H, W, 4), 128, dtype=np.uint8)
    color[:80, :, :3] = 0
    color[160:, :, :3] = 255
    missed = (measure(plane(1.0), color=color) == 0)[:, BAND:]
    assert missed[:80].mean() == pytest.approx(ndtr(BARE.dark_level / BARE.dark_spread), abs=0.02)
    assert not missed[80:160].any()
    glare = ndtr((1 - BARE.glare_level) / BARE.glare_spread)
    assert missed[160:].mean() == pytest.approx(glare, abs=0.02)


def test_pixels_fly_only_beside_edges():
    depth = plane(1.2)
    depth[:, 200:] = 0.7  # its shadow ends at column 200
    config = DepthNoiseConfig(disparity_noise=0, edge_jitter=0, edge_missed=0, missed=0)
    measured = measure(depth, config)
    flying = (measured > 0.71) & (measured < 1.19)
    assert not flying[:, :199].any()
    assert not flying[:, 201:].any()
    # One of both pixels at the edge flies in a share of rows; in half of these it is the near one.
    assert flying[:, 200].mean() == pytest.approx(0.5 * config.flying_probability, abs=0.08)


def test_edges_are_ragged():
    depth = plane(1.2)
    depth[100:, :] = 0.7
    config = DepthNoiseConfig(edge_missed=0, flying_probability=0, missed=0)
    near = measure(depth, config)[:, BAND:] < 0.9
    first = np.argmax(near, axis=0)
    assert first.std() == pytest.approx(config.edge_jitter, rel=0.5)
    assert abs(first.mean() - 100) < 0.5


def test_the_same_seed_gives_the_same_image_and_the_truth_is_left_alone():
    depth = plane(0.9)
    a, b, c = (measure(depth, DepthNoiseConfig(), seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert np.mean(a != c) > 0.5
    assert np.all(depth == np.float32(0.9))
    assert a.dtype == np.float32


@pytest.mark.parametrize(
    ("depth", "intrinsics", "color", "word"),
    [
        (np.ones(5), K, None, "depth"),
        (np.ones((4, 5)), K[:2], None, "K"),
        (np.ones((4, 5)), np.diag([np.nan, 1, 1]), None, "K"),
        (np.ones((4, 5)), K, np.zeros((5, 4, 3), np.uint8), "color"),
    ],
)
def test_bad_input_is_named(depth, intrinsics, color, word):
    with pytest.raises(InputError, match=word):
        add_depth_noise(depth, intrinsics, BARE, np.random.default_rng(0), color)


def test_nothing_to_see_is_no_error():
    for value in (0.0, np.inf, np.nan):
        measured = measure(plane(value), DepthNoiseConfig())
        assert not np.isnan(measured).any()
        assert set(np.unique(measured)) <= {0.0, np.inf}


def test_the_system_gives_the_same_noise_at_the_same_time():
    system = DepthNoise(K, DepthNoiseConfig())
    image = ImageDepth32F(W, H)
    image.mutable_data[:] = 0.8

    def at(time):
        context = system.CreateDefaultContext()
        system.get_input_port(0).FixValue(context, AbstractValue.Make(image))
        context.SetTime(time)
        return system.get_output_port().Eval(context).data.copy()

    np.testing.assert_array_equal(at(0.1), at(0.1))
    assert np.mean(at(0.1) != at(0.2)) > 0.5
    rng = np.random.default_rng([0, 100_000])
    wanted = add_depth_noise(image.data[:, :, 0], K, DepthNoiseConfig(), rng)
    np.testing.assert_array_equal(at(0.1)[:, :, 0], wanted)


def test_a_station_shows_noisy_images_and_the_true_one_as_a_cheat():
    noisy = build(load_scenario("two_bins", data="depth_noise: {camera1: {seed: 4}}"))
    context = noisy.CreateDefaultContext()

    def image(name):
        return noisy.GetOutputPort(name).Eval(context).data[:, :, 0].copy()

    true, measured = image("cheat.camera1.depth_image"), image("camera1.depth_image")
    assert np.all(true > 0)
    both = (measured > 0) & np.isfinite(measured)
    assert 0.4 < both.mean() < 0.99
    error = np.abs(measured[both] - true[both])
    sigma = axial_sigma(1.0, np.diag([615.0, 615, 1]), DepthNoiseConfig())
    assert 0.3 * sigma < np.median(error) < 1.5 * sigma
    # The point cloud is made of the measured image.
    points = noisy.GetOutputPort("camera1.point_cloud").Eval(context).xyzs().T
    X_WC = noisy.GetOutputPort("camera1.X_WC").Eval(context)
    z = X_WC.inverse().multiply(points.T)[2].reshape(measured.shape)
    np.testing.assert_allclose(z[both], measured[both], atol=1e-5)
    # Another time is another frame; the other cameras stay ideal.
    context.SetTime(0.1)
    assert np.mean(image("camera1.depth_image") != measured) > 0.5
    np.testing.assert_array_equal(image("cheat.camera1.depth_image"), true)
    assert not noisy.HasOutputPort("cheat.camera0.depth_image")
    plain = build(load_scenario("two_bins"))
    wanted = plain.GetOutputPort("camera0.depth_image").Eval(plain.CreateDefaultContext()).data
    np.testing.assert_array_equal(image("camera0.depth_image"), wanted[:, :, 0])


def test_a_scenario_says_what_is_wrong_with_its_noise():
    text = "depth_noise: {camera9: {seed: -3}, camera0: {min_depth: 2.0, baseline: nought}}"
    with pytest.raises(InputError) as error:
        load_scenario("two_bins", data=text)
    for word in ("camera9", "seed", "min_depth", "max_depth", "baseline"):
        assert word in str(error.value)
