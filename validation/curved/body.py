"""Body of a curved cover: where its shape comes from, and the meshes that the finite elements solve."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from meshes.array_types import FloatArray
from meshes.solids import SolidMesh, SweptCover
from meshes.solids.shell import Shell
from meshes.solids.solid_mesh import LIMITS, check_quality
from meshes.surfaces.triangles import enclosed_volume

#: Volume of a regular tetrahedron over the cube of its edge [-].
_REGULAR = 1 / (6 * np.sqrt(2))
#: Largest number of tetrahedra that a mesh may be expected to have [-].
_MOST_TETRAHEDRA = 150_000
#: Factor on the element size of a mesh with too few elements through the thickness, as on coarse triangles, and how
#: often it is taken [-].
_SMALLER, _TRIES = 0.85, 3
#: Element size over the thickness and layers of elements of a mesh that is finer than the finest of a result [-].
_FINER, _FINER_LAYERS = 0.3, 6

#: Receives a line of text before each step.
Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverBody:
    """Body of a curved cover.

    Attributes:
        source: What the body is made from, in words.
        thickness: Thickness along the normals of the base, or its mean [m].
        make: Function that makes meshes of a thickness [m], coarsest first, and reports its progress.
        changeable: Whether the body can be made with another thickness.
        notes: Sentences on what was repaired or assumed.
        refine: Function that makes a mesh of a thickness [m] that is finer than all of `make`; None if there is none.
        base: Triangles of the base, facing into the cover, shape (b, 3, 3) [m]; None for the base of the finest mesh.
    """

    source: str
    thickness: float
    make: Callable[[float, Progress], tuple[SolidMesh, ...]]
    changeable: bool = True
    notes: tuple[str, ...] = ()
    refine: Callable[[float], SolidMesh] | None = None
    base: FloatArray | None = None
    _made: dict[float, tuple[SolidMesh, ...]] = field(default_factory=dict, repr=False)

    def meshes(self, progress: Progress | None = None) -> tuple[SolidMesh, ...]:
        """Make the meshes, coarsest first; they are kept for the next call.

        Raises:
            ValueError: If the body cannot be meshed, with one line per fault.
            ModuleNotFoundError: If the mesher is not installed.
        """
        if self.thickness not in self._made:
            self._made[self.thickness] = self.make(self.thickness, progress or (lambda _: None))
        return self._made[self.thickness]

    def with_thickness(self, thickness: float) -> CoverBody:
        """Return the same body with another thickness [m].

        Raises:
            ValueError: If the thickness follows from the given surfaces.
        """
        if thickness == self.thickness:
            return self
        if not self.changeable:
            raise ValueError(f"the thickness follows from {self.source}; leave it out")
        return replace(self, thickness=thickness)


def make_swept_body(cover: SweptCover, source: str) -> CoverBody:
    """Make the body of a cover that is swept from its base."""
    return CoverBody(
        source=source, thickness=cover.thickness, make=partial(_sweep, cover), refine=partial(_refine, cover)
    )


def _sweep(cover: SweptCover, thickness: float, progress: Progress) -> tuple[SolidMesh, ...]:
    progress("hexahedra swept from the base")
    return replace(cover, thickness=thickness).meshes()


def _refine(cover: SweptCover, thickness: float) -> SolidMesh:
    return replace(cover, thickness=thickness).mesh(_FINER * thickness, layers=_FINER_LAYERS)


def mesh_shell(
    shell: Shell, source: str, sizes: tuple[float, ...], _: float, progress: Progress
) -> tuple[SolidMesh, ...]:
    """Fill a shell with tetrahedra of several sizes, coarsest first, or take the meshes from the store of results.

    The mesher gives another mesh at every call, so that the store keeps the mesh for later runs.

    Raises:
        ValueError: If the mesher fails, or the elements would be too many.
        ModuleNotFoundError: If pytetwild is not installed.
    """
    meshes = []
    for wanted in sizes:
        size = wanted
        mesh = _fill(shell, source, size, progress)
        for _try in range(_TRIES):
            if check_quality(mesh).through >= LIMITS.through:
                break
            size *= _SMALLER
            mesh = _fill(shell, source, size, progress)
        meshes.append(mesh)
    # On strongly curved surfaces the envelope sets the size of the elements, and the order of their numbers is chance.
    by_count = {len(mesh.cells): mesh for mesh in meshes}
    return tuple(by_count[count] for count in sorted(by_count))


def _fill(shell: Shell, source: str, size: float, progress: Progress) -> SolidMesh:
    """Fill a shell with tetrahedra of one size [m], or take the mesh from the store of results."""
    from fem_reference import result_store
    from meshes.solids.tetrahedra import fill_with_tetrahedra

    expected = enclosed_volume(shell.surface) / (_REGULAR * size**3)
    if expected > _MOST_TETRAHEDRA:
        raise ValueError(
            f"cover.element_size: {1e3 * size:.3g} mm would make {expected:.0f} tetrahedra, more than "
            f"{_MOST_TETRAHEDRA}; take larger elements"
        )

    def compute() -> dict[str, object]:
        progress(f"tetrahedra of {1e3 * size:.3g} mm")
        mesh = fill_with_tetrahedra(shell.surface, shell.base, size, name=source, crossings=not shell.is_folded)
        arrays = {name: getattr(mesh, name) for name in ("nodes", "cells", "base", "top", "sides")}
        return {**arrays, "settings": np.array(json.dumps(dict(mesh.settings)))}

    found = result_store.fetch("cover-mesh", {"surface": shell.surface, "base": shell.base, "size": size}, compute)
    return SolidMesh(
        nodes=found["nodes"].astype(float),
        **{name: found[name].astype(np.int64) for name in ("cells", "base", "top", "sides")},
        source=f"tetrahedra in {source}",
        settings=json.loads(str(found["settings"])),
    )
