"""Content of a picture of a cover: its deformed body with values at the nodes, its texels and the forces on them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from meshes import Cover, Indenter, Pose, TexelArray
from meshes.array_types import FloatArray, IntArray
from meshes.solids.solid_mesh import SolidMesh


@dataclass(frozen=True, kw_only=True)
class _Numbers:
    """Constants of the pictures of covers; chosen for good visibility."""

    #: Number of steps in which half a turn of an axisymmetric solution is drawn [-].
    turn: int = 48
    #: Distance from the contact up to which a wide cover is drawn, over the thickness of the cover [-].
    surroundings: float = 4.0
    #: Distance from the top within which nodes lie on it, over the thickness of the cover [-].
    on_top: float = 1e-6
    #: Number of steps in which an indenter is moved to the points that it touches; one is enough without tilt [-].
    steps: int = 8
    #: Largest stress of one layer, over that of another layer, above which the colour scale is logarithmic [-].
    uneven: float = 20.0


_NUMBERS = _Numbers()
#: Names of the parts of the surface of an unloaded cover, whose nodes have the values 1, 2 and 3.
PARTS = ("left out", "touchable", "bonded")
#: Nodes at the corners of the 8 small hexahedra into which a hexahedron of 27 nodes is split, in the order of VTK,
#: shape (8, 8).
_PARTS = np.array(
    [
        [i + x + 3 * (j + y) + 9 * (k + z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
        for k in (0, 1)
        for j in (0, 1)
        for i in (0, 1)
    ]
)


if TYPE_CHECKING:
    from fem_reference.fields.cover_fields import CoverFields
    from fem_reference.indentation.result import Indentation


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverScene:
    """Deformed cover with values at its n nodes, and the texels below it with the forces on them.

    Attributes:
        position: Positions of the nodes before deformation, shape (n, 3) [m].
        displacement: Displacements of the nodes, shape (n, 3) [m].
        cells: Nodes of e elements in the order of VTK: hexahedra, shape (e, 8), or tetrahedra, shape (e, 4).
        thickness: Thickness of the cover [m].
        surface: Values that colour the surface, shape (n,); None for none.
        surface_label: Name and unit of `surface`.
        inside: Values that colour the section, shape (n,); None for none.
        inside_label: Name and unit of `inside`.
        logarithmic: Whether the scale of the section's colours is logarithmic.
        texels: Texels; None for none.
        texel_forces: Forces on the n texels, shape (n,) [N]; None for none.
        touched: Point of the undeformed cover where the indenter touches it, shape (3,) [m]; None without an indenter.
        indenter: The indenter; None without one.
        pose: Pose of the pressed indenter, whose point lies where the indenter's lowest point on its axis came to.
        layers: Names of the layers, bottom first; empty where the elements have none.
        layer: Index of the layer of each element, shape (e,); None where the elements have none.
        title: Text above the picture.
        limits: Largest distance from `touched` along x and y within which the cover is drawn [m]; infinite for the
            whole cover.
    """

    position: FloatArray
    displacement: FloatArray
    cells: IntArray
    thickness: float
    surface: FloatArray | None = None
    surface_label: str = ""
    inside: FloatArray | None = None
    inside_label: str = ""
    logarithmic: bool = False
    texels: TexelArray | None = None
    texel_forces: FloatArray | None = None
    touched: FloatArray | None = None
    indenter: Indenter | None = None
    pose: Pose = field(default_factory=Pose)
    layers: tuple[str, ...] = ()
    layer: IntArray | None = None
    title: str = ""
    limits: float = float("inf")


def show_indentation(
    found: Indentation,
    texels: TexelArray,
    indenter: Indenter,
    pose: Pose,
    *,
    cover: object = None,
    title: str = "",
) -> CoverScene | None:
    """Prepare the picture of an indentation; None if the result has neither a mesh nor fields.

    On a mesh the surface is coloured by the contact pressure and the section by the displacement.  With fields the
    surface is coloured by the pressure -sigma_zz, which is the contact pressure under the indenter, and the section by
    the von Mises stress.

    Args:
        found: Result of `press`.
        texels: Texels of the array.
        indenter: The indenter.
        pose: Its pose before the load.
        cover: The cover, whose layers are named.
        title: Text above the picture.
    """
    if found.mesh is not None:
        return _show_solid(found, texels, indenter, pose, title)
    if found.fields is None:
        return None
    fields = found.fields
    weight, places = -found.contact_forces[:, 2], found.contact_points[:, :2]
    middle = np.average(places, axis=0, weights=weight)
    reach = float(np.abs(places[weight > 0] - middle).max(initial=0.0))
    top = float(fields.position[:, 2].max())
    if fields.axisymmetric:
        fields = _revolve(fields)
    height = top - float(fields.position[:, 2].min())
    on_top = np.flatnonzero(fields.position[:, 2] > top - _NUMBERS.on_top * height)
    touched = np.column_stack([places[weight > 0], np.full(int((weight > 0).sum()), top)])
    nearest = on_top[KDTree(fields.position[on_top]).query(touched)[1]]
    layers = cover.layers if isinstance(cover, Cover) else ()
    return CoverScene(
        position=fields.position,
        displacement=fields.displacement,
        cells=fields.cells,
        thickness=height,
        surface=-1e-3 * fields.stress[:, 2, 2],
        surface_label="pressure [kPa]",
        inside=1e-3 * fields.von_mises,
        inside_label="von Mises stress [kPa]",
        logarithmic=_is_uneven(fields),
        texels=texels,
        texel_forces=found.texel_forces,
        touched=np.array([*middle, top]),
        indenter=indenter,
        pose=_advance(pose, indenter, touched + fields.displacement[nearest]),
        layers=tuple(f"{layer.material.name}, {1e3 * layer.thickness:.3g} mm" for layer in layers),
        layer=fields.layer,
        title=title,
        limits=reach + _NUMBERS.surroundings * height,
    )


def _advance(pose: Pose, indenter: Indenter, touched: FloatArray) -> Pose:
    """Move an indenter along its motion until its surface passes through points that it touches.

    Args:
        pose: Pose of the indenter, at any distance.
        indenter: The indenter.
        touched: Points of the deformed cover that the indenter touches, shape (m, 3) [m].
    """
    along = -float(pose.towards @ pose.rotation[:, 2])
    for _ in range(_NUMBERS.steps):
        x, y, z = pose.points_to_indenter(touched).T
        missing = indenter.gap(x, y) - z
        step = np.median(missing[np.isfinite(missing)]) / along if np.isfinite(missing).any() else 0.0
        pose = replace(pose, point=tuple((pose.position + step * pose.towards).tolist()))
    return pose


def _show_solid(found: Indentation, texels: TexelArray, indenter: Indenter, pose: Pose, title: str) -> CoverScene:
    """Prepare the picture of an indentation of a solid cover."""
    from fem_reference.curved_cover.responses import find_top
    from meshes.solids.facets import area_vectors, split_facet
    from meshes.solids.solid_mesh import compute_volume, measure_area

    mesh, moved = found.mesh, found.displacement
    if mesh is None or moved is None:
        raise ValueError("the result has no mesh")
    top = find_top(mesh)
    nearest = np.asarray(KDTree(top.nodes).query(found.contact_points)[1])
    inward = -np.einsum("mc,mc->m", found.contact_forces, top.normals[nearest])
    forces, held = np.bincount(nearest, inward, len(top.nodes)).astype(float), inward > 0
    place = split_facet(top.facets.shape[1], 2)[0]
    reference = 4.0 if mesh.is_hexahedral else 0.5
    areas = reference * np.linalg.norm(area_vectors(top.nodes, top.facets, place), axis=2).mean(axis=1)
    pressure = 1e-3 * average_pressure(top.facets, forces, areas)
    count = len(mesh.nodes)
    surface = np.zeros(max(count, len(moved)))
    surface[top.index] = pressure
    touched = np.average(top.nodes, axis=0, weights=forces) if forces.any() else top.nodes.mean(axis=0)
    return CoverScene(
        position=mesh.nodes,
        displacement=moved[:count],
        cells=split_cells(mesh),
        thickness=compute_volume(mesh) / measure_area(mesh, "base"),
        surface=surface[:count],
        surface_label="contact pressure [kPa]",
        inside=1e3 * np.linalg.norm(moved[:count], axis=1),
        inside_label="displacement [mm]",
        texels=texels,
        texel_forces=found.texel_forces,
        touched=top.nodes[np.argmin(np.linalg.norm(top.nodes - touched, axis=1))],
        indenter=indenter,
        pose=_advance(pose, indenter, found.contact_points[held] + moved[top.index[nearest[held]]]),
        title=title,
    )


def show_mesh(mesh: SolidMesh, texels: TexelArray | None = None, *, title: str = "") -> CoverScene:
    """Prepare the picture of the mesh of a cover without load, with the bonded, touchable and left-out parts.

    Args:
        mesh: Mesh of a cover.
        texels: Texels on its base.
        title: Text above the picture.
    """
    from meshes.solids.solid_mesh import compute_volume, measure_area

    part = np.full(len(mesh.nodes), 2.0)
    for number, facets in ((1.0, mesh.left_out), (3.0, mesh.base)):
        part[np.unique(facets)] = number
    return CoverScene(
        position=mesh.nodes,
        displacement=np.zeros_like(mesh.nodes),
        cells=split_cells(mesh),
        surface=part,
        surface_label="parts",
        inside=part,
        inside_label="parts ",  # another bar, because pyvista merges bars of one title
        thickness=compute_volume(mesh) / measure_area(mesh, "base"),
        texels=texels,
        title=title,
    )


def split_cells(mesh: SolidMesh) -> IntArray:
    """Return the elements of a mesh for VTK.

    A hexahedron of 27 nodes is split into 8 hexahedra of 8 nodes; a tetrahedron is drawn by its corners.
    """
    return np.asarray(mesh.cells[:, _PARTS].reshape(-1, 8)) if mesh.is_hexahedral else mesh.cells[:, :4]


def average_pressure(facets: IntArray, forces: FloatArray, areas: FloatArray) -> FloatArray:
    """Spread nodal forces to facets and return the mean pressures around the nodes.

    The force of a node is divided equally among its facets.  The corner of a flat triangle with quadratic shape
    functions has no area of its own.  Forces over nodal areas would therefore be no pressures.

    Args:
        facets: Indices of the nodes of f facets, shape (f, a).
        forces: Forces on the m nodes against their normals, shape (m,) [N].
        areas: Areas of the facets, shape (f,) [m2].

    Returns:
        Pressures, shape (m,) [Pa].
    """
    count = np.bincount(facets.ravel(), minlength=len(forces))
    each = (forces / np.maximum(count, 1))[facets].sum(axis=1)

    def spread(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(facets.ravel(), np.repeat(values, facets.shape[1]), len(forces)), dtype=float)

    return np.asarray(spread(each) / np.maximum(spread(areas), np.finfo(float).tiny))


def _is_uneven(fields: CoverFields) -> bool:
    """Return whether the largest stresses of a cover's layers differ too much for a linear scale of colours."""
    stress = fields.von_mises
    largest = [stress[np.unique(fields.cells[fields.layer == layer])].max() for layer in np.unique(fields.layer)]
    return bool(max(largest) > _NUMBERS.uneven * min(largest))


def _revolve(fields: CoverFields) -> CoverFields:
    """Revolve the fields of an axisymmetric solution by a full turn about its axis, and return them on hexahedra."""
    axis = fields.position[np.argmin(fields.position[:, 0])] * [1.0, 1.0, 0.0]
    angles = np.linspace(0.0, 2 * np.pi, 2 * _NUMBERS.turn + 1)
    turn = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_matrix()
    count = len(fields.position)
    start = count * np.arange(len(angles) - 1)[:, None, None]
    cells = np.concatenate([fields.cells[None] + start, fields.cells[None] + start + count], axis=2)
    return replace(
        fields,
        position=np.einsum("aij,nj->ani", turn, fields.position - axis).reshape(-1, 3) + axis,
        displacement=np.einsum("aij,nj->ani", turn, fields.displacement).reshape(-1, 3),
        stress=np.einsum("aij,njk,alk->anil", turn, fields.stress, turn).reshape(-1, 3, 3),
        cells=cells.reshape(-1, 8),
        layer=np.tile(fields.layer, len(angles) - 1),
        axisymmetric=False,
    )
