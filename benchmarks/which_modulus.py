"""Print the tables of docs/which-modulus.md: fitted and textbook moduli by cover and load, and points per texel.

    python benchmarks/which_modulus.py

The array is the WTS 0614-34, 6 x 14 texels of 3.4 mm.  All covers are linear, E = 1 MPa; loads in proportion to E give
the same numbers.  About 6 minutes on one core with an empty store.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import fastmodel
from meshes import Cover
from validation.published.rules import PUBLISHED
from validation.sensor_file import BUILT_IN
from validation.simulator_values.models import Candidate, list_hydroelastic, refine
from validation.simulator_values.scoring import Presses, ScoredValues, make_presses, score

#: Thickness [m], Poisson ratio, and loads [N] of each row.
ROWS = (
    (2e-3, 0.49, (0.2, 0.8)),
    (2e-3, 0.49, (1.0, 5.0)),
    (2e-3, 0.49, (5.0, 12.0)),
    (2e-3, 0.3, (1.0, 5.0)),
    (2e-3, 0.45, (1.0, 5.0)),
    (2e-3, 0.5, (1.0, 5.0)),
    (1e-3, 0.49, (1.0, 5.0)),
    (4e-3, 0.49, (1.0, 5.0)),
)
#: Points along each side of a texel of the second table.
POINTS = (1, 2, 4, 8)
SENSOR = BUILT_IN["wts-0614-34"]


def press(thickness: float, ratio: float, loads: tuple[float, float]) -> tuple[Cover, Presses]:
    """Press a cover of the built-in sensor with another thickness and Poisson ratio at three loads."""
    (layer,) = SENSOR.layered_cover.layers
    layer = replace(layer, thickness=thickness, material=replace(layer.material, poisson_ratio=ratio))
    cover = replace(SENSOR.layered_cover, layers=(layer,))
    return cover, make_presses(cover, fastmodel.load("wts-0614-34"), loads, lambda _: None)


def show(row: ScoredValues | None) -> str:
    """Return mean and largest misplaced force of a row [%]."""
    return "undefined" if row is None else f"{100 * row.mean:.1f} ({100 * row.worst:.1f})"


def main() -> None:
    """Print both tables."""
    argparse.ArgumentParser(description=__doc__.split("\n")[0]).parse_args()
    print(
        "| h [mm] | nu | loads [N] | fitted k h / E | power law | fitted [%] | power law [%] | E / h [%] "
        "| E_oed / h [%] | without spread: fitted, E / h, E_oed / h [%] |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for thickness, ratio, loads in ROWS:
        cover, presses = press(thickness, ratio, loads)
        rows = {row.name: row for row in score(list_hydroelastic(cover, None), cover, presses.presses)}
        fitted, law = rows["fitted, exact spread"], rows["power law, exact spread"]
        bare = (rows.get(f"{name}, no spread") for name in ("fitted", "Young's modulus", "oedometric modulus"))
        cells = [
            f"{1e3 * thickness:g}", f"{ratio:g}", f"{loads[0]:g} to {loads[1]:g}",
            f"{fitted.parameters['modulus'] / 1e6:.2f}",
            f"{law.parameters['modulus'] / 1e6:.2f} (d / h)^{law.parameters['exponent']:.2f}",
            *(show(each) for each in (fitted, law, rows["Young's modulus, exact spread"],
                                      rows.get("oedometric modulus, exact spread"))),
            ", ".join(show(each).split(" ")[0] for each in bare),
        ]  # fmt: skip
        print(f"| {' | '.join(cells)} |", flush=True)
    cover, presses = press(2e-3, 0.49, (1.0, 5.0))
    penalty = PUBLISHED["penalty"]
    laws = [Candidate(name="one point, no kernel", model=penalty)]
    laws += [Candidate(name=f"{n} x {n}", model=refine(penalty, cover, SENSOR.array, n)) for n in POINTS]
    print("\n| points per texel | stiffness [N/m] | misplaced [%] |\n|---|---|---|")
    for row in score(laws, cover, presses.presses):
        print(f"| {row.name} | {row.parameters['stiffness']:.3g} | {show(row)} |")


if __name__ == "__main__":
    main()
