"""Cover data in closed form, so that these tests need no finite elements."""

import numpy as np

from fastmodel import WTS_0614_34, Butterworth, CoverCells, Gaussian, Parameters
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
