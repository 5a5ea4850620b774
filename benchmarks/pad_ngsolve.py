"""The pad of `pad.py` by NGSolve: run by that script inside an environment of its own, one process per run.

The same method on both sides: a quarter of the pad, the base lifted by the L2 projection of each texel's indicator,
even and odd parities in x and y, the two mixed parities solved as one, each diagonal pair of texels solved once.
Lengths in millimetres, shear modulus 1.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import netgen.meshing as netgen
import ngsolve
import numpy as np
import numpy.typing as npt
from netgen.occ import Box, Glue, OCCGeometry, Pnt
from ngsolve import (
    H1,
    BilinearForm,
    Grad,
    GridFunction,
    InnerProduct,
    LinearForm,
    Mesh,
    Sym,
    VectorH1,
    div,
    ds,
    dx,
)

PITCH, THICKNESS, TEXELS = 3.4, 2.0, 4
PAIRS = [(i, j) for i in range(TEXELS) for j in range(TEXELS)]


def texel_name(i: int, j: int) -> str:
    """Name of a texel's patch of the base."""
    return f"texel{i}{j}"


def hexahedra(per_texel: int, through: int) -> Mesh:
    """Structured: texel edges on element edges, elements crowding towards the base."""
    mesh = netgen.Mesh()
    mesh.dim = 3
    x = np.linspace(0, TEXELS * PITCH, TEXELS * per_texel + 1)
    z = THICKNESS * (np.arange(through + 1) / through) ** 1.5
    n, m = len(x), len(z)
    points = [[[mesh.Add(netgen.MeshPoint(netgen.Pnt(a, b, c))) for c in z] for b in x] for a in x]

    def face(number: int, name: str, quads: list[list[tuple[int, int, int]]]) -> None:
        mesh.Add(netgen.FaceDescriptor(surfnr=number, domin=1, bc=number))
        for quad in quads:
            mesh.Add(netgen.Element2D(number, [points[a][b][c] for a, b, c in quad]))
        mesh.SetBCName(number - 1, name)

    for a in range(n - 1):
        for b in range(n - 1):
            for c in range(m - 1):
                ring = [(a + 1, b), (a + 1, b + 1), (a, b + 1), (a, b)]
                mesh.Add(netgen.Element3D(1, [points[p][q][k] for k in (c, c + 1) for p, q in ring]))
    flat = [(a, b) for a in range(n - 1) for b in range(n - 1)]
    side = [(a, c) for a in range(n - 1) for c in range(m - 1)]
    for number, (i, j) in enumerate(PAIRS, 1):
        mine = [(a, b) for a, b in flat if (a // per_texel, b // per_texel) == (i, j)]
        face(number, texel_name(i, j), [[(a, b, 0), (a, b + 1, 0), (a + 1, b + 1, 0), (a + 1, b, 0)] for a, b in mine])
    face(17, "top", [[(a, b, m - 1), (a + 1, b, m - 1), (a + 1, b + 1, m - 1), (a, b + 1, m - 1)] for a, b in flat])
    face(18, "x0", [[(0, b, c), (0, b, c + 1), (0, b + 1, c + 1), (0, b + 1, c)] for b, c in side])
    face(19, "y0", [[(a, 0, c), (a + 1, 0, c), (a + 1, 0, c + 1), (a, 0, c + 1)] for a, c in side])
    e = n - 1
    face(20, "x1", [[(e, b, c), (e, b + 1, c), (e, b + 1, c + 1), (e, b, c + 1)] for b, c in side])
    face(21, "y1", [[(a, e, c), (a, e, c + 1), (a + 1, e, c + 1), (a + 1, e, c)] for a, c in side])
    return Mesh(mesh)


def tetrahedra(size: float) -> Mesh:
    """Netgen's own mesh of the glued texel columns."""
    boxes = [Box(Pnt(i * PITCH, j * PITCH, 0), Pnt((i + 1) * PITCH, (j + 1) * PITCH, THICKNESS)) for i, j in PAIRS]
    solid = Glue(boxes)
    for face in solid.faces:
        c = face.center
        if abs(c.z) < 1e-6:
            face.name = texel_name(int(c.x / PITCH), int(c.y / PITCH))
        else:
            face.name = "x0" if abs(c.x) < 1e-6 else "y0" if abs(c.y) < 1e-6 else "other"
    return Mesh(OCCGeometry(solid).GenerateMesh(maxh=size))


def system(
    mesh: Mesh, order: int, nu: float, *, mixed: bool, fixed: list[str], solver: str
) -> tuple[Any, BilinearForm, Any]:
    """Space, matrix and inverse for one parity."""
    mu, soft = 1.0, (1 - 2 * nu) / (2 * nu)
    u_space = VectorH1(mesh, order=order, dirichletx=fixed[0], dirichlety=fixed[1], dirichletz=fixed[2])
    if mixed:
        space = u_space * H1(mesh, order=order - 1, dirichlet=fixed[3])
        (u, p), (v, q) = space.TnT()
        form = 2 * mu * InnerProduct(Sym(Grad(u)), Sym(Grad(v))) - p * div(v) - q * div(u) - soft * p * q
    else:
        space = u_space
        u, v = space.TnT()
        form = 2 * mu * InnerProduct(Sym(Grad(u)), Sym(Grad(v))) + div(u) * div(v) / soft
    condense = not mixed
    a = BilinearForm(space, symmetric=True, condense=condense)
    a += form * dx
    a.Assemble()
    return space, a, a.mat.Inverse(space.FreeDofs(condense), inverse=solver)


def lifts(
    mesh: Mesh, order: int, nu: float, points: npt.NDArray[np.float64], *, mixed: bool, solver: str
) -> npt.NDArray[np.float64]:
    """Lift of the top at points (k, 2) for each parity and each texel of the quarter, shape (2, 2, 4, 4, k)."""
    base = "|".join(texel_name(i, j) for i, j in PAIRS)
    places = mesh(points[:, 0], points[:, 1], np.full(len(points), THICKNESS))
    out = np.zeros((2, 2, TEXELS, TEXELS, len(points)))
    for px, py in ((0, 0), (0, 1), (1, 1)):
        odd = [name for name, parity in (("x0", px), ("y0", py)) if parity]
        fixed = [
            "|".join([base, *(["x0"] if not px else []), *(["y0"] if py else [])]),
            "|".join([base, *(["y0"] if not py else []), *(["x0"] if px else [])]),
            "|".join([base, *odd]),
            "|".join(odd),
        ]
        space, a, inverse = system(mesh, order, nu, mixed=mixed, fixed=fixed, solver=solver)
        whole = GridFunction(space)
        move = whole.components[0].components[2] if mixed else whole.components[2]
        scalar = move.space
        s, t = scalar.TnT()
        mass = BilinearForm(scalar, symmetric=True)
        mass += s * t * ds(base)
        mass.Assemble()
        keep = scalar.GetDofs(mesh.Boundaries(base))
        if odd:
            keep &= ~scalar.GetDofs(mesh.Boundaries("|".join(odd)))
        project = mass.mat.Inverse(keep, inverse="sparsecholesky")
        for i, j in PAIRS:
            if px == py and j < i:
                continue
            share = LinearForm(scalar)
            share += 0.25 * t * ds(texel_name(i, j))
            share.Assemble()
            whole.vec[:] = 0
            move.vec.data = project * share.vec
            whole.vec.data -= inverse * (a.mat * whole.vec).Evaluate()
            if a.condense:
                whole.vec.data += a.harmonic_extension * whole.vec
            out[px, py, i, j] = move(places).ravel()
    return out


def main() -> None:
    """Run one configuration and write the answer of every texel to every load."""
    task = json.loads(sys.argv[1])
    ngsolve.SetNumThreads(1)
    loads = np.load(task["loads"])
    started, clock = time.process_time(), time.perf_counter()
    mesh = tetrahedra(task["size"]) if task["mesh"] == "tet" else hexahedra(task["per_texel"], task["through"])
    meshed = time.process_time()
    points = loads.reshape(-1, 2)
    value = lifts(mesh, task["order"], task["nu"], points, mixed=task["mixed"], solver=task["solver"])
    value = value.reshape(2, 2, TEXELS, TEXELS, *loads.shape[:2]).mean(axis=-1)
    seconds = {"cpu": time.process_time() - started, "wall": time.perf_counter() - clock, "mesh": meshed - started}
    np.save(task["result"], value)
    space = VectorH1(mesh, order=task["order"])
    unknowns = space.ndof + (H1(mesh, order=task["order"] - 1).ndof if task["mixed"] else 0)
    print(json.dumps({**seconds, "unknowns": unknowns, "version": ngsolve.__version__}))


if __name__ == "__main__":
    main()
