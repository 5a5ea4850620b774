"""Score the fast model under a sphere of one pitch radius, on covers of 5 pitches to a thirtieth of a pitch.

For every Poisson ratio and pitch / thickness it prints the own compliance of a cell over that of the cell cut into 21
x 21 parts.  For three depths and four positions it prints the radius of the contact over the pitch, the misplaced
force, and the depth over that of the finite elements.  Takes about two minutes with an empty store.

    python benchmarks/pitch_by_thickness.py
"""

from __future__ import annotations

import numpy as np

import fastmodel
from fastmodel import WTS_0614_34, Gaussian, Parameters
from fastmodel.validity import FEWEST_CELLS
from fem_reference import point_spread, press
from fem_reference.linear_response.surface_compliance import surface_compliance
from meshes import Cover, Layer, Material, Sphere, TexelArray
from validation.derivation.cover_kernels import cover_cells
from validation.derivation.validity import measure_misplaced

PITCH = 3.4e-3
RATIOS = (0.0, 0.3, 0.49, 0.499)
PITCH_BY_THICKNESS = (0.2, 0.5, 1.0, 3.0, 10.0, 20.0, 30.0)
#: Depths over the smaller of thickness and pitch.
DEPTHS = (0.02, 0.1, 0.3)
#: Positions on a texel corner, a texel centre and off the grid, in pitches.
PLACES = ((0.0, 0.0), (0.5, 0.5), (0.37, 0.5), (0.21, -0.33))


def own_compliance(cover: Cover, cells: fastmodel.CoverCells) -> float:
    """Compliance of a cell under its own pressure over that of the cell cut into 21 x 21 parts."""
    surface = surface_compliance(cover, 4 * max(cells.cell))
    along, across = ((np.arange(21) - 10) * edge / 21 for edge in cells.cell)
    x, y = np.meshgrid(along, across)
    cut = surface.of_rectangle(x, y, cells.cell[0] / 21, cells.cell[1] / 21).sum()
    return float(cells.compliance[0, 0] / cut)


def main() -> None:
    """Print one line per cover, and the extremes."""
    array, ball = TexelArray.grid(8, 8, PITCH), Sphere(radius=PITCH)
    rows: list[tuple[bool, float, float]] = []
    for ratio in RATIOS:
        for quotient in PITCH_BY_THICKNESS:
            material = Material(
                name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=ratio
            )
            cover = Cover(layers=(Layer(thickness=PITCH / quotient, material=material),))
            cells = cover_cells(cover, array, point_spread(cover))
            spread = Gaussian(sigma_x=0.5, sigma_y=0.5, ksize_x=3, ksize_y=3)
            parameters = Parameters(array=array, spread=spread, electronics=WTS_0614_34, surface=cells)
            line = f"nu {ratio:<5} pitch/thickness {quotient:<4} own compliance {own_compliance(cover, cells):.3f}"
            for depth in (share * min(cover.thickness, PITCH) for share in DEPTHS):
                found = []
                for place in PLACES:
                    at = (place[0] * PITCH, place[1] * PITCH)
                    reference = press(cover, array, ball, depth=depth, at=at)
                    fast = fastmodel.indent(parameters, ball, load=reference.total_force, at=at)
                    wanted = np.append(reference.texel_forces, reference.outside)
                    part = 100 * measure_misplaced(np.append(fast.texel_forces, fast.outside), wanted)
                    found.append((not fast.warnings, part, (fast.depth or 0.0) / reference.depth))
                rows += found
                contact = np.sqrt(reference.contact_area / np.pi) / PITCH
                depths = [each[2] for each in found]
                worst = max(each[1] for each in found)
                line += f" | a {contact:.2f}: {worst:.1f} %, {min(depths):.2f}..{max(depths):.2f}"
            print(line, flush=True)
    for enough, name in ((True, f"{FEWEST_CELLS} cells or more"), (False, "fewer cells, with a warning")):
        parts, depths = zip(*((part, depth) for many, part, depth in rows if many == enough), strict=True)
        print(f"{name}: misplaced at most {max(parts):.1f} %, depth {min(depths):.2f} to {max(depths):.2f}")


if __name__ == "__main__":
    main()
