"""Solve the contact of a rigid frictionless flat punch or sphere with a layered cover, almost to machine precision.

The mixed boundary-value problem reduces to a Fredholm equation of the second kind (Lebedev and Ufliand 1958 for the
punch; Hayes, Keer, Herrmann and Mockros 1972 for both).  With the compliance c L(k) / k of the cover's top, where
c = (1 - nu) / mu of the top layer, and a contact pressure whose Hankel transform is int_0^a phi(t) cos(k t) dt,

    phi(x) + (2 / pi) int_0^a phi(t) M(x, t) dt = (2 / (pi c)) g(x),
    M(x, t) = int_0^inf (L(k) - 1) cos(k x) cos(k t) dk,

where a is the radius of the contact and g(x) = depth for the punch, depth - x artanh(x / R) for a sphere of radius R,
and depth - x^2 / R for a paraboloid of that radius.  The force is 2 pi int_0^a phi(t) dt.  For sphere and paraboloid
the condition phi(a) = 0 determines the depth.
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
    """Solved axisymmetric contact of a rigid indenter with an elastic cover.

    Attributes:
        force: Normal force on the indenter [N].
        depth: Approach of the indenter from first touch [m].
        contact_radius: Radius of the contact area [m].
    """

    force: float
    depth: float
    contact_radius: float


def punch(cover: Cover, radius: float, depth: float, *, nodes: int = 96) -> LayerContact:
    """Press a flat-ended rigid cylinder into a laterally wide cover.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        radius: Radius of the cylinder [m].
        depth: Approach of the cylinder from first touch [m].
        nodes: Number of Gauss points of the integral equation [-].
    """
    x, weight, matrix = _equation(cover, radius, nodes)
    phi = np.linalg.solve(matrix, np.full_like(x, depth) * _scale(cover))
    return LayerContact(force=float(2 * np.pi * weight @ phi), depth=depth, contact_radius=radius)


def sphere(
    cover: Cover, radius: float, contact_radius: float, *, paraboloid: bool = False, nodes: int = 96
) -> LayerContact:
    """Press a rigid sphere into a laterally wide cover until the contact has the given radius.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        radius: Radius R of the sphere [m].
        contact_radius: Radius of the contact area, less than `radius` [m].
        paraboloid: Replace the sphere by the paraboloid r^2 / 2 R, as in Hertz's theory.
        nodes: Number of Gauss points of the integral equation [-].

    Raises:
        ValueError: If the contact is not smaller than the sphere.
    """
    if not 0 < contact_radius < radius:
        raise ValueError(f"the contact radius must lie in 0..{radius} m, not {contact_radius}")
    x, weight, matrix = _equation(cover, contact_radius, nodes)

    def transform_gap(t: npt.ArrayLike) -> FloatArray:
        """Compute depth - g(t) of the module's integral equation, the part that depends on the indenter's shape [m]."""
        t = np.asarray(t, dtype=float)
        return t**2 / radius if paraboloid else t * np.arctanh(t / radius)

    flat = np.linalg.solve(matrix, np.ones_like(x))
    curved = np.linalg.solve(matrix, transform_gap(x))
    edge = _kernel(cover, np.array([contact_radius]), x)[0] * weight * (2 / np.pi)
    # The condition phi(a) = 0 reads g(a) = (2 / pi) int phi(t) M(a, t) dt, here with phi = depth * flat - curved.
    depth = float((transform_gap(contact_radius) - edge @ curved) / (1 - edge @ flat))
    phi = (depth * flat - curved) * _scale(cover)
    return LayerContact(force=float(2 * np.pi * weight @ phi), depth=depth, contact_radius=contact_radius)


def hertz(layer: Layer, radius: float, force: float) -> LayerContact:
    """Press a rigid sphere into a half space: a^3 = 3 F R / 4 E*, depth = a^2 / R (Hertz; Johnson 1985, eq. 4.22).

    Args:
        layer: Layer whose material fills the half space; its thickness is not used.
        radius: Radius R of the sphere [m].
        force: Normal force F on the sphere [N].
    """
    material = layer.material
    plane = material.youngs_modulus / (1 - material.poisson_ratio**2)
    contact = (3 * force * radius / (4 * plane)) ** (1 / 3)
    return LayerContact(force=force, depth=contact**2 / radius, contact_radius=contact)


def _scale(cover: Cover) -> float:
    """Compute the factor 2 / (pi c) of the right-hand side of the integral equation [Pa]."""
    material = cover.layers[-1].material
    return 2 / np.pi * material.shear_modulus / (1 - material.poisson_ratio)


def _equation(cover: Cover, radius: float, nodes: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Discretise the Fredholm equation of a contact of radius a by Gauss points.

    Returns:
        Gauss points and weights on 0..a, shape (nodes,) each [m], and the matrix of the equation, shape (nodes, nodes)
        [-].
    """
    points, weights = np.polynomial.legendre.leggauss(nodes)
    x = radius * (points + 1) / 2
    weight = radius * weights / 2
    return x, weight, np.eye(nodes) + 2 / np.pi * _kernel(cover, x, x) * weight


def _kernel(cover: Cover, x: FloatArray, t: FloatArray) -> FloatArray:
    """Evaluate the kernel M(x, t) of the Fredholm equation, shape (len(x), len(t)) [1/m]."""
    k, weight = hankel_nodes(cover, float(x.max() + t.max()))
    relative = transfer(cover, k).compliance / half_space_compliance(cover.layers[-1], k) - 1
    return np.asarray((np.cos(np.outer(x, k)) * (relative * weight)) @ np.cos(np.outer(k, t)))
