"""The fast model: a tactile array under a soft cover, in MuJoCo, faster than real time.

The picture to have in mind is a chain, one vector of n texels long (row-major, x fastest):

    contact force on each texel         `METHODS`       each step or as rarely as frames allow [N]
    -> Butterworth low-pass             `Butterworth`   at that rate                           [N]
    -> spread by the cover              `Gaussian`      once per frame, one constant matrix    [N]
    -> noise, characteristic, counts    `Electronics`   once per frame                         [-]
    -> `Frame`                          true time, counts, texel forces, 8-bit image

`Parameters` holds all of it for one sensor and travels as a folder (`save`, `load`); `fit_gaussian` makes the
spread from a reference response.  Two ways to run it:

    parameters = fastmodel.load("wts-0614-34")                # or a folder
    sensor = fastmodel.attach(spec, "fingertip", parameters)      # before compiling
    model = spec.compile(); data = mujoco.MjData(model)
    sensor.bind(model)
    while ...:
        mujoco.mj_step(model, data)
        if sensor.step(data):
            show(sensor.frame().image)

    result = fastmodel.indent(parameters, meshes.Sphere(radius=5e-3), load=4.9)   # a bench test, settled

Contact forces add up to the weight; after spread, what the texels do not feel is `outside`.  Two things carry
no meaning: how deep an object sinks (MuJoCo's contact softness is an engine setting, not the cover's), and how
`BoxTexels` share a flat face (by number of contact points, not by area); `AreaTexels`, `Foundation` and
`CoverContact` share it by area, by an elastic foundation and by the cover's own compliance.

Every error about input is a `FastModelError`, itself a `ValueError`.  Needs numpy, scipy and mujoco; numba, when
installed, speeds contact reading, sampling and filter up.
"""

from importlib.metadata import version

from fastmodel.adapters.batch import Batch
from fastmodel.bench import FastIndentation, Placement, add_geoms, indent, indent_together
from fastmodel.contact.area import AreaTexels
from fastmodel.contact.boxes import BoxTexels
from fastmodel.contact.cover import CoverContact, Foundation
from fastmodel.contact.interface import TexelContact
from fastmodel.contact.methods import METHODS
from fastmodel.contact.plate import Plate
from fastmodel.errors import (
    ArgumentTypeError,
    FastModelError,
    FilterError,
    LifeCycleError,
    MissedArrayError,
    OverlapError,
    ParametersError,
    ShapeError,
    StateError,
    UnknownNameError,
)
from fastmodel.fitting.contact_stiffness import ContactFit, FoundationFit, fit_contact, fit_foundation
from fastmodel.fitting.gaussian import Fit, fit_gaussian
from fastmodel.parameters import Parameters, list_sensors, load
from fastmodel.pressure.cover_kernels import CoverCells
from fastmodel.sensor import OptionWarning, Sensor, attach, recommend_options
from fastmodel.signal.butterworth import Butterworth, FilterBank
from fastmodel.signal.electronics import WTS_0614_34, Electronics
from fastmodel.signal.frame import Frame
from fastmodel.signal.point_spread import Gaussian, Spread, Tabulated, outside_share

__version__ = version("softcover")

__all__ = [
    "METHODS",
    "WTS_0614_34",
    "AreaTexels",
    "ArgumentTypeError",
    "Batch",
    "BoxTexels",
    "Butterworth",
    "ContactFit",
    "CoverCells",
    "CoverContact",
    "Electronics",
    "FastIndentation",
    "FastModelError",
    "FilterBank",
    "FilterError",
    "Fit",
    "Foundation",
    "FoundationFit",
    "Frame",
    "Gaussian",
    "LifeCycleError",
    "MissedArrayError",
    "OptionWarning",
    "OverlapError",
    "Parameters",
    "ParametersError",
    "Placement",
    "Plate",
    "Sensor",
    "ShapeError",
    "Spread",
    "StateError",
    "Tabulated",
    "TexelContact",
    "UnknownNameError",
    "add_geoms",
    "attach",
    "fit_contact",
    "fit_foundation",
    "fit_gaussian",
    "indent",
    "indent_together",
    "list_sensors",
    "load",
    "outside_share",
    "recommend_options",
]
