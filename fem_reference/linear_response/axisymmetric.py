"""Solve a layered cover with axisymmetric finite elements: mesh, constraints, base pressure, and unit point load.

The base pressure is computed from the reactions of the fixed base nodes.  The sum of the reactions equals the load
except for rounding; the inverse mass matrix of the base edges turns the reactions into a pressure that is quadratic on
each element edge.  The error of this pressure oscillates and is orthogonal to linear functions.  The pressure is
therefore evaluated at the two points of each edge where the oscillation vanishes; in tests the error of the peak was
five to ten times smaller at these points than at the nodes.

The point load is a single nodal force.  The displacement under the force is singular, but the base pressure is
accurate: by Galerkin orthogonality the error of a functional of the base pressure is the error of the dual solution at
the loaded point, and the dual solution is smooth at this point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import skfem
from scipy.interpolate import CubicSpline

from fem_reference import result_store
from fem_reference.elements.grading import ON_BOUNDARY, grade_outward, layer_heights
from fem_reference.elements.line import Line, recover_pressure
from fem_reference.elements.taylor_hood import MixedElements, assemble_linear, mesh_layers, prepare_elements
from fem_reference.finite_strain.loading_path import Progress, Units, report
from fem_reference.linear_response.point_spread import GRIDS, PointSpread
from fem_reference.linear_response.surface_compliance import decay_length
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover
from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class AxisymmetricSettings:
    """Constants of the axisymmetric meshes of wide covers, in the r-z plane."""

    #: Radius, over the cover thickness, within which the mesh of a point load has elements of equal size [-].
    even: float = 4.0
    #: Radius of the outer boundary of the mesh of a point load, over the decay length of the cover's response [-].  At
    #: this radius the slowest mode of the response has decayed to 1e-5.
    reach: float = 16.0
    #: Size ratio of neighbouring elements outside the radius `even`, minus one, times the number of elements through
    #: the cover [-].
    growth: float = 1.2
    #: Smallest number of elements through a layer [-].
    least: int = 2


_SETTINGS = AxisymmetricSettings()


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialCover:
    """Laterally wide cover, meshed in the r-z plane in units of its thickness and of its top layer's shear modulus.

    Attributes:
        cover: The cover [SI units].
        elements: Elements.
        reach: Radius of the outer boundary, where all displacements are zero on a bonded base [thicknesses].
    """

    cover: Cover
    elements: MixedElements
    reach: float

    @classmethod
    def mesh(cls, cover: Cover, count: int, radii: FloatArray, *, surface_size: float | None = None) -> RadialCover:
        """Mesh a cover.

        Args:
            cover: The cover.
            count: Number of elements through the whole cover; each layer gets at least two [-].
            radii: Element edges along the radius [thicknesses].
            surface_size: Height of the elements at the top, if smaller than the regular one [thicknesses].
        """
        mesh, region = mesh_cover(Units.of(cover).scale_cover(cover), count, radii, surface_size=surface_size)
        elements = prepare_elements(mesh, region=region, axisymmetric=True)
        return cls(cover=cover, elements=elements, reach=float(radii[-1]))

    @cached_property
    def base(self) -> IntArray:
        """Indices of the nodes of the base, from the axis outwards."""
        return self._sort_nodes(0.0)

    @cached_property
    def top(self) -> IntArray:
        """Indices of the nodes of the top, from the axis outwards."""
        return self._sort_nodes(1.0)

    @property
    def constrained(self) -> IntArray:
        """Indices of the displacements that are zero: on the axis, on the base and on the outer boundary."""
        r, z = self.elements.nodes.T
        return find_constrained(self.cover, r, z, self.reach)

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """Matrix of linear elasticity with the properties of the layers at zero load."""
        return assemble_linear(self.elements, *Units.of(self.cover).scale_moduli(self.cover))

    def recover_base(self, reactions: FloatArray, load: float) -> PointSpread:
        """Compute the base pressure per load from the reactions of the constrained nodes.

        What a stiff layer carries to the fixed outer boundary counts as force on the base beyond it.

        The pressure is extended to the axis by symmetry, and to zero at the outer boundary.

        Args:
            reactions: Reaction at every unknown, each of a whole circle, shape (n,) [units of force].
            load: The load [units of force].
        """
        forces = reactions[2 * self.base + 1]
        line = Line(edges=self.elements.nodes[self.base[::2], 0], order=2)
        r, unit = _find_accurate_radii(line), self.cover.thickness
        p = line.at(r) @ recover_pressure([line], forces, axisymmetric=True)
        around_axis = CubicSpline(np.r_[-r[3::-1], r[:4]], np.r_[p[3::-1], p[:4]])
        return PointSpread(
            radius=np.r_[0.0, r, self.reach] * unit,
            pressure_per_force=np.r_[around_axis(0.0), p, 0.0] / (load * unit**2),
            reaction=float(reactions[self.constrained[self.constrained % 2 == 1]].sum()) / load,
            thickness=unit,
        )

    def _sort_nodes(self, height: float) -> IntArray:
        """Return the indices of the nodes at a height [thicknesses], from the axis outwards."""
        r, z = self.elements.nodes.T
        nodes = np.flatnonzero(np.abs(z - height) < ON_BOUNDARY)
        return nodes[np.argsort(r[nodes])]


def solve_point_load(cover: Cover, *, elements_per_thickness: int, reach: float) -> PointSpread:
    """Solve for the base pressure under a unit point load on the axis.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        elements_per_thickness: Number of elements through the whole cover; each layer gets at least two [-].
        reach: Radius of the outer boundary, where all displacements are zero [m].
    """
    n = elements_per_thickness
    radii = grade_outward(1 / n, _SETTINGS.even, reach / cover.thickness, growth=1 + _SETTINGS.growth / n)
    radial = RadialCover.mesh(cover, n, radii)
    system = ConstrainedSystem(radial.constrained).factorise(radial.stiffness)
    load = np.zeros(radial.stiffness.shape[0])
    load[2 * radial.top[0] + 1] = -1.0
    reactions = system.reaction(system.solve(load), load)
    return radial.recover_base(reactions, 1.0)


def point_spread(cover: Cover, *, progress: Progress = None) -> PointSpread:
    """Solve for the point spread function of a cover on three grids, or read it from the result store.

    The differences between the grids give the error estimate.

    Args:
        cover: Laterally wide cover; hyperelastic materials are linearised at zero load.
        progress: Called with a line of text before each solve.

    Raises:
        ValueError: If the cover has free side edges.
    """
    if cover.size is not None:
        raise ValueError("free side edges are not supported by the axisymmetric solve; leave out cover.size")
    reach = _SETTINGS.reach * decay_length(cover)

    def compute() -> PointSpread:
        grids = []
        for n in GRIDS:
            report(progress, f"axisymmetric solve, {n} elements through the cover")
            grids.append(solve_point_load(cover, elements_per_thickness=n, reach=reach))
        return replace(grids[-1], coarse=tuple(grids[:-1]))

    inputs = {"cover": cover, "reach": reach, "grids": GRIDS, "settings": _SETTINGS}
    return result_store.fetch("point-spread", inputs, compute)


def find_constrained(cover: Cover, r: FloatArray, z: FloatArray, reach: float) -> IntArray:
    """Return the indices of the displacements that are zero: on the axis, on the base and on the outer boundary.

    The displacement of a cover that slides on its base decays only with the inverse of the distance, parallel to the
    base and without pressure on it.  The outer boundary of such a cover is free; fixed, it would press on the base.

    Args:
        cover: Cover; a bonded base constrains both displacements, a sliding base only the normal displacement.
        r: Radii of the n nodes, shape (n,) [thicknesses].
        z: Heights of the n nodes, shape (n,) [thicknesses].
        reach: Radius of the outer boundary [thicknesses].
    """
    axis, base = r < ON_BOUNDARY, z < ON_BOUNDARY
    bonded = cover.base == "bonded"
    outer = (r > reach - ON_BOUNDARY) & bonded
    radial = axis | outer | (base & bonded)
    return np.concatenate([2 * np.flatnonzero(radial), 2 * np.flatnonzero(base | outer) + 1])


def mesh_cover(
    cover: Cover, count: int, radii: FloatArray, *, surface_size: float | None = None
) -> tuple[skfem.MeshQuad, IntArray]:
    """Mesh a cover with quadrilaterals in the r-z plane.

    Args:
        cover: Cover with its layers.
        count: Number of elements through the whole cover; each layer gets at least two [-].
        radii: Element edges along the radius [m].
        surface_size: Height of the elements at the top [m]; used if it is smaller than the regular element height.

    Returns:
        The mesh, and the index of the layer of each element.
    """
    size = cover.thickness / count
    counts = [max(_SETTINGS.least, round(layer.thickness / size)) for layer in cover.layers]
    heights, layer = layer_heights([each.thickness for each in cover.layers], counts, surface_size=surface_size)
    return mesh_layers([radii], heights, layer)


def _find_accurate_radii(line: Line) -> FloatArray:
    """Compute the two radii on each element edge where the error of the recovered base pressure vanishes [m].

    These radii are the roots of the quadratic polynomial that is orthogonal to all linear functions with weight r.
    """
    start, length = line.edges[:-1], np.diff(line.edges)
    moment = [start / (j + 1) + length / (j + 2) for j in range(4)]
    determinant = moment[1] ** 2 - moment[0] * moment[2]
    linear = (moment[0] * moment[3] - moment[1] * moment[2]) / determinant
    constant = (moment[2] ** 2 - moment[1] * moment[3]) / determinant
    root = np.sqrt(linear**2 / 4 - constant)
    t = np.stack([-linear / 2 - root, -linear / 2 + root], axis=1)
    return np.asarray((start[:, None] + length[:, None] * t).ravel())
