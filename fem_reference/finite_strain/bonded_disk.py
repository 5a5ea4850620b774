"""Rubber disks squeezed between two bonded rigid plates, at finite strain: a mount, a pad, a test of the elements.

`closed_form.bonded_disk` is the small-strain limit for incompressible rubber.  Where plate and free edge meet, real
rubber rolls onto the plate from the first; here it passes beside it, so elements much smaller than those of `GRIDS`
fold over there at the larger strains, and the paths on them end early.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem_reference.elements.scaling import Units
from fem_reference.elements.taylor_hood import prepare_elements
from fem_reference.errors import ConvergenceError
from fem_reference.finite_strain.hyperelastic import InvertedError, Solid
from fem_reference.grid_convergence import grid_convergence
from fem_reference.linear_response.axisymmetric import mesh_cover
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover, Layer, Material

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Elements through half the height on the three grids; the last one is the answer.
GRIDS = (4, 6, 9)
#: Order of convergence that the corner allows at small strain: twice its exponent, see `closed_form.bonded_disk`.
_ORDER = 1.19
#: A node this close to a boundary lies on it, in half heights [-].
_TOUCH = 1e-9
_ITERATIONS = 16
#: Residuals relative to the plate's largest nodal force, and to a pressure unknown's share of the volume.
_TIGHT = 1e-8
#: Shortest step, relative to the travel wanted.
_SMALLEST = 1 / 256


@dataclass(frozen=True, kw_only=True, eq=False)
class Squeezed:
    """A disk at several compressions.

    Attributes:
        strain: Shortening over height, shape (n,) [-].
        force: Force on the plates, shape (n,) [N].
        energy: Stored energy, shape (n,) [J].
        error_estimate: Estimated relative error of each force, from three grids, shape (n,) [-].
    """

    strain: FloatArray
    force: FloatArray
    energy: FloatArray
    error_estimate: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Disk:
    """Half a disk on a mesh, in half heights and shear moduli; z = 0 is its middle, the plate is at z = 1.

    Attributes:
        solid: Elements and material.
        held: Unknowns that are prescribed.
        plate: Those of them that move with the plate.
    """

    solid: Solid
    held: IntArray
    plate: IntArray

    @classmethod
    def of(cls, material: Material, radius: float, count: int) -> Disk:
        """A disk of `radius` half heights with `count` elements through half the height."""
        unit = Cover(layers=(Layer(thickness=1.0, material=material),))
        mesh, _ = mesh_cover(unit, count, np.linspace(0, radius, max(2, round(radius * count)) + 1))
        elements = prepare_elements(mesh, axisymmetric=True)
        r, z = elements.nodes.T
        top, middle = np.flatnonzero(z > 1 - _TOUCH), np.flatnonzero(z < _TOUCH)
        across = np.concatenate([np.flatnonzero(r < _TOUCH), top])
        return cls(
            solid=Solid.of_cover(elements, unit, Units.of(unit)),
            held=np.unique(np.concatenate([2 * across, 2 * middle + 1, 2 * top + 1])),
            plate=2 * top + 1,
        )

    def squeeze(self, travels: Sequence[float]) -> list[tuple[FloatArray, float]]:
        """State and force at ascending travels of the plate.

        Raises:
            ConvergenceError: If a step fails even when halved repeatedly.
        """
        size = self.solid.elements.displacements + self.solid.elements.pressures
        here, done, step, force, system = np.zeros(size), 0.0, travels[0], 0.0, None
        out: list[tuple[FloatArray, float]] = []
        for travel in travels:
            while done < travel:
                aim = travel if travel - done <= 1.3 * step else done + step
                try:
                    here, force, system = self._newton(here, aim - done, system)
                except (InvertedError, ConvergenceError, np.linalg.LinAlgError) as error:
                    step, system = (aim - done) / 2, None
                    if step < travel * _SMALLEST:
                        raise ConvergenceError(f"no convergence beyond a compression of {done:.3g}: {error}") from error
                    continue
                done, step = aim, 2 * step
            out.append((here, force))
        return out

    def _newton(
        self, start: FloatArray, further: float, system: ConstrainedSystem | None
    ) -> tuple[FloatArray, float, ConstrainedSystem]:
        """Move the plate and balance; the first iteration carries the movement into the disk."""
        state = start.copy()
        moved = np.where(np.isin(self.held, self.plate), -further, 0.0)
        for _ in range(_ITERATIONS):
            residual, tangent = self.solid.linearise(state)
            if system is not None and not moved.any() and self._balanced(residual):
                return state, float(-residual[self.plate].sum()), system
            system = ConstrainedSystem(tangent, self.held, like=system)
            state += system.solve(-residual, moved)
            moved = np.zeros_like(moved)
        raise ConvergenceError(f"Newton's method did not converge in {_ITERATIONS} iterations")

    def _balanced(self, residual: FloatArray) -> bool:
        split = self.solid.elements.displacements
        free = residual.copy()
        free[self.held] = 0
        share = float(self.solid.elements.weight.sum()) / (len(residual) - split)
        forces, volumes = np.abs(free[:split]).max(), np.abs(free[split:]).max()
        return bool(forces < _TIGHT * np.abs(residual[self.plate]).max() and volumes < _TIGHT * share)


def compress_disk(material: Material, *, radius: float, height: float, strains: Sequence[float]) -> Squeezed:
    """Squeeze a disk between bonded rigid plates.

    Args:
        material: Its material; a small-strain one counts as neo-Hookean with the same moduli.
        radius: Radius at rest [m].
        height: Height at rest [m].
        strains: Shortening over height, ascending [-].

    Raises:
        ValueError: If a length is not positive or the strains do not ascend within 0..1.
        ConvergenceError: If the disk cannot be squeezed that far.
    """
    if not (radius > 0 and height > 0):
        raise ValueError(f"a disk needs a positive radius and height, not {radius} m and {height} m")
    wanted = [float(strain) for strain in strains]
    if not wanted or wanted != sorted(set(wanted)) or not 0 < wanted[0] <= wanted[-1] < 1:
        raise ValueError(f"strains must ascend within 0..1, not {wanted}")
    unit, stress = height / 2, material.shear_modulus
    forces, energies = [], []
    for count in GRIDS:
        disk = Disk.of(material, radius / unit, count)
        path = disk.squeeze(wanted)
        forces.append([force for _, force in path])
        energies = [2 * disk.solid.energy(state) for state, _ in path]
    sizes = [1 / count for count in GRIDS]
    spread = [grid_convergence(each, sizes, most=_ORDER) / each[-1] for each in zip(*forces, strict=True)]
    return Squeezed(
        strain=np.array(wanted),
        force=np.array(forces[-1]) * stress * unit**2,
        energy=np.array(energies) * stress * unit**3,
        error_estimate=np.array(spread),
    )
