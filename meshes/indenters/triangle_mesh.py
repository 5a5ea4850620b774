"""Indenter bounded by any closed surface of triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from meshes.array_types import FloatArray
from meshes.indenters.indenter import Indenter, Primitive
from meshes.indenters.punches import require_axis_inside
from meshes.surfaces.underside import TriangleGap, compute_volume, select_facing_down, split_into_hulls


@dataclass(frozen=True, kw_only=True)
class _Numbers:
    """Numbers of the measures of a body; it is symmetric if its image deviates by less than the sum of tolerances."""

    #: Volume over the cube of the body's size, and height over the size, that count as zero [-]; rounding.
    zero: float = 1e-9
    #: Grid points along x and along y at which the gap is compared with its mirror image [-]; chosen.
    symmetry_points: int = 61
    #: Tolerance over the larger half width of the body [-]; rounding in STL files of single precision.
    relative_tolerance: float = 1e-6
    #: Tolerance [m]; rounding in double precision.
    tolerance: float = 1e-9
    #: Distance of the middles of two edges that are one, over the larger half width [-]; single precision.
    same_place: float = 1e-6
    #: Angle between two facets above which they form an edge of the body [rad]; chosen, 29 degrees.
    edge_angle: float = 0.5


_NUMBERS = _Numbers()


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangleMesh(Indenter):
    """A body bounded by n triangles, with its lowest point at z = 0 and its axis through the origin.

    Two bodies are equal when their triangles are equal and in the same order.

    Attributes:
        triangles: Corners (x, y, z) of each triangle, counterclockwise as seen from outside, shape (n, 3, 3) [m].
    """

    triangles: FloatArray

    def __post_init__(self) -> None:
        """Check the triangles and make them read-only; whether the surface is closed is not checked here.

        Raises:
            ValueError: If the array has another shape or a number that is not finite; or the triangles face inwards or
                enclose no volume; or the lowest point is not at z = 0; or the axis lies outside the bounding rectangle.
        """
        corners = np.array(self.triangles, dtype=np.float64)
        if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners):  # noqa: PLR2004
            raise ValueError(f"triangles must have the shape (n, 3, 3), not {corners.shape}")
        if not np.isfinite(corners).all():
            raise ValueError("the corners of all triangles must be finite")
        size = float(np.ptp(corners, axis=(0, 1)).max())
        if not compute_volume(corners) > _NUMBERS.zero * size**3:
            raise ValueError("the surface holds no volume, or its triangles face inwards")
        if abs(corners[..., 2].min()) > _NUMBERS.zero * size:
            raise ValueError(f"the lowest point must stand at z = 0, not at {corners[..., 2].min()} m")
        require_axis_inside(corners[..., :2].reshape(-1, 2))
        corners.setflags(write=False)
        object.__setattr__(self, "triangles", corners)

    def __eq__(self, other: object) -> bool:
        """Return whether the other object is a body with equal triangles in the same order."""
        return isinstance(other, TriangleMesh) and np.array_equal(self.triangles, other.triangles)

    def __hash__(self) -> int:
        """Return a hash of the triangles."""
        return hash(self.triangles.tobytes())

    @cached_property
    def is_flat(self) -> bool:
        """Whether every triangle that faces down lies in the plane z = 0."""
        return not self._lower[..., 2].any()

    @cached_property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Whether the gap is symmetric about the plane x = 0, and whether about the plane y = 0.

        The gap and its mirror image are compared at the points of a grid.
        """
        half = self.footprint
        x, y = np.meshgrid(*(np.linspace(-h, h, _NUMBERS.symmetry_points) for h in half))
        gap = np.nan_to_num(self.gap(x, y), posinf=-1.0)
        tolerance = _NUMBERS.tolerance + _NUMBERS.relative_tolerance * max(half)
        in_x, in_y = (bool(np.abs(gap - np.flip(gap, axis)).max() < tolerance) for axis in (1, 0))
        return (in_x, in_y)

    @property
    def footprint(self) -> tuple[float, float]:
        """Largest distance of a corner from the axis along x, and the same along y [m]."""
        half = np.abs(self.triangles[..., :2]).max(axis=(0, 1))
        return (float(half[0]), float(half[1]))

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lowest triangle over each point; inf beside the body [m]."""
        x, y = np.broadcast_arrays(x, y)
        return self._gap.evaluate(x.ravel(), y.ravel()).reshape(x.shape)

    def measure_facets(self, height: float, turn: FloatArray | None = None) -> float:
        """Estimate how far the facets up to a height deviate from the smooth surface that they stand for.

        Two facets that meet at a small angle are chords of an arc with the sagitta width times angle over 8.  The
        deviation of a facet is the sum over its sides.  Facets that meet at a larger angle form an edge of the body.

        Args:
            height: Height above the lowest point up to which facets are considered [m].
            turn: Rotation matrix of the body, shape (3, 3); None if it stands upright.

        Returns:
            Largest deviation, 0 if no facets meet at a small angle [m].
        """
        lower = self._lower if turn is None else self._lower @ turn.T
        facets = lower[lower[..., 2].min(axis=1) - lower[..., 2].min() < height]
        normal = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
        double_area = np.linalg.norm(normal, axis=1)
        facets, normal = facets[double_area > 0], normal[double_area > 0] / double_area[double_area > 0, None]
        ends = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2, 3)
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        owner = np.repeat(np.arange(len(facets)), 3)
        width = np.repeat(double_area[double_area > 0], 3) / length
        # Facets that share an edge share its middle; sorting the middles brings them together.
        middle = np.round(ends.mean(axis=1) / (_NUMBERS.same_place * max(self.footprint))).astype(np.int64)
        order = np.lexsort(middle.T)
        one, other = order[:-1], order[1:]
        shared = (middle[one] == middle[other]).all(axis=1)
        one, other = one[shared], other[shared]
        angle = np.arccos(np.clip((normal[owner[one]] * normal[owner[other]]).sum(axis=1), -1.0, 1.0))
        angle[angle > _NUMBERS.edge_angle] = 0.0
        each = np.concatenate([one, other])
        return float(np.bincount(owner[each], width[each] * np.tile(angle, 2) / 8).max(initial=0.0))

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one hull if the lower surface is convex; else hulls whose union approximates the lower surface.

        The approximation is within the tolerance of `meshes.surfaces.underside.HULLS`, or a warning is logged.

        Raises:
            ModuleNotFoundError: If trimesh is not installed.
        """
        return self._primitives

    @cached_property
    def _lower(self) -> FloatArray:
        return select_facing_down(self.triangles)

    @cached_property
    def _gap(self) -> TriangleGap:
        return TriangleGap(self._lower)

    @cached_property
    def _primitives(self) -> tuple[Primitive, ...]:
        return tuple(
            Primitive(kind="hull", vertices=tuple((float(x), float(y), float(z)) for x, y, z in hull))
            for hull in split_into_hulls(self.triangles)
        )
