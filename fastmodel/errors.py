"""Errors about a user's input.  Each message says what is wrong, where, and what would be accepted."""

from __future__ import annotations

from collections.abc import Iterable


class FastModelError(ValueError):
    """Base of all errors that this package raises about its input."""


class ArgumentTypeError(FastModelError, TypeError):
    """An argument of a wrong type."""


class ParametersError(FastModelError):
    """A parameters folder that is missing or damaged, or holds values out of range."""


class FilterError(FastModelError):
    """A filter that cannot exist at the given sampling rate."""


class ShapeError(FastModelError):
    """An array whose shape does not fit the texel array."""


class UnknownNameError(FastModelError):
    """A name that does not exist in the model or in this package."""

    def __init__(self, kind: str, name: str, valid: Iterable[str]) -> None:
        """Compose the message.

        Args:
            kind: What is named, for example "body".
            name: The name that was given.
            valid: The names that exist.
        """
        super().__init__(f"no {kind} named {name!r}; valid names: {', '.join(sorted(valid)) or '(none)'}")


class LifeCycleError(FastModelError):
    """A sensor used out of order: not bound, bound to another model, or stepped off its time grid."""


class OverlapError(FastModelError):
    """Texels that overlap, so that one force would be measured twice."""


class StateError(FastModelError):
    """A simulation state that is not finite."""


class MissedArrayError(FastModelError):
    """An indenter that came to rest beside the texels."""


def check_type(name: str, value: object, expected: type | tuple[type, ...], wanted: str) -> None:
    """Check the type of an argument.

    Args:
        name: Name of the argument.
        value: Its value.
        expected: The type, or the types, that are accepted.
        wanted: The accepted types in words, for the message.

    Raises:
        ArgumentTypeError: If the value has another type.
    """
    if not isinstance(value, expected):
        raise ArgumentTypeError(f"{name} must be {wanted}, not {type(value).__name__}")
