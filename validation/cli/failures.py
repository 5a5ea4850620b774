"""Conversion of an error into the lines that the user reads and the exit status of the command."""

from __future__ import annotations

from dataclasses import dataclass

from cyclopts import CycloptsError

from fem_reference.errors import ConvergenceError
from validation.errors import MissingExtraError

#: Exit statuses of commands; `docs/json.md` explains them.
DONE, CHECK_FAILED, BAD_INPUT, OUTSIDE_FAILED, NOT_CONVERGED = range(5)
#: Exit status after Ctrl-C: 128 plus 2, the number of the signal, by the convention of shells.
INTERRUPTED = 130

#: Extra of the package (`pip install 'softcover[EXTRA]'`) that installs each optional module.
_EXTRAS = {
    "skfem": "fem",
    "pymetis": "fem",
    "trimesh": "fem",
    "manifold3d": "fem",
    "jinja2": "report",
    "plotly": "report",
    "matplotlib": "report",
    "serial": "device",
    "mcap": "device",
    "mcap_ros2": "device",
    "rosbags": "device",
    "gymnasium": "gym",
    "pyvista": "view",
}


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """Explanation of an error to the user: the lines to print, and the exit status of the command."""

    lines: tuple[str, ...]
    status: int


def explain(error: Exception) -> Explanation | None:
    """Explain an error to the user.

    Returns:
        The lines to print and the exit status; None for a programming error, which only a traceback explains.
    """
    match error:
        case ImportError():
            missing = _find_missing_extra(error)
            return None if missing is None else Explanation(lines=(str(missing),), status=OUTSIDE_FAILED)
        case ConvergenceError():
            return Explanation(lines=tuple(str(error).splitlines()), status=NOT_CONVERGED)
        case OSError() | MemoryError():
            return Explanation(lines=(_describe_outside(error),), status=OUTSIDE_FAILED)
        case CycloptsError():
            return Explanation(lines=(" ".join(str(error).split()),), status=BAD_INPUT)
        case ValueError():  # all packages of softcover raise subclasses of ValueError for bad input
            return Explanation(lines=tuple(str(error).splitlines()), status=BAD_INPUT)
    return None


def _describe_outside(error: OSError | MemoryError) -> str:
    if isinstance(error, MemoryError):
        return "not enough memory for this input"
    return f"{error.filename}: {error.strerror or error}" if error.filename else str(error.strerror or error)


def _find_missing_extra(error: BaseException | None) -> MissingExtraError | None:
    """Find out whether an import error, or one of its causes, is due to an optional module that is not installed.

    Returns:
        An error that names the extra to install; None if no optional module is missing.
    """
    while error is not None and not isinstance(error, MissingExtraError):
        module = str(getattr(error, "name", "")).split(".")[0]
        error = MissingExtraError(_EXTRAS[module], module) if module in _EXTRAS else error.__cause__
    return error
