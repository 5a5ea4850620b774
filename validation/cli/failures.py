"""Conversion of an error into the lines that the user reads and the exit status of the command."""

from __future__ import annotations

import errno
from dataclasses import dataclass

from cyclopts import CycloptsError

from fem_reference.errors import ConvergenceError
from validation.errors import InputError
from validation.extras import EXTRAS, MissingExtraError

#: Exit statuses of commands; `docs/json.md` explains them.
DONE, CHECK_FAILED, BAD_INPUT, OUTSIDE_FAILED, NOT_CONVERGED = range(5)
#: Exit status after Ctrl-C: 128 plus 2, the number of the signal, by the convention of shells.
INTERRUPTED = 130
#: Exit status when the reader of the output has gone, as in `softcover materials | head`: 128 plus 13, by the same
#: convention.
PIPE_CLOSED = 141

#: Errors of the operating system that the text of a path causes, whatever the state of the machine: a name that is too
#: long, a file where a folder is needed or the other way round, links in a circle.
_PATH_FAULTS = {errno.ENAMETOOLONG, errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ELOOP, errno.EINVAL, errno.EILSEQ}


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
            return Explanation(lines=(_join_lines(error),), status=NOT_CONVERGED)
        case OSError() | MemoryError():
            status = BAD_INPUT if _is_path_fault(error) else OUTSIDE_FAILED
            return Explanation(lines=(_describe_outside(error),), status=status)
        case InputError():
            return Explanation(lines=error.faults, status=BAD_INPUT)
        case CycloptsError() | ValueError():  # all packages of softcover raise subclasses of ValueError for bad input
            return Explanation(lines=(_join_lines(error),), status=BAD_INPUT)
    return None


def _describe_outside(error: OSError | MemoryError) -> str:
    if isinstance(error, MemoryError):
        return "not enough memory for this input"
    return f"{error.filename}: {error.strerror or error}" if error.filename else str(error.strerror or error)


def _is_path_fault(error: BaseException) -> bool:
    """Return whether an error, or the one that it was raised from, is due to the text of a path."""
    return any(getattr(each, "errno", None) in _PATH_FAULTS for each in (error, error.__cause__))


def _join_lines(error: Exception) -> str:
    """Return the text of an error on one line."""
    return " ".join(str(error).split())


def _find_missing_extra(error: BaseException | None) -> MissingExtraError | None:
    """Find out whether an import error, or one of its causes, is due to an optional module that is not installed.

    Returns:
        An error that names the extra to install; None if no optional module is missing.
    """
    while error is not None and not isinstance(error, MissingExtraError):
        module = str(getattr(error, "name", "")).split(".")[0]
        error = MissingExtraError(module) if module in EXTRAS else error.__cause__
    return error
