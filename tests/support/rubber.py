"""Rubber covers and small meshes of them that tests of the finite elements share."""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem

from fem_reference.elements.taylor_hood import prepare_elements
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.loading_path import Units
from meshes import Cover, Layer, Material

YOUNGS_MODULUS = 1e6


def make_rubber(poisson_ratio: float = 0.49, model: str = "neo-hookean") -> Material:
    """Rubber with a Young's modulus of 1 MPa, for finite strain or `linear-elastic`."""
    parameters = {"youngs_modulus": YOUNGS_MODULUS}
    if model == "neo-hookean":
        parameters = {"shear_modulus": YOUNGS_MODULUS / (2 * (1 + poisson_ratio))}
    return Material(name="rubber", model=model, parameters=parameters, poisson_ratio=poisson_ratio)


def make_cover(
    poisson_ratio: float = 0.49, model: str = "neo-hookean", *, thickness: float = 2e-3, **options: Any
) -> Cover:
    """One bonded layer of that rubber; thickness in metres."""
    layer = Layer(thickness=thickness, material=make_rubber(poisson_ratio, model))
    return Cover(layers=(layer,), **options)


def stack_layers(*layers: tuple[float, float, float], **options: Any) -> Cover:
    """Linear-elastic layers, bottom first: thickness [m], Young's modulus [Pa] and Poisson ratio of each."""
    return Cover(
        layers=tuple(
            Layer(
                thickness=thickness,
                material=Material(
                    name="layer", model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=ratio
                ),
            )
            for thickness, modulus, ratio in layers
        ),
        **options,
    )


def make_solid(kind: str, poisson_ratio: float = 0.45, *, direct: float = 0.0) -> Solid:
    """A small "block" or "ring" of elements, in units of one; `direct` as in `Solid.from_cover`."""
    ring = skfem.MeshQuad().refined(2).translated((0.5, 0.0))
    mesh = ring if kind == "ring" else skfem.MeshHex().refined(1)
    elements = prepare_elements(mesh, axisymmetric=kind == "ring")
    cover = make_cover(poisson_ratio)
    return Solid.from_cover(elements, cover, Units.of(cover), direct=direct)


def count_unknowns(solid: Solid) -> int:
    """Displacements and pressures of a solid."""
    return solid.elements.displacements + solid.elements.pressures


def draw_state(solid: Solid, size: float, seed: int = 0) -> np.ndarray:
    """A random state with displacements and pressures of about `size`."""
    return size * np.random.default_rng(seed).standard_normal(count_unknowns(solid))
