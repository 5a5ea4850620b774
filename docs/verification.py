"""Print the table of measured errors in docs/reference.md: the elements against the exact bonded layer.

Run it in the repository root: `.venv/bin/python docs/verification.py` (a minute).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from fem_reference import closed_form, point_spread, press
from meshes import Cover, Cylinder, Layer, Material, Sphere, TexelArray
from meshes.catalogue import ARRAYS

ARRAY = ARRAYS["wts-0614-34"]
RATIOS = (0.0, 0.3, 0.45, 0.49, 0.5)


def main() -> None:
    """Print one row per Poisson ratio."""
    heads = ("Poisson ratio", "radial profile", "texel, point load", "texel, uniform", "balance")
    heads += ("sphere, a/h 0.5", "sphere, a/h 1", "punch, a/h 1")
    print("| " + " | ".join(heads) + " |\n|" + "---|" * len(heads))
    for ratio in RATIOS:
        cover = bonded(ratio)
        errors = (*spread_errors(cover), *press_errors(cover))
        print(f"| {ratio} | " + " | ".join(f"{100 * error:.2g} %" for error in errors) + " |")


def bonded(poisson_ratio: float) -> Cover:
    """The 2 mm cover, 1 MPa, bonded."""
    material = Material(
        name="linear", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=poisson_ratio
    )
    return Cover(layers=(Layer(thickness=2e-3, material=material),))


def spread_errors(cover: Cover) -> tuple[float, float, float, float]:
    """Of the peak of the profile; of the load, largest over texels, twice; of the load."""
    spread = point_spread(cover)
    radius = np.linspace(0, spread.reach, 3000)
    exact = closed_form.point_response(cover, radius)
    profile = np.abs(spread.pressure(radius) - exact).max() / exact.max()
    centre = ARRAY.centres[ARRAY.middle, :2]
    point = np.abs(spread.texel_response(ARRAY) - exact_forces(cover, centre)).max()
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
    return closed_form.point_response_spline(cover, reach)


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
