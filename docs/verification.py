"""Print the tables of measured errors in docs/reference.md, all against answers that share nothing with the elements.

Run it in the repository root: `.venv/bin/python docs/verification.py` (five minutes), or name `layer`, `shapes` or
`disks` for one table.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import cache
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from fem_reference import closed_form, point_spread, press
from meshes import Box, Cover, Cylinder, Layer, Material, Roller, Sphere, TexelArray
from meshes.catalogue import ARRAYS
from tests.exact.bonded_disk import compress_disk, gent_lindley
from tests.exact.boundary import pressed_shape
from tests.exact.disk_series import bonded_disk
from tests.exact.point_response import point_response_spline

ARRAY = ARRAYS["wts-0614-34"]
RATIOS = (0.0, 0.3, 0.45, 0.49, 0.499, 0.5)
#: Square punch, and a cylinder on its side, with their depths; cells along a quarter's side of the boundary elements.
SHAPES = ((Box(size=(4e-3, 4e-3, 4e-3)), 0.05e-3), (Roller(radius=4e-3, length=8e-3), 0.2e-3))
CELLS = 24
FACTORS = (0.25, 0.5, 1.0, 2.0, 3.0)


def main() -> None:
    """Print the tables that are named, or all."""
    tables = {"layer": layer_table, "shapes": shape_table, "disks": disk_table}
    for name in sys.argv[1:] or tables:
        tables[name]()
        print()


def head(*columns: str) -> None:
    """Print the head of a table."""
    print("| " + " | ".join(columns) + " |\n|" + "---|" * len(columns))


def row(name: str, errors: Iterable[float]) -> None:
    """Print errors in percent."""
    print(f"| {name} | " + " | ".join(f"{100 * error:.2g} %" for error in errors) + " |", flush=True)


def layer_table() -> None:
    """One row per Poisson ratio: loads at points, spheres and punches on one bonded layer."""
    heads = ("Poisson ratio", "radial profile", "texel, point load", "texel, uniform", "balance")
    head(*heads, "sphere, a/h 0.5", "sphere, a/h 1", "punch, a/h 1")
    for ratio in RATIOS:
        cover = of(ratio)
        row(str(ratio), (*spread_errors(cover), *press_errors(cover)))


def shape_table() -> None:
    """Square punch and roller against boundary elements on the exact compliance: force, any texel over the peak."""
    head("cover", "punch, force", "punch, texel", "roller, force", "roller, texel")
    covers = {f"bonded, {ratio}": of(ratio) for ratio in RATIOS[1:]}
    covers |= {f"sliding, {ratio}": of(ratio, base="sliding") for ratio in (0.3, 0.5)}
    covers |= {f"foil on 0.45, {base}": foil_on_foam(base=base) for base in ("bonded", "sliding")}
    for name, cover in covers.items():
        errors: list[float] = []
        for shape, depth in SHAPES:
            exact = pressed_shape(cover, shape, depth, cells=CELLS)
            found, forces = press(cover, ARRAY, shape, depth=depth), exact.texel_forces(ARRAY)
            errors.append(abs(found.total_force / exact.total_force - 1))
            errors.append(float(np.abs(found.texel_forces - forces).max() / forces.max()))
        row(name, errors)


def disk_table() -> None:
    """Incompressible disks between bonded plates: apparent over Young's modulus, elements over series, estimates."""
    columns = ("shape factor", "series", "Gent-Lindley", "elements, small strain", "5 %", "10 %", "15 %")
    head(*columns, "error, small strain", "estimate there", "estimate at 15 %")
    rubber = Material(name="rubber", model="neo-hookean", parameters={"shear_modulus": 1e6 / 3}, poisson_ratio=0.5)
    for factor in FACTORS:
        radius, height = 4e-3 * factor, 2e-3
        found = compress_disk(rubber, radius=radius, height=height, strains=[1e-4, 0.05, 0.1, 0.15])
        apparent = found.force / (np.pi * radius**2 * found.strain * rubber.youngs_modulus)
        series = bonded_disk(factor).value
        numbers = [series, gent_lindley(factor), *apparent]
        errors = [abs(apparent[0] / series - 1), found.error_estimate[0], found.error_estimate[-1]]
        row(" | ".join([str(factor), *(f"{number:.4g}" for number in numbers)]), errors)


