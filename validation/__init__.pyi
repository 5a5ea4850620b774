# The public names of `validation`.  A module is imported when one of its names is first used.

from .api import (
    calibrate as calibrate,
    fit_filter as fit_filter,
    datasheet as datasheet,
    derive as derive,
    export as export,
    load as load,
    press as press,
    record as record,
    regress as regress,
    replay as replay,
    validate as validate,
)
from .results.report import read_report as read_report
