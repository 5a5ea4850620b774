"""Score every contact method of the fast model against the finite elements (small strain).

Eight shapes x 2 weights x 3 yaws x 4 positions on the WTS 0614-34, 2 mm of rubber at Poisson ratio 0.49 and 0.3; two
squares at once; a block loaded off its middle and free to tilt.  Takes a few minutes with an empty store.

    python benchmarks/fastmodel_scores.py [--json FILE]
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from campaign import LOADS, SHAPES
from other_methods import METHODS, use_distance_fields

import fastmodel
from fastmodel import WTS_0614_34, Parameters, Placement
from fastmodel.signal.electronics import grey_levels
from fem_reference import point_spread, press
from fem_reference.small_strain_contact.several_indenters import Body, press_together
from meshes import Box, Pose, TexelArray
from meshes.catalogue import ARRAYS
from tests.support.rubber import make_cover
from validation.derivation.kernel import cover_cells

ARRAY: TexelArray = ARRAYS["wts-0614-34"]
BLOCK = Box(size=(10e-3, 10e-3, 10e-3))
YAWS = (0.0, np.pi / 4, np.pi / 2)
#: Over a texel's centre, edge and corner, and off the grid.
PLACES = ((1.7e-3, 1.7e-3), (1.7e-3, 0.0), (0.0, 0.0), (0.7e-3, -1.1e-3))
RATIOS = (0.49, 0.3)


def parameters(poisson_ratio: float) -> Parameters:
    """The fast model of that cover, with the Gaussian that fits it best."""
    cover = make_cover(poisson_ratio, "linear-elastic")
    spread = point_spread(cover)
    uniform = ARRAY.image(spread.texel_response(ARRAY, load="uniform"))
    fit = fastmodel.fit_gaussian(uniform, (ARRAY.rows // 2, ARRAY.columns // 2))
    cells = cover_cells(cover, ARRAY, spread)
    return Parameters(array=ARRAY, spread=fit.gaussian, electronics=WTS_0614_34, surface=cells)


def misplaced(reference, found, load: float) -> float:  # noqa: ANN001 -- any two results with texel forces
    """Share of the load on wrong texels [%]."""
    apart = np.abs(found.texel_forces - reference.texel_forces).sum() + abs(found.outside - reference.outside)
    return float(50 * apart / load)


def image_changed(reference, found) -> float:  # noqa: ANN001
    """The 2015 report's measure, grey levels scaled to the largest reference texel [%]."""
    white = reference.texel_forces.max()
    grey = [grey_levels(each.texel_forces, white).astype(int) for each in (reference, found)]
    return float(100 * np.abs(grey[0] - grey[1]).sum() / (255 * ARRAY.count))


def single(ratio: float, shapes=tuple(SHAPES), loads=LOADS, yaws=YAWS, places=PLACES) -> Iterator[dict]:  # noqa: ANN001
    """Scores of guided shapes, one at a time."""
    fast, cover = parameters(ratio), make_cover(ratio, "linear-elastic")
    for name, load, yaw, at in itertools.product(shapes, loads, yaws, places):
        shape = SHAPES[name]
        reference = press(cover, ARRAY, shape, load=load, pose=Pose.planar(at=at, yaw=yaw))
        for method, contact in METHODS.items():
            found = fastmodel.indent(fast, shape, load=load, at=at, yaw=yaw, contact=contact)
            yield _row(ratio, name, method, reference, found, load, at, yaw)


def two_squares(ratio: float, places=PLACES) -> Iterator[dict]:  # noqa: ANN001
    """Scores of 12 and 6 mm squares, 16 mm apart along y, 500 and 100 g, each at its own depth."""
    fast, cover = parameters(ratio), make_cover(ratio, "linear-elastic")
    for x, y in places:
        squares = [("big square", LOADS[1], (x, y - 6e-3)), ("small square", LOADS[0], (x, y + 10e-3))]
        bodies = [Body(indenter=SHAPES[name], load=load, at=at) for name, load, at in squares]
        reference = press_together(cover, ARRAY, bodies)
        placements = [Placement(indenter=SHAPES[name], load=load, at=at) for name, load, at in squares]
        for method, contact in METHODS.items():
            found = fastmodel.indent_together(fast, placements, contact=contact)
            yield _row(ratio, "two squares", method, reference, found, sum(LOADS), (x, y), 0.0)


def tilting_block(ratio: float, places=PLACES) -> Iterator[dict]:  # noqa: ANN001
    """Scores of a 10 mm block whose weight acts 2 mm off its middle, free to tilt."""
    fast, cover = parameters(ratio), make_cover(ratio, "linear-elastic")
    for at in places:
        settings = {"indenter": BLOCK, "load": LOADS[1], "at": at, "guided": False, "centre": (2e-3, 0.0)}
        reference = press_together(cover, ARRAY, [Body(**settings)])
        for method, contact in METHODS.items():
            found = fastmodel.indent_together(fast, [Placement(**settings)], contact=contact)
            yield _row(ratio, "tilting block", method, reference, found, LOADS[1], at, 0.0)


def _row(ratio, name, method, reference, found, load, at, yaw) -> dict:  # noqa: ANN001, PLR0917
    return {
        "poisson_ratio": ratio,
        "shape": name,
        "method": method,
        "load": load,
        "at": list(at),
        "yaw": yaw,
        "misplaced": misplaced(reference, found, load),
        "image_changed": image_changed(reference, found),
        "balance": abs(found.total_force / load - 1),
    }


def summary(rows: list[dict]) -> list[str]:
    """One line per method and group."""
    lines = [f"{'method':<20}{'cases':<16}{'misplaced [%]: median':>22}{'mean':>8}{'max':>8}{'image [%]':>12}"]
    groups = {"guided": set(SHAPES), "two squares": {"two squares"}, "tilting block": {"tilting block"}}
    for method, (group, names) in itertools.product(METHODS, groups.items()):
        mine = [row for row in rows if row["method"] == method and row["shape"] in names]
        if mine:
            values = np.array([[row["misplaced"], row["image_changed"]] for row in mine])
            m, image = values[:, 0], values[:, 1].mean()
            title = f"{group} ({len(mine)})"
            lines.append(f"{method:<20}{title:<16}{np.median(m):>22.2f}{m.mean():>8.2f}{m.max():>8.2f}{image:>12.3f}")
    return lines


def main() -> None:
    """Score all cases and print the table."""
    parser = argparse.ArgumentParser(description="score the contact methods against the finite elements")
    parser.add_argument("--json", type=Path, help="where to write every case")
    target = parser.parse_args().json
    use_distance_fields()
    rows = []
    for ratio in RATIOS:
        rows += [*single(ratio), *two_squares(ratio), *tilting_block(ratio)]
    print("\n".join(summary(rows)))
    for name in SHAPES:
        means = [
            np.mean([row["misplaced"] for row in rows if (row["shape"], row["method"]) == (name, method)])
            for method in METHODS
        ]
        print(
            f"{name:<18}" + "".join(f"{method} {mean:6.2f} %   " for method, mean in zip(METHODS, means, strict=True))
        )
    if target is not None:
        target.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