def of(poisson_ratio: float, base: Literal["bonded", "sliding"] = "bonded") -> Cover:
    """The 2 mm cover, 1 MPa."""
    material = Material(
        name="linear", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=poisson_ratio
    )
    return Cover(layers=(Layer(thickness=2e-3, material=material),), base=base)


def foil_on_foam(base: Literal["bonded", "sliding"]) -> Cover:
    """A foil a tenth as thick as the cover and a hundred times as stiff as what is under it."""
    moduli = {"soft": (1e6, 0.45, 1.8e-3), "foil": (1e8, 0.35, 0.2e-3)}
    layers = [
        Layer(
            thickness=thickness,
            material=Material(
                name=name, model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=ratio
            ),
        )
        for name, (modulus, ratio, thickness) in moduli.items()
    ]
    return Cover(layers=tuple(layers), base=base)


def spread_errors(cover: Cover) -> tuple[float, float, float, float]:
    """Of the peak of the profile; of the load, largest over texels, twice; of the load.

    The point load stands over a texel's centre, the middle of its edge and its corner.
    """
    spread = point_spread(cover)
    radius = np.linspace(0, spread.reach, 3000)
    exact = closed_form.point_response(cover, radius)
    profile = np.abs(spread.pressure(radius) - exact).max() / exact.max()
    centre = ARRAY.centres[ARRAY.middle, :2]
    half = np.array(ARRAY.pitch) / 2
    loaded = [centre, centre + half * (1, 0), centre + half]
    influence = spread.texel_influence(ARRAY, np.array(loaded))
    point = max(np.abs(each - exact_forces(cover, x)).max() for each, x in zip(influence, loaded, strict=True))
    nodes, weights = np.polynomial.legendre.leggauss(6)
    exact_uniform = sum(
        a * b / 4 * exact_forces(cover, centre + np.array([x, y]) * ARRAY.texel_size[0] / 2)
        for x, a in zip(nodes, weights, strict=True)
        for y, b in zip(nodes, weights, strict=True)
    )
    uniform = np.abs(spread.texel_response(ARRAY, "uniform") - exact_uniform).max()
    places = np.vstack([ARRAY.centres[:, :2], ARRAY.centres[:, :2] + 1e-3])
    balance = np.abs(spread.texel_influence(ARRAY, places).sum(axis=1) + spread.outside(ARRAY, places) - 1).max()
    return float(profile), float(point), float(uniform), float(balance)


def exact_forces(cover: Cover, place: np.ndarray, array: TexelArray = ARRAY) -> np.ndarray:
    """Force on every texel of a unit point load at a place, by quadrature of the exact response [-]."""
    reach = 24 * cover.thickness
    nodes, weights = np.polynomial.legendre.leggauss(14)
    half = np.array(array.texel_size) / 2
    x = array.centres[:, None, 0] + nodes * half[0] - place[0]
    y = array.centres[:, None, 1] + nodes * half[1] - place[1]
    radius = np.minimum(np.hypot(x[:, :, None], y[:, None, :]), reach)
    return np.einsum("nij,i,j->n", exact_spline(cover, reach)(radius), weights, weights) * half[0] * half[1]


@cache
def exact_spline(cover: Cover, reach: float) -> CubicSpline:
    """The exact radial response out to `reach` [1/m2]."""
    return point_response_spline(cover, reach)


def press_errors(cover: Cover) -> tuple[float, float, float]:
    """Of the force at the exact solution's depth."""
    errors = []
    for share in (0.5, 1.0):
        exact = closed_form.sphere(cover, 10e-3, share * cover.thickness)
        errors.append(abs(press(cover, ARRAY, Sphere(radius=10e-3), depth=exact.depth).total_force / exact.force - 1))
    exact = closed_form.punch(cover, cover.thickness, 0.05e-3)
    found = press(cover, ARRAY, Cylinder(radius=exact.contact_radius), depth=exact.depth)
    return errors[0], errors[1], abs(found.total_force / exact.force - 1)


if __name__ == "__main__":
    main()
