"""Texel arrays, covers, materials and indenters, as plain numpy data.

The finite-element model (`fem_reference`) and the fast model in MuJoCo (`fastmodel`) read these classes, so that a
shape is defined once for the two models.  A texel is one pressure-sensitive element of a tactile array; the cover is
the elastic layers above the array; an indenter is a rigid body that presses on the cover.  In the array's frame x goes
along columns, y along rows and z out of the cover; the origin is the array's centre.  Texels are in row-major order, x
fastest.  Tactile images are indexed `[row, column]`, with row 0 at the smallest y.
"""

from __future__ import annotations

from meshes.array import TexelArray
from meshes.cover import Cover, Layer, SolidCover
from meshes.indenters.shapes import (
    Box,
    Cone,
    Cylinder,
    FlatPunch,
    Indenter,
    LetterH,
    Nut,
    Primitive,
    Prism,
    Roller,
    RoundedTip,
    Sphere,
)
from meshes.indenters.triangle_mesh import TriangleMesh
from meshes.material import Material
from meshes.pose import Pose
from meshes.surfaces.files import read_stl
from meshes.tilt import TiltedIndenter, tilt_indenter

__all__ = [
    "Box",
    "Cone",
    "Cover",
    "Cylinder",
    "FlatPunch",
    "Indenter",
    "Layer",
    "LetterH",
    "Material",
    "Nut",
    "Pose",
    "Primitive",
    "Prism",
    "Roller",
    "RoundedTip",
    "SolidCover",
    "Sphere",
    "TexelArray",
    "TiltedIndenter",
    "TriangleMesh",
    "read_stl",
    "tilt_indenter",
]


def __getattr__(name: str) -> str:
    """Return the package's version for the name `__version__`, looked up on first use because that takes about 30 ms.

    Raises:
        AttributeError: For any other name.
    """
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version

    return version("softcover")
