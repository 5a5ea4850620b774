"""Press six bodies from CAD at three tessellations each, at tip, side and pad, and compare with the finest.

    python -m benchmarks.curved_bodies [--bodies NAME ...] [--processes 1] [--keep FOLDER] [--out RECORDS.jsonl]

Two bodies are read from SOFTCOVER_GEOMETRY.  Four are read from SOFTCOVER_BODIES, a folder into which the wheels of
dm-control and robosuite were unpacked (`pip download --no-deps dm-control robosuite`, `unzip`); none is installed.
`--keep` stores the meshes in a folder, or takes them from it.  Others need pyvista and pytetwild.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import pickle
import sys
import tempfile
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import fem_reference.curved_cover.press as solver
from fem_reference import press
from fem_reference.curved_cover.penetration import measure_penetration
from fem_reference.errors import ConvergenceError, UnsupportedError
from meshes import Sphere, TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Pose
from meshes.solids.covers import take_meshes
from meshes.solids.solid_mesh import SolidMesh
from meshes.solids.tetrahedra import refine
from meshes.surfaces.files import read_triangles
from meshes.surfaces.triangles import label_parts, merge_corners, nearest_points, normal_vectors, unit_vectors
from tests.support.rubber import make_rubber

RUBBER = make_rubber(model="linear-elastic")
#: The ball [m] and its load [N].
BALL, LOAD = Sphere(radius=5e-3), 0.2
#: Names of the places.
PLACES = ("tip", "side", "pad")


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body from CAD.

    Attributes:
        files: Files of surface and, if there is one, base.
        about: Source and licence.
        places: Directions from the middle of the body to tip, side and pad.
        keys: Keys of the table `[cover]`.
        scale: Factor on its lengths [-].
        shares: Divisors of the number of triangles of the three tessellations [-].
        core: Size of a base that has the shape of the surface, over the surface; 0 for none [-].
    """

    files: tuple[Path, ...]
    about: str
    places: tuple[tuple[float, float, float], ...]
    keys: dict[str, object] = field(default_factory=dict)
    scale: float = 1.0
    core: float = 0.0
    shares: tuple[int, int, int] = (1, 4, 16)


def list_bodies() -> dict[str, Body]:
    """List the bodies."""
    geometry = Path(os.environ.get("SOFTCOVER_GEOMETRY", "../shared/geometry"))
    public = Path(os.environ.get("SOFTCOVER_BODIES", "../bodies"))
    dog, objects = public / "dm_control/suite/dog_assets", public / "robosuite/models/assets/objects/meshes"
    return {
        "biotac": Body(
            files=(geometry / "biotac/skin.tet", geometry / "biotac/core.obj"), keys={"unit": "m"},
            about="NVlabs/biotac_sim, MIT style", places=((1, 0, -0.3), (0.2, 1, 0.3), (0, 0, 1)),
        ),
        "sharpa": Body(
            files=(geometry / "sharpa/tactileSensor_4F.obj",), keys={"unit": "mm", "thickness": "2 mm"},
            about="sharpa-robotics/sharpa-tactile-sensor-assets, Apache-2.0",
            places=((0, -1, 0.2), (1, 0, 0.3), (0, -0.2, -1)),
        ),
        "phalanx": Body(
            files=(dog / "BONEPhalanx_media_digiti_III_L.stl",), keys={"unit": "m"}, scale=1.6, core=0.62,
            about="dm-control, Apache-2.0: a bone, whose waist and end are saddles",
            places=((0, 0, 1), (1, 0, 0.1), (0, 1, 0)),
        ),
        "lemon": Body(
            files=(objects / "lemon.stl",), keys={"unit": "m"}, scale=0.5, core=0.72,
            about="robosuite, MIT: a skin with a core", places=((1, 0, 0), (0.2, 1, 0.1), (-0.2, 0, 1)),
        ),
        "patella": Body(
            files=(dog / "BONEPatella_L.stl",), keys={"unit": "m"}, scale=2.0, core=0.6, shares=(1, 2, 4),
            about="dm-control, Apache-2.0: a bone of the size of a fingertip, with a core",
            places=((1, 0, 0), (0.2, 1, 0.1), (-0.2, 0, 1)),
        ),
        "talus": Body(
            files=(dog / "BONETibial_tarsal_L.stl",), keys={"unit": "m"}, core=0.6,
            about="dm-control, Apache-2.0: a bone whose joint is a saddle", places=((0, 0, 1), (1, 0, 0.1), (0, 1, 0)),
        ),
    }  # fmt: skip


