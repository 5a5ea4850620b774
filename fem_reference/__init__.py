"""The truth: finite-element solutions of a soft cover over a rigid texel array.

What the sensor feels is the normal force on each texel's patch of the rigid base.  `point_spread` says what a unit
load anywhere on the cover puts on every texel, `press` pushes a rigid indenter into the cover and finds the contact,
and `closed_form` holds exact solutions that verify both.  Every result carries an estimate of its own error.
"""

from importlib.metadata import version

from fem_reference.errors import ConvergenceError
from fem_reference.finite_strain.bonded_disk import Squeezed, compress_disk
from fem_reference.indentation.press import Indentation, press, press_path
from fem_reference.linear_response.point_spread import PointSpread, point_spread

__version__ = version("softcover")

__all__ = [
    "ConvergenceError",
    "Indentation",
    "PointSpread",
    "Squeezed",
    "compress_disk",
    "point_spread",
    "press",
    "press_path",
]
