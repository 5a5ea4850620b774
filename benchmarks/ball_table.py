"""Press balls into one layer, by the exact linear solution and at finite strain, and write the table of `design`.

python benchmarks/ball_table.py            writes validation/resolution/ball_table.csv (about five minutes)
python benchmarks/ball_table.py --errors   prints its leave-one-out errors

Lengths are in units of the thickness h, loads in units of mu h^2 with the shear modulus mu.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

from fem_reference.closed_form.contact import indent
from fem_reference.indentation.ball_path import press_ball
from meshes import Cover, Layer, Material, Sphere
from validation.resolution.ball import DEPTHS, LEAST_FINITE, PATH, RADII, RATIOS, estimate_errors

#: Shear modulus [Pa] and thickness [m] of the layer; the table does not depend on them.
SHEAR, THICKNESS = 1e5, 1e-3


def press(ratio: float, radius: float) -> Iterator[tuple[float, float, float]]:
    """Press one ball to every depth; yield linear load, contact radius, and load at finite strain over the linear."""
    material = Material(name="", model="neo-hookean", parameters={"shear_modulus": SHEAR}, poisson_ratio=ratio)
    cover = Cover(layers=(Layer(thickness=THICKNESS, material=material),))
    pressed = [depth for depth in DEPTHS if depth >= LEAST_FINITE]
    path = press_ball(cover, radius * THICKNESS, [THICKNESS * depth for depth in pressed])
    if len(path.load) < len(pressed):
        raise SystemExit(f"nu {ratio:g}, R/h {radius:g}: no solution at finite strain beyond {path.depth[-1]:g} m")
    exact = [indent(cover, Sphere(radius=radius * THICKNESS), depth=THICKNESS * depth) for depth in DEPTHS]
    loads = np.array([each.force for each in exact])
    ratios = np.interp(DEPTHS, (0.0, *pressed), (1.0, *(path.load / loads[-len(pressed) :])))
    for each, load, share in zip(exact, loads, ratios, strict=True):
        yield load / (SHEAR * THICKNESS**2), each.contact_radius / THICKNESS, share


def main() -> None:
    """Write the table, or print its errors."""
    if "--errors" in sys.argv[1:]:
        names = ("linear load", "contact radius", "ratio of loads")
        print("\n".join(f"{name}: {100 * error:.2g} %" for name, error in zip(names, estimate_errors(), strict=True)))
        return
    lines = ["# nu, R/h, depth/h, linear load/(mu h^2), contact radius/h, ratio of loads; by benchmarks/ball_table.py"]
    for ratio in RATIOS:
        for radius in RADII:
            print(f"nu {ratio:g}, R/h {radius:g}", file=sys.stderr)
            for depth, row in zip(DEPTHS, press(ratio, radius), strict=True):
                lines.append(",".join(f"{value:.6g}" for value in (ratio, radius, depth, *row)))
    PATH.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
