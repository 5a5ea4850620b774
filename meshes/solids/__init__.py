"""Solid meshes of curved covers: hexahedra swept from a base surface, tetrahedra, their quality, and built-in covers.

`SweptCover` (`flat_pad`, `phalanx`, `fingertip`) makes meshes of any element size. `sweep` does so for a base surface
given by the user, and `tetrahedra.fill_with_tetrahedra` for a closed surface of triangles.  A mesh must pass
`check_quality` before it is solved.
"""

from __future__ import annotations

from meshes.solids.solid_mesh import Quality, SolidMesh, check_quality, check_texels, read_mesh, write_mesh
from meshes.solids.swept import BaseSurface, SweptCover, fingertip, flat_pad, phalanx, sweep

__all__ = [
    "BaseSurface",
    "Quality",
    "SolidMesh",
    "SweptCover",
    "check_quality",
    "check_texels",
    "fingertip",
    "flat_pad",
    "phalanx",
    "read_mesh",
    "sweep",
    "write_mesh",
]
