"""What depth images say about rigid bodies of known shape, in Gauss-Newton form.

Two terms, as in dense articulated tracking (Schmidt, Newcombe and Fox, "DART", RSS 2014): the
distance of each measured point to the nearest body's surface, robustly, and the depth by which
the bodies' surfaces lie in space that the camera saw through. A free object is one body, an arm
is one body per link.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from prehensile.native import _core
from prehensile.perception.cloud import FARTHEST, within
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.free_space import DepthView
from prehensile.perception.mesh import TriangleMesh
from prehensile.perception.ranges import require_ranges
from prehensile.perception.registration.constraints import corner_points
from prehensile.perception.registration.losses import RobustLoss

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body B of known shape.

    Attributes:
        field: its distance field.
        points: (K, 3) samples of its surface, expressed in B [m]; some hundreds.
        normals: (K, 3) unit normals there, outward.
        corners: (M, 3) of its convex hull, for what it must not enter [m]; by default those of
            the samples.
    """

    field: DistanceField
    points: Array
    normals: Array
    corners: Array | None = None

    def __post_init__(self) -> None:
        """Checks the shapes.

        Raises:
            ValueError: naming the argument.
        """
        for name in ("points", "normals", "corners"):
            value = getattr(self, name)
            if value is None:
                continue
            array = np.ascontiguousarray(value, dtype=float)
            if array.ndim != 2 or array.shape[1] != 3 or not within(array, FARTHEST):
                raise ValueError(f"{name}: expected (N, 3) finite numbers, not {array.shape}")
            object.__setattr__(self, name, array)
        if self.points.shape != self.normals.shape or not len(self.points):
            raise ValueError(
                "normals: expected one for each of the points, of which there are some"
            )

    def box(self) -> Array:
        """(2, 3) least and greatest coordinates of what is known of its surface, in B [m]."""
        known = self.points if self.corners is None else np.vstack([self.points, self.corners])
        return np.stack([known.min(axis=0), known.max(axis=0)])

    @staticmethod
    def from_mesh(
        mesh: TriangleMesh,
        field: DistanceField | None = None,
        *,
        num_samples: int = 400,
        seed: int = 0,
    ) -> "Body":
        """A body from its mesh.

        Args:
            mesh: its surface; parts of it that lie inside it get no samples if the field is signed.
            field: its distance field; built from the mesh if None.
            num_samples: samples spread evenly over the surface, >= 1.
            seed: of where they lie.

        Raises:
            ValueError: as :meth:`.DistanceField.from_mesh`, or if there are to be no samples.
        """
        if num_samples < 1:
            raise ValueError(f"num_samples: must be at least 1, not {num_samples}")
        if not 0 < mesh.area() < np.inf:
            raise ValueError(f"mesh: its area must be positive and finite, not {mesh.area()}")
        field = field or DistanceField.from_mesh(mesh)
        rng = np.random.default_rng(seed)
        # Many candidates, of which those on the outer surface are thinned out evenly: each time
        # the one farthest from all before.
        areas = mesh.areas()
        chosen = rng.choice(len(areas), 8 * num_samples, p=areas / areas.sum())
        u, v = rng.uniform(size=(2, len(chosen), 1))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        a, b, c = (mesh.vertices[mesh.triangles[chosen, k]] for k in range(3))
        candidates = a + u * (b - a) + v * (c - a)
        outer = np.abs(field.at(candidates).distances) < max(0.5 * field.spacing, 1e-3)
        candidates = candidates[outer]
        normals = mesh.triangle_normals()[chosen][outer]
        distances = np.full(len(candidates), np.inf)
        kept = [0]
        while len(kept) < min(num_samples, len(candidates)):
            away = ((candidates - candidates[kept[-1]]) ** 2).sum(axis=1)
            distances = np.minimum(distances, away)
            kept.append(int(distances.argmax()))
        corners = corner_points(None, mesh.vertices)
        return Body(field, candidates[kept], normals[kept], corners)


