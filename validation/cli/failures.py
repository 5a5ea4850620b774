"""Turn an error into the lines that the user reads and the exit status."""

from __future__ import annotations

from dataclasses import dataclass

from cyclopts import CycloptsError

from fem_reference.errors import ConvergenceError
from validation.errors import MissingExtraError

#: Exit statuses; `docs/json.md` lists them.
DONE, CHECK_FAILED, BAD_INPUT, OUTSIDE_FAILED, NOT_CONVERGED = range(5)
#: Exit status after Ctrl-C: 128 plus the number of the signal, as shells expect it.
INTERRUPTED = 130

#: The extra that installs an optional module.
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
}


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """The lines to print, and the exit status."""

    lines: tuple[str, ...]
    status: int


def explain(error: Exception) -> Explanation | None:
    """Describe an error to the user.

    Returns:
        None for a programming error, which only a traceback explains.
    """
    match error:
        case ImportError():
            missing = _find_missing_extra(error)
            return None if missing is None else Explanation(lines=(str(missing),), status=OUTSIDE_FAILED)
        case ConvergenceError():
            return Explanation(lines=tuple(str(error).splitlines()), status=NOT_CONVERGED)
        case OSError():
            where = f"{error.filename}: " if error.filename else ""
            return Explanation(lines=(f"{where}{error.strerror or error}",), status=OUTSIDE_FAILED)
        case CycloptsError():
            return Explanation(lines=(" ".join(str(error).split()),), status=BAD_INPUT)
        case ValueError():  # every package raises subclasses of it for bad input
            return Explanation(lines=tuple(str(error).splitlines()), status=BAD_INPUT)
    return None


def _find_missing_extra(error: BaseException | None) -> MissingExtraError | None:
    """Find the missing module of an extra among an import error and its causes."""
    while error is not None and not isinstance(error, MissingExtraError):
        module = str(getattr(error, "name", "")).split(".")[0]
        error = MissingExtraError(_EXTRAS[module], module) if module in _EXTRAS else error.__cause__
    return error
