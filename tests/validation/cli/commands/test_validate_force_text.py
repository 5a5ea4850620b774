"""What `softcover validate-force` prints, against the numbers of a comparison with made-up curves."""

import re

import numpy as np
import pytest

from meshes import Cover, Layer, Material, Sphere
from validation.cli.commands.validate_force import _show
from validation.measured_force.case import Measurement
from validation.measured_force.comparison import compare_forces
from validation.measured_force.curves import Curve

DEPTH = np.array([0.25e-3, 0.5e-3, 1e-3, 1.5e-3, 2e-3])


@pytest.fixture(params=[1, 2], ids=["one layer", "two layers"])
def comparison(request):
    gel = Material(name="gel", model="neo-hookean", parameters={"shear_modulus": 1e5}, poisson_ratio=0.495)
    cover = Cover(layers=(Layer(thickness=4e-3, material=gel),) * request.param)
    given = Measurement(
        name="made up", source="nowhere", indenter=Sphere(radius=7e-3), cover=cover, depth=DEPTH,
        force=4 * (DEPTH / 1e-3) ** 2.2 * [1.01, 0.99, 1.02, 0.97, 1.03], fitted=DEPTH < 1.2e-3,
        force_uncertainty=0.05, zero_uncertainty=1e-5,
    )  # fmt: skip
    curves = {
        name: Curve(
            force=5 * (DEPTH / 1e-3) ** power, error=np.full(5, 0.02),
            varied={"dome": (5 * (DEPTH / 1e-3) ** power, 5.5 * (DEPTH / 1e-3) ** (power + 0.1), 1.7)},
        )
        for name, power in (("frictionless", 2.0), ("no slip", 2.5))
    }  # fmt: skip
    return compare_forces(given, curves)


def test_the_tables_print_every_point_that_is_scored_and_every_part(comparison, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    _show(comparison)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.strip(" ─━┡╇┩┏┳┓└┴┘")]
    given, rows = comparison.measurement, comparison.rows
    layers = len(given.cover.layers)
    assert lines[0].startswith("made up: 4 mm gel")
    assert lines[1] == "source: nowhere"
    for line, row in zip(lines[2:5], rows, strict=True):
        scale, unit = (row.scale / 10, "MPa") if layers == 1 else (row.scale, "times those given")
        assert line.startswith(f"{row.name}: {'shear modulus' if layers == 1 else 'moduli'} {scale:.4g} {unit}")
        if row.interval is not None:
            low, high = (end / 10 if layers == 1 else end for end in row.interval)
            assert line.endswith(f" ({low:.4g}..{high:.4g}, 95 %)")
    assert sum("95 %)" in line for line in lines[2:5]) == sum(row.interval is not None for row in rows) > 0
    cells = [[each.strip() for each in re.split("[┃│]", line.strip())[1:-1]] for line in lines if set(line) & set("┃│")]
    words = " ".join(" ".join(line for line in lines[5:] if not set(line) & set("┃│")).split())
    assert words == " ".join(
        [
            "Measured force D, computed force S; error E = S - D and standard uncertainties in % of D",
            "abs(E) < u_val: the comparison cannot resolve an error of the model",
            "Parts of u_input in % of D",
            *comparison.verdict,
        ]
    )
    assert cells[0] == ["friction", "mm", "D [N]", "S [N]", "E", "u_val", "u_num", "u_input", "u_D"]
    expected = []
    for row in rows:
        for i in (3, 4):
            share = 100 / given.force[i]
            parts = (row.u_val[i], row.numerical[i], row.u_input[i], row.measured[i])
            expected.append([
                row.name, f"{1e3 * DEPTH[i]:.4g}", f"{given.force[i]:.4g}", f"{row.predicted[i]:.4g}",
                f"{share * (row.predicted[i] - given.force[i]):+.1f}", *(f"{share * part:.1f}" for part in parts),
            ])  # fmt: skip
    assert cells[1:7] == expected
    names = list(rows[-1].inputs)
    assert cells[7] == ["friction", "mm", *names]
    assert {"friction", "dome", "zero of depth"} <= set(names)
    expected = [
        [row.name, f"{1e3 * DEPTH[i]:.4g}"]
        + [f"{100 * row.inputs[name][i] / given.force[i]:.2f} %" if name in row.inputs else "" for name in names]
        for row in rows
        for i in (3, 4)
    ]
    assert cells[8:] == expected
