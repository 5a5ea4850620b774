"""Reference solutions by finite elements: a soft cover, bonded to a rigid texel array, under a rigid indenter.

A texel is one pressure-sensitive element of the array; the force on a texel is the normal force on its part of the
rigid base.  `point_spread` returns the texel forces due to a unit load at any point of the cover.  `press` presses a
rigid indenter into the cover and solves the contact.  `closed_form` holds exact solutions for verification.  Every
result contains an estimate of its discretisation error.
"""

import lazy_loader

# The public names are those of `__init__.pyi`.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
