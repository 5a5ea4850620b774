"""Parsing of quantities from text, such as `2 mm`, `1 MPa` or `500 g`, into numbers in SI units.

The package pint defines the units.  It is imported on first use, and its parsed definitions of units are stored in the
user's cache folder, because parsing them takes longer than a small finite-element solution.
"""

from __future__ import annotations

import functools
import math
import re
from typing import TYPE_CHECKING, Any, Literal

from meshes.constants import STANDARD_GRAVITY
from validation.errors import InputError, shorten

if TYPE_CHECKING:
    import pint

Kind = Literal["length", "pressure", "frequency", "force", "angle", "per force", "time", "mass"]

#: SI unit, and an accepted example for error messages, by kind of quantity.
_EXAMPLES = {
    "length": ("m", "2 mm"),
    "pressure": ("Pa", "1 MPa"),
    "frequency": ("Hz", "271 Hz"),
    "force": ("N", "4.9 N"),
    "angle": ("rad", "45 deg"),
    "per force": ("1/N", "2665.7 1/N"),
    "time": ("s", "20 ms"),
    "mass": ("kg", "500 g"),
}
#: Largest accepted number of characters of one quantity [-].  The patterns below take long on longer texts.
LONGEST = 80
#: Time from which minutes are printed instead of seconds [s].
_LONG = 100.0
_NUMBER = re.compile(r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,4})?)")
#: Pattern of one name in a unit, with a power of one digit at most.  A unit consists of such names, joined by `*`, `/`
#: or a blank.  Other texts are not given to pint, whose parser would also evaluate numbers and powers of powers.
_NAME = r"[A-Za-z\u00b0\u00b5\u03bc\u03a9\u2126\u00c5%]{1,40}(?:(?:\*\*|\^)[-+]?[1-9]|[\u00b2\u00b3])?"
_UNIT = re.compile(rf"(?:1 ?/ ?)?{_NAME}(?:(?: ?[*/\u00b7] ?| ){_NAME}){{0,4}}")
_SEPARATOR = re.compile(r"[x\u00d7,](?=\s*[-+.0-9])")


def read_quantity(value: object, kind: Kind, *, place: str = "", example: str = "") -> float:
    """Parse one quantity, a number with a unit.

    A force may be given as the weight of a mass, `500 g`.

    Args:
        value: The text; a plain number is refused because it has no unit.
        kind: Kind of quantity that is expected.
        place: Option or key that holds the text; error messages begin with it.
        example: Accepted text for error messages, where another one than that of the kind is of use.

    Returns:
        The number in SI units, angles in radians.

    Raises:
        InputError: If the text has no number, no unit, an unknown unit or a unit of another kind of quantity.
    """
    where = f"{place}: " if place else ""
    example = f"write for example '{example or _EXAMPLES[kind][1]}'"
    if isinstance(value, str) and len(value) > LONGEST:
        raise InputError(f"{where}{value[:LONGEST]!r}... is longer than the {LONGEST} characters accepted; {example}")
    match = _NUMBER.match(value.strip()) if isinstance(value, str) else None
    if isinstance(value, bool) or not isinstance(value, str | int | float) or (isinstance(value, str) and not match):
        raise InputError(f"{where}{shorten(value)} is not a {kind}; {example}")
    unit = " ".join(match.string[match.end() :].split()) if match else ""
    if match is None or not unit:
        raise InputError(f"{where}{value!r} has no unit; {example}")
    factor = _factor(unit, kind) if _UNIT.fullmatch(unit) else None
    if factor is None:
        raise InputError(f"{where}{unit!r} in {value!r} is not a unit of {kind}; {example}")
    number = float(match[1]) * factor
    if not math.isfinite(number):
        raise InputError(f"{where}{value!r} is too large; {example}")
    return number


def read_positive(text: str, kind: Kind, most: float, *, place: str, zero: bool = False) -> float:
    """Parse a quantity that must be positive, or with `zero` not negative, and at most `most` in SI units.

    Raises:
        InputError: For the faults of `read_quantity`, or outside this range.
    """
    number = read_quantity(text, kind, place=place)
    if number < 0 or (number == 0 and not zero):
        raise InputError(f"{place}: must {'not be negative' if zero else 'be positive'}, not {text!r}")
    if number > most:
        raise InputError(f"{place}: must be at most {most:g} {_EXAMPLES[kind][0]}, not {text!r}")
    return number


def read_quantities(value: object, kind: Kind, count: int, *, place: str = "", joint: str = ",") -> tuple[float, ...]:
    """Parse several quantities of one kind, joined by `x` or `,`, such as `10mmx10mmx5mm` or `0.7mm,-1.1mm`.

    Args:
        value: The text.
        kind: Kind of quantity that each value must have.
        count: Number of quantities that is expected [-].
        place: Option or key that holds the text; error messages begin with it.
        joint: Separator in the example that an error message shows.

    Returns:
        The numbers in SI units.

    Raises:
        InputError: For the faults of `read_quantity`, or if the number of quantities differs from `count`.
    """
    short = isinstance(value, str) and len(value) <= count * LONGEST
    parts = _SEPARATOR.split(str(value)) if short else [value]
    if len(parts) != count:
        where = f"{place}: " if place else ""
        example = joint.join([_EXAMPLES[kind][1].replace(" ", "")] * count)
        raise InputError(f"{where}{shorten(value)} is not {count} values; write for example '{example}'")
    return tuple(read_quantity(part, kind, place=place) for part in parts)


def split_quantity(text: str) -> tuple[float, str] | None:
    """Split a text into a number and what follows it, its unit; None if it does not begin with a number."""
    match = _NUMBER.match(text.strip()[:LONGEST])
    return match and (float(match[1]), text.strip()[match.end() :].strip())


@functools.lru_cache(maxsize=256)
def find_factor(unit: str, wanted: str) -> float | None:
    """Return the factor from one unit to another; None if they differ in kind.  Equal names need not be known units."""
    if unit == wanted:
        return 1.0
    if not (_UNIT.fullmatch(unit) and _UNIT.fullmatch(wanted)):
        return None
    try:
        return float(_registry().Quantity(1.0, unit).to(wanted).magnitude)
    except Exception:  # noqa: BLE001 -- as in `_factor`
        return None


def format_time(seconds: float) -> str:
    """Return a time in whole seconds below 100 s, else in whole minutes."""
    return f"{max(seconds, 1):.0f} s" if seconds < _LONG else f"{seconds / 60:.0f} min"


@functools.cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    try:
        return pint.UnitRegistry(cache_folder=":auto:")
    except OSError:  # No cache folder is writable; pint then parses its definitions at every start.
        return pint.UnitRegistry()


@functools.lru_cache(maxsize=256)
def _factor(unit: str, kind: Kind) -> float | None:
    """Return the factor from a unit to SI units; None if the unit is unknown or does not measure this kind of quantity.

    A unit of mass is accepted for a force; its factor is that of the mass's weight.
    """
    registry = _registry()
    try:
        quantity = (1.0 * registry.parse_units(unit)).to_base_units()
    except Exception:  # noqa: BLE001 -- pint's parser raises many unrelated types on arbitrary text
        return None
    if quantity.dimensionality == registry.parse_units(_EXAMPLES[kind][0]).dimensionality:
        # In pint, angles and plain numbers have the same dimension, so that the name of the unit tells them apart.
        return float(quantity.magnitude) if (kind == "angle") == ("radian" in str(quantity.units)) else None
    if kind == "force" and quantity.dimensionality == {"[mass]": 1}:
        return float(quantity.magnitude) * STANDARD_GRAVITY  # The force is given as the mass of a weight.
    return None
