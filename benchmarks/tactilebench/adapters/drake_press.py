"""Press the cases in Drake, by hydroelastic contact of a rigid body with a compliant half space.

    python benchmarks/tactilebench/adapters/drake_press.py --variant youngs
    python benchmarks/tactilebench/adapters/drake_press.py --variant fitted

`youngs` takes Young's modulus over a slab of the cover's thickness, and a texel feels the pressure above it.  `fitted`
takes 2.3 times as much, about what `softcover export --format drake` fits to thin rubber, and spreads the pressure to
the texels by the exact response of the elastic layer, which needs softcover.  Needs `pip install drake`.
"""

from __future__ import annotations

import sys

import numpy as np
from bodies import FloatArray, Part, find_bottom, integrate, make_parser, make_parts, run, sum_on_texels
from pydrake.geometry import (
    AddCompliantHydroelasticPropertiesForHalfSpace,
    AddRigidHydroelasticProperties,
    Box,
    Convex,
    Cylinder,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    HalfSpace,
    HydroelasticContactRepresentation,
    ProximityProperties,
    SceneGraph,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from scipy.optimize import brentq

from tactilebench import BenchError, Case

#: Factor on the modulus of E / h, by variant [-].
FACTORS = {"youngs": 1.0, "fitted": 2.3}
#: Longest edge of triangles over the smallest pitch, for the integral over a texel by variant, and on bodies [-].
EDGES, EDGE = {"youngs": 1 / 12, "fitted": 1 / 6}, 1 / 12
#: Least depth; Drake does not cut a face that lies in the surface [m].
FIRST = 1e-8


def make_shape(part: Part) -> Shape:
    """Return the shape of a part."""
    if part.kind == "hull":
        return Convex(part.corners.T, "hull")
    if part.kind == "sphere":
        return Sphere(*part.size)
    return Cylinder(part.size[0], 2 * part.size[1]) if part.kind == "cylinder" else Box(*(2 * x for x in part.size))


class Scene:
    """A case in Drake: a rigid body over a half space whose surface is the plane z = 0."""

    def __init__(self, case: Case, factor: float) -> None:
        self._case, self._body, parts = case, case.bodies[0], make_parts(case.bodies[0])
        self._bottom = find_bottom(parts, self._body.rotation)
        if len(case.cover.layers) > 1:
            raise BenchError(f"{case.name} has several layers; the modulus of one is taken, as in --tier linear")
        (layer,) = case.cover.layers
        soft, rigid = ProximityProperties(), ProximityProperties()
        AddCompliantHydroelasticPropertiesForHalfSpace(layer.thickness, factor * layer.youngs_modulus, soft)
        AddRigidHydroelasticProperties(min(case.pitch) * EDGE, rigid)
        graph = SceneGraph()
        source = graph.RegisterSource("case")
        cover = GeometryInstance(RigidTransform(), HalfSpace(), "cover")
        cover.set_proximity_properties(soft)
        graph.RegisterAnchoredGeometry(source, cover)
        self._frame = graph.RegisterFrame(source, GeometryFrame("body"))
        for number, part in enumerate(parts):
            pose = RigidTransform(RotationMatrix(part.rotation), part.position)
            geometry = GeometryInstance(pose, make_shape(part), f"part{number}")
            geometry.set_proximity_properties(rigid)
            graph.RegisterGeometry(source, self._frame, geometry)
        self._context, self._port = graph.CreateDefaultContext(), graph.get_source_pose_port(source)
        self._output = graph.get_query_output_port()

    def touch(self, depth: float) -> tuple[FloatArray, FloatArray]:
        """Sink the body to a depth [m]; returns triangles of the contact, shape (m, 3, 3) [m], and pressures (m, 3)."""
        x, y, _ = self._body.at
        pose = RigidTransform(RotationMatrix(self._body.rotation), [x, y, -depth - self._bottom])
        poses = FramePoseVector()
        poses.set_value(self._frame, pose)
        self._port.FixValue(self._context, poses)
        query = self._output.Eval(self._context)
        corners, pressures = [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
        for found in query.ComputeContactSurfaces(HydroelasticContactRepresentation.kTriangle):
            mesh, field = found.tri_mesh_W(), found.tri_e_MN()
            faces = np.array([[each.vertex(k) for k in range(3)] for each in mesh.triangles()])
            values = np.array([field.EvaluateAtVertex(k) for k in range(mesh.num_vertices())])
            corners.append(np.array(mesh.vertices())[faces])
            pressures.append(values[faces])
        return np.concatenate(corners), np.concatenate(pressures)

    def press(self, edge: float) -> tuple[FloatArray, FloatArray]:
        """Sink the body until it bears its load.

        Args:
            edge: Longest edge of the triangles of the integral [m].

        Returns:
            Points on the cover, shape (k, 2) [m], and forces at them, shape (k,) [N].
        """

        def miss(depth: float) -> float:
            return float(integrate(*self.touch(depth), np.inf)[1].sum()) - self._body.load

        deepest = self._case.cover.thickness
        while miss(deepest) < 0:
            deepest *= 1.5
        depth = brentq(miss, FIRST, deepest, xtol=1e-10, rtol=1e-7)
        return integrate(*self.touch(depth), edge)


def press(case: Case, variant: str) -> FloatArray:
    """Return the forces on the texels of a case, shape (n,) [N]."""
    points, forces = Scene(case, FACTORS[variant]).press(EDGES[variant] * min(case.pitch))
    if variant == "youngs":
        return sum_on_texels(case, points, forces)
    from fem_reference.closed_form.layer import tabulate_texel_response
    from meshes import Cover, Layer, Material

    layers = tuple(
        Layer(thickness=each.thickness, material=Material(name="layer", model="linear-elastic",
              parameters={"youngs_modulus": each.youngs_modulus}, poisson_ratio=each.poisson_ratio))
        for each in case.cover.layers
    )  # fmt: skip
    response = tabulate_texel_response(Cover(layers=layers), case.texel_size)
    return np.array([response(*(points - at).T) @ forces for at in case.centres[:, :2]])


def main() -> int:
    """Press the cases and score them."""
    parser = make_parser(__doc__)
    parser.add_argument("--variant", choices=FACTORS, default="fitted", help="modulus, and spread behind the contact")
    options = parser.parse_args()
    words = {"youngs": "modulus E / h", "fitted": "modulus 2.3 E / h, exact spread of the layer"}[options.variant]
    name = f"drake-{options.variant}"
    return run(
        options, name, f"Drake, hydroelastic, {words}", lambda case: press(case, options.variant), package="drake"
    )


if __name__ == "__main__":
    sys.exit(main())
