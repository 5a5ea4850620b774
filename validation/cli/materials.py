"""`softcover materials`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from meshes.catalogue import MATERIALS
from meshes.material import MODELS, Material
from validation.cli.options import Json
from validation.cli.output import print_json, show
from validation.errors import InputError, nearest

if TYPE_CHECKING:
    from meshes.hardness import HardnessModulus

Name = Annotated[str | None, Parameter(help="One material, with all that is known of it.")]
Hardness = Annotated[
    str | None,
    Parameter(name="--hardness", help="A Shore A hardness, e.g. 30 or '30 shore-a': the modulus that it stands for."),
]

#: What a modulus does, and what it does not.
PSF_NOTE = (
    "Young's modulus drops out of the point spread function (of several layers their ratio stays); "
    "it decides how deep and how wide a touch goes. Thickness and Poisson ratio do not drop out."
)


def materials(name: Name = None, /, *, hardness: Hardness = None, json: Json = False) -> None:
    """The materials that a cover can be made of by name, one of them, or a modulus from a hardness."""
    if name is not None and hardness is not None:
        raise InputError("--hardness: stands for a material of its own; leave out the name")
    if hardness is not None:
        from validation.text.hardness import read_hardness

        found = read_hardness(hardness, place="--hardness", bare=True)
        print_json(_hardness_json(found)) if json else _show_hardness(found)
    elif name is not None:
        material = _named(name)
        print_json({"name": name, **_as_json(material)}) if json else _show_one(material)
    elif json:
        print_json({"materials": {name: _as_json(material) for name, material in MATERIALS.items()}, "psf": PSF_NOTE})
    else:
        _show_all(MATERIALS.values())


def _named(name: str) -> Material:
    if name not in MATERIALS:
        raise InputError(f"unknown material {name!r}; {nearest(name, MATERIALS)}")
    return MATERIALS[name]


def _show_all(listed: Iterable[Material]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    listed = list(listed)
    sources = list(dict.fromkeys(_source(material) for material in listed))
    table = Table(title="Materials (E at small strain, ± its spread between sources)", box=box.SIMPLE, pad_edge=False)
    for heading in ("name", "model", "E", "nu", "from"):
        table.add_column(heading, no_wrap=True, justify="right" if heading == "E" else "left")
    for material in listed:
        modulus = f"{_pascals(material.youngs_modulus)} ±{100 * material.spread:.0f} %"
        source = f"({sources.index(_source(material)) + 1})"
        table.add_row(material.name, material.model, modulus, _ratio(material), source)
    console = Console(highlight=False)
    console.print(table)
    for place, source in enumerate(sources, start=1):
        console.print(f"({place}) {source}")
    console.print(PSF_NOTE)


def _show_one(material: Material) -> None:
    bulk = "infinite (incompressible)" if math.isinf(material.bulk_modulus) else _pascals(material.bulk_modulus)
    rows = {
        "model": f"{material.model}, {'small strain' if material.small_strain_only else 'finite strain'}",
        **{f"  {name}": _parameter(material, name) for name in material.parameters},
        "shear modulus": f"{_pascals(material.shear_modulus)} at small strain",
        "Young's modulus": f"{_pascals(material.youngs_modulus)} at small strain, ±{100 * material.spread:.0f} %",
        "bulk modulus": bulk,
        "Poisson ratio": _ratio(material),
        "source": material.source,
        "PSF": _psf(material),
    }
    _show_rows(material.name, rows)
    show("")
    show(f"softcover derive wts-0614-34 --material {material.name} --thickness 2mm")


def _show_hardness(found: HardnessModulus) -> None:
    rows = {
        "Young's modulus": f"{_pascals(found.youngs_modulus)}, {_pascals(found.low)} to {_pascals(found.high)} (k = 2)",
        **{f"  {name}": _pascals(value) for name, value in found.by_relation.items()},
        "shear modulus": f"{_pascals(found.youngs_modulus / 3)} when incompressible",
        "source": found.source,
        "PSF": PSF_NOTE,
    }
    _show_rows(f"{found.shore_a:g} Shore A", rows)
    show("")
    show(f'In a sensor file: material = {{ model = "neo-hookean", hardness = "{found.shore_a:g} shore-a" }}')


def _show_rows(title: str, rows: Mapping[str, str]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column()
    for name, value in rows.items():
        table.add_row(name, value)
    Console(highlight=False).print(table)


def _psf(material: Material) -> str:
    """What a bonded layer of this material does to the width of a touch."""
    widths = [_width(material.poisson_ratio + sign * material.poisson_spread) for sign in (-1, 0, 1)]
    band = f" ({widths[0]:.2f} to {widths[2]:.2f} over its Poisson ratios)" if material.poisson_spread else ""
    return (
        f"{PSF_NOTE} A bonded layer of thickness h spreads a point load over a base pressure of standard deviation "
        f"h sqrt(nu / (1 - nu)) = {widths[1]:.3g} h along each axis{band}; its core is much narrower, and "
        "`softcover derive` fits that."
    )


def _width(poisson_ratio: float) -> float:
    """Standard deviation of the base pressure of a bonded layer over its thickness, sqrt(nu / (1 - nu)) [-]."""
    ratio = min(0.5, max(0.0, poisson_ratio))
    return math.sqrt(ratio / (1 - ratio))


def _source(material: Material) -> str:
    """The source without what differs from one row to the next."""
    return material.source.split(": E0", 1)[0]


def _parameter(material: Material, name: str) -> str:
    unit = MODELS[material.model][name]
    return ", ".join(_pascals(value) if unit == "Pa" else f"{value:g}" for value in material.terms(name))


def _ratio(material: Material) -> str:
    spread = f" ±{material.poisson_spread:g}" if material.poisson_spread else ""
    return f"{material.poisson_ratio:g}{spread}"


def _pascals(value: float) -> str:
    for unit, factor in (("GPa", 1e9), ("MPa", 1e6), ("kPa", 1e3)):
        if abs(value) >= factor:
            return f"{value / factor:.4g} {unit}"
    return f"{value:.4g} Pa"


def _as_json(material: Material) -> dict[str, Any]:
    parameters = {
        name: values if len(values := material.terms(name)) > 1 else values[0] for name in material.parameters
    }
    return {
        "model": material.model,
        "parameters": parameters,
        "youngs_modulus": material.youngs_modulus,
        "shear_modulus": material.shear_modulus,
        "bulk_modulus": None if math.isinf(material.bulk_modulus) else material.bulk_modulus,
        "poisson_ratio": material.poisson_ratio,
        "poisson_spread": material.poisson_spread,
        "psf_deviation_per_thickness": _width(material.poisson_ratio),
        "spread": material.spread,
        "source": material.source,
    }


def _hardness_json(found: HardnessModulus) -> dict[str, Any]:
    return {
        "shore_a": found.shore_a,
        "youngs_modulus": found.youngs_modulus,
        "low": found.low,
        "high": found.high,
        "spread": found.spread,
        "by_relation": dict(found.by_relation),
        "source": found.source,
    }
