"""One press of a campaign on a curved cover by finite elements, kept in the store of results."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from fem_reference import result_store
from fem_reference.curved_cover import CurvedIndentation, press_curved
from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.responses import lay_out
from meshes.array_types import FloatArray
from meshes.solids import SolidMesh
from validation.curved.press import choose_friction
from validation.json_values import json_text

if TYPE_CHECKING:
    from validation.campaign.case import Case
    from validation.sensor_file import SensorDescription

#: Parts of a result that follow from the mesh and are not stored.
_FROM_MESH = ("mesh", "top")


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedReference:
    """Reference of a case on a curved cover, with the names that campaigns use.

    Attributes:
        found: The result.
    """

    found: CurvedIndentation

    @property
    def texel_forces(self) -> FloatArray:
        """Force on each of n texels along its own normal, shape (n,) [N]."""
        return self.found.texel_forces

    @property
    def outside(self) -> float:
        """Zero: on a curved cover the force beside the texels is a vector, `unmeasured`, which no score uses [N]."""
        return 0.0

    @property
    def total_force(self) -> float:
        """Load along the direction of motion [N]."""
        return self.found.load

    @property
    def depth(self) -> float:
        """Distance that the indenter moved since it first touched [m]."""
        return self.found.depth

    @property
    def contact_area(self) -> float:
        """Area of the top in contact [m2]."""
        return self.found.contact_area

    @property
    def error_estimate(self) -> Mapping[str, float]:
        """Estimated relative errors by name; nan with one mesh [-]."""
        return self.found.error_estimate

    @property
    def assumptions(self) -> Mapping[str, str]:
        """What was assumed."""
        return self.found.assumptions

    @property
    def warnings(self) -> tuple[str, ...]:
        """What limits the result."""
        return self.found.warnings

    def as_json(self) -> dict[str, Any]:
        """Return the result as a dictionary, under the names used in JSON."""
        names = ("texel_forces", "force", "moment", "base_force", "base_moment", "unmeasured", "depth", "contact_area")
        return {name: getattr(self.found, name) for name in names} | {
            "total_force": self.total_force,
            "error_estimate": dict(self.error_estimate),
            "assumptions": dict(self.assumptions),
            "warnings": list(self.warnings),
        }


def press_case(sensor: SensorDescription, meshes: Sequence[SolidMesh], case: Case) -> CurvedReference:
    """Compute one case by finite elements, or read the result from the store.

    Args:
        sensor: A sensor with a curved cover.
        meshes: Meshes of the cover, coarsest first.
        case: The indentation.

    Raises:
        InputError: If the sensor file states a friction that curved covers do not have.
        ValueError: If the indenter never touches or would go through most of the cover.
        ConvergenceError: If the contact or the load is not found.
    """
    texels, material = sensor.array, sensor.cover.layers[0].material
    pose, friction = case.pose, choose_friction(sensor)

    def compute() -> dict[str, Any]:
        found = press_curved(
            meshes,
            texels,
            material,
            case.indenter,
            pose,
            load=case.load,
            friction=friction,
        )
        values = {field.name: getattr(found, field.name) for field in fields(found) if field.name not in _FROM_MESH}
        values = {name: value for name, value in values.items() if value is not None}
        arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray | float)}
        texts = {name: value for name, value in values.items() if name not in arrays}
        return {**arrays, "texts": np.array(json_text(texts))}

    inputs = {
        "meshes": [mesh.digest for mesh in meshes], "texels": texels, "material": material, "indenter": case.indenter,
        "pose": pose, "load": case.load, "friction": friction,
    }  # fmt: skip
    stored = result_store.fetch("curved-press", inputs, compute)
    values: dict[str, Any] = {
        name: value if value.ndim else float(value) for name, value in stored.items() if name != "texts"
    }
    texts = json.loads(str(stored["texts"]))
    values |= {name: tuple(each) if isinstance(each, list) else _restore(each) for name, each in texts.items()}
    found = CurvedIndentation(mesh=meshes[-1], top=_find_top(meshes[-1]), **values)
    return CurvedReference(found=found)


def _restore(values: Any) -> Any:  # noqa: ANN401 -- JSON
    """Return a mapping with nan for null, which JSON has instead."""
    return {name: math.nan if value is None else value for name, value in values.items()}


@lru_cache(maxsize=3)
def _find_top(mesh: SolidMesh) -> FacetSurface:
    layout = lay_out(mesh)
    return FacetSurface.part_of(layout.elements.nodes, layout.top)
