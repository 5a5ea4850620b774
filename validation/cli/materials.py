"""`softcover materials`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from meshes.catalogue import MATERIALS
from validation.cli.output import print_json


def materials(*, as_json: Annotated[bool, Parameter(name="--json")] = False) -> None:
    """List the materials that a cover can be made of by name.

    Args:
        as_json: Print one JSON object.
    """
    if as_json:
        print_json({"materials": {name: _entry(name) for name in MATERIALS}})
        return
    from rich.console import Console
    from rich.table import Table

    sources = list(dict.fromkeys(material.source for material in MATERIALS.values()))
    table = Table(title="Materials (small strain; the spread is that of the modulus between sources)")
    for heading in ("name", "model", "E", "nu", "spread", "source"):
        table.add_column(heading, no_wrap=True)
    for name, material in MATERIALS.items():
        modulus = f"{material.youngs_modulus / 1e3:.4g} kPa"
        ratio, spread = f"{material.poisson_ratio:g}", f"±{100 * material.spread:.0f} %"
        table.add_row(name, material.model, modulus, ratio, spread, f"({sources.index(material.source) + 1})")
    console = Console()
    console.print(table)
    for number, source in enumerate(sources, start=1):
        console.print(f"({number}) {source}", highlight=False)


def _entry(name: str) -> dict[str, object]:
    material = MATERIALS[name]
    return {
        "model": material.model,
        "parameters": dict(material.parameters),
        "youngs_modulus": material.youngs_modulus,
        "poisson_ratio": material.poisson_ratio,
        "spread": material.spread,
        "source": material.source,
    }
