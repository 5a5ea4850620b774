"""Fits of the fast model's contact stiffnesses to the depth of a sphere that presses on the cover."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshes import Cover, Sphere

if TYPE_CHECKING:
    from fastmodel.fitting.contact_stiffness import ContactFit, FoundationFit

FloatArray = npt.NDArray[np.float64]

#: Radius of the sphere that presses on the cover: an object of the size of a fingertip [m].
_SPHERE_RADIUS = 5e-3
#: Radii of the contact area between sphere and cover for which force and depth are computed, over the thickness of the
#: cover [-].
_CONTACTS_BY_THICKNESS = (0.25, 0.5, 0.75, 1.0, 1.5)
#: Largest radius of the contact area, over the radius of the sphere.  The closed-form solution replaces the sphere by a
#: paraboloid, which is acceptable up to about this ratio [-].
_LARGEST_CONTACT = 0.8
#: Radii of the contact area over the radius of the sphere, for thick covers.  There the limit `_LARGEST_CONTACT` leaves
#: fewer than three of the radii in `_CONTACTS_BY_THICKNESS` [-].
_CONTACTS_BY_RADIUS = (0.2, 0.4, _LARGEST_CONTACT)


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthFits:
    """Forces and depths of a sphere that presses on a cover, and the contact stiffnesses fitted to them.

    Attributes:
        ball_radius: Radius of the sphere [m].
        load: Forces on the sphere in k presses, shape (k,) [N].
        depth: Approaches of the sphere from first touch by the closed-form layer solution, shape (k,) [m].
        foundation: Fitted modulus of an elastic foundation, independent springs under the sphere.
        contact: Fitted contact parameters of MuJoCo.
    """

    ball_radius: float
    load: FloatArray
    depth: FloatArray
    foundation: FoundationFit
    contact: ContactFit


def fit_depth(cover: Cover) -> DepthFits:
    """Compute forces and depths of a sphere on a wide cover, and fit the fast model's contact stiffnesses to them.

    The fitted quantities are the modulus of an elastic foundation and the contact parameters of MuJoCo.

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
