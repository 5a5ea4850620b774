"""FElupe's side of `check_truth.py`: a ball on a bonded neo-Hookean layer, and the nodal forces on its base.

The task is JSON on standard input: radius of the ball, depths, bulk modulus, radii of the mesh and elements through the
layer, with the thickness and the shear modulus as units.  The mesh, the elements and Newton's method are those of
`finite_strain_felupe.py`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from finite_strain_felupe import Ball, body_of, follow, held_of

#: Tolerance of Newton's method, and its solver.
SETTINGS = {"tolerance": 1e-8, "solver": "scipy"}


def press(task: dict) -> dict:
    """Press the ball in steps; its force, and the nodal forces on the base over the radius."""
    field, body = body_of(task)
    ball = Ball(field, task["ball"], task["penalty"])
    for found in follow(task | SETTINGS, field, body, held_of(task, field[0]), ball):
        last = found
    points = field.region.mesh.points
    base = np.flatnonzero(points[:, 0] == 0)
    base = base[np.argsort(points[base, 1])]
    forces = np.asarray(last.fun[: 2 * len(points)]).reshape(-1, 2)[base, 0]
    return {"force": float(ball.total), "radii": points[base, 1].tolist(), "nodal": forces.tolist()}


if __name__ == "__main__":
    print(json.dumps(press(json.load(sys.stdin))))
