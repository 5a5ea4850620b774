"""Solid covers with the meshes that finite elements solve: swept from a base, or tetrahedra in a closed shell."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from meshes.cover import Layer, SolidCover
from meshes.material import Material
from meshes.solids.shell import Shell
from meshes.solids.solid_mesh import ARRAYS, LIMITS, SolidMesh, check_quality, measure_thickness
from meshes.solids.swept import SweptCover
from meshes.surfaces.triangles import enclosed_volume

#: Volume of a regular tetrahedron over the cube of its edge [-].
_REGULAR = 1 / (6 * np.sqrt(2))
#: Largest expected number of tetrahedra of a mesh [-].  More are refused before the mesher starts.
_MOST_TETRAHEDRA = 150_000
#: Factor by which the element size is reduced if a mesh has too few elements through the thickness [-].
_SMALLER = 0.85
#: Largest number of reductions of the element size if a mesh has too few elements through the thickness [-].
_TRIES = 3
#: Element size of the mesh of `SolidCover.refine`, over the thickness [-].  This mesh is finer than the meshes of all
#: results and verifies them.
_FINER = 0.3
#: Number of layers of elements of the mesh of `SolidCover.refine` [-].
_FINER_LAYERS = 6

#: Function that receives a line of text before each step.
Progress = Callable[[str], None]
#: Function of some inputs and of a function that computes arrays from them.  It returns the arrays that an earlier call
#: with the same inputs stored, or computes and stores them.
Keep = Callable[[Mapping[str, Any], Callable[[], Mapping[str, Any]]], Mapping[str, Any]]


def make_swept_cover(swept: SweptCover, material: Material, source: str, *, assumed: bool = False) -> SolidCover:
    """Make a cover of hexahedra that are swept from its base.

    Args:
        swept: Base and thickness.
        material: Material of the cover.
        source: Origin of the cover, in words.
        assumed: Whether thickness and material were never measured.
    """

    def make(thickness: float, progress: Progress) -> tuple[SolidMesh, ...]:
        progress("hexahedra swept from the base")
        return replace(swept, thickness=thickness).meshes()

    def refine(thickness: float) -> SolidMesh:
        return replace(swept, thickness=thickness).mesh(_FINER * thickness, layers=_FINER_LAYERS)

    layer = Layer(thickness=swept.thickness, material=material)
    return SolidCover(layers=(layer,), source=source, make=make, refine=refine, assumed=assumed)


def make_shell_cover(shell: Shell, material: Material, source: str, sizes: tuple[float, ...], keep: Keep) -> SolidCover:
    """Make a cover of tetrahedra in a closed surface.

    Args:
        shell: The closed surface.
        material: Material of the cover.
        source: Origin of the cover, in words.
        sizes: Element size of each mesh [m].
        keep: Function that stores the meshes for later runs, because the mesher gives a different mesh at every call.
    """

    def make(_: float, progress: Progress) -> tuple[SolidMesh, ...]:
        meshes = [_fill_finely(shell, source, size, keep, progress) for size in sizes]
        # On strongly curved surfaces the mesher's envelope limits the element size; the numbers of elements are then
        # not in order.
        by_count = {len(mesh.cells): mesh for mesh in meshes}
        return tuple(by_count[count] for count in sorted(by_count))

    return SolidCover(
        layers=(Layer(thickness=shell.thickness, material=material),),
        source=source,
        make=make,
        given_thickness=shell.thickness,
        notes=shell.notes,
        base_triangles=shell.base,
    )


def take_meshes(
    meshes: Sequence[SolidMesh], material: Material, source: str = "given meshes", notes: tuple[str, ...] = ()
) -> SolidCover:
    """Make a cover of given meshes, coarsest first.

    Args:
        meshes: One mesh, or two or three of the same shape.
        material: Material of the cover.
        source: Origin of the cover, in words.
        notes: Sentences on what was repaired or assumed.
    """
    thickness = measure_thickness(meshes[-1])
    layer = Layer(thickness=thickness, material=material)
    return SolidCover(
        layers=(layer,), source=source, make=lambda *_: tuple(meshes), given_thickness=thickness, notes=notes
    )


def _fill_finely(shell: Shell, source: str, size: float, keep: Keep, progress: Progress) -> SolidMesh:
    """Fill a shell with tetrahedra of a size [m], or of a smaller size if too few elements fit in the thickness."""
    mesh = _fill(shell, source, size, keep, progress)
    for _ in range(_TRIES):
        if check_quality(mesh).through >= LIMITS.through:
            break
        size *= _SMALLER
        mesh = _fill(shell, source, size, keep, progress)
    return mesh


def _fill(shell: Shell, source: str, size: float, keep: Keep, progress: Progress) -> SolidMesh:
    """Fill a shell with tetrahedra of one size [m], or take the mesh of an earlier call.

    Raises:
        ValueError: If the mesher fails, or the mesh would have too many elements.
        ModuleNotFoundError: If pytetwild is not installed.
    """
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
        return {**mesh.arrays, "settings": np.array(json.dumps(dict(mesh.settings)))}

    found = keep({"surface": shell.surface, "base": shell.base, "size": size}, compute)
    return SolidMesh(
        nodes=found["nodes"].astype(float),
        **{name: found[name].astype(np.int64) for name in ARRAYS[1:]},
        source=f"tetrahedra in {source}",
        settings=json.loads(str(found["settings"])),
    )
