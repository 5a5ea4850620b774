"""Changes of a cover by options of the command line: `--material`, `--thickness` and `--layer`."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Any

from meshes import Cover, Layer, Material
from meshes.catalogue import MATERIALS
from meshes.material import MODELS
from validation.errors import InputError, match_name, nearest
from validation.sensor_file.faults import KEYS_BY_SYMBOL, list_faults
from validation.sensor_file.tables import LONGEST, PARAMETERS, MaterialTable
from validation.text.quantity import read_quantity

#: Largest accepted number of characters of one change [-].
_LONGEST = 500
_EXAMPLE = "write for example '--layer 1:thickness=1mm,youngs_modulus=2MPa'"
#: Keys that a change may have: thickness, the name of a material, and keys of a material's table.
_KEYS = ("thickness", "material", "youngs_modulus", "poisson_ratio", "hardness", "model", *PARAMETERS)


def change_cover(
    cover: Cover, *, material: str | None = None, thickness: str | None = None, layers: Sequence[str] = ()
) -> Cover:
    """Replace a cover by one layer if a material or a thickness is given, then change single layers.

    The result is no longer labelled as assumed if every layer has a new thickness and a new material.

    Args:
        cover: The cover.
        material: Name of the material of the one layer; the material stays if None.
        thickness: Thickness of the one layer with its unit; the thickness stays if None.
        layers: Changes of layers, each of the form `NUMBER:KEY=VALUE,...`; see `read_change`.

    Raises:
        InputError: With one line per fault: unknown names, bad quantities, a layer that the cover does not have, or
            only one of `material` and `thickness` for a cover of several layers.
    """
    if material is not None or thickness is not None:
        cover = _replace_cover(cover, material, thickness)
    faults: list[str] = []
    changes: dict[int, dict[str, str]] = {}
    for text in layers:
        try:
            number, change = read_change(text, len(cover.layers))
            changes.setdefault(number, {}).update(change)
        except InputError as error:
            faults += error.faults
    changed = list(cover.layers)
    for number, change in changes.items():
        try:
            changed[number - 1] = _change_layer(cover.layers[number - 1], change)
        except InputError as error:
            faults += (f"--layer {number}: {fault}" for fault in error.faults)
    if faults:
        raise InputError(*faults)
    known = len(changes) == len(changed) and all(map(_is_known, changes.values()))
    return dataclasses.replace(cover, layers=tuple(changed), assumed=cover.assumed and not known)


def read_change(text: str, count: int) -> tuple[int, dict[str, str]]:
    """Parse one change of a layer, for example `2:thickness=1mm,material=pet`.

    Args:
        text: The change: the number of the layer, 1 for the bottom one, and its new values by their keys.
        count: Number of layers of the cover [-].

    Returns:
        The number of the layer, and the new values as text by their keys.

    Raises:
        InputError: With one line per fault.
    """
    number, colon, rest = text[:_LONGEST].partition(":")
    if len(text) > _LONGEST or not colon or not re.fullmatch(r"\s*\d{1,4}\s*", number):
        raise InputError(f"--layer: {text[:80]!r} is not a layer's number, a colon and KEY=VALUE; {_EXAMPLE}")
    if not 1 <= int(number) <= count:
        known = "only layer 1" if count == 1 else f"layers 1 (bottom) to {count} (top)"
        raise InputError(f"--layer: the cover has no layer {int(number)}, {known}; {_EXAMPLE}")
    faults, change = [], {}
    for part in rest.split(","):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if key not in _KEYS:
            faults.append(f"--layer {int(number)}: unknown key {key!r}; {nearest(KEYS_BY_SYMBOL.get(key, key), _KEYS)}")
        elif not equals or not value:
            faults.append(f"--layer {int(number)}: {key} has no value; {_EXAMPLE}")
        elif key in change:
            faults.append(f"--layer {int(number)}: {key} is given twice; {_EXAMPLE}")
        else:
            change[key] = value
    if faults:
        raise InputError(*faults)
    return int(number), change


def _is_known(change: Mapping[str, str]) -> bool:
    """Return whether a change states the thickness and the whole elastic behaviour of a layer."""
    elastic = "material" in change or {"youngs_modulus", "poisson_ratio"} <= set(change) or "hardness" in change
    return "thickness" in change and elastic


def _change_layer(layer: Layer, change: Mapping[str, str]) -> Layer:
    values = dict(change)
    faults: list[str] = []
    thickness, name = layer.thickness, values.pop("material", None)
    if (text := values.pop("thickness", None)) is not None:
        try:
            thickness = read_quantity(text, "length", place="thickness")
        except InputError as error:
            faults += error.faults
        if not 0 < thickness <= LONGEST:
            wrong = f"must be positive and at most {LONGEST:g} m, not {text!r}"
            faults.append(f"thickness: {wrong}; write for example '2mm'")
    material = layer.material
    if name is not None:
        found = match_name(name, MATERIALS)
        if found not in MATERIALS:
            faults.append(f"material: unknown material {name!r}; {nearest(name, MATERIALS)}")
        material = MATERIALS.get(found, material)
    try:
        material = _change_material(material, values) if values else material
    except InputError as error:
        faults += error.faults
    if faults:
        raise InputError(*faults)
    return Layer(thickness=thickness, material=material)


def _change_material(material: Material, change: Mapping[str, str]) -> Material:
    """Change values of a material.

    A new Young's modulus of a rubber multiplies all moduli of its strain energy, so that the shape of its stress-strain
    curve stays.  A new material model, or a hardness, replaces all parameters.

    Args:
        material: The material.
        change: New values as text, by the keys of the table `material` of a sensor file.

    Raises:
        InputError: If a value is bad, or the material model has no such parameter.
    """
    from pydantic import TypeAdapter, ValidationError

    replaced = not {"model", "hardness"}.isdisjoint(change)
    scaled = "youngs_modulus" in change and "model" not in change and material.model != "linear-elastic"
    table = {
        "model": material.model,
        "poisson_ratio": material.poisson_ratio,
        **({} if replaced else _describe(material)),
    }
    table |= {key: _convert(key, text) for key, text in change.items() if not (scaled and key == "youngs_modulus")}
    try:
        made: Material = TypeAdapter(MaterialTable).validate_python(table).material()
        if scaled:
            made = _scale(made, read_quantity(change["youngs_modulus"], "pressure", place="youngs_modulus"))
    except ValidationError as error:
        raise InputError(*list_faults(error)) from None
    except ValueError as error:
        raise InputError(*str(error).splitlines()) from None
    only_ratio = set(change) == {"poisson_ratio"}
    return dataclasses.replace(
        made,
        name=f"{material.name}, changed",
        source=f"{', '.join(change)} given by the user; else {material.source}",
        spread=material.spread if only_ratio else made.spread,
        spread_above=material.spread_above if only_ratio else made.spread_above,
        poisson_spread=0.0 if "poisson_ratio" in change else material.poisson_spread,
    )


def _describe(material: Material) -> dict[str, Any]:
    """Return the parameters of a material as in the table `material` of a sensor file."""
    units = MODELS[material.model]
    table: dict[str, Any] = {}
    for name in material.parameters:
        values = [f"{value!r} Pa" if units[name] == "Pa" else value for value in material.terms(name)]
        table[name] = values if len(values) > 1 else values[0]
    return table


def _convert(key: str, text: str) -> object:
    """Convert the text of a value to what the tables of a sensor file hold: a number, a list, or the text itself.

    Values for several terms of a strain energy are separated by `/`.
    """
    if key == "poisson_ratio":
        return _read_number(key, text)
    if key == "alpha":
        return [_read_number(key, part) for part in text.split("/")]
    return text.split("/") if key == "mu" else text


def _read_number(key: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{key}: {text!r} is not a number; write for example {key}=0.49") from None


def _scale(material: Material, modulus: float) -> Material:
    """Multiply all moduli of a material by a factor, so that it has a Young's modulus E [Pa].

    Args:
        material: The material.
        modulus: The Young's modulus E at small strain [Pa].

    Raises:
        InputError: If E is not positive.
    """
    if not modulus > 0:
        raise InputError(f"youngs_modulus: must be positive, not {modulus:g} Pa")
    factor, units = modulus / material.youngs_modulus, MODELS[material.model]
    parameters = {
        name: tuple(value * (factor if units[name] == "Pa" else 1.0) for value in material.terms(name))
        for name in material.parameters
    }
    return dataclasses.replace(
        material, parameters={name: terms if len(terms) > 1 else terms[0] for name, terms in parameters.items()}
    )


def _replace_cover(cover: Cover, material: str | None, thickness: str | None) -> Cover:
    """Replace a cover by one of a single layer with another material or thickness.

    Args:
        cover: The cover.
        material: Name of the new material; the material stays if None.
        thickness: New thickness with its unit; the thickness stays if None.

    Raises:
        InputError: If the material is unknown or the thickness is not a positive length, or if only one of the two is
            given and the cover has several layers.
    """
    faults = []
    material = None if material is None else match_name(material, MATERIALS)
    if (material is None or thickness is None) and len(cover.layers) > 1:
        faults.append(
            "--material, --thickness: the cover has several layers; give both to replace them by one, or change one "
            "layer: --layer 1:thickness=1mm"
        )
    if material is not None and material not in MATERIALS:
        faults.append(f"--material: unknown material {material!r}; {nearest(material, MATERIALS)}")
    height = cover.layers[0].thickness
    try:
        height = height if thickness is None else read_quantity(thickness, "length", place="--thickness")
    except InputError as error:
        faults += error.faults
    if not 0 < height <= LONGEST:
        faults.append(
            f"--thickness: must be positive and at most {LONGEST:g} m, not {thickness!r}; write for example '2mm'"
        )
    if faults:
        raise InputError(*faults)
    assumed = cover.assumed and (material is None or thickness is None)
    chosen = cover.layers[0].material if material is None else MATERIALS[material]
    return dataclasses.replace(cover, layers=(Layer(thickness=height, material=chosen),), assumed=assumed)
