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
    """What to print, line by line, and the exit status."""

    lines: tuple[str, ...]
    status: int


def explain(error: Exception) -> Explanation | None:
    """Say what went wrong.

    Returns:
        None for a programming error, which only a traceback explains.
    """
    if isinstance(error, ImportError):
        return _explain_missing_module(error)
    status = _find_status(error)
    if status is None:
        return None
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return Explanation(lines=(f"{where}{error.strerror or error}",), status=status)
    if isinstance(error, CycloptsError):
        return Explanation(lines=(" ".join(str(error).split()),), status=status)
    return Explanation(lines=tuple(str(error).splitlines()), status=status)


def _find_status(error: Exception) -> int | None:
    if isinstance(error, ConvergenceError):
        return NOT_CONVERGED
    if isinstance(error, OSError):
        return OUTSIDE_FAILED
    # Every package raises subclasses of ValueError for bad input.
    return BAD_INPUT if isinstance(error, ValueError | CycloptsError) else None


def _explain_missing_module(error: ImportError) -> Explanation | None:
    if isinstance(error, MissingExtraError):
        return Explanation(lines=(str(error),), status=OUTSIDE_FAILED)
    cause: BaseException | None = error
    while cause is not None:
        module = str(getattr(cause, "name", "")).split(".")[0]
        if module in _EXTRAS:
            missing = MissingExtraError(_EXTRAS[module], module)
            return Explanation(lines=(str(missing),), status=OUTSIDE_FAILED)
        cause = cause.__cause__
    return None
