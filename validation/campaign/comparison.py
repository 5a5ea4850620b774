"""Comparison of the finite-element model and the fast model in one indentation."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from fem_reference.errors import IncompletePathError
from validation.campaign.case import Case, tabulate_pose
from validation.campaign.reference_press import name_unsupported
from validation.campaign.results import Reference, score_forces, texel_error
from validation.cover_meshes import describe_mesh
from validation.errors import InputError
from validation.metrics import Score
from validation.sensor_file import SensorDescription
from validation.text.friction import describe_friction

if TYPE_CHECKING:
    from fastmodel import FastIndentation, Parameters
    from fem_reference.indentation.result import Indentation

Progress = Callable[[str], None]

#: Models that a user can name: finite elements and the fast model.
MODELS = ("fem", "fast")
#: Own error of the reference in the texels above which the fast model is not scored in a press [-].
_NO_SCORE = 0.05
#: Contact methods of the fast model that a user can name.
METHODS = ("default", "cover", "foundation", "boxes", "curved")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Results of the finite-element model and the fast model for one indentation.

    Attributes:
        sensor: Description of the pressed sensor, or the parameters of its fast model if the cover is not known.
        case: Indentation.  If finite elements were computed, its load is their force.
        fem: Result of the finite elements; None unless `models` contains `fem` or a depth was given.
        fast: Result of the fast model; None unless `models` contains `fast`.
        score: Score of the fast model against the finite elements; None unless there are results of both models.
        models: Names of the models that were chosen, some of `MODELS`.
        wanted: Requested load [N] or depth [m], under the name `load` or `depth`.
        stopped: Load or depth at which the finite elements stopped early, with the reason; empty if they did not stop.
        note: Reason why a chosen model was left out; empty if none was.
    """

    sensor: SensorDescription | Parameters
    case: Case
    fem: Indentation | None
    fast: FastIndentation | None
    score: Score | None
    models: Sequence[str]
    wanted: Mapping[str, float]
    stopped: str = ""
    note: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the results as a dictionary, under the names that the command line prints as JSON."""
        sensor, image = self.sensor, self.sensor.array.image
        models: dict[str, Any] = {}
        if self.fem is not None and "fem" in self.models:
            mesh = self.fem.mesh
            models["fem"] = Reference.of(self.fem).as_json() | {
                "texel_forces": image(self.fem.texel_forces),
                "mesh": None if mesh is None else describe_mesh(mesh),
            }
        if self.fast is not None:
            fast, along = self.fast, self.fast.total_force * self.case.pose.towards
            models["fast"] = {
                "texel_forces": image(fast.texel_forces),
                "contact_forces": image(fast.contact_forces),
                # With rigid boxes as texels the depth is None, because the penetration depends on a setting of MuJoCo.
                **{name: getattr(fast, name) for name in ("outside", "total_force", "method", "depth", "seconds")},
                "force": along if fast.force is None else fast.force,
                "misplaced_force": None if self.score is None else self.score.misplaced_force,
                "warnings": list(fast.warnings),
            }
        return {
            "sensor": sensor.array.name,
            "cover": sensor.describe_cover() if isinstance(sensor, SensorDescription) else None,
            "indenter": self.case.shape,
            "load": self.case.load,
            "wanted": dict(self.wanted),
            "stopped": self.stopped or None,
            **tabulate_pose(self.case.pose),
            "models": models,
            "scores": None if self.score is None else self.score.as_json(),
        }


def compare_models(
    sensor: SensorDescription | Parameters,
    case: Case,
    *,
    parameters: Parameters | Callable[[], Parameters] | None = None,
    depth: float | None = None,
    friction: float | None = None,
    strain: Literal["small", "finite"] | None = None,
    accuracy: float | None = None,
    models: Sequence[str] = MODELS,
    method: str = "default",
    fields: bool = False,
    as_far: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Compute one indentation by the chosen models, and score the fast model if both are chosen.

    Args:
        sensor: Description of the sensor that is pressed, or the parameters of its fast model.
        case: The indentation: indenter, pose and load.
        parameters: Parameters of the sensor's fast model, or a function that returns them, which is called after the
            finite elements; required if `models` contains `fast`.
        depth: Approach of the indenter, which replaces the load [m]; the fast model's load is then the force of the
            finite elements.
        friction: Coulomb friction coefficient between indenter and cover for finite elements, inf for no slip [-]; that
            of the sensor if None.  The fast model has no friction, and a warning states this.
        strain: Kind of strain of the finite elements; the default of the solver if None.
        accuracy: Wanted relative error of the finite elements; None for the usual grids [-].
        models: Names of the models, some of `MODELS`.
        method: Contact method of the fast model, one of `METHODS`.
        fields: Whether the finite elements also return displacement and stress in the cover.
        as_far: Whether finite elements that stop early give the comparison at the largest load that they reached,
            without a fast model.  `Comparison.stopped` then states the reason.
        progress: Called with a line of text before each step.

    Raises:
        ValueError: If the fast model is chosen without parameters.
        InputError: If the finite elements are chosen without a description of the sensor, or do not support the
            request.
        ConvergenceError: If the finite-element solver did not converge.
        FastModelError: If the method needs cover data that the sensor's parameters lack.
    """
    tell, stopped, note = progress or (lambda _: None), "", ""
    wanted = {"load": case.load} if depth is None else {"depth": depth}
    coefficient, stated = choose_friction(sensor, friction)
    fem, fast, score = None, None, None
    if "fast" in models and parameters is None:
        raise ValueError("the fast model needs its parameters")
    if "fem" in models or depth is not None:
        tell("indentation by finite elements")
        options: dict[str, Any] = {"strain": strain, "accuracy": accuracy, "fields": fields, "friction": coefficient}
        with name_unsupported(stated, others="--"):
            fem, stopped = _press_as_far(sensor, case, depth, tell, as_far=as_far, **options)
        models = ("fem",) if stopped else models
        case = dataclasses.replace(case, load=fem.total_force)
    if "fast" in models and fem is not None and callable(parameters) and (note := _refuse_score(fem)):
        models = ("fem",)
    model = None
    if "fast" in models:
        model = parameters() if callable(parameters) else parameters
    if model is not None and (reason := model.provenance.get("no_contact")):
        if "fem" not in models:
            raise InputError(f"--model: {reason}; write --model fem")
        models, note = ("fem",), f"{reason}; --model fem leaves it out"
    if "fast" in models and model is not None:
        from fastmodel import indent

        tell("indentation by the fast model")
        fast = indent(model, case.indenter, load=case.load, pose=case.pose, contact=method)
        if coefficient:
            use = "not used" if fem is None else "used by the finite elements alone"
            sentence = f"the fast model has no friction; {describe_friction(coefficient)} is {use}"
            fast = dataclasses.replace(fast, warnings=(*fast.warnings, sentence))
        if fem is not None:
            score = score_forces(fem, fast.texel_forces, fast.outside, case.load, model)
    return Comparison(
        sensor=sensor, case=case, fem=fem, fast=fast, score=score, models=tuple(models), wanted=wanted,
        stopped=stopped, note=note,
    )  # fmt: skip


