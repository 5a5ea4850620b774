# The public names of `fem_reference`.  A module is imported when one of its names is first used.

from .errors import ConvergenceError as ConvergenceError, IncompletePathError as IncompletePathError
from .indentation.press import press as press, press_path as press_path
from .indentation.result import Indentation as Indentation
from .linear_response.axisymmetric import point_spread as point_spread
from .linear_response.point_spread import PointSpread as PointSpread
