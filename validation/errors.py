"""Errors that a user can correct, and hints in their messages."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """The user's input has faults.

    Attributes:
        faults: One line per fault: where it is, what is wrong, what would be accepted.
    """

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


class MissingExtraError(ImportError):
    """An optional package is needed and not installed."""

    def __init__(self, extra: str, module: str) -> None:
        super().__init__(f"{module} is not installed; run: python -m pip install 'softcover[{extra}]'")
        self.extra = extra


def nearest(word: str, known: Iterable[str]) -> str:
    """The end of a fault's line: the known name most similar to `word`, if any, and all known names."""
    names = list(known)
    close = difflib.get_close_matches(word.lower(), [name.lower() for name in names], n=1, cutoff=0.5)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}accepted: {', '.join(names)}"
