"""The fast model: rigid texels in MuJoCo, point spread function, Butterworth filter, electronics."""

from fastmodel.butterworth import Butterworth, FilterBank
from fastmodel.electronics import WTS_0614_34, Electronics
from fastmodel.errors import FastModelError
from fastmodel.fit import Fit, fit_gaussian
from fastmodel.frame import Frame
from fastmodel.parameters import Parameters, load
from fastmodel.spread import Gaussian, Spread, Tabulated

__all__ = [
    "WTS_0614_34",
    "Butterworth",
    "Electronics",
    "FastModelError",
    "FilterBank",
    "Fit",
    "Frame",
    "Gaussian",
    "Parameters",
    "Spread",
    "Tabulated",
    "fit_gaussian",
    "load",
]
