"""Compare presses with friction, and presses in three dimensions, with independent solutions; print a table.

Each case is pressed with `press`, and its total force, peak texel and their estimated errors stand beside the true
errors.  Truth is, by case,

- `integral equations`: contacts without slip on a wide layer (`closed_form.stuck_punch`, `stuck_shape`); the free sides
  of the cover of limited size that is pressed are farther from the contact than their effect reaches;
- `r-z plane`: the axisymmetric solver at the same place of a wide cover, with its own estimate below a third;
- `cubic elements`: the ratio of the forces with and without slip on elements of order 3, a second discretisation.

Run `python benchmarks/friction.py` for all cases, or with the numbers of some of them.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fem_reference import press
from fem_reference.closed_form.contact import LayerContact
from fem_reference.small_strain_contact.no_slip import FaceGrid, press_face
from meshes import Box, Cover, Cylinder, Indenter, Layer, Material, Sphere, TexelArray
from meshes.pose import Pose
from tests.exact.no_slip import stuck_punch, stuck_shape

#: Thickness of the covers, and edges of those of limited size [m].
THICKNESS, PAD = 2e-3, (27.2e-3, 27.2e-3)
#: Texels under the covers.
ARRAY = TexelArray.grid(8, 8, pitch=3.4e-3)
#: Grid of elements of order 3 for the ratio of the forces with and without slip.
CUBIC = FaceGrid(through=3, edge=0.004, growth=1.0, across=16, order=3)


@dataclass(frozen=True, kw_only=True)
class Truth:
    """Independent force [N] and peak texel [N] of a case, None if it gives no peak texel, and where they come from."""

    source: str
    force: float
    peak: float | None


@dataclass(frozen=True, kw_only=True)
class Case:
    """A press and the function that computes its truth."""

    cover: Cover
    indenter: Indenter
    depth: float
    friction: float
    truth: Callable[[Case], Truth]

    @property
    def name(self) -> str:
        """One line that describes the case."""
        material = self.cover.layers[0].material
        law = "no slip" if np.isinf(self.friction) else f"friction {self.friction:g}"
        where = "wide" if self.cover.size is None else "pad"
        return (
            f"{type(self.indenter).__name__} {2e3 * self.indenter.footprint[0]:.3g} mm, {material.model}, "
            f"nu {material.poisson_ratio:g}, {where}, {1e3 * self.depth:.3g} mm, {law}"
        )


def make_cover(nu: float, *, finite: bool = False, wide: bool = False) -> Cover:
    """Return a bonded layer with a Young's modulus of 1 MPa, linear elastic or neo-Hookean."""
    parameters = {"shear_modulus": 1e6 / (2 * (1 + nu))} if finite else {"youngs_modulus": 1e6}
    model = "neo-hookean" if finite else "linear-elastic"
    material = Material(name="rubber", model=model, parameters=parameters, poisson_ratio=nu)
    return Cover(layers=(Layer(thickness=THICKNESS, material=material),), size=None if wide else PAD)


def solve_integral_equations(case: Case) -> Truth:
    """Return the contact without slip of a cylinder or a sphere on the wide layer."""
    wide = make_cover(case.cover.layers[0].material.poisson_ratio, wide=True)
    if isinstance(case.indenter, Cylinder):
        contact = stuck_punch(wide, case.indenter.radius).press(case.depth)
    else:
        contact = _grow_to(wide, case.indenter, case.depth)
    return Truth(source="integral equations", force=contact.force, peak=float(contact.texel_forces(ARRAY).max()))


def _grow_to(cover: Cover, ball: Indenter, depth: float) -> LayerContact:
    """Return the growing contact of a ball at a depth, by the secant rule on the contact radius."""
    radius = ball.footprint[0]

    def gap(r: np.ndarray) -> np.ndarray:
        return np.asarray(radius - np.sqrt(radius**2 - r**2))

    low, high = (np.sqrt(radius * depth) * factor for factor in (0.7, 1.3))
    solved = [stuck_shape(cover, gap, each).depth - depth for each in (low, high)]
    for _ in range(6):
        low, high = high, high - solved[1] * (high - low) / (solved[1] - solved[0])
        contact = stuck_shape(cover, gap, high)
        solved = [solved[1], contact.depth - depth]
        if abs(solved[1]) < 1e-6 * depth:
            break
    return contact


