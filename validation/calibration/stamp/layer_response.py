"""Response of a one-layer cover of any thickness, from one finite-element solve per Poisson ratio.

The response of a linear cover scales with its thickness and does not depend on Young's modulus.  So the solve uses a
thickness of 1 mm, and lengths are scaled to it.
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

#: Poisson ratios that are tried, of foam and rubber [-]: the recordings hardly distinguish even these two.
POISSON_RATIOS = (0.0, 0.49)
#: Range of thickness that is fitted [m].
THICKNESS = (0.5e-3, 12e-3)
#: Thickness of the cover that is solved [m].
_UNIT = 1e-3
#: Contact cells along each edge of the stamp's face [-].
_CELLS = 36
#: Contact cells along each edge of a bin, whose force acts at its centroid; fewer forces make the fit faster [-].
_BIN = 4


def unit_cover(poisson_ratio: float, thickness: float = _UNIT) -> Cover:
    """One linear layer; its modulus (1 MPa) has no effect on the results of this module."""
    material = Material(
        name="stamp cover",
        model="linear-elastic",
        parameters={"youngs_modulus": 1e6},
        poisson_ratio=poisson_ratio,
        source="an arbitrary modulus: texel forces under a given load do not depend on it",
    )
    return Cover(layers=(Layer(thickness=thickness, material=material),))


def influence(array: TexelArray, poisson_ratio: float, thickness: float, positions: FloatArray) -> FloatArray:
    """Force on each texel per unit point load at each position, shape (k, n) [-].

    Args:
        array: A flat grid of texels.
        poisson_ratio: One of `POISSON_RATIOS` (each costs a solve) [-].
        thickness: Thickness of the cover [m].
        positions: Positions on top, shape (k, 2) [m].
    """
    scale = thickness / _UNIT
    return _unit_spread(poisson_ratio).texel_influence(_scaled_grid(array, scale), positions / scale)


@cache
def punch_pressure(poisson_ratio: float, thickness: float) -> tuple[FloatArray, FloatArray]:
    """Contact pressure of the stamp on one bonded layer without friction, as forces at points.

    Args:
        poisson_ratio: Poisson ratio of the layer [-].
        thickness: Thickness of the layer [m].

    Returns:
        Points in the stamp's frame, shape (k, 2) [m], and shares of the load, shape (k,) [-].
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
    """Thickness whose fitted Gaussian has a given sigma, for each Poisson ratio [m]; NaN outside `THICKNESS`.

    Args:
        array: A flat grid of texels.
        sigma: Width of the fast model's kernel [pitches].
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
    """Thicknesses [m] and the fitted sigma of each [pitches]."""
    thickness = np.geomspace(*THICKNESS, 8)
    array = TexelArray.grid(13, 13, pitch, texel_size=size)
    sigmas = [_fit_sigma(_scaled_grid(array, each / _UNIT), poisson_ratio) for each in thickness]
    return thickness, np.maximum.accumulate(sigmas)


def _fit_sigma(array: TexelArray, poisson_ratio: float) -> float:
    response = array.image(_unit_spread(poisson_ratio).texel_response(array, load="uniform"))
    loaded = (array.rows // 2, array.columns // 2)
    return fit_gaussian(np.asarray(response, dtype=np.float64), loaded).gaussian.sigma_x


@cache
def _unit_spread(poisson_ratio: float) -> PointSpread:
    return point_spread(unit_cover(poisson_ratio))


def _scaled_grid(array: TexelArray, scale: float) -> TexelArray:
    """The grid with all lengths divided by `scale`."""
    return TexelArray.grid(
        array.rows,
        array.columns,
        (array.pitch[0] / scale, array.pitch[1] / scale),
        texel_size=(array.texel_size[0] / scale, array.texel_size[1] / scale),
        active=array.active,
        name=array.name,
    )
