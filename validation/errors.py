"""Errors that a user can correct: exceptions, their collection, and hints at accepted names in their messages."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import ParamSpec, TypeVar, cast

P = ParamSpec("P")
T = TypeVar("T")

#: Largest number of characters of a value that an error message repeats [-].
_LONGEST = 80


class InputError(ValueError):
    """Reports faults in the user's input, such as files and options.

    Attributes:
        faults: One line per fault: place of the fault, description, and accepted values.
    """

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


@contextlib.contextmanager
def at(place: str) -> Iterator[None]:
    """Prefix each fault of bad input that the `with` block raises with a place, such as `sensor.toml: `.

    Raises:
        InputError: With the faults of an `InputError`, or the lines of another `ValueError`.
    """
    try:
        yield
    except ValueError as error:
        faults = error.faults if isinstance(error, InputError) else str(error).splitlines()
        raise InputError(*(f"{place}{fault}" for fault in faults)) from None


class Faults(list[str]):
    """List of faults of several inputs, one line each, which are reported together."""

    def read(self, function: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Call a function that reads an input, and keep the faults of the `InputError` that it raises.

        The result is the value of the function; after a fault it is None, whatever its type.  Call `refuse` before
        results are used.
        """
        try:
            return function(*arguments, **options)
        except InputError as error:
            self.extend(error.faults)
            return cast("T", None)

    def refuse(self) -> None:
        """Raise one error with all faults that were kept; do nothing if there is none.

        Raises:
            InputError: With all faults.
        """
        if self:
            raise InputError(*self)


def check_choice(place: str, kind: str, word: str, known: Iterable[str]) -> None:
    """Refuse a word that is not among the accepted ones.

    Args:
        place: Option or key that holds the word; the message begins with it.
        kind: Kind of the word, for the message.
        word: Word given by the user.
        known: The accepted words.

    Raises:
        InputError: If the word is unknown; the message names the nearest accepted word and lists all.
    """
    names = list(known)
    if word not in names:
        raise InputError(f"{place}: unknown {kind} {word!r}; {nearest(word, names)}")


def refuse_existing(option: str, path: Path | None) -> None:
    """Refuse a file to write that exists already.

    Args:
        option: Option that names the file; the error message begins with it.
        path: The file; None if the option is not given.

    Raises:
        InputError: If the file exists.
    """
    if path is not None and path.exists():
        raise InputError(f"{option}: {path} exists; name a new file")


def nearest(word: str, known: Iterable[str], meanings: Mapping[str, Sequence[str]] | None = None) -> str:
    """Return the part of an error message that lists accepted names, after an unknown name.

    Args:
        word: The unknown name.
        known: The accepted names.
        meanings: Accepted names that an unknown name in lower case may stand for.

    Returns:
        Text with the accepted names, after those that `word` may stand for, else the most similar one if any is.
    """
    names = list(known)
    lower = {name.lower(): name for name in names}
    close = difflib.get_close_matches(word.lower(), lower, n=1, cutoff=0.5)
    meant = (meanings or {}).get(match_name(word, meanings or ()), [lower[each] for each in close])
    hint = f"did you mean {' or '.join(map(repr, meant))}? " if meant else ""
    return f"{hint}accepted: {', '.join(names)}"


def shorten(value: object) -> str:
    """Return a value of any type as text for an error message; a long text is cut.

    A table or a list is represented by the name of its type.
    """
    text = repr(value) if isinstance(value, str | int | float | bool | None) else f"a {type(value).__name__}"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def match_name(word: str, known: Iterable[str]) -> str:
    """Return the accepted name that has the same letters and digits as a word; the word itself if there is none.

    Case, hyphens, blanks and underscores are ignored: `Dragon Skin 30` and `dragon_skin_30` are `dragon-skin-30`.
    """
    wanted = _keep_letters(word)
    return next((name for name in known if _keep_letters(name) == wanted), word)


def _keep_letters(name: str) -> str:
    return "".join(character for character in name.casefold() if character.isalnum())
