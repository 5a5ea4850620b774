"""Layout of the force of soft bodies (flexes of MuJoCo) on the front of an array.

MuJoCo gives every touching element of a flex one contact point.  On a flat face this point jumps from one corner of the
element to another at every step, so that contact points resolve the position of a flex only to an element.  The force
of each flex on the array is therefore distributed over its surface in proportion to a depth: that of the surface below
the top of the array, plus the contact margin.  With the softness of MuJoCo's contacts, equal areas at equal depths have
equal forces.  The total force is exact.  The centre of pressure follows from the depths, not from the points.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from fastmodel.compiled import compile_kernel
from meshes.array_types import FloatArray, IntArray

#: Largest number of divisions of the edge of an element [-].
_MOST_DIVISIONS = 12
#: Number of corners of a triangle [-].
_TRIANGLE = 3
#: Dimension of a flex that is a solid [-].
_SOLID = 3


class FlexSurfaces:
    """The surfaces of all flexes of a model, divided into small pieces of equal size in each element."""

    def __init__(self, model: mujoco.MjModel, spacing: float) -> None:
        """Divide the surfaces.

        Args:
            model: The compiled model.
            spacing: Largest distance between pieces of a surface at rest, except in large elements, whose number of
                pieces is limited; and edge length of the squares over which the force is summed [m].
        """
        self._radius, self._spacing, self._spread_depths = model.flex_radius, spacing, compile_kernel(spread_depths)
        self._elements = [model.flex_vertadr[flex] + _list_elements(model, flex) for flex in range(model.nflex)]
        data = mujoco.MjData(model)
        if self._elements:
            mujoco.mj_fwdPosition(model, data)
        self._shares = [
            _divide(
                corners.shape[1],
                np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(initial=0.0) / spacing,
            )
            for corners in (data.flexvert_xpos[elements] for elements in self._elements)
        ]
        if self._elements:  # This call compiles the kernel, so that nothing is compiled at the first contact.
            self.spread(0, 1.0, data.flexvert_xpos.copy(), 0.0, np.array([[0.0, 0.0, 0.0], [1e-3, 1e-3, 0.0]]))

    def replace_points(
        self,
        data: mujoco.MjData,
        pressed: FloatArray,
        owner: IntArray,
        touches: FloatArray,
        *,
        place: FloatArray,
        bounds: FloatArray,
    ) -> tuple[IntArray, FloatArray]:
        """Replace the contact points of flexes by points spread over the parts of their surfaces that touch the array.

        Args:
            data: The state.
            pressed: Force of each of k contacts on the front of the array, not zero for m of them, shape (k,) [N].
            owner: Index of the body of each of the m contacts, -1 for flexes and other unknown shapes, shape (m,).
            touches: Position x, y [m] and force [N] of these contacts, shape (m, 3).
            place: Axes of the array in the world, as columns, and its origin, shape (4, 3) [-, m].
            bounds: Bounds of the array, see `spread`, shape (2, 3) [m].

        Returns:
            `owner` and `touches` of the contacts of all other bodies and of the new points.
        """
        own = pressed.nonzero()[0]
        flex, margin = data.contact.flex[own].max(axis=1), data.contact.includemargin[own]
        vertices = (data.flexvert_xpos - place[3]) @ place[:3]
        kept, added = np.ones(len(own), dtype=bool), [np.zeros((0, 3))]
        for each in np.unique(flex[flex >= 0]).tolist():
            mine = (flex == each) & (touches[:, 2] > 0)
            if not mine.any():
                continue
            points = self.spread(each, float(touches[mine, 2].sum()), vertices, float(margin[mine].max()), bounds)
            if points is not None:
                kept &= ~mine
                added.append(points)
        points = np.concatenate(added)
        return np.append(owner[kept], np.full(len(points), -1)), np.concatenate([touches[kept], points])

    def spread(
        self, flex: int, force: float, vertices: FloatArray, margin: float, bounds: FloatArray
    ) -> FloatArray | None:
        """Distribute the force of one flex over the parts of its surface that touch the array.

        Args:
            flex: Id of the flex.
            force: Force of the flex on the front of the array [N].
            vertices: Positions of the vertices of all flexes in the array's frame, shape (vertices, 3) [m].
            margin: Distance from the array at which contacts begin [m].
            bounds: Smallest and largest x and y of the array, its back and its top, at z = 0, shape (2, 3) [m].

        Returns:
            Position x, y [m] and force [N] of k points, shape (k, 3); None if no part lies below the top and margin.
        """
        reach = (float(self._radius[flex]), margin, self._spacing)
        sums = self._spread_depths(vertices[self._elements[flex]], self._shares[flex], bounds, reach)
        weight = sums[:, 0]
        if not len(weight):
            return None
        return np.column_stack([sums[:, 1:] / weight[:, None], force * weight / weight.sum()])


def spread_depths(
    corners: FloatArray, shares: FloatArray, bounds: FloatArray, reach: tuple[float, float, float]
) -> FloatArray:
    """Kernel: sum depth times area of the pieces of a surface over the squares of a grid.

    Args:
        corners: Corners of the elements in the array's frame, shape (elements, 3 or 2, 3) [m].
        shares: Barycentric coordinates of the centroid of each piece of an element, shape (pieces, 3 or 2) [-].
        bounds: Bounds of the pieces that count, see `FlexSurfaces.spread`, shape (2, 3) [m].
        reach: Distance of the flex's surface from its elements; distance from the array below which a piece counts; and
            edge length of the squares [m].

    Returns:
        One row for each of k squares that a piece with positive depth lies in, shape (k, 3).  The first number is the
        sum over the pieces of depth times area seen along z [m3], or times length for segments.  The other two are the
        sums of this weight times x and times y of the piece [m4].
    """
    radius, margin, edge = reach
    columns, rows = int((bounds[1, 0] - bounds[0, 0]) / edge) + 1, int((bounds[1, 1] - bounds[0, 1]) / edge) + 1
    sums = np.zeros((rows * columns, 3))
    for e in range(len(corners)):
        if corners[e, :, 2].min() - radius >= margin:
            continue
        ax, ay = corners[e, 1, 0] - corners[e, 0, 0], corners[e, 1, 1] - corners[e, 0, 1]
        bx, by = corners[e, -1, 0] - corners[e, 0, 0], corners[e, -1, 1] - corners[e, 0, 1]
        size = (math.hypot(ax, ay) if corners.shape[1] == 2 else 0.5 * abs(ax * by - ay * bx)) / len(shares)  # noqa: PLR2004
        for k in range(len(shares)):
            x, y, z = 0.0, 0.0, -radius
            for c in range(shares.shape[1]):
                x += shares[k, c] * corners[e, c, 0]
                y += shares[k, c] * corners[e, c, 1]
                z += shares[k, c] * corners[e, c, 2]
            outside = (
                x < bounds[0, 0]
                or x > bounds[1, 0]
                or y < bounds[0, 1]
                or y > bounds[1, 1]
                or z < bounds[0, 2] - margin - margin
            )
            if z >= margin or outside:
                continue
            square = int((y - bounds[0, 1]) / edge) * columns + int((x - bounds[0, 0]) / edge)
            weight = size * (margin - z)
            sums[square, 0] += weight
            sums[square, 1] += weight * x
            sums[square, 2] += weight * y
    return sums[sums[:, 0] > 0]


def _list_elements(model: mujoco.MjModel, flex: int) -> IntArray:
    """List the corners of the triangles or segments that make the surface of a flex, shape (elements, 3 or 2)."""
    if model.flex_dim[flex] == _SOLID:  # MuJoCo lists the triangles of the surface of a solid flex as its shell.
        first, count = model.flex_shelldataadr[flex], model.flex_shellnum[flex]
        return model.flex_shell[first : first + count * _TRIANGLE].reshape(count, _TRIANGLE).astype(np.int64)
    corners = int(model.flex_dim[flex]) + 1
    first, count = model.flex_elemdataadr[flex], model.flex_elemnum[flex]
    return model.flex_elem[first : first + count * corners].reshape(count, corners).astype(np.int64)


def _divide(corners: int, divisions: float) -> FloatArray:
    """Divide a segment or triangle into k equal pieces, and find the centroid of each piece.

    Args:
        corners: Number of corners, 2 or 3.
        divisions: Number of divisions of each edge, rounded up.

    Returns:
        Barycentric coordinates of the centroids, the weights of the corners, shape (k, corners) [-].
    """
    n = min(max(math.ceil(divisions), 1), _MOST_DIVISIONS)
    if corners < _TRIANGLE:
        middle = (np.arange(n) + 0.5) / n
        return np.column_stack([1 - middle, middle])
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    inverted = [(i + 2 / 3, j + 2 / 3) for i in range(n) for j in range(n - i - 1)]
    second, third = np.array(upright + inverted).T / n
    return np.column_stack([1 - second - third, second, third])
