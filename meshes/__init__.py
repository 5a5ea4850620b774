"""Texel arrays, covers, materials and indenters, as plain numpy data.

The finite-element model (`fem_reference`) and the fast model in MuJoCo (`fastmodel`) read these classes, so that a
shape is defined once for the two models.  A texel is one pressure-sensitive element of a tactile array; the cover is
the elastic layers above the array; an indenter is a rigid body that presses on the cover.  In the array's frame x goes
along columns, y along rows and z out of the cover; the origin is the array's centre.  Texels are in row-major order, x
fastest.  Tactile images are indexed `[row, column]`, with row 0 at the smallest y.
"""

import lazy_loader

# The public names are those of `__init__.pyi`.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
