"""A material law that no file of the package knows, registered before the rest is imported; prints values as JSON.

Energy mu / 2 (I1 - 3) + a (I1 - 3)^2 + K / 2 (J - 1)^2 with the isochoric I1.  K and mu determine the Poisson ratio.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import meshes.material as law

law.MODELS = {
    **law.MODELS,
    "soft-quadratic": law.Model(
        parameters={
            "mu": law.Parameter(meaning="shear modulus"),
            "a": law.Parameter(meaning="modulus of (I1 - 3)^2", positive=False),
            "K": law.Parameter(meaning="bulk modulus"),
        },
        shear_modulus=lambda each: each.number("mu"),
        poisson_ratio=lambda each: (
            (3 * each.number("K") - 2 * each.number("mu")) / (6 * each.number("K") + 2 * each.number("mu"))
        ),
        at_poisson_ratio=lambda each, ratio: {
            **each.parameters,
            "K": each.number("mu") * 2 * (1 + ratio) / (3 * (1 - 2 * ratio)),
        },
    ),
}

SENSOR = """
[array]
rows = 2
columns = 2
pitch = "2.5 mm"
[[cover.layer]]
thickness = "4 mm"
material = { model = "soft-quadratic", mu = "100 kPa", a = "40 kPa", K = "0.3 MPa" }
[cover]
size = ["8 mm", "6 mm"]
base = "sliding"
[electronics]
rate = "100 Hz"
sensitivity = "1000 1/N"
"""


def main() -> None:
    """Read, change and press a cover of the law, and print what came of it."""
    import fem_reference.materials as energies
    from fem_reference import press
    from meshes import Box, Cover, Layer
    from validation.errors import InputError
    from validation.sensor_file import load
    from validation.sensor_file.changed_cover import change_cover

    energies.ENERGIES = {
        **energies.ENERGIES,
        "soft-quadratic": lambda each, unit: energies.Polynomial(
            c1=each.number("mu") / unit / 2, c2=each.number("a") / unit
        ),
    }

    def change(cover: Cover, text: str) -> law.Material:
        return change_cover(cover, layers=(text,)).layers[0].material

    def refuse(text: str) -> str:
        file.write_text(SENSOR.replace(', K = "0.3 MPa"', text))
        try:
            return str(load(file))
        except InputError as error:
            return str(error)

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sensor.toml"
        file.write_text(SENSOR)
        sensor = load(file)
        wrong = ("", ', K = "9 MPa", poisson_ratio = 0.2', ', K = "10 kPa"', ', k = "1 MPa"')
        faults = {text: refuse(text) for text in wrong}
    cover = sensor.cover
    (layer,) = cover.layers
    rubber = Cover(layers=(Layer(thickness=1e-3, material=law.Material(
        name="rubber", model="neo-hookean", parameters={"shear_modulus": 1e5}, poisson_ratio=0.35)),))  # fmt: skip
    with_law = "1:thickness=1mm,model=soft-quadratic,mu=100kPa,a=40kPa,K=300kPa"
    found = press(cover, sensor.array, Box(size=(14e-3, 14e-3, 5e-3)), depth=1.2e-3)
    sys.stdout.write(
        json.dumps(
            {
                "read": [layer.material.shear_modulus, layer.material.bulk_modulus, layer.material.poisson_ratio],
                "to the law": change(rubber, with_law).poisson_ratio,
                "assumed": change_cover(Cover(layers=rubber.layers, assumed=True), layers=(with_law,)).assumed,
                "from the law": change(cover, "1:model=neo-hookean,shear_modulus=100kPa").poisson_ratio,
                "bulk": change(cover, "1:K=1MPa").bulk_modulus,
                "scaled": dict(change(cover, "1:youngs_modulus=540kPa").parameters),
                "moved": dict(layer.material.with_poisson_ratio(0.25).parameters),
                "incompressible": layer.material.with_poisson_ratio(0.5).poisson_ratio,
                "zero": [
                    law.Material(name="m", model="soft-quadratic", parameters={"mu": mu, "a": 0.0, "K": 2 / 3 * mu})
                    .poisson_ratio
                    for mu in (1.1e5, 3.3e4, 7e5, 1e5, 12345.0)
                ],
                "faults": faults,
                "strain": found.assumptions["strain"],
                "force": found.total_force,
            }
        )
    )  # fmt: skip


if __name__ == "__main__":
    main()
