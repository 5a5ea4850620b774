"""Compute the response of every texel of a curved cover to a force anywhere on its top, by adjoint solutions.

The force on a texel is the resultant of the traction on its part of the base along the texel's own normal, positive
under pressure, shear included.  On a curved base the normal rotates over the texel, so that this force differs from the
integral of the normal stress by 5 to 8 % (core of 6 mm).  Forces along different normals do not add up to the load; the
balance is stated as a vector (`Indentation.unmeasured`).

The base under a texel is displaced by a unit along the texel's normal, while the rest of the base is fixed and the top
is free.  By reciprocity (Betti) minus the displacement of a point of the top is the force on the texel per unit force
on this point, one vector per point.  The prescribed displacement is the L2 projection of the texel's part of the base
(`meshes.solids.texels`) onto the shape functions of the base.  The result is therefore the integral of the continuous
traction that is recovered from the reactions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
import scipy.sparse.linalg as spla

from fem_reference import result_store
from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.solid import CoverSolid
from fem_reference.finite_strain.loading_path import Progress, report
from fem_reference.grid_convergence import field_convergence
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray
from meshes.layer import Layers
from meshes.solids.facets import facet_shape, split_facet
from meshes.solids.solid_mesh import SolidMesh, check_quality, check_texels, measure_thickness
from meshes.solids.texels import covered_share

#: Number of parts of each side of a facet; a part belongs to a texel to the share that the texel covers [-].
_PARTS = 12
#: Number of iterations in the search for the point of the top above the centre of a texel [-].
_STEPS = 8
#: Largest distance of the point above a texel from the line along the texel's normal, over the cover thickness;
#: beyond it, the texel counts as uncovered [-].
_BESIDE = 0.25
#: Height of the top above a texel, over the cover thickness, above which the texel counts as uncovered, because this
#: part of the top belongs to another side of the body [-].
_HIGH = 3.0
#: Smallest order of convergence in error estimates [-]; quadratic elements have the order 3.
_ORDER = 2.0
#: Ratio of the element sizes of two meshes that an error estimate assumes at least [-].
_SAME_SIZE = 1.2
#: Largest distance of a point from the top for `at`, over the size of the cover [-].
_OFF_TOP = 1e-2


@dataclass(frozen=True, kw_only=True, eq=False)
class GridResponse:
    """Responses of n texels on one mesh.

    Attributes:
        mesh: The mesh.
        top: Top of the cover with its m nodes; positions, normals and areas of the nodes are its attributes.
        influence: Force on each texel per unit force vector on each node of the top, shape (n, m, 3) [-].
    """

    mesh: SolidMesh
    top: FacetSurface
    influence: FloatArray

    @property
    def normal_influence(self) -> FloatArray:
        """Force on each texel per unit force on each node of the top against its normal, shape (n, m) [-]."""
        return -np.asarray(np.einsum("nmc,mc->nm", self.influence, self.top.normals, optimize=True))

    def texel_forces(self, forces: FloatArray) -> FloatArray:
        """Compute the force on each texel under forces on the nodes of the top, inactive texels included.

        Args:
            forces: Force vectors, shape (m, 3) or (k, m, 3) [N].

        Returns:
            Forces, shape (n,) or (k, n) [N].
        """
        return np.asarray(np.einsum("...mc,nmc->...n", forces, self.influence, optimize=True))

    def at(self, points: FloatArray, directions: FloatArray | None = None, *, beside: bool = False) -> FloatArray:
        """Compute the force on each texel per unit point force at points of the top.

        Args:
            points: Positions of k points, shape (k, 3) [m]; the nearest points of the top are used.
            directions: Unit directions of the forces, shape (k, 3) [-]; opposite to the normals of the top if None.
            beside: Whether points may lie off the top.

        Returns:
            Forces, shape (k, n) [-].

        Raises:
            ValueError: If a point is not on the top and may not lie off it.
        """
        weights, distance = self.top.locate(points)
        if not (beside or distance.max(initial=0.0) <= _OFF_TOP * self.mesh.size):
            raise ValueError(f"a point lies {1e3 * distance.max():.3g} mm off the top of the cover")
        if directions is None:
            directions = -(weights @ self.top.normals)
            directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        count = len(self.influence)
        values = weights @ self.influence.transpose(1, 0, 2).reshape(len(self.top.nodes), -1)
        return np.asarray(np.einsum("knc,kc->kn", values.reshape(-1, count, 3), directions))


@dataclass(frozen=True, kw_only=True, eq=False)
class TexelResponses:
    """Responses of n texels of a curved cover, with an estimate of the discretisation error.

    Attributes:
        texels: Array of n texels.
        layers: Material of the cover, or its layers.
        grids: Responses on one to three meshes, coarsest first; results are those of the finest.
    """

    texels: TexelArray
    layers: Layers
    grids: tuple[GridResponse, ...]

    @property
    def finest(self) -> GridResponse:
        """Responses of the texels on the finest mesh."""
        return self.grids[-1]

    def texel_forces(self, forces: FloatArray) -> FloatArray:
        """Compute the force on each texel under forces on the nodes of the top of the finest mesh.

        Args:
            forces: Force vectors, shape (m, 3) or (k, m, 3) [N].

        Returns:
            Forces, 0 on inactive texels, shape (n,) or (k, n) [N].
        """
        return np.where(self.texels.active, self.finest.texel_forces(forces), 0.0)

    def under_pressure(self, pressure: FloatArray) -> FloatArray:
        """Compute the force on each texel under a pressure on the top of the finest mesh.

        Args:
            pressure: Pressures at the nodes of the top, shape (m,) or (k, m) [Pa].

        Returns:
            Forces, 0 on inactive texels, shape (n,) or (k, n) [N].
        """
        forces = self.finest.top.integrate_pressure(np.atleast_2d(pressure))
        return self.texel_forces(forces if np.ndim(pressure) > 1 else forces[0])

    @cached_property
    def above(self) -> FloatArray:
        """Points of the top above the centres of the texels along the texels' normals, shape (n, 3) [m]."""
        return find_above(self.finest.top, self.texels)

    @cached_property
    def uncovered(self) -> BoolArray:
        """Whether each texel has no top above it along its normal, so that `above` lies beside it, shape (n,)."""
        return find_uncovered(self.finest.top, self.texels, measure_thickness(self.finest.mesh))

    @cached_property
    def matrix(self) -> FloatArray:
        """Force on each texel (column) per unit point force on the top above each texel (row), shape (n, n) [-].

        The point forces act opposite to the texels' normals.
        """
        return self._evaluate(self.finest)

    @cached_property
    def error_estimate(self) -> dict[str, float]:
        """Estimated errors over the largest force on a texel per unit force [-]; nan with one mesh.

        `peak_texel` is the largest error of the force on a texel under a point force above its centre. `any_texel` is
        the largest error of the force on any texel under such a force.
        """
        values = np.array([self._evaluate(grid) for grid in self.grids])
        own = np.array([np.diag(each) for each in values])
        meshes = [grid.mesh for grid in self.grids]
        peak = float(own[-1].max())
        return {
            "peak_texel": estimate_error(own, meshes) / peak,
            "any_texel": estimate_error(values, meshes) / peak,
        }

    def _evaluate(self, grid: GridResponse) -> FloatArray:
        """Compute the force on each texel (column) per unit point force above each texel (row) on one mesh."""
        return grid.at(find_above(grid.top, self.texels), -self.texels.normals)