def _refuse_score(fem: Indentation) -> str:
    """Return why the fast model is not derived for a score: the finite elements' own error; empty if it is small."""
    if not (own := texel_error(fem.error_estimate)) > _NO_SCORE:  # also without an estimate
        return ""
    return (
        f"the finite elements state an error of {100 * own:.2g} % for the texels, more than the fast model usually "
        "has, so it is not derived for a score; --model fast computes it alone"
    )


def _press_as_far(
    sensor: SensorDescription | Parameters,
    case: Case,
    depth: float | None,
    tell: Progress,
    *,
    as_far: bool,
    **options: Any,  # noqa: ANN401 -- those of `press`
) -> tuple[Indentation, str]:
    """Press by finite elements, with `as_far` as far as they get.

    Returns:
        The result at the requested load or depth and an empty text.  If the finite elements stopped early, the result
        at the largest load or depth that they reached, and the reason.
    """
    from fem_reference.indentation.press import press

    target: dict[str, Any] = {"load": case.load} if depth is None else {"depth": depth}
    try:
        return press(
            find_cover(sensor), sensor.array, case.indenter, case.pose, **target, **options,
            progress=lambda text: tell(f"finite elements, {text}"),
        ), ""  # fmt: skip
    except IncompletePathError as error:
        if not as_far or not error.reached:
            raise
        return error.reached[-1], str(error)


def choose_friction(sensor: SensorDescription | Parameters, given: float | None) -> tuple[float, str]:
    """Choose the coefficient of friction of a press: the given one, else that of the sensor file, else 0.

    Returns:
        The coefficient [-], and the option or the key of the sensor file that states it.
    """
    if given is not None:
        return given, "--friction"
    return getattr(sensor, "friction", 0.0), f"{getattr(sensor, 'source', '')}: contact.friction"


def find_cover(sensor: SensorDescription | Parameters) -> Any:  # noqa: ANN401 -- a cover of any kind
    """Return the cover of a sensor.

    Raises:
        InputError: If only the parameters of its fast model are known.
    """
    if not isinstance(sensor, SensorDescription):
        raise InputError("the finite elements need the description of the cover")
    return sensor.cover
