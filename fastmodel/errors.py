"""Errors about a user's input.  Each message says what is wrong, where, and what would be accepted."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable
from pathlib import Path

#: Folder of this package.
_PACKAGE = Path(__file__).parent


class FastModelError(ValueError):
    """Base of all errors that this package raises about its input."""


class ArgumentTypeError(FastModelError, TypeError):
    """An argument has a wrong type."""


class ParametersError(FastModelError):
    """Parameters cannot be read, have values out of range, or lack data that a contact method needs."""


class FilterError(FastModelError):
    """A low-pass filter has a bad order or cut-off, or a cut-off not below half the sampling rate."""


class ShapeError(FastModelError):
    """A numeric array has a shape that does not fit the texel array or the other inputs."""


class UnknownNameError(FastModelError):
    """A given name does not exist in the MuJoCo model or in this package."""

    def __init__(self, kind: str, name: str, valid: Iterable[str], note: str = "") -> None:
        """Compose the message from the given name and the valid names.

        Args:
            kind: Kind of the named object, for example "body".
            name: The name that was given.
            valid: The names that exist.
            note: What follows the valid names in the message.
        """
        super().__init__(f"no {kind} named {name!r}; valid names: {', '.join(sorted(valid)) or '(none)'}{note}")


class LifeCycleError(FastModelError):
    """A sensor is not bound, is bound to another model, or was not stepped once after every physics step."""


class OverlapError(FastModelError):
    """Two texels of an array overlap, so that one force would be measured twice."""


class StateError(FastModelError):
    """A force in the simulation, or a given force to start from, is not finite."""


class MissedArrayError(FastModelError):
    """An indenter did not come to rest on the texels, for example because it lies beside them."""


def check_type(name: str, value: object, expected: type | tuple[type, ...], wanted: str) -> None:
    """Check that an argument has one of the accepted types.

    Args:
        name: Name of the argument.
        value: Value of the argument.
        expected: The type, or the types, that are accepted.
        wanted: The accepted types in words, for the message.

    Raises:
        ArgumentTypeError: If the value has another type.
    """
    if not isinstance(value, expected):
        raise ArgumentTypeError(f"{name} must be {wanted}, not {type(value).__name__}")


def warn_user(message: str, category: type[Warning]) -> None:
    """Give a warning that names the line of the caller outside this package, however deep inside it the cause lies.

    Args:
        message: The warning.
        category: Its class.
    """
    level, frame = 1, sys._getframe(1)  # noqa: SLF001 -- the documented way to the calling line
    while frame.f_back is not None and Path(frame.f_code.co_filename).is_relative_to(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, category, stacklevel=level + 1)
