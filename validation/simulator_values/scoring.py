"""Presses over a range of loads, and scores of contact laws in them.

The bodies are those to which the comparison models are fitted, and a smaller ball.  Each presses at the ends of the
range and at their geometric mean, without friction.  A law is fitted to all presses.  Its error on shapes that a fit
has not seen is the mean over fits that leave out one shape each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from meshes import Cover, Pose
from validation.campaign.case import Case
from validation.derivation.contact_range import DEEP, bear
from validation.errors import InputError
from validation.published.model import Values
from validation.published.models import CalibrationPress, choose_calibration, fit_model, list_errors, place_on
from validation.published.scene import make_scene
from validation.results import Number, Result, result_model
from validation.simulator_values.models import Candidate

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fem_reference.closed_form.layer import TexelResponse

#: The smaller ball: indenter, and position of its axis from the array's centre over the pitch.
_SMALL_BALL, _PLACE = "sphere:radius=4mm", (0.2, -0.35)
#: Smallest distance of a body's axis from the edge of the array over the pitch [-].
_INSIDE = 0.1
#: Smallest number of cells of the grid of hydroelastic contact that lie below the depth of the finite elements [-].
_CELLS = 12
#: Smallest ratio of the loads of a range that follows from the electronics [-].
_RATIO = 0.1


@result_model
class ScoredPress(Result):
    """A press in which a law is scored.

    Attributes:
        indenter: The indenter as text.
        load: Load on it [N].
        misplaced_force: Share of the load on a wrong texel [-].
        depth_ratio: Depth of the indenter in the law over that in the finite elements [-]; NaN if the law has no depth.
    """

    indenter: str
    load: float
    misplaced_force: float
    depth_ratio: Number


@result_model
class ScoredValues(Result):
    """A contact law with its values and their error.

    Attributes:
        name: Name of the law and of the origin of the values.
        rule: The law in a few words.
        parameters: Values by name, in SI units.
        units: Units by name of the parameter; none for a pure number.
        fitted: Names of the fitted parameters.
        mean: Mean misplaced force over the presses [-].
        worst: Largest misplaced force [-].
        unseen: Mean misplaced force on shapes that a fit has not seen [-]; NaN for values that are not fitted.
        presses: The presses.
    """

    name: str
    rule: str
    parameters: Mapping[str, float]
    units: Mapping[str, str]
    fitted: tuple[str, ...]
    mean: float
    worst: float
    unseen: Number
    presses: tuple[ScoredPress, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Presses:
    """Presses over a range of loads.

    Attributes:
        loads: Smallest and largest load [N].
        presses: The presses.
        left_out: One sentence for each press that is left out.
        response: Response of the cover to a point load.
    """

    loads: tuple[float, float]
    presses: tuple[CalibrationPress, ...]
    left_out: tuple[str, ...]
    response: TexelResponse


def find_loads(parameters: Parameters, response: TexelResponse) -> tuple[float, float]:
    """Find the loads of a point over the centre of a texel between which its count leaves zero and reaches its maximum.

    Args:
        parameters: The sensor, with its electronics.
        response: Response of the cover to a point load.

    Returns:
        Smallest and largest load [N]; the smallest is at least a tenth of the largest.

    Raises:
        InputError: If no force gives the largest count.
    """
    from validation.data_sheet import trace_range

    forces, counts = trace_range(parameters.electronics)
    if counts[-1] < parameters.electronics.output_max:
        raise InputError("--load: the electronics never saturate, so that no range follows; write for example 1N:5N")
    peak = float(response(np.zeros(1), np.zeros(1))[0])
    high = float(forces[-1]) / peak
    return max(float(forces[0]) / peak, _RATIO * high), high


def make_presses(
    cover: Cover, parameters: Parameters, loads: tuple[float, float] | None, progress: Callable[[str], None]
) -> Presses:
    """Press every body at three loads of a range by finite elements.

    Args:
        cover: A wide cover of planar layers.
        parameters: Parameters of the fast model; their array is a regular grid.
        loads: Smallest and largest load [N]; None for those of `find_loads`.
        progress: Called with a line of text before each press.

    Raises:
        InputError: If less than two bodies bear the largest load.
        ConvergenceError: If the finite elements do not converge.
    """
    from fem_reference.closed_form.layer import tabulate_texel_response
    from fem_reference.indentation.press import press

    array = parameters.array
    response = tabulate_texel_response(cover, array.texel_size)
    low, high = loads or find_loads(parameters, response)
    small = Case.read("small ball", _SMALL_BALL, "1 N")
    bodies = [replace(small, pose=Pose.planar(at=place_on(array, _PLACE))), *choose_calibration(array, ())]
    half = np.array([array.columns, array.rows]) / 2 - _INSIDE
    low_end, high_end = place_on(array, -half), place_on(array, half)
    bodies = [replace(each, pose=Pose.planar(at=np.clip(each.pose.at, low_end, high_end).tolist())) for each in bodies]
    borne = [bear(cover, body.indenter) for body in bodies]
    if sum(most >= high for most in borne) < 2:  # noqa: PLR2004 -- a fit needs two shapes
        raise InputError(
            f"--load: {high:.3g} N presses the cover deeper than {DEEP:.0%} of its thickness under all but the widest "
            f"body, where nothing is scored; accepted: up to {sorted(borne)[-2]:.3g} N"
        )
    presses, left_out = [], []
    for body, most in zip(bodies, borne, strict=True):
        for load in sorted({low, math.sqrt(low * high), high}):
            case = replace(body, load=load)
            if load > most:
                left_out.append(f"{body.shape} at {load:.3g} N: deeper than {DEEP:.0%} of the thickness")
                continue
            progress(f"finite elements: {body.shape} at {load:.3g} N")
            reference = press(cover, array, case.indenter, load=load, pose=case.pose, progress=progress)
            scene = make_scene(cover, parameters, case, response)
            presses.append(CalibrationPress(scene=scene, reference=reference))
    return Presses(loads=(low, high), presses=tuple(presses), left_out=tuple(left_out), response=response)


def score(candidates: Sequence[Candidate], cover: Cover, presses: Sequence[CalibrationPress]) -> list[ScoredValues]:
    """Fit and score contact laws, each in all presses.

    Args:
        candidates: The laws.
        cover: The cover.
        presses: Presses by at least two shapes.
    """
    known: dict[str, Values] = {}
    rows = []
    for each in candidates:
        unseen, values = math.nan, known.get(each.like, each.values)
        if values is None:
            values, _ = fit_model(each.model, cover, presses)
            unseen = _measure_unseen(each, cover, presses)
        known[each.name] = values
        rows.append(_score(each, values, presses, unseen))
    return rows


def check_fit(candidate: Candidate, row: ScoredValues, presses: Sequence[CalibrationPress]) -> None:
    """Refuse fitted values that the presses do not settle.

    Args:
        candidate: The law.
        row: Its fitted values.
        presses: The presses.

    Raises:
        InputError: If the contact of a press lies on too few cells of the grid of hydroelastic contact, or twice a
            value scores the same.
    """
    smallest = min(press.scene.load for press in presses)
    for press in presses if candidate.sink else ():
        gaps = press.scene.map.gaps
        if np.count_nonzero(gaps - gaps.min() < press.reference.depth) < _CELLS:
            raise InputError(
                f"--load: under {press.scene.load:.3g} N the contact of {press.scene.case.shape} is smaller than the "
                "cells that resolve it, so that no modulus follows; take larger loads"
            )
    for name in row.fitted:
        twice = list_errors(candidate.model, {**row.parameters, name: 2 * row.parameters[name]}, presses)
        if math.isclose(float(np.mean(twice)), row.mean, rel_tol=1e-6, abs_tol=1e-9):
            raise InputError(
                f"--load: presses from {smallest:.3g} N on do not settle the {name}: twice its value scores the same; "
                "take larger loads"
            )


def _measure_unseen(candidate: Candidate, cover: Cover, presses: Sequence[CalibrationPress]) -> float:
    """Compute the mean misplaced force on shapes that are left out of the fit, one after the other [-]."""
    errors: list[float] = []
    for shape in dict.fromkeys(press.scene.case.shape for press in presses):
        others = [press for press in presses if press.scene.case.shape != shape]
        values, _ = fit_model(candidate.model, cover, others)
        errors += list_errors(candidate.model, values, [press for press in presses if press not in others])
    return float(np.mean(errors))


def _score(candidate: Candidate, values: Values, presses: Sequence[CalibrationPress], unseen: float) -> ScoredValues:
    errors = list_errors(candidate.model, values, presses)
    ratios = [
        math.nan if candidate.sink is None else candidate.sink(press.scene, **values) / press.reference.depth
        for press in presses
    ]
    return ScoredValues(
        name=candidate.name,
        rule=candidate.model.rule,
        parameters=dict(values),
        units=candidate.model.units,
        fitted=candidate.model.fitted if candidate.values is None else (),
        mean=float(np.mean(errors)),
        worst=max(errors),
        unseen=unseen,
        presses=tuple(
            ScoredPress(
                indenter=press.scene.case.shape, load=press.scene.load, misplaced_force=error, depth_ratio=ratio
            )
            for press, error, ratio in zip(presses, errors, ratios, strict=True)
        ),
    )