def mesh_body(name: str, share: int) -> dict[str, Any]:
    """Mesh one tessellation of a body, and place three texels on its base."""
    import pyvista
    import trimesh

    from validation.schema import parse
    from validation.schema.sensor import CurvedCoverTable
    from validation.sensor_file.curved_cover import build_solid

    body = list_bodies()[name]
    parts = [body.scale * keep_largest(read_triangles(path, 1.0)) for path in body.files]
    if body.core:
        middle = parts[0].reshape(-1, 3).mean(axis=0)
        parts.append(middle + body.core * (parts[0] - middle))
    keys = body.keys | {"surface": "outer.stl", "material": "dragon-skin-30"}
    keys |= {"base": "base.stl"} if len(parts) > 1 else {}
    counts = []
    with tempfile.TemporaryDirectory() as folder:
        for path, triangles in zip(("outer.stl", "base.stl"), parts, strict=False):
            part = pyvista.wrap(trimesh.Trimesh(*merge_corners(triangles), process=False))
            part = part.decimate(1 - 1 / share) if share > 1 else part
            counts.append(part.n_cells)
            part.save(Path(folder) / path)
        spent = sum(os.times()[:4])
        cover = build_solid(parse(keys, CurvedCoverTable), Path(folder))
        cover.meshes()
        spent = sum(os.times()[:4]) - spent
    return {
        "name": name, "share": share, "triangles": counts, "seconds": spent,
        "mesh": cover.meshes()[0].arrays | {"source": name, "settings": dict(cover.meshes()[0].settings)},
        "base": np.asarray(cover.base_triangles),
    }  # fmt: skip


def place_texels(name: str, base: FloatArray, finest: FloatArray) -> tuple[TexelArray, FloatArray]:
    """Place a texel at each place of a body, on the base of one tessellation.

    Args:
        name: Name of the body.
        base: Triangles of the base of the tessellation, shape (b, 3, 3) [m].
        finest: Triangles of the base of the finest tessellation, which decides on the places, likewise.

    Returns:
        The texels, and the points on the finest base through which the balls move, shape (3, 3) [m].
    """
    middles, normals, chosen = finest.mean(axis=1), unit_vectors(normal_vectors(finest)), []
    for place in list_bodies()[name].places:  # far along a direction and near to its line
        along, away = unit_vectors(np.array(place, dtype=float)), middles - middles.mean(axis=0)
        chosen.append(int(np.argmax(away @ along - np.linalg.norm(np.cross(away, along), axis=1))))
    grid = TexelArray.grid(1, len(chosen), 3e-3, name=name)
    points = middles[chosen]
    return replace(grid, centres=nearest_points(points, base)[0], normals=normals[chosen]), points


def press_body(kept: dict[str, Any], finest: FloatArray) -> list[dict[str, Any]]:
    """Press one tessellation of a body at its three places, see `place_texels`."""
    coarse = SolidMesh(**kept["mesh"])
    meshes = [coarse, refine(coarse)]
    texels, points = place_texels(kept["name"], kept["base"], finest)
    records = []
    label = {key: kept[key] for key in ("name", "share", "triangles")} | {"mesh_seconds": kept["seconds"]}
    label["elements"] = len(meshes[-1].cells)
    for place, centre, outward in zip(PLACES, points, texels.normals, strict=True):
        started, record = sum(os.times()[:4]), label | {"place": place}
        pose = Pose.facing(centre + 30e-3 * outward, -outward)
        check = solver.check_penetration
        try:
            with mock.patch.object(solver, "check_penetration", wraps=check) as checked:
                found = press(take_meshes(meshes, RUBBER), texels, BALL, pose, load=LOAD)
        except (ValueError, UnsupportedError, ConvergenceError) as error:
            records.append(record | {"refused": f"{type(error).__name__}: {error}"})
            continue
        mesh, displacement, *_ = checked.call_args.args
        free = np.unique(np.concatenate([mesh.top.ravel(), mesh.left_out.ravel()]))
        moved = mesh.nodes[free] + displacement[free] - checked.call_args.kwargs["travel"] * pose.towards
        inside = float(measure_penetration(BALL, pose.points_to_indenter(moved)).max())
        records.append(record | {
            "press_seconds": sum(os.times()[:4]) - started, "depth": found.depth, "area": found.contact_area,
            "geometry_error": meshes[-1].geometry_error, "errors": dict(found.error_estimate),
            "texel_forces": found.texel_forces.tolist(), "warnings": list(found.warnings), "inside": inside,
        })  # fmt: skip
    return records


