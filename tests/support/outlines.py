"""Outlines of flat faces: the corners of a rectangle, of the letter H and of a nut [m]."""

from meshes.indenters.polygons import make_hexagon
from meshes.indenters.shapes import match_hexagon

RECTANGLE = ((5e-3, 3e-3), (-5e-3, 3e-3), (-5e-3, -3e-3), (5e-3, -3e-3))
_HALF = tuple((1e-3 * x, 1e-3 * y) for x, y in [(6, 8), (2, 8), (2, 2), (-2, 2), (-2, 8), (-6, 8)])
LETTER = _HALF + tuple((-x, -y) for x, y in _HALF)
#: The outer hexagon and the one in place of the bore.
HEXAGONS = (tuple(make_hexagon(13e-3)), tuple(make_hexagon(match_hexagon(8e-3))))
