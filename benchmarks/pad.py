"""Response of all 64 texels under a pad with free sides: softcover against NGSolve, each as fast as 0.5 % allows.

The pad: 27.2 x 27.2 x 2 mm, E = 1 MPa, clamped base, 8 x 8 texels of 3.4 mm, a unit load on a disk of 0.5 mm radius
over every texel's centre.  Both sides solve a quarter with the same parities and right-hand sides (`pad_ngsolve.py`),
each run in a process and on a thread of its own; imports and, for NGSolve, meshing with structured hexahedra cost
nothing here.  First every configuration is run once and held against a converged reference; then the cheapest of each
side within 0.5 % of the peak texel are run in turn and their medians compared.  NGSolve is installed into a temporary
environment.

    python benchmarks/pad.py [--poisson-ratio 0.49] [--peer PYTHON] [--scaling] [--plot FILE] [--json FILE]
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from common import Lines, answered, environment, finish, installed, make_parser

FloatArray = npt.NDArray[np.float64]
Task = dict[str, Any]

PITCH, THICKNESS, TEXELS, DISK = 3.4e-3, 2e-3, 4, 0.5e-3
TARGET = 0.005
REPEATS = 7
LIMIT = 120
_PEER = Path(__file__).with_name("pad_ngsolve.py")

#: Elements per texel, through the cover, and the order of the displacement.
GRIDS = [(1, 1, 2), (2, 1, 2), (2, 2, 2), (3, 1, 2), (3, 2, 2), (4, 2, 2), (5, 2, 2), (5, 3, 2), (1, 1, 3), (2, 2, 3)]
DISPLACEMENT = [(1, 1, 3), (1, 2, 3), (2, 1, 3), (2, 2, 3), (3, 2, 3), (1, 2, 4), (4, 2, 2)]
#: The same mixed elements on the same grids as the peer's, up to where one run takes a minute.
SCALING = [(1, 1, 2), (2, 1, 2), (2, 2, 2), (3, 2, 2), (4, 2, 2), (5, 3, 2), (6, 3, 2), (8, 4, 2)]
FINEST: Task = {"per_texel": 4, "through": 3, "order": 3}


def ours(grids: list[tuple[int, int, int]]) -> list[Task]:
    """Tasks of softcover."""
    return [{"per_texel": n, "through": m, "order": order} for n, m, order in grids]


def peers(grids: list[tuple[int, int, int]], *, mixed: bool, solver: str = "sparsecholesky") -> list[Task]:
    """Tasks of NGSolve on hexahedra."""
    return [{"mesh": "hex", **task, "mixed": mixed, "solver": solver} for task in ours(grids)]


def tetrahedra() -> list[Task]:
    """Tasks of NGSolve on its own tetrahedra."""
    usual = {"mesh": "tet", "mixed": False, "solver": "sparsecholesky"}
    return [{**usual, "size": size, "order": order} for size, order in ((1.7, 3), (1.1, 3), (1.7, 4))]


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One process: what it was told, its costs and the forces, shape (16 loads, 8, 8)."""

    task: Task
    cost: dict[str, float]
    forces: FloatArray

    def error(self, reference: FloatArray) -> float:
        """Largest error of any texel under any load, in parts of the peak texel [-]."""
        return float(np.abs(self.forces - reference).max() / reference.max())


def loads() -> FloatArray:
    """Twenty-four equal forces on each disk, disks over the texel centres of the quarter, shape (16, 24, 2) [m]."""
    centres = np.array([(x, y) for x in (np.arange(TEXELS) + 0.5) for y in (np.arange(TEXELS) + 0.5)]) * PITCH
    angle = (np.arange(8) + 0.5) * np.pi / 4
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    disk = np.concatenate([DISK * np.sqrt((k + 0.5) / 3) * ring for k in range(3)])
    return np.asarray(centres[:, None] + disk)


