"""Reference solutions by finite elements: a soft cover, bonded to a rigid texel array, under a rigid indenter.

A texel is one pressure-sensitive element of the array; the force on a texel is the normal force on its part of the
rigid base.  `point_spread` returns the texel forces due to a unit load at any point of the cover.  `press` presses a
rigid indenter into the cover and solves the contact.  `closed_form` holds exact solutions for verification.  Every
result contains an estimate of its discretisation error.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fem_reference.errors import ConvergenceError, IncompletePathError
    from fem_reference.indentation.press import press, press_path
    from fem_reference.indentation.result import Indentation
    from fem_reference.linear_response.axisymmetric import point_spread
    from fem_reference.linear_response.point_spread import PointSpread

#: The module that defines each public name of this package.  A module is imported when one of its names is first used,
#: so that `fem_reference.result_store` can be used where scikit-fem is not installed.
_MODULES = {
    "ConvergenceError": "fem_reference.errors",
    "IncompletePathError": "fem_reference.errors",
    "Indentation": "fem_reference.indentation.result",
    "press": "fem_reference.indentation.press",
    "press_path": "fem_reference.indentation.press",
    "PointSpread": "fem_reference.linear_response.point_spread",
    "point_spread": "fem_reference.linear_response.axisymmetric",
}

__all__ = [
    "ConvergenceError",
    "IncompletePathError",
    "Indentation",
    "PointSpread",
    "point_spread",
    "press",
    "press_path",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 -- any public name
    """Import a public name, or look up `__version__`, when it is first used."""
    if name == "__version__":
        return import_module("importlib.metadata").version("softcover")
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)
