"""Errors about a user's input.  Each message states the fault, its place, and what would be accepted."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

#: Folder of this package.
_PACKAGE = Path(__file__).parent


class FastModelError(ValueError):
    """An input that this package refuses; base class of all errors of this package."""


class ParametersError(FastModelError):
    """Parameters cannot be read, have values out of range, or lack data that a contact method needs."""


class LifeCycleError(FastModelError):
    """A sensor is not bound, is bound to another model, or was not stepped once after every physics step."""


class MissedArrayError(FastModelError):
    """An indenter did not come to rest on the texels, for example because it lies beside them."""


def name_unknown(kind: str, name: str, valid: Iterable[str], note: str = "") -> FastModelError:
    """Make the error about a name that does not exist, which lists those that do.

    Args:
        kind: Kind of the named object, for example "body".
        name: The name that was given.
        valid: The names that exist.
        note: Text after the valid names in the message.
    """
    return FastModelError(f"no {kind} named {name!r}; valid names: {', '.join(sorted(valid)) or '(none)'}{note}")


def check_type(name: str, value: object, expected: type | tuple[type, ...], wanted: str) -> None:
    """Check that an argument has one of the accepted types.

    Args:
        name: Name of the argument.
        value: Value of the argument.
        expected: The type, or the types, that are accepted.
        wanted: The accepted types in words, for the message.

    Raises:
        FastModelError: If the value has another type.
    """
    if not isinstance(value, expected):
        raise FastModelError(f"{name} must be {wanted}, not {type(value).__name__}")


def check_count(name: str, number: float, least: int, unit: str = "") -> int:
    """Check that an argument is a whole number of at least `least`, and return it as such.

    Args:
        name: Name of the argument.
        number: Value of the argument.
        least: Smallest accepted number.
        unit: Unit of the number, for the message, for example " of physics steps".

    Raises:
        FastModelError: If the value is no number, not whole, or smaller than `least`.
    """
    check_type(name, number, (int, float, np.integer), f"a whole number{unit}")
    if not math.isfinite(number) or number != int(number) or number < least:
        raise FastModelError(f"{name} must be a whole number{unit} from {least} on, not {number}")
    return int(number)


def warn_user(message: str, category: type[Warning]) -> None:
    """Give a warning that names the line of the caller outside this package, at any depth of calls.

    Args:
        message: Text of the warning.
        category: Class of the warning.
    """
    level, frame = 1, sys._getframe(1)  # noqa: SLF001 -- the documented way to the calling line
    while frame.f_back is not None and Path(frame.f_code.co_filename).is_relative_to(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, category, stacklevel=level + 1)
