"""Rigid frictionless flat punch and sphere on a layered cover, to many digits.

The mixed boundary-value problem reduces to a Fredholm equation of the second kind (Lebedev and Ufliand 1958 for the
punch; Hayes, Keer, Herrmann and Mockros 1972 for both).  With the compliance c L(k) / k of the cover's top, where
c = (1 - nu) / mu of the top layer, and a contact pressure whose Hankel transform is int_0^a phi(t) cos(k t) dt,

    phi(x) + (2 / pi) int_0^a phi(t) M(x, t) dt = (2 / (pi c)) g(x),
    M(x, t) = int_0^inf (L(k) - 1) cos(k x) cos(k t) dk,

where g = depth for the punch, and depth - x artanh(x / R) for the sphere (depth - x^2 / R for the paraboloid).  The
force is 2 pi int phi.  For sphere and paraboloid the condition phi(a) = 0 determines the depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem_reference.closed_form.layer import half_space_compliance, hankel_nodes, transfer
from meshes import Cover, Layer
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class LayerContact:
    """A solved contact.

    Attributes:
        force: Force [N].
        depth: Approach from first touch [m].
        contact_radius: Radius of the contact [m].
    """

    force: float
    depth: float
    contact_radius: float


def punch(cover: Cover, radius: float, depth: float, *, nodes: int = 96) -> LayerContact:
    """Flat-ended rigid cylinder pressed into a laterally wide cover.

    Args:
        cover: Layers; linear elastic at zero load.
        radius: Punch radius [m].
        depth: Approach [m].
        nodes: Gauss points of the integral equation [-].
    """
    x, weight, matrix = _equation(cover, radius, nodes)
    phi = np.linalg.solve(matrix, np.full_like(x, depth) * _scale(cover))
    return LayerContact(force=float(2 * np.pi * weight @ phi), depth=depth, contact_radius=radius)


def sphere(
    cover: Cover, radius: float, contact_radius: float, *, paraboloid: bool = False, nodes: int = 96
) -> LayerContact:
    """Rigid sphere pressed into a laterally wide cover until the contact has the given radius.

    Args:
        cover: Layers; linear elastic at zero load.
        radius: Sphere radius [m].
        contact_radius: Contact radius, less than `radius` [m].
        paraboloid: Use r^2 / 2R for the sphere's gap, as Hertz does.
        nodes: Gauss points of the integral equation [-].

    Raises:
        ValueError: If the contact is not smaller than the sphere.
    """
    if not 0 < contact_radius < radius:
        raise ValueError(f"the contact radius must lie in 0..{radius} m, not {contact_radius}")
    x, weight, matrix = _equation(cover, contact_radius, nodes)

    def transform_gap(t: npt.ArrayLike) -> FloatArray:
        """Contribution of the indenter's gap to g, with the sign reversed [m]."""
        t = np.asarray(t, dtype=float)
        return t**2 / radius if paraboloid else t * np.arctanh(t / radius)

    flat = np.linalg.solve(matrix, np.ones_like(x))
    curved = np.linalg.solve(matrix, transform_gap(x))
    edge = _kernel(cover, np.array([contact_radius]), x)[0] * weight * (2 / np.pi)
    # phi(a) = 0: g(a) = (2 / pi) int phi(t) M(a, t) dt for phi = depth * flat - curved
    depth = float((transform_gap(contact_radius) - edge @ curved) / (1 - edge @ flat))
    phi = (depth * flat - curved) * _scale(cover)
    return LayerContact(force=float(2 * np.pi * weight @ phi), depth=depth, contact_radius=contact_radius)


def hertz(layer: Layer, radius: float, force: float) -> LayerContact:
    """Sphere on a half space of the layer's material: a^3 = 3 F R / 4 E*, depth a^2 / R (Johnson 1985, eq. 4.22).

    Args:
        layer: Gives the material; its thickness is not used.
        radius: Sphere radius [m].
        force: Force [N].
    """
    material = layer.material
    plane = material.youngs_modulus / (1 - material.poisson_ratio**2)
    contact = (3 * force * radius / (4 * plane)) ** (1 / 3)
    return LayerContact(force=force, depth=contact**2 / radius, contact_radius=contact)


def _scale(cover: Cover) -> float:
    """Factor 2 / (pi c) of the equation's right-hand side [Pa]."""
    material = cover.layers[-1].material
    return 2 / np.pi * material.shear_modulus / (1 - material.poisson_ratio)


def _equation(cover: Cover, radius: float, nodes: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gauss points and weights on 0..a [m], and the matrix of the Fredholm equation [-]."""
    points, weights = np.polynomial.legendre.leggauss(nodes)
    x = radius * (points + 1) / 2
    weight = radius * weights / 2
    return x, weight, np.eye(nodes) + 2 / np.pi * _kernel(cover, x, x) * weight


def _kernel(cover: Cover, x: FloatArray, t: FloatArray) -> FloatArray:
    """M(x, t), shape (len(x), len(t)) [1/m]."""
    k, weight = hankel_nodes(cover, float(x.max() + t.max()))
    relative = transfer(cover, k).compliance / half_space_compliance(cover.layers[-1], k) - 1
    return np.asarray((np.cos(np.outer(x, k)) * (relative * weight)) @ np.cos(np.outer(k, t)))
