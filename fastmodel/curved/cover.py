"""Arrays that describe a curved cover: points of its surface, compliance between them, and forces on the texels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmodel.errors import FastModelError
from meshes import TexelArray
from meshes.array_types import FloatArray

#: Largest difference between the compliance and its transpose, over the largest compliance [-]: rounding to four-byte
#: numbers and the error of a direct solver stay below.
_SYMMETRIC = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedCover:
    """Linear response of a curved cover at m points of its surface, over n texels.

    A force on a point is that of a pressure around it, which falls to zero at the neighbouring points.

    Attributes:
        points: Positions of the points on the undeformed top, in the array's frame, shape (m, 3) [m].
        normals: Unit normals of the top at the points, outwards, shape (m, 3) [-].
        influence: Force on each texel, along the texel's normal, per unit force on each point against its
            normal, shape (n, m) [-].
        compliance: Displacement around each point (weighted mean over its pressure) against its normal, per unit force
            on each point, symmetric, shape (m, m) [m/N].
        thickness: Mean thickness of the cover [m].
    """

    points: FloatArray
    normals: FloatArray
    influence: FloatArray
    compliance: FloatArray
    thickness: float

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            FastModelError: If shapes do not fit.
            ValueError: If a value is not finite, a normal is no unit vector, the compliance is not symmetric or has no
                positive diagonal, or the thickness is not positive.
        """
        count = len(self.points)
        shapes = {"points": (count, 3), "normals": (count, 3), "compliance": (count, count)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise FastModelError(f"{name} of a curved cover has shape {getattr(self, name).shape}, not {shape}")
        if self.influence.ndim != 2 or self.influence.shape[1] != count:  # noqa: PLR2004
            raise FastModelError(f"influence of a curved cover has shape {self.influence.shape}, not (texels, {count})")
        for name in ("points", "normals", "influence", "compliance"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} of a curved cover has a value that is not finite")
        if np.abs(np.linalg.norm(self.normals, axis=1) - 1).max(initial=0.0) > _SYMMETRIC:
            raise ValueError("normals of a curved cover must be unit vectors")
        if np.abs(self.compliance - self.compliance.T).max() > _SYMMETRIC * np.abs(self.compliance).max():
            raise ValueError("the compliance of a curved cover must be symmetric")
        if not (np.diag(self.compliance) > 0).all():
            raise ValueError("the compliance of a curved cover must have a positive diagonal")
        if not 0 < self.thickness < np.inf:
            raise ValueError(f"thickness must be positive, not {self.thickness} m")

    def check(self, array: TexelArray) -> None:
        """Check that the cover belongs to an array.

        Raises:
            FastModelError: If it has another number of texels.
        """
        if len(self.influence) != array.count:
            raise FastModelError(f"the curved cover is for {len(self.influence)} texels; the array has {array.count}")
