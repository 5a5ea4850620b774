"""Exact solutions of linear elastic layers, contacts on layers, and bonded disks, to verify the finite elements.

`pressed_shape` and `press_face` are boundary-element solutions on the exact compliance of the layers, for shapes of
indenters without an exact solution.  `curved` holds layers on a rigid cylinder and on a rigid sphere.

No module of this package uses code of the finite elements.
"""

from fem_reference.closed_form.boundary import PressedCells, pressed_shape
from fem_reference.closed_form.contact import LayerContact, hertz, indent, punch, sphere
from fem_reference.closed_form.curved import (
    ArcLoad,
    CapLoad,
    CylinderLayer,
    LineLoad,
    PointLoad,
    SphereLayer,
    SpherePatch,
    SpotLoad,
    touch_cylinder,
)
from fem_reference.closed_form.disk import bonded_disk, gent_lindley
from fem_reference.closed_form.influence import tabulate_texel_response
from fem_reference.closed_form.layer import (
    Transfer,
    half_space_compliance,
    one_layer_compliance,
    point_response,
    point_response_spline,
    traction_compliance,
    transfer,
    variance,
)
from fem_reference.closed_form.no_slip import StuckPunch, stuck_punch, stuck_shape
from fem_reference.closed_form.outline import press_face

__all__ = [
    "ArcLoad",
    "CapLoad",
    "CylinderLayer",
    "LayerContact",
    "LineLoad",
    "PointLoad",
    "PressedCells",
    "SphereLayer",
    "SpherePatch",
    "SpotLoad",
    "StuckPunch",
    "Transfer",
    "bonded_disk",
    "gent_lindley",
    "half_space_compliance",
    "hertz",
    "indent",
    "one_layer_compliance",
    "point_response",
    "point_response_spline",
    "press_face",
    "pressed_shape",
    "punch",
    "sphere",
    "stuck_punch",
    "stuck_shape",
    "tabulate_texel_response",
    "touch_cylinder",
    "traction_compliance",
    "transfer",
    "variance",
]
