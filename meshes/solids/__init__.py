"""Solid meshes of curved covers: hexahedra swept from a base surface, tetrahedra, their quality, and built-in covers.

`SweptCover` (`flat_pad`, `phalanx`, `fingertip`) makes meshes of any element size; `sweep` does so for a surface of
one's own, and `tetrahedra.fill_with_tetrahedra` for a closed surface of triangles.  `check_quality` must be passed
before a mesh is solved.
"""

from __future__ import annotations

from meshes.solids.base_surface import BaseSurface
from meshes.solids.built_in import SweptCover, fingertip, flat_pad, phalanx
from meshes.solids.quality import Quality, check_quality, check_texels
from meshes.solids.solid_mesh import SolidMesh, read_mesh, write_mesh
from meshes.solids.sweep import sweep

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
