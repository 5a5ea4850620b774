"""FElupe's side of `finite_strain.py`: one task given as JSON, forces and costs printed as JSON.

FElupe is under the GPL; the benchmark installs it into an environment of its own and nothing else imports it.  Both of
its routes are here: `NearlyIncompressible` as it comes (displacement, pressure, volume ratio) and the same two fields
as softcover through its interface for user materials, which is leaner.
"""

from __future__ import annotations

import json
import sys
import time

import felupe as fem
import numpy as np
from felupe.math import cdya_il, det, dya, inv, transpose
from scipy.sparse.linalg import spsolve


class TwoFields(fem.ConstitutiveMaterial):
    """Isochoric energy + p (J - 1) - p^2 / 2 K in displacement and pressure."""

    def __init__(self, material: fem.ConstitutiveMaterial, bulk: float) -> None:
        self.material, self.bulk = material, bulk
        self.x = [material.x[0], np.ones(1), material.x[-1]]

    def gradient(self, x: list, *_: object, **__: object) -> list:
        """Stress and volume residual."""
        (F, p), state = x[:2], x[-1]
        J = det(F)
        stress, new = self.material.gradient([F, state])
        return [stress + p * J * transpose(inv(F, determinant=J)), J - 1 - p / self.bulk, new]

    def hessian(self, x: list, *_: object, **__: object) -> list:
        """Their derivatives, upper triangle."""
        (F, p), state = x[:2], x[-1]
        J = det(F)
        normal = transpose(inv(F, determinant=J))
        tangent = self.material.hessian([F, state])[0]
        tangent = tangent + p * J * (dya(normal, normal) - cdya_il(normal, normal))
        return [tangent, J * normal, -np.ones_like(p) / self.bulk]


def solver(name: str):  # noqa: ANN201 -- either library's function
    """A sparse direct solver of one system."""
    if name == "pardiso":
        from pypardiso import spsolve as pardiso

        return pardiso
    return spsolve


def body_of(task: dict) -> tuple[fem.FieldContainer, fem.SolidBody]:
    """Half a disk as the rectangle z (first axis), r (second axis), or an eighth of a square block."""
    n, m, extent = task["through"], task["across"], task["radius"]
    fields = 3 if task["fields"] == "three" else 2
    if task["shape"] == "disk":
        mesh = fem.Rectangle(b=(1.0, extent), n=(n + 1, m + 1)).add_midpoints_edges().add_midpoints_faces()
        region = fem.RegionBiQuadraticQuad(mesh)
    else:
        mesh = fem.Cube(b=(1.0, extent, extent), n=(n + 1, m + 1, m + 1))
        mesh = mesh.add_midpoints_edges().add_midpoints_faces().add_midpoints_volumes()
        region = fem.RegionTriQuadraticHexahedron(mesh)
    field = fem.FieldsMixed(region, n=fields, axisymmetric=task["shape"] == "disk", disconnect=False)
    neo = fem.NeoHooke(mu=1.0)
    law = fem.NearlyIncompressible(neo, bulk=task["bulk"]) if fields == 3 else TwoFields(neo, task["bulk"])
    return field, fem.SolidBody(law, field)


def held_of(task: dict, u: fem.Field) -> dict[str, fem.Boundary]:
    """The plate at the first axis's end, the planes of symmetry."""
    across = [(1, 0)] if task["shape"] == "disk" else [(1, 0, 1), (1, 1, 0)]
    along = (0, 1) if task["shape"] == "disk" else (0, 1, 1)
    found = {f"plate {skip}": fem.Boundary(u, fx=1.0, skip=skip) for skip in across}
    found |= {f"side {skip}": fem.Boundary(u, **{f"f{'yz'[i]}": 0.0}, skip=skip) for i, skip in enumerate(across)}
    return found | {"middle": fem.Boundary(u, fx=0.0, skip=along), "plate": fem.Boundary(u, fx=1.0, skip=along)}


def converged(tolerance: float):  # noqa: ANN201 -- felupe calls it
    """Converged as softcover means it: largest residuals beside the plate's force and a pressure's volume."""

    def check(dx, x, f, xtol, ftol, dof1=None, dof0=None, items=None, eps=1e-3):  # noqa: ANN001, ANN202, ARG001, PLR0917
        split = x.fields[0].values.size
        free = f[dof1]
        forces = np.abs(free[dof1 < split]).max()
        volumes = np.abs(free[dof1 >= split]).max()
        share = x.region.dV.sum() / (f.size - split)
        met = forces < tolerance * np.abs(f[dof0]).max() and volumes < tolerance * share
        return np.abs(dx).max(), forces, met

    return check


def run(task: dict) -> tuple[list[float], int, int]:
    """Forces at every travel, unknowns and iterations."""
    field, body = body_of(task)
    boundaries = held_of(task, field[0])
    moved = boundaries["plate"]
    iterations, forces = 0, []
    for travel in task["travels"]:
        moved.value = -travel
        held, free = fem.dof.partition(field, boundaries)
        wanted = fem.dof.apply(field, boundaries, held)
        found = fem.newtonraphson(
            items=[body],
            x0=field,
            dof0=held,
            dof1=free,
            ext0=wanted,
            check=converged(task["tolerance"]),
            solver=solver(task["solver"]),
            verbose=0,
        )
        field.link(found.x)
        iterations += found.iterations
        forces.append(float(-found.fun[moved.dof].sum()))
    return forces, int(np.sum(field.fieldsizes)), iterations


def main() -> None:
    """Solve one task."""
    task = json.loads(sys.argv[1])
    solver(task["solver"])  # imports are not measured on either side
    started, clock = time.process_time(), time.perf_counter()
    forces, unknowns, iterations = run(task)
    cost = {"cpu": time.process_time() - started, "wall": time.perf_counter() - clock}
    print(json.dumps({**cost, "unknowns": unknowns, "iterations": iterations, "forces": forces}))


if __name__ == "__main__":
    main()
