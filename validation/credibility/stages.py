"""Score by stage: contributions of cover, contact, spread and electronics to the error of the fast model.

The stages form a chain from the reference image to the counts.  Each stage replaces one part of the reference by that
of the fast model, and its error is the misplaced force between the images before and after:

* cover: finite strain is replaced by the linear cover at zero load;
* spread: the reference's contact forces go through the fast model's tables from cells to texels;
* contact: the fast model's own contact forces replace those of the reference;
* electronics: counts replace forces, and are converted back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fastmodel.surface import CoverCells
from meshes import Cover, TexelArray
from meshes.array_types import FloatArray
from validation.campaign.reference_press import press_reference
from validation.campaign.results import CaseResult
from validation.derivation.contact_range import linearise
from validation.pooling import Pooled, pool
from validation.results import Number, Result, result_model

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fem_reference.indentation.result import Indentation

#: Stages in the order of the chain, each with the replaced part.
STAGES: Mapping[str, str] = {
    "cover": "linear cover at zero load instead of finite strain",
    "spread": "tables from cells to texels instead of finite elements, under the reference's contact forces",
    "contact": "contact forces of the fast model instead of the reference's",
    "electronics": "counts instead of forces: rounding, threshold and saturation, without noise",
}
#: Number of forces at which the characteristic is tabulated to invert it [-].
_POINTS = 20_001
#: Number of forces at which the characteristic is tabulated for an array of many texels [-].
_FEW = 2001
#: Number of texels from which `_FEW` forces are tabulated, to save time [-].
_MANY = 500
#: Largest tabulated force over the largest texel force [-].
_RANGE = 1.05


@result_model
class StageErrors(Result):
    """Misplaced force of each stage, over the load.

    Attributes:
        cases: Error of each stage by name of the case and of the stage; NaN where a stage does not apply [-].
        pooled: Mean over the cases, by stage.
        note: Sentence about parts that were not computed; empty if all were.
    """

    cases: Mapping[str, Mapping[str, Number]]
    pooled: Mapping[str, Pooled]
    note: str = ""


def score_stages(cover: Cover, parameters: Parameters, results: Sequence[CaseResult]) -> StageErrors | None:
    """Score the stages of the fast model in every case.

    Args:
        cover: Laterally wide cover.
        parameters: Parameters of the fast model.
        results: The scored cases.

    Returns:
        The errors; None if the parameters have no tables of the cover, or the texels form no regular grid.
    """
    surface, array = parameters.surface, parameters.array
    cells = None if surface is None else surface.cells
    if cells is None or not array.regular or cells.table is not None:
        return None
    errors = {result.case.name: _score_case(cover, parameters, cells, result) for result in results}
    return StageErrors(
        cases=errors,
        pooled={stage: pool([each[stage] for each in errors.values()]) for stage in STAGES},
        note="" if cover.small_strain_only else "the reference of the stage cover is at small strain",
    )


def _score_case(cover: Cover, parameters: Parameters, cells: CoverCells, result: CaseResult) -> dict[str, float]:
    """Compute the error of each stage in one case [-]."""
    array, load = parameters.array, result.case.load
    fast, outside = result.predictions["fast"].texel_forces, result.predictions["fast"].outside
    true = result.reference.found
    linear = true
    if not cover.small_strain_only:
        linear = press_reference(linearise(cover), array, replace(result.case, path=()))
    spread = spread_contact(cells, array, linear, load)
    counted = count_back(parameters, fast)
    images = {
        "cover": (true.texel_forces, true.outside, linear.texel_forces, linear.outside),
        "spread": (linear.texel_forces, linear.outside, spread, load - float(spread.sum())),
        "contact": (spread, load - float(spread.sum()), fast, outside),
        "electronics": (fast, 0.0, counted, 0.0),
    }
    return {
        stage: float(np.abs(a - b).sum() + abs(out_a - out_b)) / (2 * load)
        for stage, (a, out_a, b, out_b) in images.items()
    }


def spread_contact(cells: CoverCells, array: TexelArray, reference: Indentation, load: float) -> FloatArray:
    """Spread the reference's contact forces by the fast model's tables from cells to texels, shape (n,) [N].

    As in the fast model, the force on a cell acts uniformly on the cell.

    Args:
        cells: Tables of the cover.
        array: The array, a regular grid.
        reference: Result of the finite elements, with its contact points.
        load: Applied force, which chooses the tables of a cover under tension [N].
    """
    from fastmodel.pressure.cell_grid import BaseForces, CellGrid

    x, y = reference.contact_points[:, :2].T
    force = -reference.contact_forces[:, 2]
    low = array.centres[:, :2].min(axis=0)
    high = array.centres[:, :2].max(axis=0)
    beyond = max(0.0, float((low - [x.min(), y.min()]).max()), float(([x.max(), y.max()] - high).max()))
    grid = CellGrid.over(array, cells.per_texel, int(np.ceil(beyond / min(array.pitch))) + 1)
    column, row = np.floor((np.column_stack([x, y]) - grid.low) / grid.edge).astype(int).T
    window = np.zeros((grid.rows, grid.columns))
    np.add.at(window, (row, column), force)
    tables = cells.under_loads
    images = [BaseForces(each, grid, array).from_window(window, (0, 0)) for each in tables]
    at = cells.position_among_loads(load)
    lower = min(int(at), len(images) - 1)
    upper = min(lower + 1, len(images) - 1)
    return np.asarray(images[lower] + (at - lower) * (images[upper] - images[lower]))


def count_back(parameters: Parameters, forces: FloatArray) -> FloatArray:
    """Convert texel forces to counts and back, shape (n,) [N]; forces beyond saturation become the saturation force.

    Args:
        parameters: Parameters with the electronics.
        forces: Forces on n texels, shape (n,) [N].
    """
    electronics = parameters.electronics
    counts = np.asarray(electronics.counts(forces), dtype=float)
    ladder = np.linspace(0.0, _RANGE * max(float(forces.max()), 1e-9), _POINTS if len(forces) < _MANY else _FEW)
    if electronics.gains is None:
        return _invert(np.asarray(electronics.counts(ladder), dtype=float), ladder, counts)
    table = np.asarray(electronics.counts(np.tile(ladder[:, None], (1, len(forces)))), dtype=float)
    return np.concatenate([_invert(steps, ladder, counts[k : k + 1]) for k, steps in enumerate(table.T)])


def _invert(steps: FloatArray, ladder: FloatArray, counts: FloatArray) -> FloatArray:
    """Return the middle of the force interval of each count [N]; 0 for the count of zero force."""
    steps = np.maximum.accumulate(steps)
    low = np.searchsorted(steps, counts, side="left")
    high = np.searchsorted(steps, counts, side="right") - 1
    middle = (ladder[np.minimum(low, len(ladder) - 1)] + ladder[np.maximum(high, 0)]) / 2
    return np.where(counts <= steps[0], 0.0, middle)
