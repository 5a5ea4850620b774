"""Cover data in closed form, so that these tests need no finite elements."""

import dataclasses

import numpy as np
from scipy.spatial import Delaunay

from fastmodel import WTS_0614_34, Butterworth, CoverCells, CoverPoints, Gaussian, Parameters, Tabulated
from meshes import TexelArray
from meshes.catalogue import ARRAYS

WTS = ARRAYS["wts-0614-34"]


def cells(array=WTS, per_texel=4, reach=18):
    """A half space that forgets beyond a few millimetres, and a Gaussian way down to the base."""
    edge = array.pitch[0] / per_texel
    stiffness, h = 1e6, 2e-3
    distance = np.hypot(*np.meshgrid(np.arange(reach + 1) * edge, np.arange(reach + 1) * edge))
    compliance = edge**2 / (np.pi * stiffness) * np.exp(-distance / h) / np.maximum(distance, 0.28 * edge)
    place = (np.arange(-reach, per_texel + reach) + 0.5 - per_texel / 2) * edge
    from scipy.special import erf

    half = array.texel_size[0] / 2
    along = 0.5 * (erf((half - place) / (np.sqrt(2) * 0.5 * h)) + erf((half + place) / (np.sqrt(2) * 0.5 * h)))
    return CoverCells(
        per_texel=per_texel,
        cell=(edge, edge),
        compliance=compliance,
        influence=np.outer(along, along),
        top_compliance=1 / (np.pi * stiffness),
        thickness=h,
        source="test",
    )


def parameters(array=WTS, **changes):
    settings = {
        "array": array,
        "spread": Gaussian.from_sigma(0.6),
        "electronics": WTS_0614_34,
        "filter": Butterworth(cutoff_hz=40.0, order=2),
        "surface": cells(array),
    }
    return Parameters(**(settings | changes))


def make_half_space(points, normals, *, contact_modulus=1e6, thickness=2e-3):
    """A half space that is bent to a surface of given points over x and y, with 4 texels, one per quarter."""
    x, y = points[:, 0], points[:, 1]
    quarter = (x >= 0).astype(int) + 2 * (y >= 0)
    facets = Delaunay(points[:, :2]).simplices
    along, across = (points[facets[:, k], :2] - points[facets[:, 0], :2] for k in (1, 2))
    turned = along[:, 0] * across[:, 1] < along[:, 1] * across[:, 0]
    facets[turned] = facets[turned, ::-1]
    return CoverPoints(
        points=points,
        normals=normals,
        facets=facets,
        centres=points,
        shared=np.arange(len(points))[:, None],
        shares=np.ones((len(points), 1)),
        influence=0.8 * (quarter == np.arange(4)[:, None]),
        remainder=np.zeros((len(points), len(points))),
        layer=np.zeros(101),
        layer_step=0.5e-3,
        top_compliance=1 / (np.pi * contact_modulus),
        heights=np.full(len(points), thickness),
        thickness=thickness,
    )


def make_dome(side=17, half=6e-3, **options):
    """A half space on the top of a ball of 10 mm, with 4 texels."""
    x, y = (each.ravel() for each in np.meshgrid(*[np.linspace(-half, half, side)] * 2))
    normals = np.stack([x, y, np.sqrt(1e-4 - x**2 - y**2)], axis=1) / 10e-3
    return make_half_space(10e-3 * normals, normals, **options)


def dome_parameters(cover):
    """A sensor of 2 x 2 texels under a dome."""
    normals = np.array([[x, y, 8.0] for y in (-3, 3) for x in (-3, 3)]) / np.sqrt(82)
    array = dataclasses.replace(TexelArray.grid(2, 2, 4e-3), centres=8e-3 * normals, normals=normals)
    electronics = dataclasses.replace(WTS_0614_34, calibrated="texel force")
    return Parameters(array=array, spread=Tabulated(matrix=np.eye(4)), electronics=electronics, surface=cover)
