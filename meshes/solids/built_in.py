"""Built-in covers of known thickness: a flat pad, a segment of a finger, and a fingertip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from meshes.array import TexelArray
from meshes.solids.base_surface import BaseSurface, cylinder_surface, fingertip_surface, flat_surface
from meshes.solids.solid_mesh import SolidMesh
from meshes.solids.sweep import LAYERS, sweep
from meshes.solids.texels import cylinder_texels, fingertip_texels

#: Element size along the base over the thickness of the cover, unless one is given [-].
_ELEMENT_SIZE = 0.5
#: Element sizes over the thickness, and layers of elements, of three meshes for an estimate of the error [-].
_MESHES = ((0.48, 3), (0.38, 3), (0.3, 4))


@dataclass(frozen=True, kw_only=True)
class SweptCover:
    """Cover of even thickness on a base surface that is meshed with any element size, with free sides.

    Attributes:
        texels: Texels on the base.
        thickness: Thickness of the cover, along the normals of the base [m].
        surface: Function that meshes the base surface with a largest element size [m].
    """

    texels: TexelArray
    thickness: float
    surface: Callable[[float], BaseSurface]

    def mesh(self, element_size: float | None = None, *, layers: int = LAYERS) -> SolidMesh:
        """Mesh the cover by hexahedra.

        Args:
            element_size: Largest edge length along the base; half the thickness if None [m].
            layers: Number of layers of elements through the thickness [-].
        """
        size = _ELEMENT_SIZE * self.thickness if element_size is None else element_size
        return sweep(self.surface(size), self.thickness, layers=layers)

    def meshes(self, size: float = 1.0) -> tuple[SolidMesh, SolidMesh, SolidMesh]:
        """Make three meshes from coarse to fine, with 3, 3 and 4 layers, from which errors are estimated.

        Args:
            size: Factor on the element sizes along the base [-].
        """
        coarse, middle, fine = (self.mesh(size * step * self.thickness, layers=layers) for step, layers in _MESHES)
        return coarse, middle, fine


def flat_pad(
    *, size: tuple[float, float] = (20e-3, 20e-3), thickness: float = 2e-3, rows: int = 5, pitch: float = 3.4e-3
) -> SweptCover:
    """Make a flat pad with free sides and a square array in its middle.

    Args:
        size: Edge lengths along x and y [m].
        thickness: Thickness [m].
        rows: Number of rows and of columns [-].
        pitch: Pitch of the texels, which touch one another [m].
    """
    texels = TexelArray.grid(rows, rows, pitch, name="flat-pad")
    return SweptCover(texels=texels, thickness=thickness, surface=partial(flat_surface, size))


def phalanx(
    *,
    radius: float = 6e-3,
    angle: float = float(np.radians(120)),
    length: float = 20e-3,
    thickness: float = 2e-3,
    rows: int = 8,
    columns: int = 5,
    pitch: float = 2.2e-3,
) -> SweptCover:
    """Make a segment of a cylinder about y, as on the middle of a finger, with square texels.

    Args:
        radius: Radius of the base [m].
        angle: Opening angle [rad].
        length: Length along y [m].
        thickness: Thickness [m].
        rows: Number of texels along y [-].
        columns: Number of texels around [-].
        pitch: Pitch of the texels; their edge length is 0.9 of it [m].
    """
    texels = cylinder_texels(
        radius, rows=rows, columns=columns, pitch=(pitch, pitch), size=(0.9 * pitch, 0.9 * pitch), name="phalanx"
    )
    surface = partial(cylinder_surface, radius, angle, length)
    return SweptCover(texels=texels, thickness=thickness, surface=surface)


def fingertip(
    *, radius: float = 6e-3, length: float = 14.4e-3, thickness: float = 2e-3, pitch: float = 2.35e-3
) -> SweptCover:
    """Make the front half of a fingertip: half a cylinder about y that ends in a quarter sphere; 66 texels by default.

    Args:
        radius: Radius of the base [m].
        length: Length of the cylinder, from y = -length to 0 [m].
        thickness: Thickness [m].
        pitch: Wanted pitch of the texels; their edge length is 0.85 of it [m].
    """
    texels = fingertip_texels(radius, length, pitch=pitch, size=0.85 * pitch, name="fingertip")
    return SweptCover(texels=texels, thickness=thickness, surface=partial(fingertip_surface, radius, length))
