"""Exact solutions of linear elastic layers, contacts on layers, and layers on a rigid cylinder.

These solutions verify the finite elements.  No module of this package uses code of the finite elements.
"""

from fem_reference.closed_form.contact import LayerContact, indent, punch, sphere
from fem_reference.closed_form.cylinder import CylinderLayer
from fem_reference.closed_form.layer import (
    Transfer,
    half_space_compliance,
    point_response,
    tabulate_texel_response,
    transfer,
)

__all__ = [
    "CylinderLayer",
    "LayerContact",
    "Transfer",
    "half_space_compliance",
    "indent",
    "point_response",
    "punch",
    "sphere",
    "tabulate_texel_response",
    "transfer",
]
