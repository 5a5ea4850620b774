"""Bad input: every fault is kept, one readable line each."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """What the user gave cannot be used.

    Attributes:
        faults: One line per fault: where, what, what would be accepted.
    """

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


class MissingExtraError(ImportError):
    """An optional part of the installation is needed and absent."""

    def __init__(self, extra: str, module: str) -> None:
        super().__init__(f"{module} is not installed; run: python -m pip install 'softcover[{extra}]'")
        self.extra = extra


def nearest(word: str, known: Iterable[str]) -> str:
    """Say what `word` may have meant and what is known, as the end of a fault's line."""
    names = list(known)
    close = difflib.get_close_matches(word.lower(), [name.lower() for name in names], n=1, cutoff=0.5)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}accepted: {', '.join(names)}"
