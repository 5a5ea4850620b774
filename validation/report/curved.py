"""Contents of the report's page that only curved covers have: responses of texels, maps and pictures of the cases."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from validation.campaign.evaluation import Evaluation
from validation.campaign.results import CaseResult
from validation.curved.derive import CurvedDerivation
from validation.curved.touch import find_middle
from validation.extras import MissingExtraError
from validation.render.image import Scale, colour_bar, tactile_image
from validation.render.table import Cell, Table, number
from validation.scene.cover_scene import show_curved
from validation.scene.rendering import RenderingError

_LOG = logging.getLogger(__name__)

#: Most cases of which a picture is drawn, which takes a second or two each [-].
_MOST_PICTURES = 24


@dataclasses.dataclass(frozen=True, kw_only=True)
class Pictures:
    """Pictures of the cases in three dimensions.

    Attributes:
        files: Name of the picture's file by name of the case.
        missing: Why there are none, or not all; empty if all are there.
    """

    files: Mapping[str, str] = dataclasses.field(default_factory=dict)
    missing: str = ""


def draw_cases(evaluation: Evaluation, folder: Path) -> Pictures:
    """Draw the reference of each case on a curved cover: contact pressure, section, and forces on the texels.

    Args:
        evaluation: The results.
        folder: An existing folder to write to.

    Raises:
        OSError: If the folder cannot be written.
    """
    results = evaluation.campaign.cases
    files: dict[str, str] = {}
    try:
        from validation.scene.draw import write_picture

        for index, result in enumerate(results[:_MOST_PICTURES]):
            name = f"case-{index + 1:02d}.png"
            _draw(evaluation, result, folder / name, write_picture)
            files[result.case.name] = name
    except ImportError:
        missing = str(MissingExtraError("pyvista"))
    except RenderingError as error:
        missing = str(error)
    else:
        left = len(results) - len(files)
        return Pictures(files=files, missing=f"{left} further cases are not drawn" if left else "")
    _LOG.warning("no pictures in the report: %s", missing)
    return Pictures(missing=f"no pictures in three dimensions: {missing}")


def _draw(evaluation: Evaluation, result: CaseResult, path: Path, write: Any) -> None:  # noqa: ANN401 -- a function
    direction = result.case.pose.towards
    title = f"{result.case.name}: {result.case.shape}, {result.case.load:.3g} N"
    write(show_curved(result.reference.found, evaluation.sensor.array, direction=direction, title=title), path)


def curved_contents(evaluation: Evaluation, derivation: CurvedDerivation, pictures: Pictures) -> dict[str, Any]:
    """Return the variables of a curved cover for the page's template, by name."""
    array, uniform = derivation.sensor.array, derivation.uniform
    loaded = find_middle(array)
    force = Scale(peak=float(uniform[loaded].max()), unit="% of the load", factor=100)
    kernel = derivation.gaussian.spread(array, array.centres[[loaded]], array.normals[[loaded]])[0]
    difference = kernel - uniform[loaded]
    apart = dataclasses.replace(force, peak=float(np.abs(difference).max()), difference=True)
    maps = (
        (f"uniform load over texel {loaded}", uniform[loaded], force),
        ("Gaussian in surface coordinates", kernel, force),
        ("Gaussian \u2212 reference", difference, apart),
    )
    return {
        "curved": {
            "body": derivation.sensor.cover.source,
            "texels": int(array.active.sum()),
            "mesh": derivation.mesh,
            "maps": [(caption, tactile_image(array, values, scale, name=caption)) for caption, values, scale in maps],
            "bars": colour_bar(force) + colour_bar(apart),
            "responses": _tabulate_responses(derivation),
            "missing": pictures.missing,
        },
        "cases": [_show_case(evaluation, result, pictures) for result in evaluation.campaign.cases],
    }


def _show_case(evaluation: Evaluation, result: CaseResult, pictures: Pictures) -> dict[str, Any]:
    array, case, reference = evaluation.sensor.array, result.case, result.reference
    fast = result.predictions["fast"]
    difference = fast.texel_forces - reference.texel_forces
    force = Scale(peak=float(max(reference.texel_forces.max(), fast.texel_forces.max())))
    apart = Scale(peak=float(np.abs(difference).max()), difference=True)
    images = [
        (caption, tactile_image(array, values, scale, name=f"{case.name}, {caption}, forces"))
        for caption, values, scale in (
            ("reference", reference.texel_forces, force),
            ("fast", fast.texel_forces, force),
            ("fast \u2212 reference", difference, apart),
        )
    ]
    return {
        "case": case,
        "images": images,
        "bars": colour_bar(force) + colour_bar(apart),
        "picture": pictures.files.get(case.name),
        "misplaced": fast.score.misplaced_force,
        "estimate": reference.error_estimate["misplaced_force"],
    }


def _tabulate_responses(derivation: CurvedDerivation) -> Table:
    """Tabulate the responses of the texels, with the keys of `report.json` below `derive` that hold the numbers."""
    active = derivation.sensor.array.active
    own = derivation.own_shares[active]
    sigma, gaussian = derivation.gaussian.sigma, derivation.gaussian
    rows = [
        [
            Cell(text="force on a texel under a point force above it, least", small="% of the force"),
            number(own.min(), 100),
        ],
        [Cell(text="the same, largest", small="% of the force"), number(own.max(), 100)],
        [Cell(text="sigma of the Gaussian along the first axis", small="mm"), number(sigma[0], 1e3)],
        [Cell(text="sigma along the second axis", small="mm"), number(sigma[1], 1e3)],
        [Cell(text="load that the Gaussian puts on wrong texels", small="%, mean"), number(gaussian.residual, 100)],
    ]
    rows += [
        [Cell(text=f"estimated error, {name.replace('_', ' ')}", small="% of the peak texel"), number(value, 100, 2)]
        for name, value in derivation.responses.error_estimate.items()
    ]
    return Table(
        name="responses",
        caption="Responses of the texels to forces on the top",
        headings=("quantity", "value"),
        rows=rows,
    )