def texel_responses(
    meshes: Sequence[SolidMesh],
    texels: TexelArray,
    layers: Layers,
    *,
    progress: Progress = None,
) -> TexelResponses:
    """Solve for the force on every texel per unit force anywhere on the top, or read it from the store of results.

    Args:
        meshes: One mesh of the cover, or two or three from coarse to fine for an error estimate.
        texels: Texels on the base of the meshes.
        layers: Material of the cover, or its layers; hyperelastic materials are linearised at zero load.
        progress: Called with a line of text before each solution.

    Raises:
        ValueError: If a mesh cannot be used or a texel is not on the base, with one line per fault.
    """
    check_meshes(meshes)
    grids = []
    for mesh in meshes:
        check_texels(mesh, texels)
        places = {"centres": texels.centres, "normals": texels.normals, "size": texels.texel_size}

        def compute(mesh: SolidMesh = mesh) -> FloatArray:
            solid = build_solid(mesh, layers)
            report(progress, f"{texels.count} texels, {solid.unknowns} unknowns")
            return solve_texels(solid, texels)

        inputs = {"mesh": mesh.digest, "texels": places, "material": layers}
        influence = result_store.fetch("curved-responses", inputs, compute)
        grids.append(GridResponse(mesh=mesh, top=find_top(mesh), influence=influence))
    return TexelResponses(texels=texels, layers=layers, grids=tuple(grids))


