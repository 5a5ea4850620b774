"""Tactile arrays: positions and sizes of their texels, the pressure-sensitive elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshes.array_types import BoolArray, FloatArray, is_positive

#: Largest distance of a texel's centre from its place in a regular grid, over the pitch, for which an array counts as
#: regular [-].  It is larger than the rounding of coordinates in a file.
_REGULAR = 1e-6
#: Largest number of texels of an array that is read from a file: with more, the kernels of the cover would need
#: gigabytes of memory [-].
MOST_TEXELS = 10_000


def check_texel_count(rows: object, columns: object) -> None:
    """Check the numbers of rows and columns that a file states, before memory is allocated for its texels.

    Raises:
        ValueError: If a number is not a positive integer, or there are more than `MOST_TEXELS` texels.
    """
    for name, value in (("rows", rows), ("columns", columns)):
        if not isinstance(value, int) or isinstance(value, bool) or value < 1:
            raise ValueError(f"{name} must be a whole number from 1 on, not {str(value)[:40]!r}")
    if isinstance(rows, int) and isinstance(columns, int) and rows * columns > MOST_TEXELS:
        raise ValueError(f"{rows} rows of {columns} texels are too many; at most {MOST_TEXELS} texels are supported")


def check_margin(margin: Any) -> tuple[float, float]:  # noqa: ANN401 -- anything is checked
    """Return the width of a cover beyond the texels along x and y, given as one number or two [m].

    Raises:
        ValueError: If it is neither, or a width is negative or not finite.
    """
    try:
        x, y = np.broadcast_to(np.asarray(margin, dtype=np.float64), 2).tolist()
    except (TypeError, ValueError):
        x = y = np.nan
    if not (0 <= x < np.inf and 0 <= y < np.inf):
        raise ValueError(f"margin must be the width of the cover beyond the texels, 0 m or more, not {margin} m")
    return x, y


@dataclass(frozen=True, kw_only=True, eq=False)
class TexelArray:
    """A tactile array of n texels.

    In the array's frame x goes along columns, y along rows and z out of the cover.  Texels are in row-major order, x
    fastest.  A masked texel, whose `active` entry is false, measures nothing: force on a masked texel counts as force
    outside the array.

    Attributes:
        centres: Centres of the texels, shape (n, 3) [m].
        normals: Unit outward normals of the texels, shape (n, 3) [-].
        texel_size: Edge lengths, along x and y, of the rectangle on which a texel measures force [m].
        pitch: Distance between neighbouring centres along x and y [m].
        rows: Number of image rows [-].
        columns: Number of image columns [-].
        active: Whether each texel measures a force, shape (n,); false for masked texels.
        name: Name of the array in reports.
        margin: Width of the cover beyond the texels, along x and y, from half a pitch beyond the outermost centres to
            the edge of the cover [m]; None if it is not known.
    """

    centres: FloatArray
    normals: FloatArray
    texel_size: tuple[float, float]
    pitch: tuple[float, float]
    rows: int
    columns: int
    active: BoolArray
    name: str = "array"
    margin: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Check shapes and values, and make the numpy arrays read-only.

        Raises:
            ValueError: If shapes disagree, a centre is not finite, a size is not positive, a normal is no unit vector,
                all texels are masked, or the margin is negative.
        """
        n = len(self.centres)
        if self.rows < 1 or self.columns < 1 or self.rows * self.columns != n:
            raise ValueError(f"rows x columns is {self.rows} x {self.columns} but there are {n} texel centres")
        if self.centres.shape != (n, 3) or self.normals.shape != (n, 3) or self.active.shape != (n,):
            raise ValueError("centres and normals must have shape (n, 3), active must have shape (n,)")
        if not np.isfinite(self.centres).all():
            raise ValueError("centres must be finite")
        if not all(map(is_positive, (*self.texel_size, *self.pitch))):
            raise ValueError("texel_size and pitch must be positive")
        if not np.allclose(np.linalg.norm(self.normals, axis=1), 1, atol=1e-9):
            raise ValueError("normals must be unit vectors")
        if not self.active.any():
            raise ValueError("every texel is masked; at least one must be active")
        if self.margin is not None:
            check_margin(self.margin)
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
        margin: float | tuple[float, float] | None = None,
    ) -> TexelArray:
        """Make a planar array of texels on a regular grid, centred on the origin.

        Args:
            rows: Number of rows along y [-].
            columns: Number of columns along x [-].
            pitch: Distance between neighbouring centres, one number or (x, y) [m].
            texel_size: Edge lengths of a texel, one number or (x, y); the pitch if None [m].
            active: Whether each texel measures, shape (rows, columns) or (rows * columns,); all texels if None.
            name: Name of the array in reports.
            margin: Width of the cover beyond the texels, one number or (x, y); None if it is not known [m].

        Raises:
            ValueError: If a number is not positive, the margin is negative, or `active` has the wrong shape or masks
                all texels.
        """
        if rows < 1 or columns < 1:
            raise ValueError(f"rows and columns must be at least 1, not {rows} and {columns}")
        step = _as_pair(pitch)
        x, y = np.meshgrid(
            (np.arange(columns) - (columns - 1) / 2) * step[0], (np.arange(rows) - (rows - 1) / 2) * step[1]
        )
        mask = np.ones(rows * columns, dtype=bool) if active is None else np.array(active, dtype=bool).ravel()
        return cls(
            centres=np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3),
            normals=np.tile([0.0, 0.0, 1.0], (rows * columns, 1)),
            texel_size=step if texel_size is None else _as_pair(texel_size),
            pitch=step,
            rows=rows,
            columns=columns,
            active=mask,
            name=name,
            margin=None if margin is None else check_margin(margin),
        )

    @property
    def count(self) -> int:
        """Number of texels n, masked ones included [-]."""
        return len(self.centres)

    @property
    def margin_pitches(self) -> tuple[float, float]:
        """Width of the cover beyond the texels along x and y in pitches, one if the array states none [-]."""
        x, y = np.divide(self.pitch if self.margin is None else self.margin, self.pitch).tolist()
        return x, y

    @property
    def planar(self) -> bool:
        """Whether all texels lie in the plane z = 0 and their normals point along +z."""
        return bool(np.allclose(self.centres[:, 2], 0) and np.allclose(self.normals, [0, 0, 1]))

    def require_planar(self) -> None:
        """Raise an error if the array is not planar, for functions that are limited to covers of planar layers.

        Raises:
            ValueError: If the array is not planar.
        """
        if not self.planar:
            raise ValueError(
                "a planar cover needs a planar array: all texels at z = 0 looking along +z; derive a flat array of the "
                "same pitch, then exchange the array: dataclasses.replace(fastmodel.load(folder), array=..., tables={})"
            )

    @property
    def regular(self) -> bool:
        """Whether the array is planar and its texels lie on a grid of the given pitch."""
        grid = TexelArray.grid(self.rows, self.columns, self.pitch)
        apart = np.ptp(self.centres - grid.centres, axis=0).max()
        return self.planar and bool(apart <= _REGULAR * min(self.pitch))

    @property
    def layout(self) -> str:
        """Columns and rows in words, such as `6 columns x 14 rows`."""
        numbers = ((self.columns, "column"), (self.rows, "row"))
        return " x ".join(f"{number} {name}{'s' * (number != 1)}" for number, name in numbers)

    @property
    def extent(self) -> tuple[float, float]:
        """Edge lengths of the rectangle that contains all texels, along x and y [m]."""
        distance = np.ptp(self.centres[:, :2], axis=0)
        return (float(distance[0] + self.texel_size[0]), float(distance[1] + self.texel_size[1]))

    @property
    def middle(self) -> int:
        """Index of the texel in the middle of the image, `[rows // 2, columns // 2]` [-]."""
        return (self.rows // 2) * self.columns + self.columns // 2

    def image(self, values: npt.ArrayLike) -> npt.NDArray[np.generic]:
        """Reshape values of the texels into tactile images.

        Args:
            values: One value per texel, shape (..., n).

        Returns:
            The values as images, shape (..., rows, columns).
        """
        flat = np.asarray(values)
        return flat.reshape(*flat.shape[:-1], self.rows, self.columns)


def _as_pair(value: float | tuple[float, float]) -> tuple[float, float]:
    x, y = value if isinstance(value, tuple) else (value, value)
    return (float(x), float(y))
