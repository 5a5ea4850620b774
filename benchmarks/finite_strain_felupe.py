"""FElupe's side of `finite_strain.py`: one task given as JSON, forces and costs printed as JSON.

FElupe is under the GPL; the benchmark installs it into an environment of its own and nothing else imports it.  Both of
its routes are here: `NearlyIncompressible` as it comes (displacement, pressure, volume ratio) and the same two fields
as softcover through its interface for user materials, which is leaner.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator

import felupe as fem
import numpy as np
import scipy.sparse as sp
from felupe.math import cdya_il, det, dya, inv, transpose
from scipy.sparse.linalg import spsolve

#: Slope beyond which an indenter goes on as a cone, as in `fem_reference.finite_strain.indenter_surface` [-].
STEEPEST = 2.5


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
    """Half a disk or a layer as the rectangle z (first axis), r (second axis), or an eighth of a square block."""
    n, m, extent = task["through"], task["across"], task["radius"]
    fields = 3 if task["fields"] == "three" else 2
    if task["shape"] != "block":
        mesh = fem.Rectangle(b=(1.0, extent), n=(n + 1, m + 1))
        if task["shape"] == "ball":
            mesh.points[:, 1] = np.array(task["radii"])[np.round(mesh.points[:, 1] * m / extent).astype(int)]
        mesh = mesh.add_midpoints_edges().add_midpoints_faces()
        region = fem.RegionBiQuadraticQuad(mesh)
    else:
        mesh = fem.Cube(b=(1.0, extent, extent), n=(n + 1, m + 1, m + 1))
        mesh = mesh.add_midpoints_edges().add_midpoints_faces().add_midpoints_volumes()
        region = fem.RegionTriQuadraticHexahedron(mesh)
    field = fem.FieldsMixed(region, n=fields, axisymmetric=task["shape"] != "block", disconnect=False)
    neo = fem.NeoHooke(mu=1.0)
    law = fem.NearlyIncompressible(neo, bulk=task["bulk"]) if fields == 3 else TwoFields(neo, task["bulk"])
    return field, fem.SolidBody(law, field)


def held_of(task: dict, u: fem.Field) -> dict[str, fem.Boundary]:
    """The plate at the first axis's end, the planes of symmetry; under a ball the base, the axis and the far edge."""
    if task["shape"] == "ball":
        axis, far = fem.Boundary(u, fy=0.0, skip=(1, 0)), fem.Boundary(u, fy=task["radii"][-1])
        return {"base": fem.Boundary(u, fx=0.0), "axis": axis, "far": far}
    across = [(1, 0)] if task["shape"] == "disk" else [(1, 0, 1), (1, 1, 0)]
    along = (0, 1) if task["shape"] == "disk" else (0, 1, 1)
    found = {f"plate {skip}": fem.Boundary(u, fx=1.0, skip=skip) for skip in across}
    found |= {f"side {skip}": fem.Boundary(u, **{f"f{'yz'[i]}": 0.0}, skip=skip) for i, skip in enumerate(across)}
    return found | {"middle": fem.Boundary(u, fx=0.0, skip=along), "plate": fem.Boundary(u, fx=1.0, skip=along)}


