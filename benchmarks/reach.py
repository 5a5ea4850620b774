"""How deep balls come on neo-Hookean covers, asked for 80 % of the thickness (75 % at Poisson ratio 0.5).

    python benchmarks/reach.py [--ratios 2 5 10 50] [--poisson 0.3 0.49 0.5]

The covers are 2 mm thick with a shear modulus of 0.3 MPa, over an array so wide that no force falls beside it.
"""

from __future__ import annotations

import argparse
import time

from fem_reference import press
from fem_reference.errors import IncompletePathError
from meshes import Cover, Layer, Material, Sphere, TexelArray

#: Depth of the balls over the thickness: compressible, and incompressible [-].
REACH = (0.8, 0.75)
ARRAY = TexelArray.grid(41, 41, 3.4e-3, name="139 mm")


def check_reach(ratios: list[float], poisson: list[float]) -> None:
    """Print the table."""
    print("| radius / thickness | Poisson ratio | asked | reached | force [N] | estimates: force, texel, area | s |")
    print("|---|---|---|---|---|---|---|")
    for ratio, nu in ((ratio, nu) for nu in poisson for ratio in ratios):
        rubber = Material(name="rubber", model="neo-hookean", parameters={"shear_modulus": 3e5}, poisson_ratio=nu)
        cover = Cover(layers=(Layer(thickness=2e-3, material=rubber),))
        share = REACH[nu == 0.5]
        started = time.perf_counter()
        try:
            found = [press(cover, ARRAY, Sphere(radius=ratio * 2e-3), depth=share * 2e-3)]
        except IncompletePathError as error:
            found = error.reached
        seconds = f"{time.perf_counter() - started:.0f}"
        row = ["0", "", ""]
        if found:
            last = found[-1]
            names = ("total_force", "peak_texel", "contact_area")
            each = ", ".join(f"{100 * last.error_estimate[name]:.2g} %" for name in names)
            row = [f"{last.depth / 2e-3:.2f}", f"{last.total_force:.4g}", each]
        print("| " + " | ".join([f"{ratio:g}", f"{nu:g}", f"{share:g}", *row, seconds]) + " |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--ratios", nargs="*", type=float, default=[2.0, 5.0, 10.0, 50.0], help="radii over thickness")
    parser.add_argument("--poisson", nargs="*", type=float, default=[0.3, 0.49, 0.5], help="Poisson ratios")
    given = parser.parse_args()
    check_reach(given.ratios, given.poisson)
