"""Indenter that is tilted against the normal of the cover."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from meshes.array_types import BoolArray, FloatArray
from meshes.indenters.shapes import Indenter, Primitive, Sphere, quantity_field
from meshes.pose import Pose

#: Largest tilt about either axis, 10 degrees [rad].  At small strain the contact solvers neglect the horizontal part of
#: the contact pressure, which is the sine of the tilt times the pressure.  All contact solvers neglect the contact of
#: side walls.
MOST_TILT = float(np.radians(10))


@dataclass(frozen=True, kw_only=True)
class TiltNumbers:
    """Constants of the iteration for the height of a rotated surface, of its fallback search, and of sampling."""

    #: Tolerance of the limit on the tilt, for rounding [rad].
    rounding: float = 1e-9
    #: Largest number of steps of the iteration, which converges if slope times tangent of the tilt is below 1 [-].
    steps: int = 40
    #: Largest change of the height in the last step of a converged iteration, over the size of the shape [-].
    converged: float = 1e-9
    #: Smallest sampled height in the search for the lower surface, over the height of the shape [-].
    least_height: float = 1e-4
    #: Number of sampled heights in the search for the lower surface [-].
    heights: int = 120
    #: Number of bisections of the interval found by the sampled heights [-].
    halvings: int = 50
    #: Height of a step in the lower surface, over the height of the shape, above which the step is a vertical wall [-].
    jump: float = 1e-6
    #: Number of samples along each side of the shape, for its largest height [-].
    shape_samples: int = 101
    #: Number of samples along each side of a rectangle that is searched for the lowest point [-].
    samples: int = 61
    #: Number of successively smaller rectangles that are searched for the lowest point [-].
    searches: int = 8
    #: Half the size of the next smaller rectangle, over the distance between samples in the present rectangle [-].
    zoom: float = 4.0


_NUMBERS = TiltNumbers()


@dataclass(frozen=True, kw_only=True)
class TiltedIndenter(Indenter):
    """A rigid indenter, rotated about a horizontal axis through the lowest point of its own axis.

    The shape is the lower surface of the rotated body.  Its side walls do not touch the cover.  Use `tilt_indenter` to
    make one: it returns shapes unchanged that a tilt does not change.

    Attributes:
        indenter: Indenter without tilt.
        tilt: Rotation vector along x and y of the indenter's frame [rad].  A positive rotation about x raises the side
            of positive y.  A positive rotation about y lowers the side of positive x.
    """

    indenter: Indenter
    tilt: tuple[float, float] = quantity_field("angle", default=(0.0, 0.0))

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Whether the surface is symmetric about the planes x = 0 and y = 0.

        Only a rotation about the normal of a plane keeps the symmetry about this plane.
        """
        about_x, about_y = self.tilt
        along_x, along_y = self.indenter.mirror_symmetry
        return along_x and about_y == 0, along_y and about_x == 0

    @property
    def footprint(self) -> tuple[float, float]:
        """Half edge lengths of the rectangle that bounds the tilted face, or the upright curved shape, in plan [m]."""
        if not self.indenter.is_flat:
            return self.indenter.footprint
        x, y = np.abs(self._rotation[:2, :2]) @ self.indenter.footprint
        return float(x), float(y)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the tilted lower surface over its lowest point; inf where there is no surface [m]."""
        return self._height(np.asarray(x, dtype=float), np.asarray(y, dtype=float)) - self.lowest_point[2]

    @cached_property
    def lowest_point(self) -> tuple[float, float, float]:
        """Position of the point of first touch, relative to the lowest point of the upright indenter's axis [m]."""
        if self.indenter.is_flat:
            return self._find_lowest_corner()
        middle, half = np.zeros(2), np.array(self.footprint)
        best = (0.0, 0.0, float(self._height(np.zeros(1), np.zeros(1))[0]))
        for _ in range(_NUMBERS.searches):
            x, y = np.meshgrid(*(m + np.linspace(-h, h, _NUMBERS.samples) for m, h in zip(middle, half, strict=True)))
            z = self._height(x, y)
            # Of several points of equal height, such as those of an edge, take the nearest to the axis.
            low = np.flatnonzero(z.ravel() <= z.min() + 1e-12 * max(self.footprint))
            index = low[np.argmin(np.hypot(x.ravel()[low], y.ravel()[low]))]
            if z.ravel()[index] < best[2] or not np.isfinite(best[2]):
                best = (float(x.ravel()[index]), float(y.ravel()[index]), float(z.ravel()[index]))
            middle, half = np.array(best[:2]), _NUMBERS.zoom * 2 * half / (_NUMBERS.samples - 1)
        return best

    def _find_lowest_corner(self) -> tuple[float, float, float]:
        """Find the lowest point of a tilted flat face from the corners of the indenter's solids.

        If several points are equally low, such as the ends of an edge, their mean is returned [m].
        """
        down = -self._rotation[2, :2]
        points = []
        for solid in self.indenter.primitives():
            middle = np.array(solid.position)
            if solid.kind == "cylinder":
                points.append(middle[:2] + solid.size[0] * down / np.hypot(*down))
                continue
            corners = np.array(solid.vertices or np.indices((2, 2, 2)).reshape(3, -1).T * 2 - 1.0)
            corners = middle + (corners if solid.vertices else corners * solid.size)
            points += list(corners[corners[:, 2] <= corners[:, 2].min() + _NUMBERS.converged * max(self.footprint), :2])
        places = np.array(points)
        depth = places @ down
        x, y = places[depth >= depth.max() - _NUMBERS.converged * max(self.footprint)].mean(axis=0)
        lowest = self._rotation @ [x, y, 0.0]
        return float(lowest[0]), float(lowest[1]), float(lowest[2])

    def primitives(self) -> tuple[Primitive, ...]:
        """Return the convex solids of the upright indenter, rotated and raised so that the lowest point is at z = 0."""
        raised, angle = np.array([0.0, 0.0, self.lowest_point[2]]), float(np.hypot(*self.tilt))
        scalar, vector = np.cos(angle / 2), np.sin(angle / 2) * np.array([*self.tilt, 0.0]) / (angle or 1.0)
        out = []
        for solid in self.indenter.primitives():
            position, (own, *axis) = self._rotation @ solid.position - raised, solid.quaternion
            turned = own * vector + scalar * np.array(axis) + np.cross(vector, axis)
            quaternion = (float(scalar * own - vector @ axis), *turned.tolist())
            out.append(replace(solid, position=tuple(position.tolist()), quaternion=quaternion))
        return tuple(out)

    @cached_property
    def _rotation(self) -> FloatArray:
        """Rotation matrix of the tilt, shape (3, 3)."""
        return Pose.planar(tilt=self.tilt).rotation

    def _height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the height of the rotated surface above the level of the centre of rotation [m]; inf beside the body.

        The height z of the surface above (x, y) solves w(z) = gap(u(z), v(z)).  Here u, v, w are the coordinates of the
        point (x, y, z) in the frame of the upright indenter, and gap(u, v) is the height of the upright indenter's
        surface above its lowest point.
        """
        back = self._rotation.T
        size = max(self.footprint)
        plane = -(back[2, 0] * x + back[2, 1] * y) / back[2, 2]
        z, change = plane, np.full_like(plane, np.inf)
        for _ in range(_NUMBERS.steps):
            inside = np.isfinite(z)
            at = np.where(inside, z, 0.0)
            u, v = (row[0] * x + row[1] * y + row[2] * at for row in back[:2])
            next_z = np.where(inside, plane + self.indenter.gap(u, v) / back[2, 2], np.inf)
            change = np.where(np.isfinite(next_z), np.abs(next_z - at), 0.0)
            z = next_z
            if change.max(initial=0.0) < _NUMBERS.converged**2 * size:
                break
        # The iteration is exact for a flat face after one step.  Beside the face there are only vertical walls.
        failed = ~np.isfinite(z) | (change >= _NUMBERS.converged * size)
        if not self.indenter.is_flat and failed.any():
            z = z.copy()
            z[failed] = self._search_height(x[failed], y[failed], plane[failed])
        return np.asarray(z)

    def _search_height(self, x: FloatArray, y: FloatArray, plane: FloatArray) -> FloatArray:
        """Search upwards for the height of the rotated surface by sampling and bisection; inf where there is none [m].

        Args:
            x: x coordinates of the points, shape (k,) [m].
            y: y coordinates of the points, shape (k,) [m].
            plane: Height of the rotated plane w = 0 above each point, shape (k,) [m].
        """
        back = self._rotation.T

        def rise(height: FloatArray, at: BoolArray) -> FloatArray:
            """Return the height of points over the surface along the upright axis; -inf beside it [m]."""
            z = plane[at] + height
            u, v = (row[0] * x[at] + row[1] * y[at] + row[2] * z for row in back[:2])
            return np.asarray(back[2, 2] * height - self.indenter.gap(u, v))

        low, high = np.zeros_like(x), np.full_like(x, np.inf)
        for height in np.geomspace(_NUMBERS.least_height, 1.0, _NUMBERS.heights) * self._upright_height / back[2, 2]:
            left = np.isinf(high)
            above = np.zeros_like(left)
            above[left] = rise(np.full(int(left.sum()), height), left) >= 0
            high[above] = height
            low[left & ~above] = height
        found = np.isfinite(high)
        low, high = low[found], high[found]
        for _ in range(_NUMBERS.halvings):
            middle = (low + high) / 2
            above = rise(middle, found) >= 0
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        # At a wall the height over the surface is discontinuous; elsewhere it is continuous and zero at the surface.
        surface = rise(high, found) < _NUMBERS.jump * self._upright_height
        z = np.full_like(x, np.inf)
        z[found] = np.where(surface, plane[found] + high, np.inf)
        return z

    @cached_property
    def _upright_height(self) -> float:
        """Largest height of the upright indenter's lower surface, with a margin for the samples [m]."""
        x, y = np.meshgrid(*(np.linspace(-half, half, _NUMBERS.shape_samples) for half in self.indenter.footprint))
        gap = self.indenter.gap(x, y)
        return 1.05 * float(gap[np.isfinite(gap)].max())

    def measure_facets(self, height: float, turn: FloatArray | None = None) -> float:
        """Estimate how far facets up to a height over the lowest point deviate from the smooth surface [m]."""
        return self.indenter.measure_facets(height, self._rotation if turn is None else turn @ self._rotation)


def tilt_indenter(indenter: Indenter, tilt: tuple[float, float]) -> Indenter:
    """Tilt an indenter about the x and y axes of its frame; a sphere is returned unchanged.

    Args:
        indenter: Upright indenter.
        tilt: Rotations about x and y [rad].

    Raises:
        ValueError: If a rotation exceeds 10 degrees.
    """
    about_x, about_y = (float(angle) for angle in tilt)
    if not max(abs(about_x), abs(about_y)) <= MOST_TILT + _NUMBERS.rounding:
        worst = float(np.degrees(max(abs(about_x), abs(about_y))))
        raise ValueError(
            f"a tilt may have at most {np.degrees(MOST_TILT):g} degrees about either axis, not {worst:.4g}; contact "
            "with a tilted indenter neglects its side walls and horizontal forces"
        )
    if (about_x, about_y) == (0.0, 0.0) or isinstance(indenter, Sphere):
        return indenter
    return TiltedIndenter(indenter=indenter, tilt=(about_x, about_y))