def solve_in_plane(case: Case) -> Truth:
    """Return the axisymmetric solution on the wide cover."""
    material = case.cover.layers[0].material
    wide = make_cover(material.poisson_ratio, finite=material.model == "neo-hookean", wide=True)
    found = press(wide, ARRAY, case.indenter, depth=case.depth, friction=case.friction)
    return Truth(source="r-z plane", force=found.total_force, peak=float(found.texel_forces.max()))


def solve_cubic(case: Case) -> Truth:
    """Return the frictionless force times the ratio of the forces with and without slip on elements of order 3."""
    assert isinstance(case.indenter, Box)
    free = press(case.cover, ARRAY, case.indenter, depth=case.depth)
    slides, sticks = press_face(case.cover, case.indenter, Pose(), CUBIC)
    return Truth(source="cubic elements", force=free.total_force * sticks.force / slides.force, peak=None)


def list_cases() -> list[Case]:
    """Return all cases, the quick ones first."""
    out = []
    for nu in (0.0, 0.3, 0.45, 0.49, 0.5):
        for wide in (True, False):
            box = Box(size=(4e-3, 4e-3, 5e-3))
            cover = make_cover(nu, wide=wide)
            out.append(Case(cover=cover, indenter=box, depth=2e-5, friction=np.inf, truth=solve_cubic))
    for nu in (0.0, 0.3, 0.45, 0.49):
        for radius in (1e-3, 2e-3):
            disk = Cylinder(radius=radius)
            cover = make_cover(nu)
            out.append(Case(cover=cover, indenter=disk, depth=2e-5, friction=np.inf, truth=solve_integral_equations))
    for nu in (0.3, 0.49):
        ball = Sphere(radius=8e-3)
        for friction, truth in ((np.inf, solve_integral_equations), (0.4, solve_in_plane)):
            out.append(Case(cover=make_cover(nu), indenter=ball, depth=0.3e-3, friction=friction, truth=truth))
        for friction in (0.0, 0.4, np.inf):
            cover = make_cover(nu, finite=True)
            out.append(Case(cover=cover, indenter=ball, depth=0.6e-3, friction=friction, truth=solve_in_plane))
        for friction in (0.0, np.inf):
            cover, disk = make_cover(nu, finite=True), Cylinder(radius=2e-3)
            out.append(Case(cover=cover, indenter=disk, depth=0.3e-3, friction=friction, truth=solve_in_plane))
    return out


def main() -> None:
    """Solve the cases and print a line for each."""
    cases = list_cases()
    wanted = [int(each) for each in sys.argv[1:]] or range(len(cases))
    print("| # | case | truth | force: error / estimate [%] | peak texel: error / estimate [%] | CPU s |")
    print("|---|---|---|---|---|---|")
    for number in wanted:
        case = cases[number]
        truth = case.truth(case)
        started = time.process_time()
        found = press(case.cover, ARRAY, case.indenter, depth=case.depth, friction=case.friction)
        seconds = time.process_time() - started
        pairs = [
            (found.total_force, truth.force, "total_force"),
            (float(found.texel_forces.max()), truth.peak, "peak_texel"),
        ]
        columns = [
            "-"
            if true is None
            else f"{100 * (value / true - 1):+.2f} / {100 * found.error_estimate[key]:.2f}"
            + (" **missed**" if abs(value / true - 1) > found.error_estimate[key] else "")
            for value, true, key in pairs
        ]
        print(f"| {number} | {case.name} | {truth.source} | {columns[0]} | {columns[1]} | {seconds:.0f} |", flush=True)


if __name__ == "__main__":
    main()
