"""Any closed surface of triangles as an indenter."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshes.indenters.indenter import Primitive
from meshes.indenters.prism import require_axis
from meshes.surfaces.convex_hulls import convex_hulls
from meshes.surfaces.gap import Underside, facing_down

FloatArray = npt.NDArray[np.float64]

#: Volume and height that count as none, over powers of the size [-].
_FLAT = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangleMesh:
    """A body bounded by triangles; its lowest point at z = 0, its axis through the origin.

    What the triangles are is all that counts, not the file they came from.

    Attributes:
        triangles: Corners of each triangle, counterclockwise as seen from outside, shape (n, 3, 3) [m].
    """

    triangles: FloatArray = field(metadata={"quantity": "file"})

    def __post_init__(self) -> None:
        """Check the shape of the array and freeze it; whether the surface is closed is checked where files are read.

        Raises:
            ValueError: If the shape is wrong, a number is not finite, the surface is inside out or holds no volume, its
                lowest point is not at z = 0, or the axis lies beside it.
        """
        corners = np.array(self.triangles, dtype=np.float64)
        if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners):  # noqa: PLR2004
            raise ValueError(f"triangles must have the shape (n, 3, 3), not {corners.shape}")
        if not np.isfinite(corners).all():
            raise ValueError("the corners of all triangles must be finite")
        size = float(np.ptp(corners, axis=(0, 1)).max())
        volume = float(np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)
        if not volume > _FLAT * size**3:
            raise ValueError("the surface holds no volume, or its triangles face inwards")
        if abs(corners[..., 2].min()) > _FLAT * size:
            raise ValueError(f"the lowest point must stand at z = 0, not at {corners[..., 2].min()} m")
        require_axis(corners[..., :2].reshape(-1, 2))
        corners.setflags(write=False)
        object.__setattr__(self, "triangles", corners)

    axisymmetric = False

    def __eq__(self, other: object) -> bool:
        """Whether the triangles are the same."""
        return isinstance(other, TriangleMesh) and np.array_equal(self.triangles, other.triangles)

    def __hash__(self) -> int:
        """Of the triangles."""
        return hash(self.triangles.tobytes())

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        reach = np.abs(self.triangles[..., :2]).max(axis=(0, 1))
        return (float(reach[0]), float(reach[1]))

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height of the lowest triangle over each point, exact [m]."""
        x, y = np.broadcast_arrays(x, y)
        return self._underside.height(x.ravel(), y.ravel()).reshape(x.shape)

    @cached_property
    def lower(self) -> FloatArray:
        """Triangles that face down, shape (m, 3, 3) [m]."""
        return facing_down(self.triangles)

    @cached_property
    def _underside(self) -> Underside:
        return Underside(self.lower)

    @cached_property
    def _parts(self) -> tuple[Primitive, ...]:
        return tuple(
            Primitive(kind="hull", vertices=tuple((float(x), float(y), float(z)) for x, y, z in hull))
            for hull in convex_hulls(self.triangles)
        )

    def primitives(self) -> tuple[Primitive, ...]:
        """One hull where the underside is convex; else hulls that make it up within a small share of its width."""
        return self._parts
