"""The fit of the published models to a few presses that are never scored.

The protocol of the fit is the same for all models.  The mean misplaced force over the calibration presses is minimised
over the logarithms of the fitted parameters, by a scan around the published parameters and the method of Nelder and
Mead from the best point of the scan.  Where the score is constant over a range of a parameter, the smallest value of
the range is used.  All presses use bodies of revolution, whose finite-element solution takes seconds on any cover.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshes import Cover, Pose, TexelArray
from meshes.array_types import FloatArray
from validation.campaign.case import Case
from validation.campaign.plan import estimate_cost
from validation.campaign.texel_metrics import misplaced_force
from validation.derivation.contact_range import bear
from validation.published.model import Model, Values, foundation_stiffness
from validation.published.rules import PUBLISHED
from validation.published.scene import Forces, Scene, make_scene

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fem_reference.closed_form.layer import TexelResponse
    from fem_reference.indentation.result import Indentation

#: Calibration presses: name, indenter, load, and position of its axis from the array's centre over the pitch.
_PRESSES = (
    ("calibration, ball", "sphere:radius=6mm", "3 N", (0.35, 0.15)),
    ("calibration, flat punch", "cylinder:radius=3.5mm", "2 N", (-0.3, 0.4)),
    ("calibration, large ball", "sphere:radius=10mm", "1 N", (-0.9, -1.6)),
)
#: Longest expected time of a calibration press; presses of covers with a foil take longer [s].
_LONGEST = 30.0
#: Smallest number of presses to which a model is fitted [-].
_FEWEST = 2
#: Start value of a foundation's stiffness under a cover of incompressible material, for which it is undefined [Pa/m].
_START_STIFFNESS = 1e9
#: Binary logarithm of the number of points of the scan before the fit, minus the number of fitted parameters [-].
_SCAN = 3
#: Largest distance of a point of the scan from the start value, in the natural logarithm of each parameter [-].
_SCAN_RANGE = 3.0
#: Edge of the first simplex of the fit, in the natural logarithm of each parameter [-].
_SIMPLEX = 0.1
#: Largest number of evaluations of a fit per fitted parameter [-].
_EVALUATIONS = 50
#: Tolerance of a fit in the natural logarithm of each parameter, and in the mean misplaced force [-].
_TOLERANCE = 1e-4
#: Relative difference of two scores below which they count as equal [-].
_SAME_SCORE = 1e-6
#: Step of the values of a parameter in the search for a range of equal scores, in its natural logarithm [-].
_TIE_STEP = 0.01
#: Variant of a model with the parameters that its authors published.
AS_SHIPPED = "as shipped"
#: Variant of a model with parameters that are fitted to the calibration presses.
AS_FITTED = "as fitted"


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationPress:
    """A press to which models are fitted.

    Attributes:
        scene: Press with the inputs of the models.
        reference: Result of the finite elements.
    """

    scene: Scene
    reference: Indentation


@dataclass(frozen=True, kw_only=True, eq=False)
class Row:
    """A published model with its parameters, one row of the table of scores.

    Attributes:
        model: The model.
        parameters: Values of all parameters by name, in SI units.
        fitted: Names of the fitted parameters; empty for published parameters.
        cases: Calibration presses of the fit.
        error: Mean misplaced force over the calibration presses [-]; NaN for published parameters without presses.
    """

    model: Model
    parameters: Values
    fitted: tuple[str, ...] = ()
    cases: tuple[Case, ...] = ()
    error: float = math.nan

    @property
    def variant(self) -> str:
        """Origin of the parameters: `AS_SHIPPED` or `AS_FITTED`."""
        return AS_FITTED if self.fitted else AS_SHIPPED

    @property
    def name(self) -> str:
        """Name of the row, unique in the table."""
        return f"{self.model.name}, {self.variant}"

    def predict(self, scene: Scene) -> Forces:
        """Predict the forces of one press; force on masked texels counts as outside."""
        texels, outside = self.model.predict(scene, **self.parameters)
        active = scene.array.active
        return Forces(np.where(active, texels, 0.0), outside + float(texels[~active].sum()))

    def as_json(self) -> dict[str, Any]:
        """Return the row as a dictionary of JSON values."""
        model = self.model
        return {
            "name": self.name,
            "title": model.title,
            "variant": self.variant,
            "contact": model.contact,
            "rule": model.rule,
            "certainty": model.certainty,
            "total": model.total or "the load",
            "not_built": model.in_time,
            "parameters": dict(self.parameters),
            "units": dict(model.units),
            "fitted": list(self.fitted),
            "fitted_on": [f"{case.shape}, {case.load:g} N at {case.place}" for case in self.cases],
            "fit_misplaced_force": self.error,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparisonModels:
    """The published models as rows, for scoring on one cover and array.

    Attributes:
        rows: The rows.
        response: Exact response of the cover, which all scenes share.
    """

    rows: Sequence[Row]
    response: TexelResponse

    def check_unseen(self, cases: Sequence[Case]) -> None:
        """Check that no row was fitted to one of the cases that are scored.

        On a wide cover one indenter has the same contact at every pose.  It must therefore not be both fitted and
        scored, at any pose.

        Raises:
            ValueError: If a row was fitted to a press by the indenter of a case.
        """
        fitted = [case.indenter for row in self.rows for case in row.cases]
        for case in cases:
            if case.indenter in fitted:
                raise ValueError(f"{case.name} ({case.shape}) must not be scored: models were fitted to this indenter")

    def predict(self, cover: Cover, parameters: Parameters, case: Case) -> tuple[Scene, dict[str, Forces]]:
        """Make the scene of a case, and predict its forces by every row.

        Raises:
            FastModelError: If the texels do not carry the load in MuJoCo.
        """
        scene = make_scene(cover, parameters, case, self.response)
        return scene, {row.name: row.predict(scene) for row in self.rows}


def prepare_models(
    cover: Cover,
    parameters: Parameters,
    cases: Sequence[Case],
    *,
    friction: float = 0.0,
    progress: Callable[[str], None] | None = None,
) -> ComparisonModels | None:
    """Fit the published models on calibration presses, and return all rows as shipped and as fitted.

    Args:
        cover: The cover.
        parameters: Parameters of the fast model.
        cases: Cases that will be scored; no calibration press has one of their indenters.
        friction: Coulomb friction coefficient between indenter and cover in the finite elements, inf for no slip [-].
        progress: Called with a line of text before each step.

    Returns:
        The rows; None for an array that is not a regular grid or a cover with side edges, which the models do not
        support.  With fewer than two calibration presses there are no fitted rows.
    """
    if not parameters.array.regular or cover.size is not None:
        return None
    from fem_reference import ConvergenceError
    from fem_reference.closed_form.layer import tabulate_texel_response
    from fem_reference.indentation.press import press

    array, tell = parameters.array, progress or (lambda _: None)
    response = tabulate_texel_response(cover, array.texel_size)
    presses = []
    for case in choose_calibration(array, cases):
        tell(f"{case.name}, for the comparison models")
        # A press that finite elements or MuJoCo cannot compute is left out, and one that takes long.
        with suppress(ValueError, ConvergenceError):
            case = replace(case, load=min(case.load, bear(cover, case.indenter)))  # noqa: PLW2901 -- on a soft cover
            if estimate_cost(cover, case, friction).seconds > _LONGEST:
                continue
            reference = press(
                cover, array, case.indenter, load=case.load, pose=case.pose, friction=friction, progress=progress
            )
            scene = make_scene(cover, parameters, case, response)
            presses.append(CalibrationPress(scene=scene, reference=reference))
    rows = []
    for model in PUBLISHED.values():
        tell(f"fit of the comparison model {model.title}")
        rows += make_rows(model, cover, presses)
    return ComparisonModels(rows=tuple(rows), response=response)


def place_on(array: TexelArray, place: npt.ArrayLike) -> tuple[float, float]:
    """Return x and y of a place that is given from the middle of an array in pitches [m]."""
    x, y = np.round(array.centres[:, :2].mean(axis=0), 9) + np.multiply(place, array.pitch)
    return float(x), float(y)


def choose_calibration(array: TexelArray, cases: Sequence[Case]) -> list[Case]:
    """Return the calibration presses whose indenter is in none of the cases.

    Args:
        array: The array, whose middle and pitch place the presses.
        cases: The cases that are scored.
    """
    chosen = []
    for name, shape, load, place in _PRESSES:
        case = Case.read(name, shape, load)
        at = place_on(array, place)
        if all(case.indenter != scored.indenter for scored in cases):
            chosen.append(Case(name=name, indenter=case.indenter, shape=shape, load=case.load, pose=Pose.planar(at=at)))
    return chosen


def make_rows(model: Model, cover: Cover, presses: Sequence[CalibrationPress]) -> list[Row]:
    """Make a model's rows in the table of scores: for its published and for its fitted parameters, if there are any.

    Args:
        model: The model.
        cover: The cover.
        presses: Calibration presses; with fewer than two nothing is fitted.
    """
    shipped, rows = model.find_shipped(cover), []
    if shipped is not None:
        error = measure_error(model, shipped, presses) if presses else math.nan
        rows.append(Row(model=model, parameters=shipped, error=error))
    if model.fitted and len(presses) >= _FEWEST:
        parameters, error = fit_model(model, cover, presses)
        cases = tuple(press.scene.case for press in presses)
        rows.append(Row(model=model, parameters=parameters, fitted=model.fitted, cases=cases, error=error))
    return rows


def measure_error(model: Model, parameters: Values, presses: Sequence[CalibrationPress]) -> float:
    """Compute the mean misplaced force of a model over presses [-]."""
    return float(np.mean(list_errors(model, parameters, presses)))


def list_errors(model: Model, parameters: Values, presses: Sequence[CalibrationPress]) -> list[float]:
    """Compute the misplaced force of a model in each press [-]."""
    row = Row(model=model, parameters=parameters)
    errors = []
    for press in presses:
        forces = row.predict(press.scene)
        errors.append(
            misplaced_force(
                press.reference.texel_forces,
                forces.texels,
                reference_outside=press.reference.outside,
                outside=forces.outside,
                load=press.scene.load,
            )
        )
    return errors


def fit_model(model: Model, cover: Cover, presses: Sequence[CalibrationPress]) -> tuple[Values, float]:
    """Fit a model's parameters to presses; return all its parameters and the mean error that remains.

    The error of a press is the misplaced force, the share of the load on wrong texels.  The result is never worse on
    these presses than the parameters as shipped.

    Args:
        model: The model.
        cover: Cover, for the start value of a stiffness.
        presses: The presses.
    """
    from scipy.optimize import minimize
    from scipy.stats import qmc

    shipped = model.find_shipped(cover)
    known = {**(shipped or {}), **model.start}
    if "stiffness" in model.fitted:
        known.setdefault("stiffness", foundation_stiffness(cover) or _START_STIFFNESS)

    def at(logarithms: FloatArray) -> Values:
        return {**known, **dict(zip(model.fitted, np.exp(logarithms).tolist(), strict=True))}

    def error(logarithms: FloatArray) -> float:
        return measure_error(model, at(logarithms), presses)

    start = np.log([known[name] for name in model.fitted])
    scanned = start + _SCAN_RANGE * (2 * qmc.Sobol(len(start), seed=0).random_base2(_SCAN + len(start)) - 1)
    first = min([start, *scanned], key=error)
    found = minimize(
        error,
        first,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([first, first + _SIMPLEX * np.eye(len(first))]),
            "maxfev": _EVALUATIONS * len(first),
            "xatol": _TOLERANCE,
            "fatol": _TOLERANCE,
        },
    )
    fitted = at(_break_ties(found.x, start - _SCAN_RANGE, error))
    smallest = measure_error(model, fitted, presses)
    if shipped is not None and (known_error := measure_error(model, shipped, presses)) <= (1 + _SAME_SCORE) * smallest:
        return shipped, known_error
    return fitted, smallest


def _break_ties(vector: FloatArray, lowest: FloatArray, error: Callable[[FloatArray], float]) -> FloatArray:
    """Move each parameter with a range of equal scores to the smallest value of this range.

    Args:
        vector: Logarithms of the fitted parameters.
        lowest: Smallest value of each parameter.
        error: Function that returns the score of a vector.
    """
    vector = vector.copy()
    best = error(vector)
    for k in range(len(vector)):

        def is_same(steps: int, k: int = k) -> bool:
            moved = vector.copy()
            moved[k] = steps * _TIE_STEP
            return abs(error(moved) - best) <= _SAME_SCORE * best

        low, high = math.ceil(lowest[k] / _TIE_STEP), math.floor(vector[k] / _TIE_STEP)
        if high <= low or not is_same(high):
            continue
        high = low + bisect_left(range(low, high), True, key=is_same)  # noqa: FBT003 -- the value that is looked for
        vector[k] = high * _TIE_STEP
    return vector
