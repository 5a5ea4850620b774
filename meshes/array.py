"""Texel arrays: where the pressure-sensitive elements are and how large they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

#: Share of a pitch by which texels of an even grid may stand off it [-].
_EVEN = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class TexelArray:
    """A tactile array of `n` texels, in the array's own frame.

    Texels are row-major, x fastest.  A texel whose `active` entry is false exists as a place but measures
    nothing: force on it counts as force outside the array.

    Attributes:
        centres: Texel centres, shape (n, 3) [m].
        normals: Unit outward normals, shape (n, 3) [-].
        texel_size: Edge lengths of a texel's sensitive rectangle along x and y [m].
        pitch: Distance between neighbouring centres along x and y [m].
        rows: Number of image rows [-].
        columns: Number of image columns [-].
        active: Which texels measure, shape (n,).
        name: What to call the array in reports.
    """

    centres: FloatArray
    normals: FloatArray
    texel_size: tuple[float, float]
    pitch: tuple[float, float]
    rows: int
    columns: int
    active: BoolArray
    name: str = "array"

    def __post_init__(self) -> None:
        """Check shapes and freeze the arrays.

        Raises:
            ValueError: If shapes disagree, a size is not positive, or a normal is not a unit vector.
        """
        n = len(self.centres)
        if self.rows < 1 or self.columns < 1 or self.rows * self.columns != n:
            raise ValueError(f"rows x columns is {self.rows} x {self.columns} but there are {n} texel centres")
        if self.centres.shape != (n, 3) or self.normals.shape != (n, 3) or self.active.shape != (n,):
            raise ValueError("centres and normals must have shape (n, 3), active must have shape (n,)")
        if min(*self.texel_size, *self.pitch) <= 0:
            raise ValueError("texel_size and pitch must be positive")
        if not np.allclose(np.linalg.norm(self.normals, axis=1), 1, atol=1e-9):
            raise ValueError("normals must be unit vectors")
        if not self.active.any():
            raise ValueError("every texel is masked; at least one must be active")
        for values in (self.centres, self.normals, self.active):
            values.setflags(write=False)

    @classmethod
    def grid(
        cls,
        rows: int,
        columns: int,
        pitch: float | tuple[float, float],
        *,
        texel_size: float | tuple[float, float] | None = None,
        active: npt.ArrayLike | None = None,
        name: str = "array",
    ) -> TexelArray:
        """Make a flat, centred grid of texels.

        Args:
            rows: Number of rows along y [-].
            columns: Number of columns along x [-].
            pitch: Distance between centres, one number or (x, y) [m].
            texel_size: Sensitive rectangle of a texel; the pitch when not given [m].
            active: Which texels measure, shape (rows, columns) or (rows * columns,); all when not given.
            name: What to call the array.

        Raises:
            ValueError: If a number is not positive or `active` has the wrong shape.
        """
        if rows < 1 or columns < 1:
            raise ValueError(f"rows and columns must be at least 1, not {rows} and {columns}")
        step = _pair(pitch)
        x = (np.arange(columns) - (columns - 1) / 2) * step[0]
        y = (np.arange(rows) - (rows - 1) / 2) * step[1]
        centres = np.zeros((rows * columns, 3))
        centres[:, 0] = np.tile(x, rows)
        centres[:, 1] = np.repeat(y, columns)
        mask = np.ones(rows * columns, dtype=bool) if active is None else np.array(active, dtype=bool).ravel()
        return cls(
            centres=centres,
            normals=np.tile([0.0, 0.0, 1.0], (rows * columns, 1)),
            texel_size=step if texel_size is None else _pair(texel_size),
            pitch=step,
            rows=rows,
            columns=columns,
            active=mask,
            name=name,
        )

    @property
    def count(self) -> int:
        """Number of texels, masked ones included [-]."""
        return len(self.centres)

    @property
    def planar(self) -> bool:
        """Whether all texels lie in the plane z = 0 and look along +z."""
        return bool(np.allclose(self.centres[:, 2], 0) and np.allclose(self.normals, [0, 0, 1]))

    @property
    def even(self) -> bool:
        """Whether it is flat and its texels lie on a grid of the pitch."""
        if not self.planar:
            return False
        grid = TexelArray.grid(self.rows, self.columns, self.pitch)
        return bool(np.ptp(self.centres - grid.centres, axis=0).max() <= _EVEN * min(self.pitch))

    @property
    def extent(self) -> tuple[float, float]:
        """Edge lengths of the rectangle that holds every texel, along x and y [m]."""
        spread = np.ptp(self.centres[:, :2], axis=0)
        return (float(spread[0] + self.texel_size[0]), float(spread[1] + self.texel_size[1]))

    @property
    def middle(self) -> int:
        """Index of texel `[rows // 2, columns // 2]` [-]."""
        return (self.rows // 2) * self.columns + self.columns // 2

    def image(self, values: npt.ArrayLike) -> npt.NDArray[np.generic]:
        """Arrange one value per texel as an image, shape (..., n) to (..., rows, columns)."""
        flat = np.asarray(values)
        return flat.reshape(*flat.shape[:-1], self.rows, self.columns)


def _pair(value: float | tuple[float, float]) -> tuple[float, float]:
    if isinstance(value, tuple):
        return (float(value[0]), float(value[1]))
    return (float(value), float(value))
