"""Derivatives of the spread kernel's width with respect to thickness, Poisson ratio and Young's modulus of a cover."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from meshes import Cover, TexelArray
from validation.derivation.kernel_fit import fitting_grid, uncut_sigma

if TYPE_CHECKING:
    from fem_reference.linear_response.point_spread import PointSpread

#: Relative step of the cover's thickness in the central difference quotient [-].
_THICKNESS_STEP = 0.02
#: Absolute step of the Poisson ratio in the finite differences [-].
_POISSON_STEP = 0.005


def sigma_sensitivities(cover: Cover, array: TexelArray, spread: PointSpread) -> dict[str, float]:
    """Compute the derivatives of the Gaussian's sigma along x with respect to thickness and elastic constants.

    The Gaussian is the one that is not truncated at a kernel width.  The quantity changes in all layers together.

    Args:
        cover: A laterally wide cover.
        array: Texels of the sensor.
        spread: The point spread function of the cover.

    Returns:
        Derivatives with respect to `thickness` [pitches/m], `poisson_ratio` [pitches] and `youngs_modulus`
        [pitches/Pa].
    """
    grid = fitting_grid(array)
    return {
        "thickness": _thickness_slope(cover.thickness, grid, spread),
        "poisson_ratio": sum(_poisson_slope(cover, grid, spread, layer) for layer in range(len(cover.layers))),
        # Multiplying all moduli by a factor divides all displacements by this factor and does not change the forces.
        "youngs_modulus": 0.0,
    }


def _thickness_slope(thickness: float, grid: TexelArray, spread: PointSpread) -> float:
    """Return the derivative of sigma with respect to the cover's thickness, a central difference [pitches/m].

    No other cover is solved: a cover scaled by a factor s over the array responds like the original cover over the
    array scaled by 1 / s.

    Args:
        thickness: Thickness of the cover [m].
        grid: Texels on a regular grid.
        spread: The point spread function of the cover.
    """
    thicker, thinner = (
        uncut_sigma(spread, _scaled_array(grid, 1 / (1 + step))) for step in (_THICKNESS_STEP, -_THICKNESS_STEP)
    )
    return (thicker - thinner) / (2 * _THICKNESS_STEP * thickness)


def _poisson_slope(cover: Cover, grid: TexelArray, spread: PointSpread, layer: int) -> float:
    """Return the derivative of sigma with respect to the Poisson ratio of one layer [pitches].

    It is the slope of the parabola through the sigmas at three Poisson ratios inside 0..0.5.

    Args:
        cover: A laterally wide cover.
        grid: Texels on a regular grid.
        spread: The point spread function of the cover.
        layer: Index of the layer, from the bottom.
    """
    from fem_reference.closed_form import point_response

    ratio = cover.layers[layer].material.poisson_ratio
    middle = float(np.clip(ratio, _POISSON_STEP, 0.5 - _POISSON_STEP))

    def sigma_at(poisson_ratio: float) -> float:
        changed = _with_poisson_ratio(cover, layer, poisson_ratio)
        # The changed cover is solved by the closed-form layer solution at the same radii: two more finite-element
        # solutions would triple the computing time.
        response = point_response(changed, spread.radius)
        return uncut_sigma(dataclasses.replace(spread, pressure_per_force=response, coarse=()), grid)

    low, high = sigma_at(middle - _POISSON_STEP), sigma_at(middle + _POISSON_STEP)
    slope = (high - low) / (2 * _POISSON_STEP)
    if ratio == middle:  # at the middle of an interval a parabola has the slope of its chord over the interval
        return slope
    return slope + (ratio - middle) * (high - 2 * sigma_at(middle) + low) / _POISSON_STEP**2


def _scaled_array(array: TexelArray, factor: float) -> TexelArray:
    (width, height), (along_x, along_y) = (factor * np.array([array.texel_size, array.pitch])).tolist()
    return dataclasses.replace(
        array, centres=array.centres * factor, texel_size=(width, height), pitch=(along_x, along_y)
    )


def _with_poisson_ratio(cover: Cover, layer: int, poisson_ratio: float) -> Cover:
    """Return a copy of the cover with another Poisson ratio in one layer."""
    layers = list(cover.layers)
    material = dataclasses.replace(layers[layer].material, poisson_ratio=poisson_ratio)
    layers[layer] = dataclasses.replace(layers[layer], material=material)
    return dataclasses.replace(cover, layers=tuple(layers))
