"""Depth images as an active stereo camera like Intel's RealSense D415 returns them.

Such a camera matches a window of its left imager's picture against its right one's, and measures
the disparity d = f b / z (f focal length in pixels, b baseline). All that it gets wrong it gets
wrong there:

- the disparity is off by a fraction of a pixel, so the depth by sigma_d z^2 / (f b); neighbours
  whose windows overlap err together, and the result comes in steps of 1/32 of a pixel;
- a window that lies across an edge takes either side of it, or a depth between both that nothing
  is at (flying pixels);
- nothing is matched where the right imager cannot see (a shadow to the left of every edge, a band
  along the left border of the image), nor reliably where light is grazing, dark, or glaring.

The form of it follows Keselman, Woodfill, Grunnet-Jepsen and Bhowmik, "Intel RealSense Stereoscopic
Depth Cameras" (CVPR workshops 2017), and Ahn et al., "Analysis and noise modeling of the Intel
RealSense D435 for mobile robots" (UR 2019).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from prehensile.errors import InputError

_ALWAYS = 1e3  # standard deviations: certainly missed
_MATCH_WINDOW = 5  # pixels whose disparities err together
_EDGE_WINDOW = 3  # pixels whose positions err together


@dataclass
class DepthNoiseConfig:
    """What a simulated depth camera gets wrong; the defaults are those of a D415.

    Probabilities that depend on a value x are those of a normal distribution: Phi((x - x50) / s),
    so that half of the returns are missed at x50.

    Attributes:
        seed: of all noise of this camera (>= 0).
        baseline: distance of the two imagers (m, > 0).
        disparity_noise: standard deviation of the disparity (pixels, >= 0).
        disparity_step: disparities are multiples of it (pixels, >= 0; 0: none).
        edge_jitter: standard deviation of where a pixel looks, along rows and along columns
            (pixels, >= 0).
        flying_probability: share of the pixels beside an edge of depth that get a depth between
            both sides (0 to 1).
        edge_missed: share of the pixels beside an edge of depth that are missed (0 to 1).
        edge_step: a difference of disparity between neighbours that is an edge (pixels, > 0).
        missed: share of returns missed for no reason that is modelled (0 to 1).
        grazing_angle: angle between line of sight and normal at which half of the returns are
            missed (rad, 0 to pi/2).
        grazing_spread: the s of it (rad, > 0).
        dark_level: luminance, of 1, at which half of the returns are missed (0 to 1; the colour
            image has to be known).
        dark_spread: the s of it (> 0).
        glare_level: luminance above which half of the returns are missed (0 to 2; above 1 there
            is no glare).
        glare_spread: the s of it (> 0).
        min_depth: nearer returns are 0, "too near" (m, > 0).
        max_depth: farther returns are infinite, "too far" (m, > min_depth).
    """

    seed: int = 0
    baseline: float = 0.055
    disparity_noise: float = 0.08
    disparity_step: float = 1.0 / 32.0
    edge_jitter: float = 0.6
    flying_probability: float = 0.3
    edge_missed: float = 0.3
    edge_step: float = 1.0
    missed: float = 0.002
    grazing_angle: float = 1.35
    grazing_spread: float = 0.07
    dark_level: float = 0.03
    dark_spread: float = 0.02
    glare_level: float = 0.985
    glare_spread: float = 0.01
    min_depth: float = 0.3
    max_depth: float = 1.5


def add_depth_noise(
    depth: NDArray[np.floating],
    K: NDArray[np.floating],
    config: DepthNoiseConfig,
    rng: np.random.Generator,
    color: NDArray[np.uint8] | None = None,
) -> NDArray[np.float32]:
    """What a depth camera makes of a true depth image.

    Args:
        depth: (H, W) true depth along the optical axis [m]; 0 nearer, infinity farther than known.
        K: (3, 3) pinhole intrinsics [pixels].
        config: the camera's faults.
        rng: source of all randomness.
        color: (H, W, 3 or 4) uint8 what the same pixels look like; without it nothing is missed
            for being dark or glaring.

    Returns:
        (H, W) depth as measured. 0 where there was no return, for whatever reason, and nearer than
        ``min_depth``: nothing is known along the ray. Infinity beyond ``max_depth``: the ray is
        free up to there. Both as Drake's ``ImageDepth32F`` has them.

    Raises:
        InputError: a shape is wrong, or a number of the config is out of range.
    """
    depth, K = np.asarray(depth), np.asarray(K)
    if depth.ndim != 2 or min(depth.shape) < 2:
        raise InputError(f"depth has shape {depth.shape}; expected (H, W), each at least 2")
    if color is not None:
        shapes = ((*depth.shape, 3), (*depth.shape, 4))
        if color.shape not in shapes or color.dtype != np.uint8:
            raise InputError(
                f"color holds {color.dtype} of shape {color.shape}; expected uint8 of {shapes[0]}"
            )
    _check(config)
    if K.shape != (3, 3) or not np.isfinite(K).all() or K[0, 0] <= 0 or K[1, 1] <= 0:
        raise InputError("K is not a (3, 3) matrix of intrinsics with positive focal lengths")
    scale = np.float32(K[0, 0] * config.baseline)
    true = _disparity(depth, scale, config.min_depth)
    missed = _missed_score(true, K, config, color)
    missed[_unseen_by_right(true)] = _ALWAYS

    source = _jittered(true.shape, config.edge_jitter, rng)
    seen, missed = true.take(source), missed.take(source)
    patches = _box_noise(true.shape, _MATCH_WINDOW, rng)
    _fly(seen, config, rng)
    far = seen <= scale / np.float32(config.max_depth)
    seen += np.float32(config.disparity_noise) * _box_noise(true.shape, _MATCH_WINDOW, rng)
    if config.disparity_step > 0:
        seen /= np.float32(config.disparity_step)
        np.rint(seen, out=seen)
        seen *= np.float32(config.disparity_step)
    with np.errstate(divide="ignore"):
        measured = scale / np.maximum(seen, 0)
    measured[far | (measured > config.max_depth)] = np.inf
    measured[(patches < missed) | (measured < config.min_depth)] = 0
    return measured.astype(np.float32, copy=False)


def _check(config: DepthNoiseConfig) -> None:
    """Raises InputError naming each number that is out of range."""
    highest = {
        "flying_probability": 1.0,
        "edge_missed": 1.0,
        "missed": 1.0,
        "grazing_angle": np.pi / 2,
        "dark_level": 1.0,
        "glare_level": 2.0,
    }
    positive = {"baseline", "edge_step", "min_depth", "max_depth"}
    positive |= {"grazing_spread", "dark_spread", "glare_spread"}
    faults = []
    for name, value in vars(config).items():
        high = highest.get(name, np.inf)
        if not 0 <= value <= high or value == np.inf or (name in positive and value == 0):
            least = "above 0" if name in positive else "at least 0"
            most = "finite" if high == np.inf else f"at most {high:.4g}"
            faults.append(f"{name} is {value}; it must be {least} and {most}")
    if not config.min_depth < config.max_depth:
        faults.append(f"max_depth is {config.max_depth}; it must be above min_depth")
    if faults:
        raise InputError(*faults)


def axial_sigma(
    depth: NDArray[np.floating] | float, K: NDArray[np.floating], config: DepthNoiseConfig
) -> NDArray[np.float64]:
    """Standard deviation of the depth [m] that the model states: sigma_d z^2 / (f b).

    With it comes the step of the disparity, uniform within its width.
    """
    sigma_d = np.hypot(config.disparity_noise, config.disparity_step / np.sqrt(12))
    return sigma_d * np.square(np.asarray(depth, dtype=float)) / (K[0, 0] * config.baseline)


def _disparity(
    depth: NDArray[np.floating], scale: np.float32, min_depth: float
) -> NDArray[np.float32]:
    """(H, W) true disparity [pixels]; 0 for too far, and somewhat too much for too near."""
    known: NDArray[np.float32] = np.array(depth, dtype=np.float32)
    known[~(known > 0)] = 0.5 * min_depth
    return (scale / known).astype(np.float32, copy=False)


def _missed_score(
    disparity: NDArray[np.float32],
    K: NDArray[np.floating],
    config: DepthNoiseConfig,
    color: NDArray[np.uint8] | None,
) -> NDArray[np.float32]:
    """Phi^-1 of the probability that a pixel is missed, by the worst of all reasons (H, W)."""
    score = (incidence(disparity, K) - np.float32(config.grazing_angle)) / np.float32(
        config.grazing_spread
    )
    np.fmax(score, np.float32(ndtri(config.missed)), out=score)  # NaN: no surface
    if color is not None:
        luminance = color[:, :, 0] * np.float32(0.2126 / 255)
        luminance += color[:, :, 1] * np.float32(0.7152 / 255)
        luminance += color[:, :, 2] * np.float32(0.0722 / 255)
        dark = (np.float32(config.dark_level) - luminance) / np.float32(config.dark_spread)
        np.maximum(score, dark, out=score)
        luminance -= np.float32(config.glare_level)
        luminance /= np.float32(config.glare_spread)
        np.maximum(score, luminance, out=score)
    if config.edge_missed > 0:
        beside = np.zeros(disparity.shape, dtype=bool)
        across = np.abs(disparity[:, 1:] - disparity[:, :-1]) > config.edge_step
        beside[:, 1:] |= across
        beside[:, :-1] |= across
        along = np.abs(disparity[1:] - disparity[:-1]) > config.edge_step
        beside[1:] |= along
        beside[:-1] |= along
        score[beside] = np.maximum(score[beside], np.float32(ndtri(config.edge_missed)))
    return score


def incidence(inverse_depth: NDArray[np.floating], K: NDArray[np.floating]) -> NDArray[np.float32]:
    """Angle between line of sight and surface normal at each pixel.

    Under a pinhole the inverse depth w of a plane is affine in the pixel (u, v): its slopes a, b
    give the normal as (a fx, b fy, w - a (u - cx) - b (v - cy)). Of the slopes to both neighbours
    the smaller is taken, which does not reach across an edge.

    Args:
        inverse_depth: (H, W) inverse depth, in any unit.
        K: (3, 3) pinhole intrinsics [pixels].

    Returns:
        (H, W) the angle [rad]; NaN where the inverse depth is zero.
    """
    w = np.asarray(inverse_depth, dtype=np.float32)
    u = np.arange(w.shape[1], dtype=np.float32)[None, :] - np.float32(K[0, 2])
    v = np.arange(w.shape[0], dtype=np.float32)[:, None] - np.float32(K[1, 2])
    fx, fy = np.float32(K[0, 0]), np.float32(K[1, 1])
    a, b = _smaller_slope(w, axis=1), _smaller_slope(w, axis=0)
    m_z = w - a * u - b * v
    a *= fx
    b *= fy
    square = a * a + b * b + m_z * m_z
    square *= (u / fx) ** 2 + ((v / fy) ** 2 + 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = w / np.sqrt(square)
    return np.arccos(np.minimum(cosine, 1, out=cosine), out=cosine)


def _smaller_slope(w: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """The smaller of the differences to both neighbours (H, W); 0 where their signs differ."""
    w = w if axis == 1 else w.T
    ahead, behind = np.empty_like(w), np.empty_like(w)
    np.subtract(w[:, 1:], w[:, :-1], out=ahead[:, :-1])
    ahead[:, -1] = ahead[:, -2]
    behind[:, 1:] = ahead[:, :-1]
    behind[:, 0] = behind[:, 1]
    falling = np.minimum(np.maximum(ahead, behind), 0)
    slope = np.maximum(np.minimum(ahead, behind, out=ahead), 0, out=ahead)
    slope += falling
    return slope if axis == 1 else slope.T


def _unseen_by_right(disparity: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(H, W) which pixels of the left imager the right one does not see.

    Column u appears there at u - d(u). Something nearer and further right may land on the same
    place or left of it, and hides it then; and what would land left of the border is not there.
    """
    right = np.arange(disparity.shape[1], dtype=np.float32) - disparity
    least = np.minimum.accumulate(right[:, ::-1], axis=1)[:, ::-1]
    hidden = right < 0
    hidden[:, :-1] |= least[:, 1:] < right[:, :-1] - np.float32(0.5)
    return hidden


