# The public names of `meshes`.  A module is imported when one of its names is first used.

from .array import TexelArray as TexelArray
from .cover import Cover as Cover, SolidCover as SolidCover
from .indenters.shapes import (
    Box as Box,
    Cone as Cone,
    Cylinder as Cylinder,
    FlatPunch as FlatPunch,
    Indenter as Indenter,
    LetterH as LetterH,
    Nut as Nut,
    Primitive as Primitive,
    Prism as Prism,
    Roller as Roller,
    RoundedTip as RoundedTip,
    Sphere as Sphere,
)
from .indenters.triangle_mesh import TriangleMesh as TriangleMesh
from .layer import Layer as Layer
from .material import Material as Material
from .pose import Pose as Pose
from .surfaces.files import read_stl as read_stl
from .tilt import TiltedIndenter as TiltedIndenter, tilt_indenter as tilt_indenter
