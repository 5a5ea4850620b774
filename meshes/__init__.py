"""Texel arrays, covers, materials and indenters, as plain numpy data.

Both models, `fem_reference` and `fastmodel`, read these classes, so that a shape is defined once for both.  In the
array's frame x goes along columns, y along rows and z out of the cover; the origin is the array's centre.  Texels are
in row-major order, x fastest.  Images are indexed `[row, column]`, row 0 at the smallest y.
"""

from __future__ import annotations

from meshes.array import TexelArray
from meshes.cover import Cover, Layer
from meshes.indenters.box import Box
from meshes.indenters.cone import Cone
from meshes.indenters.cylinder import Cylinder
from meshes.indenters.indenter import FlatPunch, Indenter, Primitive
from meshes.indenters.letter_h import LetterH
from meshes.indenters.nut import Nut
from meshes.indenters.prism import Prism
from meshes.indenters.roller import Roller
from meshes.indenters.rounded_tip import RoundedTip
from meshes.indenters.sphere import Sphere
from meshes.indenters.triangle_mesh import TriangleMesh
from meshes.material import Material
from meshes.surfaces.stl import read_stl

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
    "Primitive",
    "Prism",
    "Roller",
    "RoundedTip",
    "Sphere",
    "TexelArray",
    "TriangleMesh",
    "read_stl",
]


def __getattr__(name: str) -> str:
    """Look up `__version__` when it is used: the look-up takes about 30 ms."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version

    return version("softcover")
