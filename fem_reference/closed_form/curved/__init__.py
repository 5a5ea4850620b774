"""Exact solutions of elastic layers bonded to a rigid cylinder or sphere, under any traction on their tops."""

from fem_reference.closed_form.curved.cylinder import ArcLoad, CylinderLayer, CylinderResponse, LineLoad
from fem_reference.closed_form.curved.sphere import CapLoad, PointLoad, SphereLayer, SphereResponse
from fem_reference.closed_form.curved.sphere_patch import SpherePatch
from fem_reference.closed_form.curved.spots import SpotLoad, SpotResponse, touch_cylinder

__all__ = [
    "ArcLoad",
    "CapLoad",
    "CylinderLayer",
    "CylinderResponse",
    "LineLoad",
    "PointLoad",
    "SphereLayer",
    "SpherePatch",
    "SphereResponse",
    "SpotLoad",
    "SpotResponse",
    "touch_cylinder",
]
