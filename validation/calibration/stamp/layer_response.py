"""Computes texel forces under a one-layer cover of any thickness, from one finite-element solution per Poisson ratio.

Forces at the base of a linear elastic layer under a given load depend on lengths relative to the thickness only, and
not on Young's modulus.  The finite-element solution therefore uses a thickness of 1 mm, and lengths are scaled to it.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from fastmodel import fit_gaussian
from fem_reference import PointSpread, point_spread
from fem_reference.linear_response.surface_compliance import surface_compliance
from fem_reference.small_strain_contact.frictionless import solve_contact
from meshes import Box, Cover, Layer, Material
from meshes.array import FloatArray, TexelArray
from validation.recordings.series import STAMP_EDGE

#: Poisson ratios of the cover that are compared in the fit, those of foam and of rubber [-].  The recordings hardly
#: distinguish even these two, so no values between them are needed.
POISSON_RATIOS = (0.0, 0.49)
#: Bounds of the fitted thickness of the cover [m].
THICKNESS = (0.5e-3, 12e-3)
#: Thickness of the layer in the finite-element solution [m].
_UNIT = 1e-3
#: Number of cells of the contact grid along each edge of the stamp's face [-].
_CELLS = 36
#: Number of cells along each edge of the square groups whose forces are summed to one force at their centroid [-].
#: Fewer point forces make the fit of the stamp faster.
_BIN = 4


def unit_cover(poisson_ratio: float, thickness: float = _UNIT) -> Cover:
    """Make a cover of one linear elastic layer; its Young's modulus of 1 MPa does not affect results of this module."""
    material = Material(
        name="stamp cover",
        model="linear-elastic",
        parameters={"youngs_modulus": 1e6},
        poisson_ratio=poisson_ratio,
        source="an arbitrary modulus: texel forces under a given load do not depend on it",
    )
    return Cover(layers=(Layer(thickness=thickness, material=material),))


def influence(array: TexelArray, poisson_ratio: float, thickness: float, positions: FloatArray) -> FloatArray:
    """Return the force on each texel per unit normal point load at positions on a one-layer cover.

    Args:
        array: A flat grid of n texels.
        poisson_ratio: Poisson ratio of the layer; each new value needs one finite-element solution [-].
        thickness: Thickness of the layer [m].
        positions: k positions x, y on the top surface, shape (k, 2) [m].

    Returns:
        Forces per unit load, shape (k, n) [-].
    """
    scale = thickness / _UNIT
    return _unit_spread(poisson_ratio).texel_influence(_scaled_grid(array, scale), positions / scale)


@cache
def punch_pressure(poisson_ratio: float, thickness: float) -> tuple[FloatArray, FloatArray]:
    """Solve the frictionless contact of the stamp with one bonded layer, and return its pressure as point forces.

    Args:
        poisson_ratio: Poisson ratio of the layer [-].
        thickness: Thickness of the layer [m].

    Returns:
        k points in the stamp's frame, shape (k, 2) [m], and the share of the load at each point, shape (k,) [-].
    """
    cover = unit_cover(poisson_ratio, thickness)
    surface = surface_compliance(cover, max(2.2 * STAMP_EDGE, 4 * thickness))
    face = Box(size=(STAMP_EDGE, STAMP_EDGE, STAMP_EDGE))
    patch = solve_contact(surface, face, cells=_CELLS, load=1.0)
    bins = np.floor((np.column_stack([patch.x, patch.y]) / STAMP_EDGE + 0.5) * (_CELLS // _BIN)).astype(int)
    flat = bins[:, 0] * (_CELLS // _BIN) + bins[:, 1]
    share = np.bincount(flat, patch.force)
    centre = np.column_stack([np.bincount(flat, patch.force * place) for place in (patch.x, patch.y)])
    return centre / share[:, None], share / share.sum()


def thickness_of_sigma(array: TexelArray, sigma: float) -> dict[float, float]:
    """Find, for each Poisson ratio, the layer thickness whose point spread is best fitted by a Gaussian of given sigma.

    Args:
        array: A flat grid of texels.
        sigma: Standard deviation of the Gaussian kernel of the fast model [pitches].

    Returns:
        Thickness by Poisson ratio [m]; NaN where it lies outside `THICKNESS`.
    """
    tables = {ratio: _sigma_table(ratio, array.pitch, array.texel_size) for ratio in POISSON_RATIOS}
    return {
        ratio: float(np.interp(sigma, sigmas, thickness, left=np.nan, right=np.nan))
        for ratio, (thickness, sigmas) in tables.items()
    }


@cache
def _sigma_table(
    poisson_ratio: float, pitch: tuple[float, float], size: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return layer thicknesses [m], and for each the sigma of the Gaussian fitted to its point spread [pitches].

    Args:
        poisson_ratio: Poisson ratio of the layer [-].
        pitch: Pitch of the texels along x and y [m].
        size: Size of a texel along x and y [m].
    """
    thickness = np.geomspace(*THICKNESS, 8)
    array = TexelArray.grid(13, 13, pitch, texel_size=size)
    sigmas = [_fit_sigma(_scaled_grid(array, each / _UNIT), poisson_ratio) for each in thickness]
    return thickness, np.maximum.accumulate(sigmas)


def _fit_sigma(array: TexelArray, poisson_ratio: float) -> float:
    """Fit a Gaussian to the response of a 1 mm layer to a uniform load on the centre texel; return sigma [pitches]."""
    response = array.image(_unit_spread(poisson_ratio).texel_response(array, load="uniform"))
    loaded = (array.rows // 2, array.columns // 2)
    return fit_gaussian(np.asarray(response, dtype=np.float64), loaded).gaussian.sigma_x


@cache
def _unit_spread(poisson_ratio: float) -> PointSpread:
    """Compute the point spread function of a layer of 1 mm thickness by finite elements."""
    return point_spread(unit_cover(poisson_ratio))


def _scaled_grid(array: TexelArray, scale: float) -> TexelArray:
    """Return a copy of a grid of texels with all lengths divided by `scale`."""
    return TexelArray.grid(
        array.rows,
        array.columns,
        (array.pitch[0] / scale, array.pitch[1] / scale),
        texel_size=(array.texel_size[0] / scale, array.texel_size[1] / scale),
        active=array.active,
        name=array.name,
    )
