"""Parsing of a rubber's hardness from text, such as `30 shore-a`, and materials with the modulus of a hardness."""

from __future__ import annotations

import re

from meshes import Material
from meshes.hardness import SCALES, HardnessModulus, modulus_from_hardness
from validation.errors import InputError, shorten

#: Largest accepted number of characters of a hardness as text [-].
_LONGEST = 40
_HARDNESS = re.compile(r"([0-9]+(?:\.[0-9]+)?) *(?:shore)?[ -]*([a-z]*|[0o]+)", re.IGNORECASE)
#: Pattern of a hardness whose scale comes first, as data sheets print it: `Shore A 20`, `Shore 00-30`.
_SCALE_FIRST = re.compile(r"shore[ -]*(a|(?:00|oo)(?=[ :-]))[ :-]*([0-9].*)", re.IGNORECASE)
_EXAMPLE = "write for example '30 shore-a' or '30 shore-00'"


def read_hardness(value: object, *, place: str = "", bare: bool = False) -> HardnessModulus:
    """Parse a hardness, Shore A or Shore 00, from text, and estimate Young's modulus from it.

    Args:
        value: The text, for example `30 A`, `30 shore-a`, `Shore A 30` or `30 shore-00`.
        place: Option or key that holds the text; error messages begin with it.
        bare: Whether a number without the name of the scale is accepted, as Shore A.

    Raises:
        InputError: If the text is no hardness, names another scale, or lies outside the range of `meshes.hardness`.
    """
    where = f"{place}: " if place else ""
    text = str(value) if isinstance(value, str | int | float) and not isinstance(value, bool) else ""
    match = _HARDNESS.fullmatch(_SCALE_FIRST.sub(r"\2 \1", text.strip())) if len(text) <= _LONGEST else None
    if not match:
        raise InputError(f"{where}{shorten(value)} is not a hardness; {_EXAMPLE}")
    if not match[2] and not bare:
        raise InputError(f"{where}{value!r} has no scale; {_EXAMPLE}")
    scale = (match[2] or "a").lower().replace("o", "0")
    if scale not in SCALES:
        names = " and ".join(each.name for each in SCALES.values())
        raise InputError(f"{where}{value!r} is not on one of the scales that are supported, {names}; {_EXAMPLE}")
    try:
        return modulus_from_hardness(float(match[1]), scale)
    except ValueError as error:
        raise InputError(f"{where}{error}; take a named material (`softcover materials`) or give its modulus") from None


def material_from_hardness(
    hardness: HardnessModulus, model: str, *, poisson_ratio: float | None = None, name: str = ""
) -> Material:
    """Make a material with the Young's modulus that was estimated from a hardness.

    Args:
        hardness: The hardness and the modulus estimated from it.
        model: Name of the material model: `linear-elastic` or `neo-hookean`.
        poisson_ratio: Poisson ratio; 0.5, incompressible, if None [-].
        name: Name of the material; composed of model and hardness if empty.

    Raises:
        InputError: If the model is another one: a hardness determines a single modulus.
    """
    ratio = 0.5 if poisson_ratio is None else poisson_ratio
    modulus = hardness.youngs_modulus
    # Parameters of the material models with a single modulus, which follows from the hardness.
    parameters = {
        "linear-elastic": {"youngs_modulus": modulus},
        "neo-hookean": {"shear_modulus": modulus / (2 * (1 + ratio))},
    }
    if model not in parameters:
        raise InputError(f"a hardness gives one modulus; it goes with {' or '.join(parameters)}, not with {model}")
    return Material(
        name=name or f"{model} of {hardness}",
        model=model,
        parameters=parameters[model],
        poisson_ratio=ratio,
        source=hardness.source,
        spread=hardness.spread,
    )
