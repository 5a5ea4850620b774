"""Rubber at finite strain: softcover against FElupe, same mesh, elements, steps and tolerance.

Two bodies squeezed between bonded plates, nearly incompressible neo-Hookean (K / mu = 500): a disk of shape factor 1,
axisymmetric, and a square block in three dimensions, an eighth of it.  Quadratic displacement on quadrilaterals or
hexahedra, continuous linear pressure, 3 Gauss points along each axis, plate travels of 5, 10 and 15 %, largest residual
1e-8 of the plate's largest nodal force.  And a bonded layer under a ball of twice its thickness in radius, pressed in
by two fifths of it in 20 steps: a frictionless penalty at Gauss points of the surface, which is softcover's law, given
to FElupe as an item; both start each step from the last two states and leave out the ball's curvature in two
iterations.  FElupe runs with its own three fields and with softcover's two, with scipy's and with MKL's solver, and the
fastest counts.  Each run has a process and a thread of its own; imports cost nothing, meshing does.  FElupe is
installed into a temporary environment.

    python benchmarks/finite_strain.py [--peer PYTHON] [--scaling] [--plot FILE] [--profile] [--json FILE]
"""

from __future__ import annotations

import cProfile
import itertools
import json
import pstats
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import Lines, answered, environment, finish, installed, make_parser

Task = dict[str, Any]

BULK, TRAVELS, TOLERANCE = 500.0, [0.05, 0.1, 0.15], 1e-8
REPEATS = 5
LIMIT = 300
_PEER = Path(__file__).with_name("finite_strain_felupe.py")
CASES = {
    "disk": {"shape": "disk", "radius": 4.0, "through": 16, "across": 64},
    "block": {"shape": "block", "radius": 1.0, "through": 6, "across": 6},
    "ball": {"shape": "ball", "radius": 10.0, "through": 10, "ball": 2.0, "penalty": 3000.0},
}
#: Depths of the ball: FElupe's Newton method does not survive longer steps, softcover's halves them.
CASES["ball"]["travels"] = [0.02 * step for step in range(1, 21)]
#: Elements through half the height, up to where one run takes a minute.
SCALING = {"disk": [2, 3, 4, 6, 8, 12, 16, 24], "block": [2, 3, 4, 6, 8]}


def whole(task: Task) -> Task:
    """A task with what all runs share, and the layer's mesh under the ball."""
    more: Task = {}
    if task["shape"] == "ball":
        radii = [*np.arange(2 * task["through"]) / task["through"], *(2 + 8 * np.linspace(0, 1, 16) ** 1.7)]
        more = {"radii": radii, "across": len(radii) - 1}
    return {"travels": TRAVELS, **task, **more, "bulk": BULK, "tolerance": TOLERANCE}


def body(task: Task) -> Callable[[], Any]:
    """Makes our side of a task: half the disk, or an eighth of the block."""
    import pymetis  # noqa: F401 -- imports are not measured on either side
    import pypardiso  # noqa: F401
    import skfem

    from fem_reference.elements.taylor_hood import prepare_elements
    from fem_reference.finite_strain.hyperelastic import Solid
    from fem_reference.finite_strain.loading_path import Units
    from meshes import Cover, Layer, Material
    from tests.exact import bonded_disk

    assert task["tolerance"] == bonded_disk.TOLERANCE  # both sides stop at the same residual
    ratio = (3 * task["bulk"] - 2) / (2 * (3 * task["bulk"] + 1))
    rubber = Material(name="rubber", model="neo-hookean", parameters={"shear_modulus": 1.0}, poisson_ratio=ratio)

    def block() -> bonded_disk.Disk:
        lines = [np.linspace(0, task["radius"], task["across"] + 1)] * 2
        elements = prepare_elements(skfem.MeshHex.init_tensor(*lines, np.linspace(0, 1, task["through"] + 1)))
        cover = Cover(layers=(Layer(thickness=1.0, material=rubber),))
        top = np.flatnonzero(elements.nodes[:, 2] > 1 - 1e-9)
        sides = [3 * np.flatnonzero(place < 1e-9) + i for i, place in enumerate(elements.nodes.T)]
        held = np.unique(np.concatenate([*sides, *(3 * top + i for i in range(3))]))
        return bonded_disk.Disk(
            solid=Solid.from_cover(elements, cover, Units.of(cover)), constrained=held, plate=3 * top + 2
        )

    if task["shape"] == "disk":
        return partial(bonded_disk.Disk.mesh, rubber, task["radius"], task["through"])
    return block if task["shape"] == "block" else partial(Pressed, task, rubber)


