"""A hardness as text, `30 shore-a`, and a material with the modulus of that hardness."""

from __future__ import annotations

import re

from meshes import Material
from meshes.hardness import HardnessModulus, modulus_from_hardness
from validation.errors import InputError

_HARDNESS = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(?:(shore)?[\s-]*([a-z]*|0+))?\s*", re.IGNORECASE)
_EXAMPLE = "write for example '30 shore-a'"


def read_hardness(value: object, *, place: str = "", bare: bool = False) -> HardnessModulus:
    """Read a Shore A hardness.

    Args:
        value: The text: `30 A`, `30 shore-a`.
        place: Option or key that holds the text; messages begin with it.
        bare: Whether a number without a scale is accepted.

    Raises:
        InputError: If it is no hardness, of another scale, or outside the range of the relations.
    """
    where = f"{place}: " if place else ""
    text = str(value) if isinstance(value, str | int | float) and not isinstance(value, bool) else ""
    match = _HARDNESS.fullmatch(text)
    if not match:
        raise InputError(f"{where}{value!r} is not a hardness; {_EXAMPLE}")
    if not match[3] and not bare:
        raise InputError(f"{where}{value!r} has no scale; {_EXAMPLE}")
    if (match[3] or "a").lower() != "a":
        raise InputError(f"{where}{value!r} is not on the Shore A scale, the only one that is supported; {_EXAMPLE}")
    try:
        return modulus_from_hardness(float(match[1]))
    except ValueError as error:
        raise InputError(f"{where}{error}; take a named material (`softcover materials`) or give its modulus") from None


def material_from_hardness(
    hardness: HardnessModulus, model: str, *, poisson_ratio: float | None = None, name: str = ""
) -> Material:
    """A rubber of this hardness.

    Args:
        hardness: The hardness and its modulus.
        model: `linear-elastic` or `neo-hookean`.
        poisson_ratio: 0.5, which is incompressible, when not given [-].
        name: Name of the material; made of model and hardness when not given.

    Raises:
        InputError: If the model has more than one modulus.
    """
    ratio = 0.5 if poisson_ratio is None else poisson_ratio
    modulus = hardness.youngs_modulus
    # The models that have a single modulus, which a hardness can replace.
    parameters = {
        "linear-elastic": {"youngs_modulus": modulus},
        "neo-hookean": {"shear_modulus": modulus / (2 * (1 + ratio))},
    }
    if model not in parameters:
        raise InputError(f"a hardness gives one modulus; it goes with {' or '.join(parameters)}, not with {model}")
    return Material(
        name=name or f"{model} of {hardness.shore_a:g} Shore A",
        model=model,
        parameters=parameters[model],
        poisson_ratio=ratio,
        source=hardness.source,
        spread=hardness.spread,
    )
