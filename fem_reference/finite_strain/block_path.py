"""Solve a loading path on a block of hexahedra, together with its baseline at small strain without friction.

A block is the part of a cover that is meshed in three dimensions.  On a wide cover the block is fixed in the frame of
the indenter, and one solution is valid for all poses of the indenter.  A cover of limited size is meshed whole, in the
frame of the array, and solved for every pose.  If the problem is symmetric about x = 0 or y = 0, only the half or
quarter at positive coordinates is meshed.  Loading path and baseline have nearly the same discretisation error, which
cancels in their difference (a control variate).  The difference is the effect of finite strain and friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline

from fem_reference.elements.grading import ON_BOUNDARY, fill_by_spacing, grade_contact, layer_heights
from fem_reference.elements.line import Line, gauss_points, recover_pressure
from fem_reference.elements.taylor_hood import MixedElements, mesh_layers, prepare_elements
from fem_reference.fields.cover_fields import recover_fields
from fem_reference.finite_strain.axisymmetric_path import FIRST_DEPTH, PENALTY
from fem_reference.finite_strain.contact import SurfaceContact, collect_points, unfold_points
from fem_reference.finite_strain.contact_problem import ContactEquilibrium, ContactProblem, Guess, transfer_state
from fem_reference.finite_strain.hyperelastic import SmallStrainSolid, Solid
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import LoadingPath, Progress
from fem_reference.indentation.grid_solution import Base, GridSolution
from fem_reference.small_strain_contact.free_edges import find_mirror_planes
from meshes import Cover, FlatPunch, TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.pose import Pose


@dataclass(frozen=True, kw_only=True)
class BlockSettings:
    """Constants of loading paths that are solved on a block of hexahedra, the meshed part of a cover."""

    #: Element size at the edge of a rectangular flat face, over the radius of the rounded edge [-].  The edges of such
    #: a face lie on mesh lines.
    on_line_element: float = 0.6
    #: Element size everywhere under a flat face that is not rectangular, over the radius of the rounded edge [-].  The
    #: edges of such a face do not lie on mesh lines.
    off_line_element: float = 1.3
    #: Element size at the edge of the contact under a curved indenter, over the regular size, which follows from the
    #: number of elements through the cover [-].
    edge_element: float = 0.5
    #: Largest element size in the contact, over the regular size, which follows from the number of elements through the
    #: cover [-].
    largest_element: float = 1.2
    #: Largest element size at the sides of a cover of limited size over the regular size [-].
    side_element: float = 1.5
    #: Increase of the element size per distance from the edge of the contact and from the sides of a cover of limited
    #: size [-].
    growth: float = 0.4
    #: Distance between the edge of the contact and a side of the cover, over half the width of the cover, below which
    #: the edge of the contact lies on the side [-].
    on_side: float = 1e-9
    #: Number of samples of the element size between two fixed element edges [-].
    samples: int = 801
    #: Largest number of equal elements along half a footprint, per element through the cover, to limit the memory [-].
    most_elements: int = 6
    #: Smallest number of elements through each layer [-].
    layer_elements: int = 2
    #: Distance from the outline of a flat punch, over its smaller half width, below which a point counts as on the
    #: outline [-].
    on_outline: float = 1e-6
    #: Mean penetration over depth below which augmentation stops, without friction [-].  Most of the effect of the
    #: penetration cancels in the difference from the baseline.
    overlap: float = 2e-3
    #: Mean penetration over depth below which augmentation stops, with friction [-].  The baseline has no friction, so
    #: that less of the effect of the penetration cancels.
    friction_overlap: float = 5e-4
    #: Gap between indenter and cover, over the depth, below which a node counts as in contact [-].
    closed: float = 0.01
    #: Number of Gauss points along each side of a texel, for the integral of the base pressure [-].
    texel_points: int = 16


_SETTINGS = BlockSettings()


@dataclass(frozen=True, kw_only=True, eq=False)
class _GridBase(Base):
    """Base pressure at the points of a grid.

    Attributes:
        x: Positions along x in the frame of the mesh, ascending, shape (m,) [m].
        y: Positions along y, shape (n,) [m].
        pressure: Pressure at the grid points, shape (m, n) [Pa].
    """

    x: FloatArray
    y: FloatArray
    pressure: FloatArray


class NodalBase(_GridBase):
    """Base pressure of a solution, given at the nodes of the base.

    The pressure is the biquadratic field whose nodal forces are the base reactions.

    The frame of the mesh is that of the array.
    """

    def forces(self, array: TexelArray, pose: Pose) -> FloatArray:  # noqa: ARG002 -- solved for one pose
        """Integrate the pressure over the texels and over the rest of the base, see `Base.forces`."""
        integrals, whole = [], []
        for axis, nodes in enumerate((self.x, self.y)):
            line = Line(edges=nodes[::2], order=2)
            centres, half = array.centres[:, axis], array.texel_size[axis] / 2
            values, position = np.unique(centres, return_inverse=True)
            integrals.append(np.array([line.integral(c - half, c + half) for c in values])[position])
            whole.append(line.integral(nodes[0], nodes[-1]))
        force = np.where(array.active, np.einsum("na,nb,ab->n", *integrals, self.pressure, optimize=True), 0.0)
        return np.append(force, whole[0] @ self.pressure @ whole[1] - force.sum())


class GaussBase(_GridBase):
    """Base pressure of a solution, given at the two Gauss points per element along x and y, where its error vanishes.

    The frame of the mesh is that of the indenter.
    """

    def forces(self, array: TexelArray, pose: Pose) -> FloatArray:
        """Integrate a spline of the pressure over the texels and over the rest of the base, see `Base.forces`."""
        nodes, weights = np.polynomial.legendre.leggauss(_SETTINGS.texel_points)
        half = np.array(array.texel_size) / 2
        offset = np.stack(np.meshgrid(nodes * half[0], nodes * half[1]), axis=-1).reshape(-1, 2)
        position = array.centres[:, None, :2] + offset
        x, y = pose.to_indenter(position[..., 0], position[..., 1])
        inside = (x > self.x[0]) & (x < self.x[-1]) & (y > self.y[0]) & (y < self.y[-1])
        spline = RectBivariateSpline(self.x, self.y, self.pressure)
        value = np.where(inside, spline.ev(x, y), 0.0)
        force = np.where(array.active, value @ np.outer(weights, weights).ravel() * half[0] * half[1], 0.0)
        return np.append(force, spline.integral(self.x[0], self.x[-1], self.y[0], self.y[-1]) - force.sum())


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockReactions:
    """Contact and base reactions of the meshed part of a cover.

    Attributes:
        lines: Positions of the base nodes along x, shape (m,), and along y, shape (n,) [m].
        forces: Normal reactions of the base at these nodes, shape (m, n) [N].
        contact: Points of the contact in the frame of the mesh, see `collect_points`, shape (k, 5).
        symmetric: Whether x = 0 and y = 0 are planes of symmetry; the mesh then ends at the plane.
        pose: Pose of the indenter in the frame of the mesh.
        free: Whether the whole cover is meshed, with free side faces, in the frame of the array.
        order: Polynomial order of the elements [-].
    """

    lines: Sequence[FloatArray]
    forces: FloatArray
    contact: FloatArray
    symmetric: tuple[bool, bool]
    pose: Pose
    free: bool
    order: int = 2

    def describe(self, *, rubs: bool, **numbers: Any) -> GridSolution:  # noqa: ANN401 -- of `GridSolution`
        """Return the solution for the whole cover.

        Args:
            rubs: Whether the solution includes shear forces.
            numbers: Further attributes of `GridSolution` by name.
        """
        x, y, normal, *shear = unfold_points(self.contact, self.symmetric).T
        turn = replace(self.pose, point=(0.0, 0.0, 0.0))
        return GridSolution(
            contact=np.column_stack([*self.pose.to_indenter(x, y), normal]),
            shear=np.column_stack(turn.to_indenter(*shear)) if rubs else None,
            base=self.recover_base(),
            **numbers,
        )

    def recover_base(self) -> NodalBase | GaussBase:
        """Compute the pressure on the whole base from its reactions."""
        lines = [Line(edges=nodes[:: self.order], order=self.order) for nodes in self.lines]
        nodal = self.free and self.order == 2  # noqa: PLR2004 -- the pressure at nodes is quadratic between them
        places, values = list(self.lines), recover_pressure(lines, self.forces)
        if not nodal:
            places = [gauss_points(line.edges, 2)[0] for line in lines]
            values = lines[0].at(places[0]) @ values @ lines[1].at(places[1]).T
        for axis, mirror in enumerate(self.symmetric):
            # Points on a plane of symmetry are not repeated.
            if mirror:
                first = int(places[axis][0] == 0)
                image = np.flip(np.delete(values, slice(first), axis), axis)
                places[axis] = np.concatenate([-places[axis][first:][::-1], places[axis]])
                values = np.concatenate([image, values], axis)
        return (NodalBase if nodal else GaussBase)(x=places[0], y=places[1], pressure=values)


@dataclass(frozen=True, kw_only=True, eq=False)
class Block:
    """Part of a cover that is meshed, with lengths in units of the cover thickness.

    Attributes:
        sides: Element edges along x and along y, ascending.
        symmetric: Whether x = 0 and y = 0 are planes of symmetry, at which `sides` start.
        size: Element size under the contact.
        surface: Surface of the indenter.
        free: Whether the side faces are free; otherwise all displacements are zero on the side faces.
    """

    sides: Sequence[FloatArray]
    symmetric: tuple[bool, bool]
    size: float
    surface: IndenterSurface
    free: bool = False

    @property
    def multiple(self) -> float:
        """Force on the whole indenter over the force on the meshed part: 1, 2 or 4 [-]."""
        return float((1 + self.symmetric[0]) * (1 + self.symmetric[1]))

    @property
    def lines(self) -> list[Line]:
        """Quadratic line elements along x and along y [thicknesses]."""
        return [Line(edges=side, order=2) for side in self.sides]

    def find_nodes(self, x: FloatArray, y: FloatArray) -> tuple[IntArray, IntArray]:
        """Find the indices along x and along y of nodes at given places.

        Coordinates of nodes on one mesh line differ by rounding; each node is assigned to the nearest line.

        Args:
            x: x coordinates of the nodes, shape (n,) [thicknesses].
            y: y coordinates of the nodes, shape (n,) [thicknesses].

        Returns:
            Indices along x and along y, shape (n,) each.
        """
        along_x, along_y = (
            np.searchsorted((line.nodes[1:] + line.nodes[:-1]) / 2, each)
            for line, each in zip(self.lines, (x, y), strict=True)
        )
        return along_x, along_y


def lay_out_block(
    path: LoadingPath, *, elements_per_thickness: int, contact_half: tuple[float, float], fillet: float, reach: float
) -> Block:
    """Choose extent, symmetry and element sizes of the block under an indenter on a wide cover.

    Args:
        path: Loading path with cover and indenter.
        elements_per_thickness: Number of elements through the cover [-].
        contact_half: Half widths of the largest contact along x and y, within which elements are small [m].
        fillet: Radius of rounded edges of the indenter [m].
        reach: Distance from the contact to the outer boundary of the block [m].
    """
    indenter = path.indenter
    symmetric = indenter.mirror_symmetry
    unit = path.units.length
    fillet, reach, *halves = (value / unit for value in (fillet, reach, *contact_half))
    size = min(1.0, 2 * min(halves)) / elements_per_thickness
    fine = _SETTINGS.on_line_element * fillet if isinstance(indenter, FlatPunch) else _SETTINGS.edge_element * size
    most = _SETTINGS.largest_element * size
    if isinstance(indenter, FlatPunch) and not is_rectangular(indenter):
        finest = max(half / (1 if mirror else 0.5) for half, mirror in zip(halves, symmetric, strict=True))
        finest /= _SETTINGS.most_elements * elements_per_thickness
        fine = most = max(min(size, _SETTINGS.off_line_element * fillet), finest)
    sides = [grade_contact(half, reach, fine=fine, most=most) for half in halves]
    return Block(
        sides=[x if mirror else np.concatenate([-x[:0:-1], x]) for x, mirror in zip(sides, symmetric, strict=True)],
        symmetric=symmetric,
        size=size,
        surface=IndenterSurface(indenter=indenter, fillet=fillet, unit=unit),
    )


def lay_out_cover(
    path: LoadingPath, pose: Pose, contact: FloatArray, *, elements_per_thickness: int, fillet: float
) -> Block:
    """Choose the element edges of the whole cover, or of its half or quarter, with small elements around the contact.

    Args:
        path: Cover, indenter and targets.
        pose: Pose of the indenter in the frame of the array.
        contact: m points whose bounding rectangle contains the contact, in the frame of the indenter, shape (m, 2) [m].
        elements_per_thickness: Number of elements through the cover [-].
        fillet: Radius of rounded edges of the indenter [m].
    """
    cover, indenter = path.cover, path.indenter
    unit = path.units.length
    placed = np.stack(pose.to_array(*contact.T)) / unit
    ends = np.array(cover.size) / 2 / unit
    low, high = np.maximum(placed.min(axis=1), -ends), np.minimum(placed.max(axis=1), ends)
    size = min(1.0, float((high - low).min())) / elements_per_thickness
    edge_on_line = isinstance(indenter, FlatPunch) and pose.is_aligned and not indenter.axisymmetric
    fine = _SETTINGS.on_line_element * fillet / unit if edge_on_line else _SETTINGS.edge_element * size
    symmetric = find_mirror_planes(indenter, pose)
    sides = [
        _grade_side((low[i], high[i]), float(ends[i]), fine=fine, coarse=size, symmetric=symmetric[i]) for i in (0, 1)
    ]
    surface = IndenterSurface(indenter=indenter, fillet=fillet / unit, unit=unit, pose=pose)
    return Block(sides=sides, symmetric=symmetric, size=size, surface=surface, free=True)


def _grade_side(contact: tuple[float, float], end: float, *, fine: float, coarse: float, symmetric: bool) -> FloatArray:
    """Place element edges along one direction, with the smallest elements at the edges of the contact.

    Lengths may have any unit.

    Args:
        contact: Lower and upper edge of the contact; both become element edges unless they lie on a side.
        end: Distance of the sides of the cover from its middle.
        fine: Element size at the edges of the contact.
        coarse: Regular element size, to which the largest elements in the contact and at the sides are proportional.
        symmetric: Whether only the part from the middle to the upper side is meshed.
    """
    (low, high), growth = contact, _SETTINGS.growth
    marks = [value for value in contact if abs(value) < end * (1 - _SETTINGS.on_side)]
    ends = [0.0 if symmetric else -end, *(mark for mark in marks if not symmetric or mark > 0), end]
    parts = [np.array(ends[:1])]
    for start, stop in pairwise(ends):
        x = np.linspace(start, stop, _SETTINGS.samples)
        from_edge = np.min([np.abs(x - mark) for mark in marks], axis=0) if marks else np.full_like(x, np.inf)
        from_contact = np.maximum(np.maximum(low - x, x - high), 0)
        from_side = np.minimum(end - x, end + x)
        largest = np.minimum(
            _SETTINGS.largest_element * coarse + growth * from_contact,
            _SETTINGS.side_element * coarse + growth * from_side,
        )
        parts.append(fill_by_spacing(x, np.minimum(fine + growth * from_edge, largest))[1:])
    return np.concatenate(parts)


def mesh_block(block: Block, cover: Cover, elements_per_thickness: int) -> MixedElements:
    """Mesh a block of the cover with hexahedra; the region number of an element is the index of its layer.

    Args:
        block: Extent of the block and element edges along x and y.
        cover: Cover with all lengths divided by its thickness.
        elements_per_thickness: Number of elements through the cover; each layer gets at least two [-].
    """
    counts = [max(_SETTINGS.layer_elements, round(layer.thickness * elements_per_thickness)) for layer in cover.layers]
    heights, layer = layer_heights([each.thickness for each in cover.layers], counts, surface_size=block.size)
    mesh, region = mesh_layers(block.sides, heights, layer)
    return prepare_elements(mesh, region=region)


def find_constrained(block: Block, elements: MixedElements, *, bonded: bool) -> IntArray:
    """Return the indices of the displacements of a meshed block that are zero, see `mark_constrained`."""
    components = mark_constrained(
        list(elements.nodes.T), [side[[0, -1]] for side in block.sides], block.symmetric, bonded=bonded, free=block.free
    )
    return np.concatenate([3 * np.flatnonzero(nodes) + i for i, nodes in enumerate(components)])


def mark_constrained(
    nodes: Sequence[FloatArray],
    ends: Sequence[FloatArray],
    symmetric: tuple[bool, bool],
    *,
    bonded: bool,
    free: bool,
) -> list[BoolArray]:
    """Mark the displacements of the meshed part of a cover that are zero.

    On a bonded base all components are zero, on a sliding base the normal component, and on planes of symmetry the
    normal component.  On an outer boundary that is not free, all components are zero above a bonded base.  Above a
    sliding base only the component normal to the boundary is zero, because fixing the others would load the base.

    Args:
        nodes: Coordinates x, y and z of the nodes, any shape [thicknesses].
        ends: Lowest and highest coordinate of the mesh along x and along y, shape (2,) each [thicknesses].
        symmetric: Whether x = 0 and y = 0 are planes of symmetry, at which the mesh starts.
        bonded: Whether the base holds all components.
        free: Whether the outer boundary is free.

    Returns:
        Whether each of the components x, y and z is zero at each node, shape of the coordinates.
    """
    base = nodes[2] < ON_BOUNDARY
    planes, sides = [], []
    for position, (low, high), mirror in zip(nodes[:2], ends, symmetric, strict=True):
        start = position < low + ON_BOUNDARY
        planes.append(start & mirror)
        sides.append(((position > high - ON_BOUNDARY) | (start & (not mirror))) & (not free))
    outer = (sides[0] | sides[1]) & bonded
    held = base & bonded
    return [sides[0] | planes[0] | outer | held, sides[1] | planes[1] | outer | held, base | outer]


def describe_state(
    path: LoadingPath, solid: Solid | SmallStrainSolid, reached: ContactEquilibrium, block: Block
) -> GridSolution:
    """Convert the equilibrium of a block at one target to a solution of the whole cover in SI units."""
    units, scale = path.units, path.load_scale
    x, y, z = solid.elements.nodes.T
    base = np.flatnonzero(z < ON_BOUNDARY)
    lines = [line.nodes for line in block.lines]
    forces = np.zeros((len(lines[0]), len(lines[1])))
    forces[block.find_nodes(x[base], y[base])] = reached.reaction[3 * base + 2]
    force = units.force / scale
    return BlockReactions(
        lines=[line * units.length for line in lines],
        forces=forces * force,
        contact=collect_points(reached.contact) * np.repeat([units.length, force], [2, 3]),
        symmetric=block.symmetric,
        pose=block.surface.pose,
        free=block.free,
    ).describe(
        rubs=path.friction > 0,
        size=block.size,
        total_force=reached.load * force,
        depth=reached.depth * units.length / scale,
        area=reached.contact.area * units.length**2,
        overlap=reached.contact.overlap / reached.depth,
        energy=solid.energy(reached.state) * block.multiple * units.force * units.length / scale**2,
    )


def is_rectangular(shape: FlatPunch) -> bool:
    """Return whether the face of a flat punch is a rectangle along x and y, so that its outline lies on mesh lines."""
    half = np.array(shape.footprint)
    corners = half * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    filled = (
        abs(float(shape.signed_distance(np.zeros(1), np.zeros(1))[0]) - half.min()) < _SETTINGS.on_outline * half.min()
    )
    return filled and bool((np.abs(shape.signed_distance(*corners.T)) < _SETTINGS.on_outline * half.min()).all())


#: Smallest number of steps of a loading path with friction, over the number of elements through the cover [-].  The
#: error of the steps then decreases with the element size, and the differences between grids include both errors.
FRICTION_STEPS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class PairedPath:
    """Equilibria of a loading path and of its baseline on one grid.

    Attributes:
        elements: Elements of the grid.
        baseline: Equilibrium at every target, at small strain without friction.
        full: Equilibrium at every target with the strain and friction of the loading path.
        ratio: Load scale of `full` over that of `baseline` [-].
    """

    elements: MixedElements
    baseline: Sequence[ContactEquilibrium]
    full: Sequence[ContactEquilibrium]
    ratio: float

    def transfer_changes(self, target: MixedElements) -> list[Guess]:
        """Interpolate the differences `full` - `ratio` * `baseline` at every target to the elements of another grid."""
        out = []
        for small, large in zip(self.baseline, self.full, strict=True):
            baseline, full = small.penalty_solution, large.penalty_solution
            change = transfer_state(self.elements, target, full.state - self.ratio * baseline.state)
            out.append(Guess(state=change, depth=full.depth - self.ratio * baseline.depth))
        return out


def press_paired(
    path: LoadingPath,
    block: Block,
    approaches: Sequence[float],
    *,
    elements_per_thickness: int,
    coarser: PairedPath | None = None,
    progress: Progress = None,
) -> tuple[list[GridSolution], list[GridSolution], PairedPath]:
    """Solve one loading path and its baseline on one grid.

    The initial guess of the baseline at each target is the undeformed state at the given depth.  The initial guess of
    the full solution is the scaled baseline plus the difference found on a coarser grid.  Targets are reached in steps
    where these guesses fail, and always with friction, because slip depends on the loading history.

    Args:
        path: Cover, indenter, targets and friction.
        block: Part of the cover that is meshed.
        approaches: Small-strain depth at each target [m].
        elements_per_thickness: Number of elements through the cover [-].
        coarser: Solutions on a coarser grid; None on the coarsest.
        progress: Called with a line of text after each step.

    Returns:
        Solutions of the baseline at every target, full solutions at every target, and the equilibria of both as initial
        guesses for a finer grid.

    Raises:
        PathConvergenceError: If a path stops before its last target.
    """
    units = path.units
    elements = mesh_block(block, units.scale_cover(path.cover), elements_per_thickness)
    solid = Solid.from_cover(elements, path.cover, units)
    small_strain_solid = solid.linearise_at_rest()
    scale = path.baseline.load_scale
    undeformed = np.zeros(elements.displacements + elements.pressures)
    guesses = [Guess(state=undeformed, depth=scale * depth / units.length) for depth in approaches]
    tell = None if progress is None else lambda text: progress(f"small strain, {text}")
    baseline = _follow(path.baseline, block, small_strain_solid, guesses, tell, friction_steps=0)
    ratio = path.load_scale / scale
    guesses = []
    if not path.friction:  # The guess is the scaled baseline plus the change found on the coarser grid.
        solutions = [each.penalty_solution for each in baseline]
        scaled = [Guess(state=ratio * each.state, depth=ratio * each.depth) for each in solutions]
        no_change = Guess(state=np.zeros_like(undeformed), depth=0.0)
        changes = [no_change] * len(scaled) if coarser is None else coarser.transfer_changes(elements)
        surface = replace(block.surface, load_scale=path.load_scale)
        guesses = [add_change(*each, elements, surface) for each in zip(scaled, changes, strict=True)]
    full_solid = small_strain_solid if path.load_scale == scale else solid
    full = _follow(path, block, full_solid, guesses, progress, friction_steps=FRICTION_STEPS * elements_per_thickness)
    before = [describe_state(path.baseline, small_strain_solid, each, block) for each in baseline]
    after = [describe_state(path, full_solid, each, block) for each in full]
    if path.fields:
        linear = path.load_scale != 1
        states = [
            recover_fields(solid, each.state, units, load_scale=path.load_scale, linear=linear).unfold(block.symmetric)
            for each in full
        ]
        after = [replace(each, fields=fields) for each, fields in zip(after, states, strict=True)]
    return before, after, PairedPath(elements=elements, baseline=baseline, full=full, ratio=ratio)


def add_change(baseline: Guess, change: Guess, elements: MixedElements, surface: IndenterSurface) -> Guess:
    """Add a change to a small-strain solution without changing the gaps of the nodes in contact.

    At small strain the gap of a node is measured above its undeformed position, at finite strain above its deformed
    position.  Nodes in contact are moved vertically until the second gap equals the first gap, because the penalty
    method turns any false penetration into a large force.

    Args:
        baseline: Solution at small strain, scaled to the load of the full loading path.
        change: Displacements, pressures and depth to add.
        elements: Elements of the mesh of `baseline` and `change`.
        surface: Surface of the indenter with the heights of the full loading path.
    """
    state, depth = baseline.state + change.state, baseline.depth + change.depth
    top = np.flatnonzero(elements.nodes[:, 2] > 1 - ON_BOUNDARY)
    x, y, _ = elements.nodes[top].T
    gap = surface.height(x, y) - baseline.depth - baseline.state[3 * top + 2]
    closed = gap < _SETTINGS.closed * baseline.depth
    top, gap = top[closed], gap[closed]
    moved = elements.nodes[top, :2] + np.column_stack([state[3 * top], state[3 * top + 1]])
    state[3 * top + 2] = surface.height(*moved.T) - depth - gap
    return Guess(state=state, depth=depth)


def _follow(
    path: LoadingPath,
    block: Block,
    solid: Solid | SmallStrainSolid,
    guesses: Sequence[Guess],
    progress: Progress,
    *,
    friction_steps: int,
) -> list[ContactEquilibrium]:
    """Solve a loading path on a meshed solid and return the equilibrium at every target."""
    problem = ContactProblem(
        solid=solid,
        contact=SurfaceContact(
            solid.elements,
            1.0,
            replace(block.surface, load_scale=path.load_scale),
            penalty=PENALTY / block.size,
            multiple=block.multiple,
            friction=path.friction,
        ),
        constrained=find_constrained(block, solid.elements, bonded=path.cover.base == "bonded"),
        units=path.units,
        load_scale=path.load_scale,
        overlap=_SETTINGS.friction_overlap if path.friction else _SETTINGS.overlap,
        friction_steps=friction_steps,
    )
    first = FIRST_DEPTH * path.load_scale
    return problem.follow(path.scaled_targets, control=path.control, first=first, guesses=guesses, progress=progress)
