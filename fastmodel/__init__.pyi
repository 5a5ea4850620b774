# The public names of `fastmodel`.  A module is imported when one of its names is first used.

from .adapters.batch import Batch as Batch
from .attachment import METHODS as METHODS, attach as attach, recommend_options as recommend_options
from .bench import (
    FastIndentation as FastIndentation,
    Placement as Placement,
    add_indenter as add_indenter,
    indent as indent,
    indent_together as indent_together,
)
from .check import OptionWarning as OptionWarning
from .contact.bodies import add_geoms as add_geoms
from .contact.boxes import BoxTexels as BoxTexels
from .contact.interface import TexelContact as TexelContact
from .contact.mesh import MeshContact as MeshContact
from .contact.plate import CoverContact as CoverContact, Foundation as Foundation, Plate as Plate
from .errors import FastModelError as FastModelError
from .fitting.contact_stiffness import fit_contact as fit_contact
from .fitting.gaussian import fit_gaussian as fit_gaussian
from .parameters import Parameters as Parameters, list_sensors as list_sensors, load as load
from .pressure.array_functions import ContactForces as ContactForces, ContactFunctions as ContactFunctions
from .sensor import Sensor as Sensor, TexelPoses as TexelPoses
from .signal.butterworth import Butterworth as Butterworth
from .signal.chain import ChainFunctions as ChainFunctions
from .signal.electronics import Electronics as Electronics, WTS_0614_34 as WTS_0614_34
from .signal.frame import Frame as Frame
from .signal.point_spread import Gaussian as Gaussian, Tabulated as Tabulated
from .surface import CoverCells as CoverCells, CoverPoints as CoverPoints
from .validity import RangeWarning as RangeWarning
