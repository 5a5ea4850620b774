# The public names of `validation`.  A module is imported when one of its names is first used.

from .api import (
    calibrate as calibrate,
    fit_filter as fit_filter,
    datasheet as datasheet,
    derive as derive,
    export as export,
    load as load,
    press as press,
    press_in_time as press_in_time,
    record as record,
    regress as regress,
    replay as replay,
    validate as validate,
)
from .calibration.touch_protocol import next_touches as next_touches
from .moving.history import History as History
from .resolution.verb import design as design, limits as limits, locate as locate
from .results.report import read_report as read_report
from .sweeps.verb import sweep as sweep
