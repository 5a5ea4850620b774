"""Changes of a cover by options of the command line: `--material`, `--thickness` and `--layer`."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import create_model

from meshes import Cover, Layer, Material, SolidCover
from meshes.material import MODELS
from validation.errors import Faults, InputError, at
from validation.schema import Table, parse
from validation.schema.types import PARAMETERS, Length, MaterialTable, Read, read_material_name

#: Largest accepted number of characters of one change of a layer as text [-].
_LONGEST = 500
_EXAMPLE = "write for example '--layer 1:thickness=1mm,youngs_modulus=2MPa'"
#: Keys of the table of a material whose values a change of a layer may replace.
_FIELDS = ("youngs_modulus", "poisson_ratio", "hardness", "model", *PARAMETERS)
_OPTIONAL: dict[str, Any] = {
    "material": (Annotated[Material, Read(read_material_name)] | None, None),
    "thickness": (Length | None, None),
    **{name: (MaterialTable.model_fields[name].rebuild_annotation() | None, None) for name in _FIELDS},
}
#: Table with the new values of a layer, each of which may be missing.
_Change: Any = create_model("_Change", __base__=Table, **_OPTIONAL)


def change_cover(
    cover: Cover | SolidCover, *, material: str | None = None, thickness: str | None = None, layers: Sequence[str] = ()
) -> Cover | SolidCover:
    """Replace a cover by one layer if a material or a thickness is given, then change single layers or add some on top.

    The result is no longer labelled as assumed if every layer has a new thickness and a new material.

    Args:
        cover: The cover.
        material: Name of the material of the one layer; the material stays if None.
        thickness: Thickness of the one layer with its unit; the thickness stays if None.
        layers: Changes of layers, each of the form `NUMBER:KEY=VALUE,...`; see `read_change`.

    Raises:
        InputError: With one line per fault: unknown names, bad quantities, a layer that the cover does not have, only
            one of `material` and `thickness` for a cover of several layers, or a thickness that follows from a shape.
    """
    faults = Faults()
    kept, assumed = list(cover.layers), cover.assumed
    given = {"material": material, "thickness": thickness}
    replaced = {key: value for key, value in given.items() if value is not None}
    if len(replaced) == 1 and len(kept) > 1:
        faults.append(
            "--material, --thickness: the cover has several layers; give both to replace them by one, or change one "
            "layer: --layer 1:thickness=1mm"
        )
    if replaced:
        kept = [faults.read(_change_layer, kept[0], replaced, "--")]
        faults.refuse()
        assumed = assumed and len(replaced) == 1
    changes: dict[int, dict[str, str]] = {}
    for text in layers:
        if change := faults.read(read_change, text, max([len(kept), *changes])):
            changes.setdefault(change[0], {}).update(change[1])
    changed = list(kept)
    for number, values in sorted(changes.items()):
        if number > len(changed):
            changed.append(kept[-1])
            if not _is_known(values):
                faults.append(
                    f"--layer: the cover has no layer {number}; a new one on top needs thickness and material: "
                    f"--layer {number}:thickness=0.2mm,material=pet"
                )
        changed[number - 1] = faults.read(_change_layer, changed[number - 1], values, f"--layer {number}: ")
    faults.refuse()
    known = len(changes) == len(changed) and all(map(_is_known, changes.values()))
    with at("--thickness: "):
        return dataclasses.replace(cover, layers=tuple(changed), assumed=assumed and not known)


def read_change(text: str, count: int) -> tuple[int, dict[str, str]]:
    """Parse one change of a layer, for example `2:thickness=1mm,material=pet`.

    Args:
        text: The change: the number of the layer, 1 for the bottom one, and its new values by their keys; a layer above
            the top one is new.
        count: Number of layers of the cover [-].

    Returns:
        The number of the layer, and the new values as text by their keys.

    Raises:
        InputError: With one line per fault.
    """
    number, colon, rest = text[:_LONGEST].partition(":")
    if len(text) > _LONGEST or not colon or not re.fullmatch(r"\s*\d{1,4}\s*", number):
        raise InputError(f"--layer: {text[:80]!r} is not a layer's number, a colon and KEY=VALUE; {_EXAMPLE}")
    if not 1 <= int(number) <= count + 1:
        known = "only layer 1" if count == 1 else f"layers 1 (bottom) to {count} (top)"
        raise InputError(
            f"--layer: the cover has no layer {int(number)}, {known}; a new one on top has the number "
            f"{count + 1}; {_EXAMPLE}"
        )
    faults, change = Faults(), {}
    for part in rest.split(","):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if key in change or (key in _Change.model_fields and not (equals and value)):
            fault = "is given twice" if key in change else "has no value"
            faults.append(f"--layer {int(number)}: {key} {fault}; {_EXAMPLE}")
        change[key] = value
    faults.refuse()
    return int(number), change


def _is_known(change: Mapping[str, str]) -> bool:
    """Return whether the new values of a layer include its thickness and all its elastic constants."""
    model = MODELS.get(change.get("model", ""))
    elastic = {"material", "hardness"} & set(change) or {"youngs_modulus", "poisson_ratio"} <= set(change)
    return "thickness" in change and bool(elastic or (model is not None and model.poisson_ratio))


def _change_layer(layer: Layer, change: Mapping[str, str], place: str) -> Layer:
    """Change a layer of a cover.

    Args:
        layer: The layer.
        change: New values as texts, by key.
        place: Start of messages about faults in the new values.
    """
    with at(place):
        read = parse({key: _convert(key, text) for key, text in change.items()}, _Change)
        material = layer.material if read.material is None else read.material
        own = {key: getattr(read, key) for key in change if key in _FIELDS}
        return Layer(
            thickness=read.thickness or layer.thickness, material=_change_material(material, own) if own else material
        )


def _change_material(material: Material, change: dict[str, Any]) -> Material:
    """Change values of a material.

    A new Young's modulus of a rubber multiplies all moduli of its strain energy, so that the shape of its stress-strain
    curve stays.  A new material model, or a hardness, replaces all parameters.

    Args:
        material: The material.
        change: New values, by the keys of the table `material` of a sensor file.

    Raises:
        ValueError: If the material model has no such parameter.
    """
    kept = {} if {"model", "hardness"} & set(change) else dict(material.parameters)
    ratio = None if MODELS[change.get("model", material.model)].poisson_ratio else material.poisson_ratio
    values = {"model": material.model, "poisson_ratio": ratio, **kept, **change}
    scaled = "youngs_modulus" in change and "model" not in change and material.model != "linear-elastic"
    modulus = values.pop("youngs_modulus") if scaled else 0.0
    made = MaterialTable.model_construct(**values).make()
    if scaled:
        factor = modulus / made.youngs_modulus
        units = {name: each.unit for name, each in MODELS[made.model].parameters.items()}
        scaled_terms = {
            name: tuple(value * (factor if units[name] == "Pa" else 1.0) for value in made.terms(name))
            for name in made.parameters
        }
        parameters = {name: terms if len(terms) > 1 else terms[0] for name, terms in scaled_terms.items()}
        made = dataclasses.replace(made, parameters=parameters)
    spreads = material if set(change) == {"poisson_ratio"} else made
    return dataclasses.replace(
        made,
        name=f"{material.name}, changed",
        source=f"{', '.join(change)} given by the user; else {material.source}",
        spread=spreads.spread,
        spread_above=spreads.spread_above,
        poisson_spread=0.0 if "poisson_ratio" in change else material.poisson_spread,
    )


def _convert(key: str, text: str) -> object:
    """Convert the new value of a layer from text to the form in a sensor file: a number, a list, or the text itself.

    A list has one value for each term of a strain energy; in the text the values are separated by `/`.
    """

    def read_number(part: str) -> float | str:
        try:
            return float(part)
        except ValueError:
            return part

    used = [(model.has_terms, model.parameters[key].unit) for model in MODELS.values() if key in model.parameters]
    is_number = key == "poisson_ratio" or any(unit == "-" for _, unit in used)
    if any(has_terms for has_terms, _ in used):
        return [read_number(part) for part in text.split("/")] if is_number else text.split("/")
    return read_number(text) if is_number else text
