"""Parsing of a friction coefficient: a number, or the text `no-slip`."""

from __future__ import annotations

import math

from validation.errors import InputError, shorten

#: Largest accepted number of characters of a friction coefficient as text [-].
_LONGEST = 40


def read_friction(value: object, *, place: str = "", example: str = "0.4") -> float:
    """Parse Coulomb's coefficient of friction between indenter and cover; infinite for `no-slip` [-].

    Args:
        value: A number, or a text with a number or `no-slip`.
        place: Option or key that holds the value; error messages begin with it.
        example: Example in the error message.

    Raises:
        InputError: If the value is neither `no-slip` nor a finite number of at least zero.
    """
    number = math.nan
    if isinstance(value, str) and value.strip() == "no-slip":
        return math.inf
    if isinstance(value, str | int | float) and not isinstance(value, bool) and len(str(value)) <= _LONGEST:
        try:
            number = float(value)
        except ValueError:
            number = math.nan
    if not 0 <= number < math.inf:
        where = f"{place}: " if place else ""
        raise InputError(f"{where}{shorten(value)} is not zero, a positive number or no-slip; for example {example}")
    return number + 0.0


def describe_friction(coefficient: float) -> str:
    """Return a friction coefficient as text that `read_friction` accepts: a number, or `no-slip` if it is infinite."""
    return "no-slip" if math.isinf(coefficient) else f"{coefficient:.6g}"
