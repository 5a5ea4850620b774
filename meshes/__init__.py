"""What things look like: texel arrays, covers and indenters, as plain numpy data.

Nothing here knows a model. `fem_reference` and `fastmodel` both read these classes, so that one definition of
a shape serves both.  Array frame: x along columns, y along rows, z out of the cover, origin in the array's
centre.  Texel order is row-major, x fastest; images are `[row, column]` with row 0 at the smallest y.
"""

from importlib.metadata import version

from meshes.array import TexelArray
from meshes.cover import Cover, Layer
from meshes.indenters.flat_faces import LetterH, Nut
from meshes.indenters.indenter import Box, Cone, Cylinder, Indenter, Primitive, Roller, RoundedTip, Sphere
from meshes.indenters.prism import Prism
from meshes.material import Material
from meshes.surfaces.stl import read_stl
from meshes.surfaces.triangle_mesh import TriangleMesh

__version__ = version("softcover")

__all__ = [
    "Box",
    "Cone",
    "Cover",
    "Cylinder",
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
