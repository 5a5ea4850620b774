"""Solid covers with the meshes that finite elements solve: swept from a base, or tetrahedra in a closed shell."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from meshes.cover import SolidCover
from meshes.layer import Layer, Layers, scale_layers
from meshes.material import Material
from meshes.solids.shell import Shell
from meshes.solids.solid_mesh import ARRAYS, LIMITS, SolidMesh, assign_layers, check_quality, measure_thickness
from meshes.solids.swept import SweptCover
from meshes.solids.tetrahedra import count_elements, fill_with_tetrahedra, refine

#: Element size of the coarse mesh of tetrahedra over the thickness, unless the sensor file states one [-].
_SIZE = 0.7
#: Expected number of tetrahedra of the coarse mesh up to which it is made of elements of `_SIZE`, and above which an
#: element size of the sensor file is refused before the mesher starts [-].  The fine mesh has eight times as many; with
#: more than 60 000 tetrahedra a factorisation takes minutes.
_MOST_TETRAHEDRA = (4500, 12_000)
#: Factor by which the element size is reduced if a mesh has too few elements through the thickness [-].
_SMALLER = 0.85
#: Largest number of reductions of the element size if a mesh has too few elements through the thickness [-].
_TRIES = 4
#: Element size of the mesh of `SolidCover.refine`, over the thickness [-].  This mesh is finer than the meshes of all
#: results and verifies them; results of a wanted accuracy take it too.
_FINER = 0.22
#: Number of layers of elements of the mesh of `SolidCover.refine` [-].
_FINER_LAYERS = 5

#: Function that receives a line of text before each step.
Progress = Callable[[str], None]
#: Function of some inputs and of a function that computes arrays from them.  It returns the arrays that an earlier call
#: with the same inputs stored, or computes and stores them.
Keep = Callable[[Mapping[str, Any], Callable[[], Mapping[str, Any]]], Mapping[str, Any]]


def make_swept_cover(swept: SweptCover, material: Material, source: str, *, assumed: bool = False) -> SolidCover:
    """Make a cover of hexahedra that are swept from its base, of one layer; its layers can be replaced by several.

    Args:
        swept: Base and thickness.
        material: Material of the cover.
        source: Origin of the cover, in words.
        assumed: Whether thickness and material were never measured.
    """

    def make(thicknesses: tuple[float, ...], progress: Progress) -> tuple[SolidMesh, ...]:
        progress("hexahedra swept from the base")
        return swept.divide(thicknesses).meshes()

    def refine(thicknesses: tuple[float, ...]) -> SolidMesh:
        return swept.divide(thicknesses).mesh(_FINER * sum(thicknesses), layers=_FINER_LAYERS)

    layer = Layer(thickness=swept.thickness, material=material)
    return SolidCover(layers=(layer,), source=source, make=make, refine=refine, assumed=assumed)


def make_shell_cover(
    shell: Shell, layers: Layers, source: str, keep: Keep, *, element_size: float | None = None
) -> SolidCover:
    """Make a cover of tetrahedra in a closed surface: a coarse mesh and its regular refinement.

    Args:
        shell: The closed surface.
        layers: Material of the cover.
        source: Origin of the cover, in words.
        keep: Function that stores the coarse mesh for later runs, because the mesher gives a different mesh at every
            call.
        element_size: Element size of the finer mesh [m]; chosen by the thickness and the volume if None.
    """

    def make(_given: tuple[float, ...], progress: Progress) -> tuple[SolidMesh, ...]:
        if element_size is None:
            size = _SIZE * shell.thickness
            size *= max(1.0, (count_elements(shell, size) / _MOST_TETRAHEDRA[0]) ** (1 / 3))
        else:
            size = 2 * element_size
            expected = count_elements(shell, size)
            if expected > _MOST_TETRAHEDRA[1]:
                raise ValueError(
                    f"cover.element_size: {1e3 * element_size:.3g} mm would make {8 * expected:.0f} tetrahedra, more "
                    f"than {8 * _MOST_TETRAHEDRA[1]}; take larger elements"
                )
        for _ in range(_TRIES):
            coarse = _fill(shell, source, size, keep, progress)
            if check_quality(coarse).through >= LIMITS.through / 2:
                break
            size *= _SMALLER
        return coarse, refine(coarse)

    return SolidCover(
        layers=scale_layers(layers, shell.thickness),
        source=source,
        make=make,
        given=(shell.thickness,),
        notes=shell.notes,
        base_triangles=shell.base,
    )


def take_meshes(
    meshes: Sequence[SolidMesh], layers: Layers, source: str = "given meshes", notes: tuple[str, ...] = ()
) -> SolidCover:
    """Make a cover of given meshes, coarsest first.

    Args:
        meshes: One mesh, or two or three of the same shape.
        layers: Material of the cover, or its layers, between which all meshes have edges of elements.
        source: Origin of the cover, in words.
        notes: Sentences on what was repaired or assumed.

    Raises:
        ValueError: If there are several layers and a mesh has no edges of elements between them.
    """
    if isinstance(layers, Material):
        layers = (Layer(thickness=measure_thickness(meshes[-1]), material=layers),)
    for mesh in meshes:
        assign_layers(mesh, layers)
    given = tuple(each.thickness for each in layers)
    return SolidCover(layers=layers, source=source, make=lambda *_: tuple(meshes), given=given, notes=notes)


def _fill(shell: Shell, source: str, size: float, keep: Keep, progress: Progress) -> SolidMesh:
    """Fill a shell with tetrahedra of one size [m], or take the mesh of an earlier call.

    Raises:
        ValueError: If the mesher fails.
        ModuleNotFoundError: If pytetwild is not installed.
    """

    def compute() -> dict[str, object]:
        progress(f"tetrahedra of {1e3 * size:.3g} mm, to be divided in eight")
        mesh = fill_with_tetrahedra(shell, size, name=source)
        return {**mesh.arrays, "settings": np.array(json.dumps(dict(mesh.settings)))}

    found = keep({"surface": shell.surface, "label": shell.label, "size": size}, compute)
    return SolidMesh(
        nodes=found["nodes"].astype(float),
        **{name: found[name].astype(np.int64) for name in ARRAYS[1:]},
        source=f"tetrahedra in {source}",
        settings=json.loads(str(found["settings"])),
    )