@dataclass(frozen=True)
class EvidenceConfig:
    """How images are read.

    Attributes:
        noise: standard deviation of a measured point across the surface [m], > 0.
        correlation: how many points count as one, because neighbours err together, >= 1.
        max_distance: points further from the predicted surface are not looked at [m], > 0; where
            the prediction is less sure than that, two of its standard deviations.
        farthest: but never further than this [m], > 0.
        loss_scale: scale of the Geman-McClure loss once the fit settles [m], > 0; it starts at
            max_distance.
        max_pixels: pixels looked at per image, >= 1.
        margin: how far in front of the measured depth a surface may be [m], >= 0; and how far
            beside what was measured it counts as seen there, though it is drawn back.
        max_violation: deeper violations of the free space count as this deep [m], > 0.
        search_radius: how far to look for the edge of the free space [pixels], 0 to 100.
        free_space_weight: of a sample's violation against a point's distance, >= 0.
        occluder_margin: points this near to a body in the way, and nearer to it than to those
            looked for, are its own [m], >= 0.
        max_normal_angle: points whose surface is turned further from the nearest one looked for,
            as a table's beside a box that stands on it, are another's [rad], >= 0; pi for any.
    """

    noise: float = 0.002
    correlation: float = 10.0
    max_distance: float = 0.03
    farthest: float = 0.12
    loss_scale: float = 0.005
    max_pixels: int = 12000
    margin: float = 0.01
    max_violation: float = 0.03
    search_radius: int = 12
    free_space_weight: float = 2.0
    occluder_margin: float = 0.01
    max_normal_angle: float = float(np.deg2rad(60))

    def __post_init__(self) -> None:
        """Checks the ranges.

        Raises:
            ValueError: naming the field.
        """
        length = (1e-9, 1e6)
        require_ranges(
            self,
            noise=length,
            correlation=(1, 1e9),
            max_distance=length,
            farthest=length,
            loss_scale=length,
            max_pixels=(1, 1e9),
            margin=(0, 1e6),
            max_violation=length,
            search_radius=(0, 100),
            free_space_weight=(0, 1e9),
            occluder_margin=(0, 1e6),
            max_normal_angle=(0, np.pi),
        )


@dataclass(frozen=True, eq=False)
class Evidence:
    """What images say near given poses, weighed by the noise.

    Attributes:
        information: (L, 6, 6) of a motion [w; v] of each body about its own origin, in W.
        gradient: (L, 6) of half the weighed cost by that motion.
        cost: robust squared distances and violations over the variance, whose half has that
            gradient; on the scale of the loss that was asked for.
        residual: root mean square distance of the points that count [m]; NaN without any.
        num_points: effective number of points that count (the sum of their weights).
        seen: part of the samples facing a camera that were measured where they should be, up to
            the margin.
        in_free: part of them that lies where the camera saw through.
        occluded: part of them that lies behind something.
    """

    information: Array
    gradient: Array
    cost: float
    residual: float
    num_points: float
    seen: float
    in_free: float
    occluded: float


class BodyEvidence:
    """The evidence of one moment's images about some bodies, ready to be asked at any poses.

    Args:
        bodies: the bodies looked for.
        views: the images, all of one moment.
        occluders: fields of other bodies in the way, each with its pose in W.
        config: how to read the images.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        views: Sequence[DepthView],
        occluders: Sequence[tuple[DistanceField, RigidTransform]],
        config: EvidenceConfig,
    ) -> None:
        self._fields = [body.field.core for body in bodies]
        self._boxes = np.array([body.box() for body in bodies]).reshape(-1, 2, 3)
        self._samples = [(body.points, body.normals) for body in bodies]
        self._views = [view.native() for view in views]
        self._other_fields = [field.core for field, _ in occluders]
        self._X_WK = np.array([X_WK.GetAsMatrix4() for _, X_WK in occluders]).reshape(-1, 4, 4)
        self._config = config

    def points_near(self, X_WB: Array, max_distance: float) -> Array:
        """(M, 3) points in W measured near the bodies at their predicted poses X_WB (L, 4, 4)."""
        config = self._config
        return _core.points_near_bodies(
            self._views,
            self._fields,
            X_WB,
            self._boxes,
            self._other_fields,
            self._X_WK,
            max_distance,
            config.occluder_margin,
            config.max_pixels,
            config.max_normal_angle,
        )

    def gate(self, deviation: float) -> float:
        """How far from the predicted surface to look if it is so unsure [m]."""
        config = self._config
        return max(config.max_distance, min(2 * deviation, config.farthest))

    def at(self, points: Array, X_WB: Array, loss_scale: float) -> Evidence:
        """The evidence at poses X_WB (L, 4, 4), by points (M, 3) in W and the free space."""
        config = self._config
        information, gradient, sums, counts = _core.body_terms(
            points,
            self._fields,
            X_WB,
            RobustLoss.GEMAN_MCCLURE.value,
            loss_scale,
            self._views,
            self._samples,
            config.margin,
            config.max_violation,
            config.search_radius,
            config.free_space_weight,
        )
        weight = 1 / (config.noise**2 * config.correlation)
        cost, num_points, squares = sums.sum(axis=0)
        facing, seen, in_free, occluded, _ = counts.sum(axis=0)
        facing = max(facing, 1.0)
        return Evidence(
            weight * information,
            weight * gradient,
            weight * float(cost),
            float(np.sqrt(squares / num_points)) if num_points > 0 else np.nan,
            float(num_points),
            float(seen / facing),
            float(in_free / facing),
            float(occluded / facing),
        )

    def loss_scale(self, iteration: int, max_distance: float) -> float:
        """The loss's scale at an iteration: halved each time, from max_distance down [m]."""
        return max(self._config.loss_scale, max_distance * 0.5**iteration)