def forces(value: FloatArray) -> FloatArray:
    """All texels from the parities, shape (2, 2, 4, 4, 16) to (16, 8, 8)."""
    square = value.reshape(2, 2, TEXELS, TEXELS, TEXELS, TEXELS).copy()
    for p in (0, 1):
        lower = np.tril_indices(TEXELS, -1)
        square[p, p][lower] = square[p, p].transpose(1, 0, 3, 2)[lower]
    square[1, 0] = square[0, 1].transpose(1, 0, 3, 2)
    out = np.zeros((TEXELS * TEXELS, 2 * TEXELS, 2 * TEXELS))
    high, low = np.arange(TEXELS, 2 * TEXELS), np.arange(TEXELS - 1, -1, -1)
    for p in (0, 1):
        for q in (0, 1):
            part = square[p, q].transpose(2, 3, 0, 1).reshape(-1, TEXELS, TEXELS)
            for x, sign_x in ((high, 1), (low, (-1) ** p)):
                for y, sign_y in ((high, 1), (low, (-1) ** q)):
                    out[:, x[:, None], y] += sign_x * sign_y * part
    return out


def worker(task: Task) -> None:
    """Our side of one run: solve, evaluate, write."""
    import pypardiso  # noqa: F401 -- imports are not measured on either side

    from fem_reference.linear_response.axisymmetric import point_spread  # noqa: F401
    from fem_reference.linear_response.finite_cover import Resolution, mesh_quarter, solve_adjoint
    from meshes import TexelArray
    from tests.support.rubber import make_cover

    size = (8 * PITCH, 8 * PITCH)
    cover = make_cover(task["poisson_ratio"], "linear-elastic", thickness=THICKNESS, size=size)
    array = TexelArray.grid(8, 8, PITCH)
    places = np.load(task["loads"])
    started, clock = time.process_time(), time.perf_counter()
    across = task["per_texel"] * THICKNESS / PITCH
    resolution = Resolution(across=across, through=task["through"], order=task["order"])
    found = solve_adjoint(cover, array, resolution)
    x, y = (line.at(places[..., axis].ravel() / THICKNESS) for axis, line in enumerate((found.x, found.y)))
    value = np.einsum("kx,ky,cpxy->cpk", x, y, found.texels, optimize=["einsum_path", (0, 2), (0, 1)])
    value = value.reshape(2, 2, TEXELS, TEXELS, *places.shape[:2]).mean(axis=-1)
    cost = {"cpu": time.process_time() - started, "wall": time.perf_counter() - clock, "unknowns": 0}
    cost["unknowns"] = int(mesh_quarter(cover, array, resolution).offsets[-1])
    np.save(task["result"], value)
    print(json.dumps(cost))


def wide(poisson_ratio: float) -> dict[str, float]:
    """The axisymmetric route on a wide cover: cost and error of the coarsest grid that holds the target."""
    from fem_reference.linear_response.axisymmetric import solve_point_load
    from meshes import TexelArray
    from tests.support.rubber import make_cover

    cover = make_cover(poisson_ratio, "linear-elastic", thickness=THICKNESS)
    array, reach = TexelArray.grid(8, 8, PITCH), 16 * THICKNESS
    places = loads()

    def answer(elements: int) -> FloatArray:
        spread = solve_point_load(cover, elements_per_thickness=elements, reach=reach)
        felt = spread.texel_influence(array, places.reshape(-1, 2))
        return np.asarray(felt.reshape(*places.shape[:2], -1).mean(axis=1))

    reference = answer(24)
    for elements in (2, 3, 4, 6, 8):
        seconds = []
        for _ in range(REPEATS):
            started = time.process_time()
            found = answer(elements)
            seconds.append(time.process_time() - started)
        error = float(np.abs(found - reference).max() / reference.max())
        if error <= TARGET:
            return {"cpu": float(np.median(seconds)), "error": error, "elements": elements}
    raise RuntimeError("no axisymmetric grid holds the target")


