"""How the width of the kernel changes with thickness, Poisson ratio and Young's modulus of the cover."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from meshes import Cover, TexelArray
from validation.derivation.kernel_fit import fitting_grid, uncut_sigma

if TYPE_CHECKING:
    from fem_reference.linear_response.point_spread import PointSpread

#: Relative step of the thickness in its central difference [-].
_THICKNESS_STEP = 0.02
#: Absolute step of the Poisson ratio in its finite difference [-].
_POISSON_STEP = 0.005


def sigma_sensitivities(cover: Cover, array: TexelArray, spread: PointSpread) -> dict[str, float]:
    """Derivatives of sigma_x of the uncut kernel; all layers change together.

    Args:
        cover: A laterally wide cover.
        array: The sensor's texels.
        spread: The point spread function of the cover.

    Returns:
        `thickness` [pitches/m], `poisson_ratio` [pitches] and `youngs_modulus` [pitches/Pa].
    """
    grid = fitting_grid(array)
    return {
        "thickness": _thickness_slope(cover.thickness, grid, spread),
        "poisson_ratio": sum(_poisson_slope(cover, grid, spread, layer) for layer in range(len(cover.layers))),
        # Multiplying all moduli by one factor divides all displacements by it and leaves all forces.
        "youngs_modulus": 0.0,
    }


def _thickness_slope(thickness: float, grid: TexelArray, spread: PointSpread) -> float:
    """Central difference by the scaling law: a cover scaled by s responds like the original under an array / s."""
    thicker, thinner = (
        uncut_sigma(spread, _scaled_array(grid, 1 / (1 + step))) for step in (_THICKNESS_STEP, -_THICKNESS_STEP)
    )
    return (thicker - thinner) / (2 * _THICKNESS_STEP * thickness)


def _poisson_slope(cover: Cover, grid: TexelArray, spread: PointSpread, layer: int) -> float:
    """Derivative by the Poisson ratio of one layer: slope of the parabola through three ratios inside 0..0.5."""
    from fem_reference.closed_form import point_response

    ratio = cover.layers[layer].material.poisson_ratio
    middle = float(np.clip(ratio, _POISSON_STEP, 0.5 - _POISSON_STEP))

    def sigma_at(poisson_ratio: float) -> float:
        changed = _with_poisson_ratio(cover, layer, poisson_ratio)
        # The closed-form layer solution at the same radii: two more finite-element solves would triple the time.
        response = point_response(changed, spread.radius)
        return uncut_sigma(dataclasses.replace(spread, pressure_per_force=response, coarse=()), grid)

    low, high = sigma_at(middle - _POISSON_STEP), sigma_at(middle + _POISSON_STEP)
    slope = (high - low) / (2 * _POISSON_STEP)
    if ratio == middle:  # at its middle point a parabola has the slope of its chord
        return slope
    return slope + (ratio - middle) * (high - 2 * sigma_at(middle) + low) / _POISSON_STEP**2


def _scaled_array(array: TexelArray, factor: float) -> TexelArray:
    return dataclasses.replace(
        array,
        centres=array.centres * factor,
        texel_size=(array.texel_size[0] * factor, array.texel_size[1] * factor),
        pitch=(array.pitch[0] * factor, array.pitch[1] * factor),
    )


def _with_poisson_ratio(cover: Cover, layer: int, poisson_ratio: float) -> Cover:
    """The cover with another Poisson ratio in one layer."""
    layers = list(cover.layers)
    material = dataclasses.replace(layers[layer].material, poisson_ratio=poisson_ratio)
    layers[layer] = dataclasses.replace(layers[layer], material=material)
    return dataclasses.replace(cover, layers=tuple(layers))