class Pressed:
    """A layer under a ball, by the product's own loading path; contact by penalty alone, as FElupe has it."""

    def __init__(self, task: Task, rubber: Any) -> None:  # noqa: ANN401 -- imported where it is used
        from fem_reference.elements.taylor_hood import prepare_elements
        from fem_reference.finite_strain import contact_problem
        from fem_reference.finite_strain.contact import SurfaceContact
        from fem_reference.finite_strain.hyperelastic import Solid
        from fem_reference.finite_strain.indenter_surface import IndenterSurface
        from fem_reference.finite_strain.loading_path import Units
        from fem_reference.linear_response.axisymmetric import find_constrained, mesh_cover
        from meshes import Cover, Layer, Sphere

        contact_problem._SETTINGS = contact_problem.PathSettings(  # noqa: SLF001
            step_tolerance=task["tolerance"], target_tolerance=task["tolerance"], augmentations=0
        )
        cover = Cover(layers=(Layer(thickness=1.0, material=rubber),))
        mesh, _ = mesh_cover(cover, task["through"], np.array(task["radii"]))
        elements = prepare_elements(mesh, axisymmetric=True)
        surface = IndenterSurface(indenter=Sphere(radius=task["ball"]), fillet=0.05)
        self.solid = Solid.from_cover(elements, cover, Units.of(cover))
        self._problem = contact_problem.ContactProblem(
            solid=self.solid,
            contact=SurfaceContact(elements, 1.0, surface, penalty=task["penalty"]),
            constrained=find_constrained(cover, *elements.nodes.T, task["radii"][-1]),
            units=Units.of(cover),
        )

    def compress(self, depths: list[float]) -> list[Any]:
        """Equilibrium at every depth."""
        return list(self._problem.follow(depths, control="depth", first=depths[0]))


def worker(task: Task) -> None:
    """Our side of one run: mesh, squeeze, forces."""
    make = body(task)
    started, clock = time.process_time(), time.perf_counter()
    made = make()
    forces = [reached.load for reached in made.compress(task["travels"])]
    cost = {"cpu": time.process_time() - started, "wall": time.perf_counter() - clock}
    unknowns = made.solid.elements.displacements + made.solid.elements.pressures
    print(json.dumps({**cost, "unknowns": unknowns, "forces": forces}))


def profile(task: Task) -> None:
    """Where our side spends its time."""
    make = body(task)
    with cProfile.Profile() as seen:
        make().compress(task["travels"])
    pstats.Stats(seen).sort_stats("tottime").print_stats(16)


class Bench:
    """Runs both sides in processes of their own."""

    def __init__(self, folder: Path, peer: Path) -> None:
        self.peer = peer
        self.environment = environment(folder)

    def run(self, task: Task) -> dict[str, Any] | None:
        """One process; None where it fails or takes too long."""
        mine = "fields" not in task
        command = [sys.executable, __file__, "--worker"] if mine else [str(self.peer), str(_PEER)]
        return answered([*command, json.dumps(whole(task))], self.environment, str(task), limit=LIMIT)

    def compare(self, case: str) -> dict[str, Any]:
        """Medians of ours and of the fastest of FElupe's ways, run in turn."""
        ours = CASES[case]
        pairs = itertools.product(("two", "three"), ("scipy", "pardiso"))
        ways = [{**ours, "fields": fields, "solver": solver} for fields, solver in pairs]
        tried = [(found["cpu"], i) for i, way in enumerate(ways) if (found := self.run(way)) is not None]
        theirs = ways[min(tried)[1]]
        runs = [[found for task in (ours, theirs) if (found := self.run(task)) is not None] for _ in range(REPEATS)]
        mine, peer = (float(np.median([run[i]["cpu"] for run in runs])) for i in (0, 1))
        forces = np.array([[each["forces"] for each in run] for run in runs])
        apart = float(np.abs(forces[:, 0] / forces[:, 1] - 1).max())
        assert apart < 1e-6, "the two sides do not solve the same problem"
        name = f"FElupe, {theirs['fields']} fields, {theirs['solver']}"
        unknowns = [each["unknowns"] for each in runs[0]]
        print(f"{case}: forces equal to {apart:.1g}; medians of {REPEATS} runs in turn, one thread, CPU seconds")
        print(f"  {'softcover':32} {unknowns[0]:8.0f} unknowns {mine:8.2f}")
        print(f"  {name:32} {unknowns[1]:8.0f} unknowns {peer:8.2f}   ratio {mine / peer:.2f}", flush=True)
        return {"ours": mine, "peer": [name, peer], "ratio": mine / peer, "unknowns": unknowns, "way": theirs}

    def scaling(self, case: str, way: Task) -> Lines:
        """CPU seconds against unknowns over two decades."""
        out: Lines = {}
        for name, more in (("softcover", {}), ("FElupe", {key: way[key] for key in ("fields", "solver")})):
            grids = [{"through": n, "across": round(n * CASES[case]["radius"])} for n in SCALING[case]]
            found = [run for grid in grids if (run := self.run({**CASES[case], **more, **grid})) is not None]
            out[f"{name}, {case}"] = [(each["unknowns"], each["cpu"]) for each in found]
        return out


def main() -> None:
    """Compare, and measure the cost against the size."""
    parser = make_parser(__doc__)
    parser.add_argument("--profile", action="store_true", help="only: where our side spends its time")
    given = parser.parse_args()
    if given.worker:
        worker(given.worker)
        return
    if given.profile:
        for case in CASES.values():
            profile(whole(case))
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        bench = Bench(folder, given.peer or installed(folder, "felupe", "pypardiso", "numpy", "scipy"))
        summary: dict[str, Any] = {case: bench.compare(case) for case in CASES}

        def scale() -> Lines:
            every = [bench.scaling(case, summary[case]["way"]) for case in SCALING]
            return {name: line for each in every for name, line in each.items()}

        labels = {"xlabel": "unknowns", "ylabel": "CPU seconds to 15 %"}
        finish(given, summary, scale, title="Rubber between bonded plates, finite strain", **labels)


if __name__ == "__main__":
    main()