def solve_texels(solid: CoverSolid, texels: TexelArray) -> FloatArray:
    """Solve the adjoint problem of each of n texels; returns forces per unit force, shape (n, m, 3) [-]."""
    base = FacetSurface.part_of(solid.nodes, solid.layout.base)
    indicator = project_texels(base, texels)
    motion = indicator[:, :, None] * texels.normals[:, None, :]
    return -solid.solve(solid.top, base=motion)


def project_texels(base: FacetSurface, texels: TexelArray) -> FloatArray:
    """Project the part of the base that each texel covers onto the shape functions of the base.

    Returns:
        Values at the nodes of the base, about 1 on the texel and 0 elsewhere, shape (n, nodes of the base) [-].
    """
    middle, area, edges = base.split(_PARTS)
    size = np.linalg.norm(area, axis=2)
    normals = (area / size[..., None]).reshape(-1, 3)
    share = covered_share(texels, middle.reshape(-1, 3), normals, edges.reshape(-1, 2, 3))
    weighted = share.reshape(texels.count, *size.shape) * size
    count = base.facets.shape[1]
    part = weighted @ facet_shape(count, split_facet(count, _PARTS)[1]).mean(axis=1)  # axes: texel, facet, node
    load = np.stack([np.bincount(base.facets.ravel(), each.ravel(), len(base.nodes)) for each in part], axis=1)
    solution = spla.splu(base.mass.tocsc()).solve(load)
    return np.asarray(solution.T)


def find_above(top: FacetSurface, texels: TexelArray) -> FloatArray:
    """Find the points of the top on the normals of the texels, shape (n, 3) [m]."""
    height = top.locate(texels.centres)[1]
    nearest = texels.centres
    for _ in range(_STEPS):
        nearest = top.locate(texels.centres + height[:, None] * texels.normals)[0] @ top.nodes
        height = np.einsum("nc,nc->n", nearest - texels.centres, texels.normals)
    return np.asarray(nearest)


def find_uncovered(top: FacetSurface, texels: TexelArray, thickness: float) -> BoolArray:
    """Return whether each texel has no top above it along its normal, shape (n,).

    Args:
        top: Top of the cover.
        texels: Texels on its base.
        thickness: Mean thickness of the cover [m].
    """
    offset = find_above(top, texels) - texels.centres
    height = np.einsum("nc,nc->n", offset, texels.normals)
    beside = np.linalg.norm(offset - height[:, None] * texels.normals, axis=1)
    return np.asarray((beside > _BESIDE * thickness) | (height <= 0) | (height > _HIGH * thickness))


def estimate_error(values: npt.ArrayLike, meshes: Sequence[SolidMesh], *, least: float = _ORDER) -> float:
    """Estimate the largest absolute error of values on the finest of some meshes, from all of them together.

    Args:
        values: Values on each mesh, coarsest first, shape (meshes, ...).
        meshes: One to three meshes.
        least: Smallest order of convergence that is assumed [-].

    Returns:
        Error of the values on the finest mesh, in the unit of the values (`field_convergence`); nan with one mesh.  Two
        meshes of about equal size, as from re-meshing, count as different by a ratio of 1.2.
    """
    if len(meshes) == 1:
        return float("nan")
    sizes = [float(len(mesh.cells)) ** (-1 / 3) for mesh in meshes]
    if len(meshes) == 2:  # noqa: PLR2004
        sizes[0] = max(sizes[0], _SAME_SIZE * sizes[1])
    return field_convergence(values, sizes, least=least)


def check_meshes(meshes: Sequence[SolidMesh]) -> None:
    """Check the quality of one to three meshes and that they are given from coarse to fine.

    Raises:
        ValueError: If a mesh cannot be used, with one line per fault, or the order or number is wrong.
    """
    if not 1 <= len(meshes) <= 3:  # noqa: PLR2004
        raise ValueError(f"give one, two or three meshes of a cover, not {len(meshes)}")
    counts = [len(mesh.cells) for mesh in meshes]
    if sorted(set(counts)) != counts:
        raise ValueError(f"give the meshes from coarse to fine, not with {counts} elements")
    for mesh in meshes:
        check_quality(mesh).require()


@lru_cache(maxsize=3)
def build_solid(mesh: SolidMesh, layers: Layers) -> CoverSolid:
    """Build the linear elastic solid of a mesh; the last three solids stay in memory with their factorisations."""
    return CoverSolid(mesh, layers)


@lru_cache(maxsize=3)
def find_top(mesh: SolidMesh) -> FacetSurface:
    """Return the top surface of a mesh with its displacement nodes; the last three surfaces stay in memory."""
    return FacetSurface.part_of(mesh.nodes, mesh.top)
