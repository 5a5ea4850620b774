"""Contact stiffnesses of the fast model, fitted to the depth of a sphere on the cover."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshes import Cover, Sphere

if TYPE_CHECKING:
    from fastmodel.fitting.contact_stiffness import ContactFit, FoundationFit

FloatArray = npt.NDArray[np.float64]

#: Radius of the sphere: that of a typical fingertip-sized object [m].
_SPHERE_RADIUS = 5e-3
#: Contact radii at which depths are computed, over the thickness of the cover [-].
_CONTACTS_BY_THICKNESS = (0.25, 0.5, 0.75, 1.0, 1.5)
#: Largest contact radius over the radius of the sphere.  The closed form replaces the sphere by a parabola, which is
#: acceptable up to about this ratio [-].
_LARGEST_CONTACT = 0.8
#: Contact radii over the radius of the sphere for thick covers, where the list above has fewer than three sizes [-].
_CONTACTS_BY_RADIUS = (0.2, 0.4, _LARGEST_CONTACT)


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthFits:
    """Force and depth of a sphere on the cover, and the stiffnesses fitted to them.

    Attributes:
        ball_radius: Radius of the sphere [m].
        load: Forces, shape (k,) [N].
        depth: Approaches from first touch by the closed-form layer solution, shape (k,) [m].
        foundation: Modulus of the elastic foundation.
        contact: MuJoCo's contact parameters.
    """

    ball_radius: float
    load: FloatArray
    depth: FloatArray
    foundation: FoundationFit
    contact: ContactFit


def fit_depth(cover: Cover) -> DepthFits:
    """Press a sphere into a wide cover and fit the foundation's modulus and MuJoCo's contact parameters.

    Args:
        cover: A laterally wide cover, linearised at zero load.
    """
    from fastmodel.fitting.contact_stiffness import fit_contact, fit_foundation
    from fem_reference.closed_form.contact import sphere

    largest = _LARGEST_CONTACT * _SPHERE_RADIUS
    contacts = np.unique(np.minimum(np.array(_CONTACTS_BY_THICKNESS) * cover.thickness, largest))
    if len(contacts) < len(_CONTACTS_BY_RADIUS):
        contacts = _SPHERE_RADIUS * np.array(_CONTACTS_BY_RADIUS)
    pressed = [sphere(cover, _SPHERE_RADIUS, float(contact)) for contact in contacts]
    load = np.array([each.force for each in pressed])
    depth = np.array([each.depth for each in pressed])
    return DepthFits(
        ball_radius=_SPHERE_RADIUS,
        load=load,
        depth=depth,
        foundation=fit_foundation(Sphere(radius=_SPHERE_RADIUS), load, depth),
        contact=fit_contact(load, depth),
    )
