"""The command `softcover materials`, which lists the named materials and estimates a modulus from a hardness."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from validation.cli import options, output
from validation.errors import InputError

if TYPE_CHECKING:
    from meshes import Material
    from meshes.hardness import HardnessModulus

#: Strains in uniaxial tension at which the nominal stress is printed [-].
_STRAINS = (-0.3, 0.1, 0.3, 1.0)
#: Note for the user on the effect of the elastic constants on the point spread function and on the contact.
PSF_NOTE = (
    "Young's modulus drops out of the point spread function (of several layers their ratio stays); "
    "it decides how deep and how wide a touch goes. Thickness and Poisson ratio do not drop out."
)


def materials(
    name: str | None = None,
    /,
    *,
    hardness: Annotated[str | None, Parameter(metavar="HARDNESS")] = None,
    out: options.File | None = None,
    json: options.Json = False,
) -> None:
    """List the materials that have a name, show one of them, or estimate a modulus from a hardness.

    Examples of use:

        softcover materials
        softcover materials dragon-skin-30
        softcover materials "Sylgard 184" --out sylgard
        softcover materials --hardness 30
        softcover materials --hardness "30 shore-00"
        softcover materials --json

    Args:
        name: One material, with everything that is known about it.
        hardness: Estimate the modulus from a Shore A hardness, e.g. 30 or '30 shore-a'.
        out: Write the stress-strain curve of the material, a .csv, .svg or .png file.
    """
    from meshes.catalogue import MATERIALS
    from validation.schema.types import read_material_name

    if out is not None and name is None:
        raise InputError("--out: holds the curve of one material; name it, for example dragon-skin-30")
    if hardness is not None:
        from validation.text.hardness import read_hardness

        if name is not None:
            raise InputError("--hardness: estimates a material of its own; leave out the name")
        found = read_hardness(hardness, place="--hardness", bare=True)
        output.print_json({**vars(found), "low": found.low, "high": found.high}) if json else _show_hardness(found)
        return
    if name is None:
        listed = {name: _list_material(material) for name, material in MATERIALS.items()}
        output.print_json({"materials": listed, "psf": PSF_NOTE}) if json else _show_all(list(MATERIALS.values()))
        return
    material = read_material_name(name)
    if out is not None:
        from validation.material_curve import write_curve

        write_curve(material, out)
    output.print_json({"name": material.name, **_list_material(material)}) if json else _show_material(material)
    if out is not None:
        output.say(f"wrote {out}")


def _show_all(materials: list[Material]) -> None:
    # A source ends with the numbers of its material.  Without these, equal sources are listed once.
    shortened = [material.source.split(": E0", 1)[0] for material in materials]
    sources = list(dict.fromkeys(shortened))
    rows = [
        (
            material.name,
            material.model.removesuffix("-elastic"),  # Short, so that the table fits 80 columns.
            _format_pressure(material.youngs_modulus, digits=3),
            _format_spread(material),
            "..".join(dict.fromkeys(f"{material.poisson_ratio + k * material.poisson_spread:.4g}" for k in (-1, 1))),
            f"({sources.index(source) + 1})",
        )
        for material, source in zip(materials, shortened, strict=True)
    ]
    title = "Materials (E: Young's modulus at small strain; range: E in other sources)"
    output.print_table(("name", "model", "E", "range", "nu", "from"), rows, title=title, left=2, lines=False)
    for number, source in enumerate(sources, start=1):
        output.show_wrapped(f"({number}) {source}", further="    ")
    advice = (
        "Sources differ by the range, and batches by about as much: for depth and contact area measure your own sheet, "
        "and write its modulus into the sensor file or --layer 1:youngs_modulus=..."
    )
    output.print_meaning((PSF_NOTE, advice))


def _show_material(material: Material) -> None:
    import numpy as np

    from meshes.material import MODELS
    from validation.material_curve import compute_stress, trace_stress

    def format_parameter(name: str) -> str:
        pressure = MODELS[material.model].parameters[name].unit == "Pa"
        return ", ".join(_format_pressure(value) if pressure else f"{value:g}" for value in material.terms(name))

    spread = material.poisson_spread
    ends = [_relative_width(material.poisson_ratio + sign * spread) for sign in (-1, 1)]
    band = " ({:.2f} to {:.2f} over its Poisson ratios)".format(*ends) if spread else ""
    strains = [strain for strain in _STRAINS if abs(strain) <= trace_stress(material)[0][-1]]
    stresses = compute_stress(material, np.array(strains)).tolist()
    bulk = "infinite (incompressible)" if math.isinf(material.bulk_modulus) else _format_pressure(material.bulk_modulus)
    rows = {
        "model": f"{material.model}, {'small strain' if material.small_strain_only else 'finite strain'}",
        **{f"  {name}": format_parameter(name) for name in material.parameters},
        "shear modulus": f"{_format_pressure(material.shear_modulus)} at small strain",
        "Young's modulus": f"{_format_pressure(material.youngs_modulus)} at small strain, {_format_spread(material)}",
        "bulk modulus": bulk,
        "Poisson ratio": f"{material.poisson_ratio:g}" + (f" ±{spread:g}" if spread else ""),
        "nominal stress": ", ".join(
            f"{_format_pressure(stress, 3)} at {100 * strain:g} %"
            for strain, stress in zip(strains, stresses, strict=True)
        ),
        "source": material.source,
        "PSF": f"{PSF_NOTE} A bonded layer of thickness h spreads a point load over a base pressure of standard "
        f"deviation h sqrt(nu / (1 - nu)) = {_relative_width(material.poisson_ratio):.3g} h along each axis{band}; its "
        "core is much narrower, and `softcover derive` fits that.",
    }
    output.print_table((), rows.items(), title=material.name)
    low, high = (_format_pressure(value) for value in material.modulus_range)
    meaning = (
        f"Sources give {low} to {high} (good: within 10 % of yours). Depth and contact area follow the modulus: "
        "measure your own sheet where they matter. One layer spreads a touch alike for every modulus."
    )
    output.print_meaning([meaning])
    output.show(f"softcover derive wts-0614-34 --material {material.name} --thickness 2mm")


def _show_hardness(found: HardnessModulus) -> None:
    modulus, low, high = (_format_pressure(value) for value in (found.youngs_modulus, found.low, found.high))
    rows = {
        "Young's modulus": f"{modulus}, {low} to {high} (k = 2)",
        **{f"  {name}": _format_pressure(value) for name, value in found.by_relation.items()},
        "shear modulus": f"{_format_pressure(found.youngs_modulus / 3)} when incompressible",
        "source": found.source,
        "PSF": PSF_NOTE,
    }
    output.print_table((), rows.items(), title=str(found))
    meaning = (
        f"A hardness fixes the modulus to within {100 * found.spread:.0f} % only (k = 2): enough to choose a cover, "
        "not to predict a depth. A tensile or compression test of your sheet gives a better one."
    )
    output.print_meaning([meaning])
    output.show(
        f'In a sensor file: material = {{ model = "neo-hookean", hardness = "{found.hardness:g} shore-{found.scale}" }}'
    )


def _relative_width(poisson_ratio: float) -> float:
    """Return the width of the base pressure under a point load on a bonded layer, divided by the layer's thickness.

    The width is the standard deviation of the position along one horizontal axis, weighted by the pressure.  For the
    Poisson ratio nu the result is sqrt(nu / (1 - nu)) [-].
    """
    ratio = min(0.5, max(0.0, poisson_ratio))
    return math.sqrt(ratio / (1 - ratio))


def _format_spread(material: Material) -> str:
    """Format the range of Young's modulus over the sources of a material: `±50 %`, or `5..45 MPa` if not symmetric."""
    if material.spread_above in (None, material.spread):
        return f"±{100 * material.spread:.0f} %"
    low, high = material.modulus_range
    text = _format_pressure(high)
    return f"{low * float(text.split()[0]) / high:.4g}..{text}"


def _format_pressure(value: float, digits: int = 4) -> str:
    for unit, factor in (("GPa", 1e9), ("MPa", 1e6), ("kPa", 1e3)):
        if abs(value) >= factor:
            return f"{value / factor:.{digits}g} {unit}"
    return f"{value:.{digits}g} Pa"


def _list_material(material: Material) -> dict[str, Any]:
    names = ("model", "youngs_modulus", "shear_modulus", "bulk_modulus", "poisson_ratio", "poisson_spread", "spread")
    low, high = material.modulus_range
    terms = {name: material.terms(name) for name in material.parameters}
    return {
        **{name: getattr(material, name) for name in names},
        "youngs_modulus_low": low,
        "youngs_modulus_high": high,
        "parameters": {name: values if len(values) > 1 else values[0] for name, values in terms.items()},
        "psf_deviation_per_thickness": _relative_width(material.poisson_ratio),
        "source": material.source,
    }