class Ball:
    """Softcover's contact law as an item of FElupe: penalty on the overlap at three Gauss points of each top edge."""

    def __init__(self, field: fem.FieldContainer, radius: float, penalty: float) -> None:
        mesh = field.region.mesh
        top = np.flatnonzero(mesh.points[:, 0] == 1)
        top = top[np.argsort(mesh.points[top, 1])]
        nodes = top[2 * np.arange(len(top) // 2)[:, None] + np.arange(3)]
        t, weight = (np.polynomial.legendre.leggauss(3)[0] + 1) / 2, np.polynomial.legendre.leggauss(3)[1] / 2
        self.shape = np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], axis=-1)
        r = mesh.points[nodes, 1]
        self.r = r @ self.shape.T
        self.weight = 2 * np.pi * self.r * weight * (r[:, -1:] - r[:, :1])
        self.dof = 2 * nodes[..., None] + np.arange(2)
        self.nodes, self.radius, self.penalty, self.depth, self.curved = nodes, radius, penalty, 0.0, True
        self.field = field
        self.size = mesh.npoints * 2
        self.assemble = fem.mechanics.Assemble(vector=self._vector, matrix=self._matrix)
        self.results = fem.mechanics.Results(stress=False, elasticity=False)

    def _at(self) -> tuple:
        u = np.einsum("qa,fai->fqi", self.shape, self.field[0].values[self.nodes])
        r = self.r + u[..., 1]
        round_ = np.minimum(r, self.radius * np.sin(np.arctan(STEEPEST)))
        root = np.sqrt(self.radius**2 - round_**2)
        height = self.radius - root + STEEPEST * (r - round_)
        pressed = self.penalty * (u[..., 0] + self.depth - height)
        touching = pressed > 0
        normal = np.stack([np.ones_like(r), -round_ / root], axis=-1)
        curvature = (r == round_) * self.radius**2 / root**3
        return np.where(touching, pressed, 0.0) * self.weight, touching * self.weight, normal, curvature

    def _vector(self, field: fem.FieldContainer | None = None, **_: object):  # noqa: ANN202 -- sparse
        self.field = field or self.field
        pressure, _, normal, _ = self._at()
        self.total = pressure.sum()
        each = np.einsum("qa,fq,fqi->fai", self.shape, pressure, normal)
        full = np.bincount(self.dof.ravel(), each.ravel(), minlength=self.size)
        self.largest = np.abs(full).max()
        return sp.csr_matrix(full[:, None])

    def _matrix(self, field: fem.FieldContainer | None = None, **_: object):  # noqa: ANN202 -- sparse
        self.field = field or self.field
        pressure, active, normal, curvature = self._at()
        curve = self.penalty * active[..., None, None] * normal[..., :, None] * normal[..., None, :]
        if self.iteration >= 2:  # as softcover does: false overlaps times a curvature lead astray
            curve[..., 1, 1] -= pressure * curvature
        self.iteration += 1
        block = np.einsum("qa,fqij,qb->faibj", self.shape, curve, self.shape)
        i = np.broadcast_to(self.dof[:, :, :, None, None], block.shape).ravel()
        j = np.broadcast_to(self.dof[:, None, None, :, :], block.shape).ravel()
        return sp.coo_matrix((block.ravel(), (i, j)), shape=(self.size, self.size)).tocsr()


def converged(tolerance: float, ball: Ball | None):  # noqa: ANN201 -- felupe calls it
    """Converged as softcover means it: largest residuals beside the rigid body's force and a pressure's volume."""

    def check(dx, x, f, xtol, ftol, dof1=None, dof0=None, items=None, eps=1e-3):  # noqa: ANN001, ANN202, ARG001, PLR0917
        split = x.fields[0].values.size
        free = f[dof1]
        forces = np.abs(free[dof1 < split]).max()
        volumes = np.abs(free[dof1 >= split]).max()
        share = x.region.dV.sum() / (f.size - split)
        met = (
            forces < tolerance * (np.abs(f[dof0]).max() if ball is None else ball.largest)
            and volumes < tolerance * share
        )
        return np.abs(dx).max(), forces, met

    return check


def follow(
    task: dict, field: fem.FieldContainer, body: fem.SolidBody, boundaries: dict[str, fem.Boundary], ball: Ball | None
) -> Iterator[object]:
    """Solve every travel of the plate, or of a ball with the last step as a guess, and yield Newton's result."""
    before = None
    for number, travel in enumerate(task["travels"]):
        if ball is None:
            boundaries["plate"].value = -travel
        else:
            ball.depth, ball.iteration = travel, 0
            now = [values.values.copy() for values in field.fields]
            if before is not None:
                for values, old, new in zip(field.fields, before, now, strict=True):
                    values.values[:] = 2 * new - old
            before = now if number else None
        held, free = fem.dof.partition(field, boundaries)
        found = fem.newtonraphson(
            items=[body] if ball is None else [body, ball],
            maxiter=40,
            x0=field,
            dof0=held,
            dof1=free,
            ext0=fem.dof.apply(field, boundaries, held),
            check=converged(task["tolerance"], ball),
            solver=solver(task["solver"]),
            verbose=0,
        )
        field.link(found.x)
        yield found


def run(task: dict) -> tuple[list[float], int, int]:
    """Forces at every travel, unknowns and iterations."""
    field, body = body_of(task)
    boundaries = held_of(task, field[0])
    moved = boundaries.get("plate")
    ball = None if moved else Ball(field, task["ball"], task["penalty"])
    iterations, forces = 0, []
    for found in follow(task, field, body, boundaries, ball):
        iterations += found.iterations
        forces.append(float(-found.fun[moved.dof].sum() if moved else ball.total))
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
