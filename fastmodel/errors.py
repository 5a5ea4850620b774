"""What can be wrong with what a user hands over; each message says what, where and what would be accepted."""

from __future__ import annotations

from collections.abc import Iterable


class FastModelError(ValueError):
    """Base of every error that this package raises about its input."""


class ParametersError(FastModelError):
    """A parameters folder is missing, damaged or holds values that make no sense."""


class FilterError(FastModelError):
    """A filter that cannot exist at this sampling rate."""


class ShapeError(FastModelError):
    """An array whose shape does not fit the texel array."""


class UnknownNameError(FastModelError):
    """A name that the model or this package does not know."""

    def __init__(self, kind: str, name: str, valid: Iterable[str]) -> None:
        """Say which names would be accepted.

        Args:
            kind: What the name should have been, for example "body".
            name: The name that was given.
            valid: The names that exist.
        """
        super().__init__(f"no {kind} named {name!r}; valid names: {', '.join(sorted(valid)) or '(none)'}")


class LifeCycleError(FastModelError):
    """A sensor used out of order: not bound, bound to another model, or stepped off its time grid."""


class OverlapError(FastModelError):
    """Texels that lie on top of one another, so that a force would be felt twice."""


class StateError(FastModelError):
    """The simulation's state is not finite."""


class MissedArrayError(FastModelError):
    """An indenter that came to rest on no texel."""
