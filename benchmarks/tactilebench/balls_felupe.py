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

import felupe as fem
import numpy as np
from finite_strain_felupe import Ball, body_of, converged, held_of, solver


def press(task: dict) -> dict:
    """Press the ball in steps; its force, and the nodal forces on the base over the radius."""
    field, body = body_of(task)
    boundaries, ball, before = held_of(task, field[0]), Ball(field, task["ball"], task["penalty"]), None
    for step, travel in enumerate(task["travels"]):
        ball.depth, ball.iteration = travel, 0
        now = [values.values.copy() for values in field.fields]
        if before is not None:
            for values, old, new in zip(field.fields, before, now, strict=True):
                values.values[:] = 2 * new - old
        before = now if step else None
        held, free = fem.dof.partition(field, boundaries)
        found = fem.newtonraphson(
            items=[body, ball], maxiter=40, x0=field, dof0=held, dof1=free, ext0=fem.dof.apply(field, boundaries, held),
            check=converged(1e-8, ball), solver=solver("scipy"), verbose=0,
        )  # fmt: skip
        field.link(found.x)
    points = field.region.mesh.points
    base = np.flatnonzero(points[:, 0] == 0)
    base = base[np.argsort(points[base, 1])]
    forces = np.asarray(found.fun[: 2 * len(points)]).reshape(-1, 2)[base, 0]
    return {"force": float(ball.total), "radii": points[base, 1].tolist(), "nodal": forces.tolist()}


if __name__ == "__main__":
    print(json.dumps(press(json.load(sys.stdin))))