class Bench:
    """Runs both sides in processes of their own."""

    def __init__(self, folder: Path, peer: Path, poisson_ratio: float) -> None:
        self.folder, self.peer, self.poisson_ratio = folder, peer, poisson_ratio
        np.save(folder / "loads.npy", loads())
        np.save(folder / "loads_mm.npy", loads() * 1e3)
        self.environment = environment(folder)

    def run(self, task: Task) -> Run | None:
        """One process; None where it fails or takes too long."""
        mine = "mesh" not in task
        result = self.folder / "result.npy"
        places = self.folder / ("loads.npy" if mine else "loads_mm.npy")
        told = {**task, "poisson_ratio": self.poisson_ratio, "nu": self.poisson_ratio}
        told |= {"loads": str(places), "result": str(result)}
        command = [sys.executable, __file__, "--worker"] if mine else [str(self.peer), str(_PEER)]
        cost = answered([*command, json.dumps(told)], self.environment, name_of(task), limit=LIMIT)
        return None if cost is None else Run(task=task, cost=cost, forces=forces(np.load(result)))

    def tune(self, tasks: list[Task], reference: FloatArray) -> Task:
        """The cheapest task within the target."""
        found = []
        for task in tasks:
            run = self.run(task)
            if run is None:
                continue
            error = run.error(reference)
            print(
                f"  {name_of(task):48} {run.cost['unknowns']:8.0f} {run.cost['cpu']:8.2f} {100 * error:8.2f}",
                flush=True,
            )
            if error <= TARGET:
                found.append((run.cost["cpu"], task))
        if not found:
            raise RuntimeError("no configuration holds the target")
        best = [task for _, task in sorted(found, key=lambda each: each[0])[:3]]
        return best[int(np.argmin(self.medians(best)))]

    def medians(self, tasks: list[Task]) -> list[float]:
        """Median CPU seconds of tasks run in turn."""
        seconds: list[list[float]] = [[] for _ in tasks]
        for _ in range(REPEATS):
            for each, task in zip(seconds, tasks, strict=True):
                run = self.run(task)
                if run is not None:
                    each.append(run.cost["cpu"])
        return [float(np.median(each)) for each in seconds]

    def scaling(self) -> Lines:
        """CPU seconds against unknowns of the quarter over two decades."""
        out: Lines = {}
        sides = {"softcover, Q2-Q1": ours(SCALING), "NGSolve, Q2-Q1": peers(SCALING[:-1], mixed=True)}
        for name, tasks in sides.items():
            runs = [run for task in tasks if (run := self.run(task)) is not None]
            out[name] = [(run.cost["unknowns"], run.cost["cpu"]) for run in runs]
        return out


def name_of(task: Task) -> str:
    """A line for a table."""
    if "mesh" not in task:
        return f"softcover Q{task['order']}-Q{task['order'] - 1}, {task['per_texel']} x {task['through']}"
    grid = f"{task['size']:.2g} mm" if task["mesh"] == "tet" else f"{task['per_texel']} x {task['through']}"
    kind = "mixed" if task["mixed"] else "displacement"
    return f"NGSolve {task['mesh']} order {task['order']} {kind}, {grid}, {task['solver']}"


def main() -> None:
    """Tune, repeat, compare."""
    parser = make_parser(__doc__)
    parser.add_argument("--poisson-ratio", type=float, default=0.49)
    given = parser.parse_args()
    if given.worker:
        worker(given.worker)
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        bench = Bench(folder, given.peer or installed(folder, "ngsolve", "mkl", "numpy"), given.poisson_ratio)
        labels = {"xlabel": "unknowns of the quarter", "ylabel": "CPU seconds, all texels"}
        finish(given, compared(bench), bench.scaling, title="Pad with free sides", **labels)


def compared(bench: Bench) -> dict[str, Any]:
    """The comparison itself."""
    finest = bench.run(FINEST)
    if finest is None:
        raise RuntimeError("the reference failed")
    reference = finest.forces
    print(f"{'':50} unknowns    CPU s  error %")
    peer_tasks = [*peers(GRIDS, mixed=True), *peers([(3, 2, 2)], mixed=True, solver="pardiso")]
    if bench.poisson_ratio < 0.5:
        peer_tasks += [*peers(DISPLACEMENT, mixed=False), *tetrahedra()]
    us, them = bench.tune(ours(GRIDS), reference), bench.tune(peer_tasks, reference)
    mine, theirs = bench.medians([us, them])
    axis = wide(bench.poisson_ratio)
    print(f"\nmedians of {REPEATS} runs in turn, one thread, CPU seconds, within {100 * TARGET:g} % of the peak texel")
    print(f"  {name_of(us):48} {mine:8.3f}")
    print(f"  {name_of(them):48} {theirs:8.3f}   ratio {mine / theirs:.2f}")
    row = f"wide cover, axisymmetric, {axis['elements']:.0f} elements through"
    print(f"  {row:48} {axis['cpu']:8.3f}   ratio {axis['cpu'] / theirs:.3f}   error {100 * axis['error']:.2f} %")
    return {"ours": [name_of(us), mine], "peer": [name_of(them), theirs], "ratio": mine / theirs, "wide": axis}


if __name__ == "__main__":
    main()
