"""Compress rubber disks between two bonded rigid plates at finite strain, to verify the elements.

`closed_form.bonded_disk` is the small-strain limit for incompressible rubber.  At the corner of plate and free edge,
real rubber bulges and touches the plate, even at small strain.  This model has no contact at the corner; rubber can
move past the edge of the plate.  Elements much smaller than those of `GRIDS` are turned inside out at the corner at
large strains, and the solution on such a grid stops before the last strain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fem_reference.elements.taylor_hood import prepare_elements
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.loading_path import Units
from fem_reference.finite_strain.newton import Equilibrium, Linearisation, is_balanced, solve_newton, walk_to
from fem_reference.grid_convergence import grid_convergence
from fem_reference.linear_response.axisymmetric import mesh_cover
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover, Layer, Material
from meshes.array_types import FloatArray, IntArray

#: Number of elements through half the height on the three grids; the result is that of the finest grid [-].
GRIDS = (4, 6, 9)
#: Largest residual in equilibrium: forces over the largest nodal force on the plate, volume residuals over the volume
#: per pressure unknown [-].
TOLERANCE = 1e-8
#: Order of convergence of the force at small strain: twice the exponent of the singularity at the corner of plate and
#: free edge, see `closed_form.bonded_disk` [-].
_ORDER = 1.19
#: Distance from a boundary of the mesh, over half the height, below which a node counts as on the boundary [-].
_ON_BOUNDARY = 1e-9
#: Largest number of Newton iterations in one step of the plate [-].
_ITERATIONS = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Squeezed:
    """Force and energy of a rubber disk at n compressions.

    Attributes:
        strain: Compression over the undeformed height, shape (n,) [-].
        force: Compressive force on the plates, shape (n,) [N].
        energy: Elastic energy stored in the disk, shape (n,) [J].
        error_estimate: Estimated relative error of each force, from three grids, shape (n,) [-].
    """

    strain: FloatArray
    force: FloatArray
    energy: FloatArray
    error_estimate: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Disk:
    """Meshed upper half of a disk, in units of half the height and of the shear modulus.

    The middle plane of the disk is z = 0 and the plate is at z = 1.

    Attributes:
        solid: Elements and material.
        constrained: Indices of the prescribed displacements.
        plate: Indices of the prescribed displacements that equal that of the plate; the other prescribed displacements
            are zero.
    """

    solid: Solid
    constrained: IntArray
    plate: IntArray

    @classmethod
    def mesh(cls, material: Material, radius: float, count: int) -> Disk:
        """Mesh the upper half of a disk.

        Args:
            material: Material of the disk.
            radius: Radius of the disk over half the height [-].
            count: Number of elements through half the height [-].
        """
        layer = Cover(layers=(Layer(thickness=1.0, material=material),))
        mesh, _ = mesh_cover(layer, count, np.linspace(0, radius, max(2, round(radius * count)) + 1))
        elements = prepare_elements(mesh, axisymmetric=True)
        r, z = elements.nodes.T
        top, middle = np.flatnonzero(z > 1 - _ON_BOUNDARY), np.flatnonzero(z < _ON_BOUNDARY)
        across = np.concatenate([np.flatnonzero(r < _ON_BOUNDARY), top])
        return cls(
            solid=Solid.from_cover(elements, layer, Units.of(layer)),
            constrained=np.unique(np.concatenate([2 * across, 2 * middle + 1, 2 * top + 1])),
            plate=2 * top + 1,
        )

    def compress(self, travels: Sequence[float]) -> list[Equilibrium]:
        """Compress the disk to each of several displacements of the plate.

        Args:
            travels: Displacements of the plate, ascending [half heights].

        Returns:
            The equilibrium at each displacement; `depth` is the displacement and `load` the force of the plate.

        Raises:
            PathConvergenceError: If a step fails even after repeated halving.
        """
        undeformed = np.zeros(self.solid.elements.displacements + self.solid.elements.pressures)
        here = Equilibrium(state=undeformed, depth=0.0, load=0.0, reaction=np.zeros_like(undeformed), iterations=0)
        out = []
        for travel in travels:
            here = walk_to(
                travel,
                here,
                control="depth",
                step=travels[0],
                solve=self._solve,
                describe=lambda reached: f"a compression of {reached.depth:.3g}",
            )
            out.append(here)
        return out

    def _solve(self, _: Equilibrium | None, here: Equilibrium, travel: float) -> Equilibrium:
        """Move the plate to `travel` and solve for equilibrium, with the last equilibrium `here` as initial guess.

        The first Newton iteration moves the nodes on the plate and distributes the displacement over the disk.
        """
        target = np.where(np.isin(self.constrained, self.plate), -travel, 0.0)

        def linearise(state: FloatArray, iteration: int) -> Linearisation[Equilibrium]:
            residual, tangent = self.solid.linearise(state)
            movement = target - state[self.constrained]
            plate_force = residual[self.plate]
            balanced = is_balanced(
                self.solid.elements,
                residual,
                self.constrained,
                reference=np.abs(plate_force).max(),
                tolerance=TOLERANCE,
            )
            equilibrium = Equilibrium(
                state=state,
                depth=travel,
                load=float(-plate_force.sum()),
                reaction=residual,
                iterations=here.iterations + iteration,
            )
            return Linearisation(
                equilibrium=equilibrium if balanced and np.abs(movement).max() < TOLERANCE * travel else None,
                solve=lambda: self._system.factorise(tangent).solve(-residual, movement),
            )

        return solve_newton(linearise, here.state, iterations=_ITERATIONS)

    @cached_property
    def _system(self) -> ConstrainedSystem:
        """Linear system with the displacements on plate, axis and middle plane prescribed."""
        return ConstrainedSystem(self.constrained)


def gent_lindley(shape_factor: float) -> float:
    """Estimate the apparent modulus of a bonded disk over its Young's modulus, 1 + 2 S^2 (Gent and Lindley 1959) [-].

    Args:
        shape_factor: Shape factor S, loaded area over free area, radius / (2 height) [-].
    """
    return 1 + 2 * shape_factor**2


def compress_disk(material: Material, *, radius: float, height: float, strains: Sequence[float]) -> Squeezed:
    """Compress a rubber disk between two bonded rigid plates.

    Args:
        material: Material of the disk; a small-strain model is treated as neo-Hookean with the same moduli.
        radius: Radius of the undeformed disk [m].
        height: Height of the undeformed disk [m].
        strains: Compressions over the undeformed height, ascending, between 0 and 1 [-].

    Raises:
        PathConvergenceError: If Newton's method does not converge at one of the strains.
    """
    unit, stress = height / 2, material.shear_modulus
    disks = [Disk.mesh(material, radius / unit, count) for count in GRIDS]
    paths = [disk.compress(strains) for disk in disks]
    forces = np.array([[reached.load for reached in path] for path in paths])
    sizes = [1 / count for count in GRIDS]
    return Squeezed(
        strain=np.array(strains),
        force=forces[-1] * stress * unit**2,
        energy=np.array([2 * disks[-1].solid.energy(reached.state) for reached in paths[-1]]) * stress * unit**3,
        error_estimate=np.array([grid_convergence(each, sizes, most=_ORDER) / each[-1] for each in forces.T]),
    )