def _box_noise(
    shape: tuple[int, ...], window: int, rng: np.random.Generator
) -> NDArray[np.float32]:
    """(H, W) noise of mean 0 and variance 1, correlated over a window of pixels.

    Sums of uniform bytes over sliding windows: nearly normal (excess kurtosis -1.2 / window^2).
    """
    rows, columns = shape[0] + window - 1, shape[1] + window - 1
    raw = np.frombuffer(rng.bytes(rows * columns), dtype=np.uint8).reshape(rows, columns)
    sums = raw[: shape[0]].astype(np.int32)
    for i in range(1, window):
        sums += raw[i : i + shape[0]]
    total = sums[:, : shape[1]].astype(np.float32)
    for i in range(1, window):
        total += sums[:, i : i + shape[1]]
    total -= np.float32(127.5 * window**2)
    total /= np.float32(window * np.sqrt((256**2 - 1) / 12))
    return total


def _jittered(shape: tuple[int, ...], sigma: float, rng: np.random.Generator) -> NDArray[np.int32]:
    """(H, W) flat index of the pixel that each pixel looks at."""
    shifts = [
        np.rint(np.float32(sigma) * _box_noise(shape, _EDGE_WINDOW, rng)).astype(np.int32)
        for _ in range(2)
    ]
    v = np.clip(shifts[0] + np.arange(shape[0], dtype=np.int32)[:, None], 0, shape[0] - 1)
    u = np.clip(shifts[1] + np.arange(shape[1], dtype=np.int32), 0, shape[1] - 1)
    return v * np.int32(shape[1]) + u


def _fly(
    disparity: NDArray[np.float32], config: DepthNoiseConfig, rng: np.random.Generator
) -> None:
    """Gives pixels beside edges a disparity between both sides, in place."""
    flat, width = disparity.reshape(-1), disparity.shape[1]
    for ahead in (1, width):
        first = np.flatnonzero(np.abs(flat[ahead:] - flat[:-ahead]) > config.edge_step)
        if ahead == 1:
            first = first[(first + 1) % width > 0]  # a row's last pixel is not beside the next
        # Each edge has two pixels; one of them, by chance, may fly.
        flies = rng.random(len(first)) < config.flying_probability
        side = rng.random(len(first)) < 0.5
        between = rng.random(len(first), dtype=np.float32)
        low, high = first[flies], first[flies] + ahead
        mixed = flat[low] + between[flies] * (flat[high] - flat[low])
        flat[np.where(side[flies], low, high)] = mixed
