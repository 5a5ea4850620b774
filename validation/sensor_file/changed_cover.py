"""Changes of a cover by options of the command line: `--material`, `--thickness` and `--layer`."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import create_model

from meshes import Cover, Layer, Material, SolidCover
from meshes.material import MODELS
from validation.errors import InputError
from validation.schema import Table, parse
from validation.schema.types import PARAMETERS, Length, MaterialTable, Read, read_material_name

#: Largest accepted number of characters of one change [-].
_LONGEST = 500
_EXAMPLE = "write for example '--layer 1:thickness=1mm,youngs_modulus=2MPa'"
_Material = Annotated[Material, Read(read_material_name)]
#: Fields of the material's table that a change may replace.
_FIELDS = ("youngs_modulus", "poisson_ratio", "hardness", "model", *PARAMETERS)


class _Replacement(Table):
    """One layer that replaces a cover: values of `--material` and `--thickness`."""

    material: _Material | None = None
    thickness: Length | None = None


_MATERIAL_FIELDS: Any = {name: (MaterialTable.model_fields[name].rebuild_annotation() | None, None) for name in _FIELDS}
#: Values of one option `--layer`; those of the material are checked again as a whole table.
_Change = create_model("_Change", __base__=_Replacement, **_MATERIAL_FIELDS)


def change_cover(
    cover: Cover | SolidCover, *, material: str | None = None, thickness: str | None = None, layers: Sequence[str] = ()
) -> Cover | SolidCover:
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
            changed[number - 1] = _change_layer(cover.layers[number - 1], change, f"--layer {number}")
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(*faults)
    known = len(changes) == len(changed) and all(map(_is_known, changes.values()))
    return _replace_layers(cover, tuple(changed), assumed=cover.assumed and not known)


def _replace_layers(cover: Cover | SolidCover, layers: tuple[Layer, ...], *, assumed: bool) -> Cover | SolidCover:
    """Replace the layers of a cover.

    Raises:
        InputError: If its thickness follows from a given shape.
    """
    try:
        return dataclasses.replace(cover, layers=layers, assumed=assumed)
    except ValueError as error:
        raise InputError(f"--thickness: {error}") from None


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
        if key in _Change.model_fields and not (equals and value):
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


def _change_layer(layer: Layer, change: Mapping[str, str], option: str) -> Layer:
    raw = {key: _convert(key, text) for key, text in change.items()}
    read: Any = parse(raw, _Change, source=option)
    own = {key: value for key, value in raw.items() if key in _FIELDS}
    material = layer.material if read.material is None else read.material
    if own:
        material = _change_material(material, own, read.youngs_modulus, option)
    return Layer(thickness=layer.thickness if read.thickness is None else read.thickness, material=material)


def _change_material(material: Material, change: Mapping[str, Any], modulus: float | None, option: str) -> Material:
    """Change values of a material.

    A new Young's modulus of a rubber multiplies all moduli of its strain energy, so that the shape of its stress-strain
    curve stays.  A new material model, or a hardness, replaces all parameters.

    Args:
        material: The material.
        change: New values, by the keys of the table `material` of a sensor file and as such a table holds them.
        modulus: The new Young's modulus; None if it stays [Pa].
        option: Option that holds the change, for messages.

    Raises:
        InputError: If the material model has no such parameter.
    """
    replaced = not {"model", "hardness"}.isdisjoint(change)
    scaled = modulus is not None and "model" not in change and material.model != "linear-elastic"
    table = {
        "model": material.model,
        "poisson_ratio": material.poisson_ratio,
        **({} if replaced else _describe(material)),
        **{key: value for key, value in change.items() if not (scaled and key == "youngs_modulus")},
    }
    try:
        made = parse(table, MaterialTable, source=option).make()
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{option}: {error}") from None
    if scaled and modulus is not None:
        made = _scale(made, modulus / made.youngs_modulus)
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
    units = {name: each.unit for name, each in MODELS[material.model].parameters.items()}
    table: dict[str, Any] = {}
    for name in material.parameters:
        values = [f"{value!r} Pa" if units[name] == "Pa" else value for value in material.terms(name)]
        table[name] = values if len(values) > 1 else values[0]
    return table


def _convert(key: str, text: str) -> object:
    """Convert the text of a value to what a sensor file holds: a number, a list with one value per term, or the text.

    Values for several terms of a strain energy are separated by `/`.
    """

    def read_number(part: str) -> float | str:
        try:
            return float(part)
        except ValueError:
            return part

    if key == "poisson_ratio":
        return read_number(text)
    if key == "alpha":
        return [read_number(part) for part in text.split("/")]
    return text.split("/") if key == "mu" else text


def _scale(material: Material, factor: float) -> Material:
    """Multiply all moduli of a material by a factor [-]."""
    units = {name: each.unit for name, each in MODELS[material.model].parameters.items()}
    parameters = {
        name: tuple(value * (factor if units[name] == "Pa" else 1.0) for value in material.terms(name))
        for name in material.parameters
    }
    return dataclasses.replace(
        material, parameters={name: terms if len(terms) > 1 else terms[0] for name, terms in parameters.items()}
    )


def _replace_cover(cover: Cover | SolidCover, material: str | None, thickness: str | None) -> Cover | SolidCover:
    """Replace a cover by one of a single layer with another material or thickness.

    Args:
        cover: The cover.
        material: Name of the new material; the material stays if None.
        thickness: New thickness with its unit; the thickness stays if None.

    Raises:
        InputError: If the material is unknown or the thickness is not a positive length, or if only one of the two is
            given and the cover has several layers.
    """
    faults: list[str] = []
    if (material is None or thickness is None) and len(cover.layers) > 1:
        faults.append(
            "--material, --thickness: the cover has several layers; give both to replace them by one, or change one "
            "layer: --layer 1:thickness=1mm"
        )
    given = {"material": material, "thickness": thickness}
    try:
        read = parse({key: value for key, value in given.items() if value is not None}, _Replacement)
    except InputError as error:
        raise InputError(*faults, *(f"--{fault}" for fault in error.faults)) from None
    if faults:
        raise InputError(*faults)
    first = cover.layers[0]
    chosen = Layer(
        thickness=first.thickness if read.thickness is None else read.thickness,
        material=first.material if read.material is None else read.material,
    )
    assumed = cover.assumed and (material is None or thickness is None)
    return _replace_layers(cover, (chosen,), assumed=assumed)
