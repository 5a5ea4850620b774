"""Solid mesh of a cover, with its base, its touchable top and its free sides, and its file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from meshes.array_types import FloatArray, IntArray
from meshes.atomic_file import replace
from meshes.bounded_file import FileLimitError, parse_json, read_bytes
from meshes.npz import pack_npz, unpack_npz
from meshes.solids.facets import QUADRILATERAL, TRIANGLE

#: Numbers of nodes of a hexahedron and of a tetrahedron [-].
HEXAHEDRON, TETRAHEDRON = 27, 4
#: Number of nodes of a facet by number of nodes of an element [-].
_FACET_NODES = {HEXAHEDRON: QUADRILATERAL, TETRAHEDRON: TRIANGLE}
#: Largest accepted size of a mesh file [bytes].
_MOST_BYTES = 2**30
#: Version of the file format.
_FORMAT = "softcover-mesh 1"

#: A setting from which a mesh was made.
Setting = str | float | int | bool


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidMesh:
    """Solid mesh of a cover.

    Elements are hexahedra of 27 nodes with quadratic geometry, in lexicographic order (node i + 3 j + 9 k at (i, j, k)
    of 3 x 3 x 3, k from base to top in swept meshes), or tetrahedra of 4 nodes.  Facets are quadrilaterals of 9 nodes
    or triangles of 3.  The normals of top and sides point out of the cover; those of the base point into it, as the
    normals of the texels do.

    Attributes:
        nodes: Positions of the n nodes, shape (n, 3) [m].
        cells: Indices of the nodes of each of e elements, shape (e, 27) or (e, 4).
        base: Facets that are bonded to the rigid base, shape (b, 9) or (b, 3).
        top: Facets that an indenter can touch, shape (t, 9) or (t, 3).
        sides: All other facets of the surface, shape (s, 9) or (s, 3).
        source: What the mesh was made from, for reports.
        settings: Settings with which it was made.
    """

    nodes: FloatArray
    cells: IntArray
    base: IntArray
    top: IntArray
    sides: IntArray
    source: str
    settings: Mapping[str, Setting] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only.

        Raises:
            ValueError: If shapes disagree, an index is out of range, or base or top is empty.
        """
        if self.nodes.ndim != 2 or self.nodes.shape[1] != 3 or not np.isfinite(self.nodes).all():  # noqa: PLR2004
            raise ValueError("the nodes of a mesh must be finite and have the shape (n, 3)")
        if self.cells.ndim != 2 or self.cells.shape[1] not in _FACET_NODES or not len(self.cells):  # noqa: PLR2004
            raise ValueError("a mesh needs hexahedra of 27 nodes or tetrahedra of 4 nodes")
        for name in ("base", "top", "sides"):
            facets = getattr(self, name)
            if facets.ndim != 2 or facets.shape[1] != _FACET_NODES[self.cells.shape[1]]:  # noqa: PLR2004
                raise ValueError(f"the facets of the {name} do not fit the elements")
            if name != "sides" and not len(facets):
                raise ValueError(f"the mesh has no {name}")
        every = np.concatenate([each.ravel() for each in (self.cells, self.base, self.top, self.sides)])
        if every.min() < 0 or every.max() >= len(self.nodes):
            raise ValueError("the mesh refers to a node that it does not have")
        for values in (self.nodes, self.cells, self.base, self.top, self.sides):
            values.setflags(write=False)
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))

    @property
    def is_hexahedral(self) -> bool:
        """Whether the elements are hexahedra."""
        return bool(self.cells.shape[1] == HEXAHEDRON)

    @cached_property
    def digest(self) -> str:
        """Hash of all arrays, the source and the settings: two meshes are equal if their hashes are."""
        hasher = hashlib.sha256(json.dumps([self.source, dict(self.settings)], sort_keys=True).encode())
        for values in (self.nodes, self.cells, self.base, self.top, self.sides):
            hasher.update(str((values.shape, values.dtype.str)).encode())
            hasher.update(np.ascontiguousarray(values).tobytes())
        return hasher.hexdigest()

    @property
    def size(self) -> float:
        """Largest edge of the bounding box [m]."""
        return float(np.ptp(self.nodes, axis=0).max())


def write_mesh(path: Path, mesh: SolidMesh) -> None:
    """Write a mesh with its source, settings and hash to an npz file.

    Raises:
        OSError: If the file cannot be written.
    """
    about = {"format": _FORMAT, "digest": mesh.digest, "source": mesh.source, "settings": dict(mesh.settings)}
    arrays = {name: getattr(mesh, name) for name in ("nodes", "cells", "base", "top", "sides")}
    replace(path, [pack_npz({**arrays, "about": np.array(json.dumps(about))})])


def read_mesh(path: Path) -> SolidMesh:
    """Read a mesh from a file of `write_mesh`, and compare it with its hash.

    Raises:
        ValueError: If the file cannot be read, is no mesh, or was changed after it was written.
    """
    try:
        arrays = unpack_npz(read_bytes(path, most=_MOST_BYTES), most=_MOST_BYTES)
        about = parse_json(str(arrays["about"]))
        for name, kinds in {"nodes": "f", "cells": "iu", "base": "iu", "top": "iu", "sides": "iu"}.items():
            if arrays[name].dtype.kind not in kinds:
                raise FileLimitError(f"has {name} of type {arrays[name].dtype}")  # noqa: TRY301 -- reported below
        if about["format"] != _FORMAT:
            raise ValueError(f"{path.name} is a mesh of another version: {str(about['format'])[:40]!r}")
        mesh = SolidMesh(
            nodes=arrays["nodes"].astype(np.float64),
            **{name: arrays[name].astype(np.int64) for name in ("cells", "base", "top", "sides")},
            source=str(about["source"]),
            settings=about["settings"],
        )
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}; give the path of a mesh file") from None
    except FileLimitError as error:
        raise ValueError(f"{path.name} {error}; give a mesh file of softcover") from None
    except (KeyError, TypeError, AttributeError):
        raise ValueError(f"{path.name} is no mesh file of softcover") from None
    if mesh.digest != about.get("digest"):
        raise ValueError(f"{path.name} was changed after it was written: its content does not have the hash it states")
    return mesh