def keep_largest(triangles: FloatArray) -> FloatArray:
    """Return the triangles of the largest connected part of a surface, without doubled ones, shape (n, 3, 3)."""
    points, faces = merge_corners(triangles)
    faces = faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]
    part = label_parts(len(points), faces)[faces[:, 0]]
    area = np.bincount(part, np.linalg.norm(normal_vectors(points[faces]), axis=1))
    return points[faces[part == area.argmax()]]


def take_body(folder: Path, name: str, share: int) -> dict[str, Any]:
    """Return what `mesh_body` returns, from a folder if it is kept there."""
    path = folder / f"{name}-{share}.pkl"
    if not path.exists():
        path.write_bytes(pickle.dumps(mesh_body(name, share)))
    return pickle.loads(path.read_bytes())  # noqa: S301 -- written by this program


def solve_body(folder: Path, case: tuple[str, int]) -> list[dict[str, Any]]:
    """Mesh and press one tessellation, or press the meshes that are kept in a folder."""
    name, share = case
    try:
        return press_body(take_body(folder, name, share), take_body(folder, name, 1)["base"])
    except (ValueError, OSError) as error:
        return [{"name": name, "share": share, "refused": str(error)}]


def write_table(records: list[dict[str, Any]]) -> str:
    """Write the table: every press beside that of the finest tessellation."""
    head = ("body", "triangles", "place", "mesh, press [CPU s]", "shape, depth, inside [mm]")
    head = (*head, "depth: estimate, off [%]", "peak texel: estimate, off [%]")
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    known: dict[tuple[str, str], dict[str, Any]] = {}
    for each in sorted(records, key=lambda e: (list(list_bodies()).index(e["name"]), e["share"])):
        head = f"| {each['name']} | 1/{each['share']} "
        if "refused" in each:
            lines.append(f"{head}| {each.get('place', '')} | refused: {each['refused']} |")
            continue
        exact = known.setdefault((each["name"], each["place"]), each)
        peak = max(np.abs(exact["texel_forces"]))
        off = np.abs(np.array(each["texel_forces"]) - exact["texel_forces"]).max() / peak
        error = each["errors"]
        lines.append(
            f"{head}({each['triangles'][0]}) | {each['place']} | {each['mesh_seconds']:.0f}, "
            f"{each['press_seconds']:.0f} | {1e3 * each['geometry_error']:.3f}, {1e3 * each['depth']:.3f}, "
            f"{1e3 * max(each['inside'], 0.0):.3f} | {100 * error['depth']:.1f}, "
            f"{100 * (each['depth'] / exact['depth'] - 1):+.1f} | {100 * error['peak_texel']:.1f}, {100 * off:.1f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Press the bodies and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--bodies", nargs="+", default=list(list_bodies()))
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    cases = [(name, share) for name in given.bodies for share in list_bodies()[name].shares]
    records: list[dict[str, Any]] = []
    with (
        tempfile.TemporaryDirectory() as store,
        multiprocessing.get_context("spawn").Pool(given.processes, maxtasksperchild=1) as pool,
    ):
        os.environ["SOFTCOVER_STORE"] = store
        for some in pool.imap_unordered(partial(solve_body, given.keep or Path(store)), cases):
            records += some
            print(*(json.dumps(e) for e in some), sep="\n", file=given.out.open("a") if given.out else sys.stderr)
    print(write_table(records))


if __name__ == "__main__":
    main()
